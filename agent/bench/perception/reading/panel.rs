//! Boxes with something to read on them, from seeds, and pictures of them.

use super::letters::{Letter, MARKS, Polygon, Style};
use acm_concept::{
    camera::{CameraModel, FrameHeader, Intrinsics, Mount, RgbdFrame},
    color::Lab,
    ids::FrameId,
    pose::Pose,
    reading::Hue,
    time::Time,
};
use acm_render::{Instance, Lighting, Material, Mesh, Renderer, Sun, sensor::SensorProfile};
use anyhow::Context;
use glam::{DMat3, DQuat, DVec2, DVec3, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::{f64::consts::TAU, sync::Arc};

/// Height of the table, metres: the lights are made for it.
const TABLE_M: f64 = 0.74;
const CAMERA: &str = "bench";
/// Layers of print lie so far over each other, metres.
const LAYER_M: f64 = 0.0004;
/// Colours of one layer and the next are so far apart at least, CIELAB.
const CONTRAST: f64 = 35.0;

/// What is on a panel.
#[derive(Debug, Clone, PartialEq)]
pub enum Shown {
    /// A line of marks.
    Text(String),
    /// A lamp, and whether it is lit.
    Lamp(Hue, bool),
    /// A needle's angle, degrees clockwise from up.
    Needle(f64),
    /// Nothing that can be read: a blank face, a texture, or a plain coloured shape.
    Nothing,
}

/// The kinds of which the bench tells apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Digits of seven segments.
    Segments,
    /// Printed digits.
    Print,
    /// One printed mark or letter.
    Mark,
    /// A lamp.
    Lamp,
    /// A dial with a needle.
    Needle,
    /// Nothing.
    Nothing,
}

impl Kind {
    /// All of them, in the order in which seeds take turns.
    pub const ALL: [Kind; 6] = [Kind::Segments, Kind::Print, Kind::Mark, Kind::Lamp, Kind::Needle, Kind::Nothing];
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Segments => "segments",
            Kind::Print => "print",
            Kind::Mark => "marks",
            Kind::Lamp => "lamps",
            Kind::Needle => "needles",
            Kind::Nothing => "nothing",
        }
    }
}

/// A panel as it was photographed.
#[derive(Debug, Clone)]
pub struct Photo {
    /// What perception gets.
    pub frame: RgbdFrame,
    /// What is on it.
    pub shown: Shown,
    /// Whether the face looks up.
    pub level: bool,
    /// Height in the picture, pixels: of a mark, a lamp, a dial.
    pub height_px: f64,
}

/// A drawing on a face: polygons in metres from its middle, x right and y up as seen from the front, with colours.
#[derive(Debug, Default)]
struct Print {
    layers: Vec<(Vec<Polygon>, [u8; 3])>,
    size: DVec2,
    height_m: f64,
}

/// Draws the panel of a seed and takes a picture of it.
///
/// # Errors
/// The renderer fails.
pub fn photo(renderer: &mut Renderer, kind: Kind, seed: u64) -> anyhow::Result<Photo> {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let body = color(rng, None);
    let (print, shown) = match kind {
        Kind::Segments | Kind::Print => {
            let count = rng.random_range(1..=3);
            let text: String = (0..count).map(|_| char::from(b'0' + rng.random_range(0..10u8))).collect();
            let style = if kind == Kind::Segments { Style::segments(rng) } else { Style::print(rng) };
            (writing(&text, style, body, rng), Shown::Text(text))
        }
        Kind::Mark => {
            let marks: Vec<char> = MARKS.chars().collect();
            let mark = marks[rng.random_range(0..marks.len())];
            let mut style = Style::print(rng);
            if style.letter(mark).is_none() {
                style = Style::Nib { half: DVec2::splat(0.07), angle: 0.4, width: 1.0, slant: 0.0, serifs: false };
            }
            (writing(&mark.to_string(), style, body, rng), Shown::Text(mark.to_uppercase().collect()))
        }
        Kind::Lamp => lamp(body, rng),
        Kind::Needle => dial(body, rng),
        Kind::Nothing => (nothing(body, rng), Shown::Nothing),
    };
    take(renderer, print, shown, body, rng, seed)
}

/// A colour far enough from another.
fn color(rng: &mut ChaCha8Rng, other: Option<[u8; 3]>) -> [u8; 3] {
    for _ in 0..200 {
        let grey: u8 = rng.random();
        let color: [u8; 3] = if rng.random_bool(0.5) { [grey; 3] } else { rng.random() };
        let apart = |other| Lab::from_srgb(color).distance(&Lab::from_srgb(other)) > CONTRAST;
        if other.is_none_or(apart) {
            return color;
        }
    }
    [20, 20, 20]
}

