// Everything is computed in the camera frame (x right, y down, z forward), where numbers are small.

struct Frame {
    clip_from_camera: mat4x4<f32>,
    shadow_from_camera: mat4x4<f32>,
    // xyz: towards the sun; w: its irradiance / pi.
    sun: vec4<f32>,
    // xyz: position; w: intensity / pi. Unused ones have intensity 0.
    points: array<vec4<f32>, 4>,
    // x: ambient; y: metres by which shadow look-ups are moved along the normal.
    misc: vec4<f32>,
};
// A program for each number of lights and with or without shadows: processors that draw run the same code for every
// pixel, and pay for a loop or a look-up that is not wanted.
override POINTS: u32 = 4u;
override SHADOWS: bool = true;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var shadow_map: texture_depth_2d;
@group(1) @binding(1) var shadow_sampler: sampler_comparison;

struct Vertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    // Rows of the affine matrix from the mesh's frame to the camera's.
    @location(2) row_x: vec4<f32>,
    @location(3) row_y: vec4<f32>,
    @location(4) row_z: vec4<f32>,
    // xyz: scale; w: edge of a pattern cell, metres.
    @location(5) scale: vec4<f32>,
    // Linear colours; w of the first: kind of pattern.
    @location(6) color: vec4<f32>,
    @location(7) pattern: vec4<f32>,
    @location(8) id: u32,
};

struct Surface {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) local: vec3<f32>,
    @location(3) local_normal: vec3<f32>,
    @location(4) @interpolate(flat) color: vec4<f32>,
    @location(5) @interpolate(flat) pattern: vec4<f32>,
    @location(6) @interpolate(flat) id: u32,
    // Where to look in the shadow map, and with which depth. The sun's rays are parallel, so this is as linear as the
    // position is.
    @location(7) sunward: vec3<f32>,
};

struct Pixel {
    @location(0) color: vec4<f32>,
    // Depth as the bits of a float, for float targets cannot be drawn to everywhere; id.
    @location(1) depth_and_id: vec2<u32>,
};

fn to_camera(v: Vertex) -> vec3<f32> {
    let p = vec4<f32>(v.position, 1.0);
    return vec3<f32>(dot(v.row_x, p), dot(v.row_y, p), dot(v.row_z, p));
}

@vertex
fn vertex_main(v: Vertex) -> Surface {
    var out: Surface;
    out.position = to_camera(v);
    out.clip = frame.clip_from_camera * vec4<f32>(out.position, 1.0);
    // The rows already scale; normals need the inverse scale, hence the square.
    let n = v.normal / (v.scale.xyz * v.scale.xyz);
    out.normal = vec3<f32>(dot(v.row_x.xyz, n), dot(v.row_y.xyz, n), dot(v.row_z.xyz, n));
    out.local = v.position * v.scale.xyz / v.scale.w;
    out.local_normal = v.normal;
    out.color = v.color;
    out.pattern = v.pattern;
    out.id = v.id;
    let moved = out.position + facing(out.position, out.normal) * frame.misc.y;
    let sunward = frame.shadow_from_camera * vec4<f32>(moved, 1.0);
    out.sunward = vec3<f32>(sunward.xy * vec2<f32>(0.5, -0.5) + vec2<f32>(0.5), sunward.z);
    return out;
}

// The unit normal on the side that is seen: the back of an open surface is lit like a front.
fn facing(position: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let unit = normalize(normal);
    return select(unit, -unit, dot(unit, position) > 0.0);
}

@vertex
fn vertex_shadow(v: Vertex) -> @builtin(position) vec4<f32> {
    return frame.shadow_from_camera * vec4<f32>(to_camera(v), 1.0);
}

fn hash(cell: vec3<i32>) -> u32 {
    var h = bitcast<u32>(cell.x) * 0x9E3779B1u ^ bitcast<u32>(cell.y) * 0x85EBCA77u ^ bitcast<u32>(cell.z) * 0xC2B2AE3Du;
    h = (h ^ (h >> 15u)) * 0x2C1B3C6Du;
    h = (h ^ (h >> 12u)) * 0x297A2D39u;
    return h ^ (h >> 15u);
}

// Whether the pattern's colour covers this point. The coordinate along the normal is left out, because on a flat face
// it would sit exactly on a cell border.
fn is_painted(kind: f32, local: vec3<f32>, normal: vec3<f32>) -> bool {
    let n = abs(normal);
    var cell = vec3<i32>(floor(local));
    let along_x = n.x > n.y && n.x > n.z;
    if (along_x) {
        cell.x = 0;
    } else if (n.y > n.z) {
        cell.y = 0;
    } else {
        cell.z = 0;
    }
    if (kind < 1.5) {
        return ((cell.x + cell.y + cell.z) & 1) != 0;
    }
    if (kind < 2.5) {
        return (select(cell.x, cell.y, along_x) & 1) != 0;
    }
    return hash(cell) % 6u == 0u;
}

fn sunlit(at: vec3<f32>) -> f32 {
    if (!SHADOWS) {
        return 1.0;
    }
    let lit = textureSampleCompareLevel(shadow_map, shadow_sampler, at.xy, at.z);
    return select(lit, 1.0, any(abs(at.xy - vec2<f32>(0.5)) > vec2<f32>(0.5)));
}

fn lamp(point: vec4<f32>, position: vec3<f32>, normal: vec3<f32>) -> f32 {
    let towards = point.xyz - position;
    let nearness = inverseSqrt(max(dot(towards, towards), 1e-4));
    return point.w * max(dot(normal, towards), 0.0) * nearness * nearness * nearness;
}

fn shade(in: Surface, base: vec3<f32>) -> Pixel {
    let normal = facing(in.position, in.normal);
    var light = frame.misc.x + frame.sun.w * max(dot(normal, frame.sun.xyz), 0.0) * sunlit(in.sunward);
    if (POINTS > 0u) {
        light += lamp(frame.points[0], in.position, normal);
    }
    if (POINTS > 1u) {
        light += lamp(frame.points[1], in.position, normal);
    }
    if (POINTS > 2u) {
        light += lamp(frame.points[2], in.position, normal);
    }
    if (POINTS > 3u) {
        light += lamp(frame.points[3], in.position, normal);
    }
    let color = base * light;
    var out: Pixel;
    // Too much light keeps its hue instead of bleaching to white.
    out.color = vec4<f32>(color / max(1.0, max(color.r, max(color.g, color.b))), 1.0);
    out.depth_and_id = vec2<u32>(bitcast<u32>(in.position.z), in.id);
    return out;
}

@fragment
fn fragment_plain(in: Surface) -> Pixel {
    return shade(in, in.color.rgb);
}

@fragment
fn fragment_pattern(in: Surface) -> Pixel {
    let painted = in.color.w > 0.5 && is_painted(in.color.w, in.local, in.local_normal);
    return shade(in, select(in.color.rgb, in.pattern.rgb, painted));
}