fn rectangle(low: DVec2, high: DVec2) -> Polygon {
    vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
}

fn disc(centre: DVec2, radius: f64) -> Polygon {
    (0..48).map(|step| centre + DVec2::from_angle(f64::from(step) / 48.0 * TAU) * radius).collect()
}

/// A line of marks, on a panel of its own or straight on the body.
fn writing(text: &str, style: Style, body: [u8; 3], rng: &mut ChaCha8Rng) -> Print {
    let height = rng.random_range(0.012..0.045);
    let spacing = rng.random_range(0.16..0.35);
    let panel = matches!(style, Style::Segments { .. }) || rng.random_bool(0.5);
    let (ground, ink) = match style {
        Style::Segments { .. } if rng.random_bool(0.7) => {
            let dark = [rng.random_range(5..40); 3];
            let lights = [[255, 60, 40], [60, 240, 90], [90, 200, 255], [255, 190, 50], [240, 240, 235]];
            (dark, lights[rng.random_range(0..lights.len())])
        }
        _ => {
            let ground = if panel { color(rng, Some(body)) } else { body };
            (ground, color(rng, Some(ground)))
        }
    };
    let letters: Vec<Letter> = text.chars().filter_map(|mark| style.letter(mark)).collect();
    let width: f64 =
        letters.iter().map(|letter| letter.width).sum::<f64>() + spacing * (letters.len().max(1) - 1) as f64;
    let (mut inked, mut ghosts) = (Vec::new(), Vec::new());
    let mut left = -0.5 * width;
    for letter in &letters {
        let placed =
            |polygon: &Polygon| -> Polygon { polygon.iter().map(|p| (*p + DVec2::new(left, -0.5)) * height).collect() };
        inked.extend(letter.ink.iter().map(placed));
        ghosts.extend(letter.ghosts.iter().map(placed));
        left += letter.width + spacing;
    }
    let half = DVec2::new(0.5 * width + rng.random_range(0.25..0.8), 0.5 + rng.random_range(0.25..0.8)) * height;
    let mut print = Print { size: 2.0 * half, height_m: height, ..Print::default() };
    if panel {
        print.layers.push((vec![rectangle(-half, half)], ground));
    }
    if rng.random_bool(0.5) && !ghosts.is_empty() {
        let faint = |k: usize| (0.88 * f64::from(ground[k]) + 0.12 * f64::from(ink[k])) as u8;
        print.layers.push((ghosts, [faint(0), faint(1), faint(2)]));
    }
    print.layers.push((inked, ink));
    print
}

fn lamp(body: [u8; 3], rng: &mut ChaCha8Rng) -> (Print, Shown) {
    // Full and dark colours of lamps.
    let lamps = [
        (Hue::Red, [255, 45, 30], [88, 18, 16]),
        (Hue::Green, [50, 235, 85], [16, 72, 28]),
        (Hue::Orange, [255, 170, 30], [92, 58, 12]),
        (Hue::Blue, [70, 110, 255], [18, 28, 92]),
    ];
    let (hue, bright, dark) = lamps[rng.random_range(0..lamps.len())];
    let lit = rng.random_bool(0.5);
    let radius = rng.random_range(0.006..0.018);
    let color = if lit { bright } else { dark };
    let mut print = Print { size: DVec2::splat(3.0 * radius), height_m: 2.0 * radius, ..Print::default() };
    let near = Lab::from_srgb(color).distance(&Lab::from_srgb(body)) < CONTRAST;
    if near || rng.random_bool(0.5) {
        let grey = if Lab::from_srgb(color).l > 50.0 { rng.random_range(10..50) } else { rng.random_range(150..240) };
        print.layers.push((vec![disc(DVec2::ZERO, 1.25 * radius)], [grey; 3]));
    }
    print.layers.push((vec![disc(DVec2::ZERO, radius)], color));
    (print, Shown::Lamp(hue, lit))
}

fn dial(body: [u8; 3], rng: &mut ChaCha8Rng) -> (Print, Shown) {
    let radius = rng.random_range(0.022..0.045);
    let angle_deg = rng.random_range(0.0..360.0f64);
    let ground = color(rng, Some(body));
    let ink = color(rng, Some(ground));
    let mut print = Print { size: DVec2::splat(2.4 * radius), height_m: 2.0 * radius, ..Print::default() };
    print.layers.push((vec![disc(DVec2::ZERO, radius)], ground));
    let at = |degrees: f64, share: f64| {
        let angle = degrees.to_radians();
        DVec2::new(angle.sin(), angle.cos()) * share * radius
    };
    if rng.random_bool(0.6) {
        let count = rng.random_range(4..=12);
        let ticks = (0..count).map(|tick| {
            let degrees = 360.0 * f64::from(tick) / f64::from(count);
            let side = at(degrees + 90.0, 0.02);
            vec![at(degrees, 0.8) + side, at(degrees, 0.95) + side, at(degrees, 0.95) - side, at(degrees, 0.8) - side]
        });
        let scale = if rng.random_bool(0.5) { ink } else { color(rng, Some(ground)) };
        print.layers.push((ticks.collect(), scale));
    }
    let (length, half, tail) =
        (rng.random_range(0.65..0.92), rng.random_range(0.03..0.07), rng.random_range(0.0..0.28));
    let side = at(angle_deg + 90.0, half);
    let taper = if rng.random_bool(0.5) { 0.3 } else { 1.0 };
    let needle = vec![
        at(angle_deg, -tail) + side,
        at(angle_deg, length) + side * taper,
        at(angle_deg, length) - side * taper,
        at(angle_deg, -tail) - side,
    ];
    print.layers.push((vec![needle], ink));
    let hub = if rng.random_bool(0.5) { ink } else { color(rng, Some(ground)) };
    print.layers.push((vec![disc(DVec2::ZERO, rng.random_range(0.08..0.16) * radius)], hub));
    (print, Shown::Needle(angle_deg))
}

/// A blank face, stripes, specks, or a plain shape that is no mark.
fn nothing(body: [u8; 3], rng: &mut ChaCha8Rng) -> Print {
    let half = DVec2::new(rng.random_range(0.02..0.05), rng.random_range(0.02..0.04));
    let mut print = Print { size: 2.0 * half, height_m: 2.0 * half.y, ..Print::default() };
    let ink = color(rng, Some(body));
    let polygons = match rng.random_range(0..5) {
        0 => Vec::new(),
        1 => {
            let cell = rng.random_range(0.006..0.015);
            let count = (2.0 * half.x / (2.0 * cell)) as u32;
            let left = |k: u32| -half.x + 2.0 * cell * f64::from(k);
            (0..count).map(|k| rectangle(DVec2::new(left(k), -half.y), DVec2::new(left(k) + cell, half.y))).collect()
        }
        2 => (0..rng.random_range(30..80))
            .map(|_| {
                let at = DVec2::new(rng.random_range(-half.x..half.x), rng.random_range(-half.y..half.y));
                let size = DVec2::new(rng.random_range(0.001..0.005), rng.random_range(0.001..0.005));
                rectangle(at - size, at + size)
            })
            .collect(),
        // A display that is off, or a label without print.
        3 => vec![rectangle(-half, half)],
        _ => {
            let corner = || (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
            let [a, b, c] = [(); 3].map({
                let mut corner = corner;
                move |()| DVec2::from(corner()) * half
            });
            vec![vec![a, b, c]]
        }
    };
    if !polygons.is_empty() {
        print.layers.push((polygons, ink));
    }
    print
}

/// Puts a print on a face of a box on a table, and photographs it from somewhere ahead.
fn take(
    renderer: &mut Renderer,
    print: Print,
    shown: Shown,
    body: [u8; 3],
    rng: &mut ChaCha8Rng,
    seed: u64,
) -> anyhow::Result<Photo> {
    let level = rng.random_bool(0.3);
    let room = print.size + DVec2::new(rng.random_range(0.02..0.06), rng.random_range(0.02..0.06));
    let deep = rng.random_range(0.04..0.09);
    let size = if level { DVec3::new(room.x, room.y, deep) } else { DVec3::new(room.x, deep, room.y) };
    let elevation: f64 =
        if level { rng.random_range(35.0..75.0f64) } else { rng.random_range(15.0..45.0f64) }.to_radians();
    let distance = rng.random_range(0.5..1.0);
    // The front looks along -y; the camera stands there, up to 35 degrees aside.
    let aside = rng.random_range(-35.0..35.0f64).to_radians();
    let turn = rng.random_range(0.0..TAU);
    let middle = DVec3::Z * (TABLE_M + 0.5 * size.z);
    let thing = Pose::new(middle, DQuat::from_rotation_z(turn));
    let face = if level {
        Pose::new(DVec3::Z * 0.5 * size.z, DQuat::IDENTITY)
    } else {
        let axes = DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y);
        Pose::new(-DVec3::Y * 0.5 * size.y, DQuat::from_mat3(&axes))
    };
    let direction = DQuat::from_rotation_z(turn + aside) * DVec3::new(0.0, -elevation.cos(), elevation.sin());
    let right = (-direction).cross(DVec3::Z).normalize();
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, (-direction).cross(right), -direction)).normalize();
    let aim = middle + DVec3::new(rng.random_range(-0.1..0.1), rng.random_range(-0.1..0.1), 0.0) * distance;
    let camera = CameraModel {
        name: CAMERA.into(),
        intrinsics: Intrinsics::from_vertical_fov(640, 480, 45f64.to_radians()),
        pose: Pose::new(aim + direction * distance, rotation),
        mount: Mount::World,
        depth_min_m: 0.1,
        depth_max_m: 6.0,
    };
    let sun = DVec3::new(rng.random_range(-0.7..0.7), rng.random_range(-0.7..0.7), -1.0);
    let usual = Lighting::default();
    let lights = Lighting { sun: Sun { direction: sun, ..usual.sun }, ..usual };
    let sensor = SensorProfile::named("d435")?.episode(rng);
    let stage = stage(&print, &thing, &face, size, body, lights, rng)?;
    let rendered = renderer.render(&stage, &sensor.true_camera(&camera))?;
    let measured = sensor.measure(&rendered, &camera, rng);
    let header = FrameHeader {
        id: FrameId(seed),
        camera: camera.name.clone(),
        time: Time::ZERO,
        intrinsics: camera.intrinsics,
        camera_pose: camera.pose,
    };
    let frame = RgbdFrame::new(header, measured.color.into(), measured.depth.into()).context("the renderer's frame")?;
    let in_view = |y: f64| {
        let point = (thing * face).transform_point(DVec3::new(0.0, y, 0.0));
        camera.intrinsics.project(camera.pose.inverse().transform_point(point))
    };
    let ends = in_view(0.5 * print.height_m).zip(in_view(-0.5 * print.height_m));
    let height_px = ends.map_or(0.0, |(a, b)| a.distance(b));
    // On a face that looks up, up is away from the viewer: the thing's own y is turned from that by `aside`.
    let shown = match shown {
        Shown::Needle(angle) if level => Shown::Needle((angle + aside.to_degrees()).rem_euclid(360.0)),
        other => other,
    };
    Ok(Photo { frame, shown, level, height_px })
}

fn stage(
    print: &Print,
    thing: &Pose,
    face: &Pose,
    size: DVec3,
    body: [u8; 3],
    lights: Lighting,
    rng: &mut ChaCha8Rng,
) -> anyhow::Result<acm_render::Scene> {
    let cuboid = Arc::new(Mesh::unit_box());
    let solid = |pose: Pose, scale: DVec3, color, id| Instance {
        mesh: cuboid.clone(),
        pose,
        scale,
        material: Material::plain(color),
        id,
    };
    let table = color(rng, Some(body));
    let mut instances = vec![
        solid(Pose::from_translation(DVec3::Z * (TABLE_M - 0.02)), DVec3::new(2.0, 2.0, 0.04), table, 1),
        solid(Pose::from_translation(DVec3::Z * -0.01), DVec3::new(12.0, 12.0, 0.02), [150, 146, 140], 2),
        solid(*thing, size, body, 3),
    ];
    for (layer, (polygons, color)) in print.layers.iter().enumerate() {
        if polygons.is_empty() {
            continue;
        }
        let lift = Pose::from_translation(DVec3::Z * LAYER_M * (layer + 1) as f64);
        instances.push(Instance {
            mesh: Arc::new(flat(polygons)?),
            pose: *thing * *face * lift,
            scale: DVec3::ONE,
            material: Material::plain(*color),
            id: 3,
        });
    }
    Ok(acm_render::Scene { instances, lights, background: [200, 200, 205] })
}

/// Convex polygons as a flat mesh that looks along z.
fn flat(polygons: &[Polygon]) -> anyhow::Result<Mesh> {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for polygon in polygons {
        let first = positions.len() as u32;
        positions.extend(polygon.iter().map(|p| Vec3::new(p.x as f32, p.y as f32, 0.0)));
        triangles.extend((2..polygon.len() as u32).map(|k| [first, first + k - 1, first + k]));
    }
    Ok(Mesh::from_triangles("print", &positions, &triangles)?)
}
