//! The renderer against analytic ray casting, colour arithmetic and its own promises. One binary and one renderer:
//! the first frame compiles the device's programs.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use acm_concept::{
    camera::{CameraModel, Intrinsics},
    pose::Pose,
    solid::{Enclosure, PlacedSolid, Solid},
};
use acm_render::{
    Instance, Lighting, Material, Mesh, Pattern, PatternKind, PointLight, RenderError, Rendered, Renderer, Scene, Sun,
};
use glam::{DQuat, DVec3, Vec3};
use std::{
    f64::consts::PI,
    sync::{Arc, Mutex, PoisonError},
};

static RENDERER: Mutex<Option<Renderer>> = Mutex::new(None);

fn try_render(scene: &Scene, camera: &CameraModel) -> Result<Rendered, RenderError> {
    let mut shared = RENDERER.lock().unwrap_or_else(PoisonError::into_inner);
    let renderer = shared.get_or_insert_with(|| Renderer::new().unwrap_or_else(|error| panic!("{error}")));
    renderer.render(scene, camera)
}

fn render(scene: &Scene, camera: &CameraModel) -> Rendered {
    try_render(scene, camera).unwrap()
}

/// A camera without any symmetry that could hide a mistake, and a width whose rows need padding.
fn skew_camera(pose: Pose) -> CameraModel {
    let intrinsics = Intrinsics { width: 403, height: 297, fx: 371.0, fy: 415.0, cx: 171.3, cy: 183.8 };
    let mount = Default::default();
    CameraModel { name: "skew".into(), intrinsics, pose, mount, depth_min_m: 0.1, depth_max_m: 6.0 }
}

/// One metre above the origin, looking down; the image's right is x, its bottom -y.
fn from_above() -> CameraModel {
    skew_camera(Pose::new(DVec3::Z, DQuat::from_rotation_x(PI)))
}

fn ambient_only(strength: f32) -> Lighting {
    Lighting { ambient: strength, sun: Sun { intensity: 0.0, ..Lighting::default().sun }, points: Vec::new() }
}

fn instance(mesh: Mesh, pose: Pose, scale: DVec3, color: [u8; 3], id: u32) -> Instance {
    Instance { mesh: Arc::new(mesh), pose, scale, material: Material::plain(color), id }
}

fn a_box(at: DVec3, size: DVec3, color: [u8; 3], id: u32) -> Instance {
    instance(Mesh::unit_box(), Pose::from_translation(at), size, color, id)
}

fn pixel(rendered: &Rendered, column: u32, row: u32) -> [u8; 3] {
    let index = 3 * (row * rendered.width + column) as usize;
    [0, 1, 2].map(|channel| rendered.color[index + channel])
}

/// What a ray through image coordinates meets first: id and depth.
fn cast(solids: &[(PlacedSolid, u32)], camera: &CameraModel, column: f64, row: f64) -> (u32, f64) {
    let direction = camera.pose.transform_vector(camera.intrinsics.ray(column, row));
    let hits = solids.iter().filter_map(|(solid, id)| {
        let (enter, _) = solid.intersect_ray(camera.pose.translation, direction)?;
        (enter > 0.01).then_some((*id, enter))
    });
    hits.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

/// Renders solids and compares every pixel that is not within a twentieth of a pixel of a silhouette.
fn compare(solids: &[(PlacedSolid, u32)], camera: &CameraModel, tolerance_m: f64) {
    let draw = |(placed, id): &(PlacedSolid, u32)| {
        let (mesh, scale) = match placed.solid.enclosure() {
            Enclosure::Box { size } => (Mesh::unit_box(), size),
            Enclosure::Cylinder { radius, height } => (Mesh::unit_cylinder(), DVec3::new(radius, radius, height)),
        };
        instance(mesh, placed.pose, scale, [200; 3], *id)
    };
    let scene = Scene { instances: solids.iter().map(draw).collect(), ..Scene::default() };
    let rendered = render(&scene, camera);
    let (mut compared, mut worst, mut seen) = (0, 0f64, std::collections::BTreeSet::new());
    for row in 0..rendered.height {
        for column in 0..rendered.width {
            let (x, y) = (f64::from(column), f64::from(row));
            let (id, depth) = cast(solids, camera, x, y);
            let border = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
                .iter()
                .any(|(dx, dy)| cast(solids, camera, x + 0.05 * dx, y + 0.05 * dy).0 != id);
            if border {
                continue;
            }
            let index = (row * rendered.width + column) as usize;
            assert_eq!(rendered.ids[index], id, "id at column {column}, row {row}");
            worst = worst.max((f64::from(rendered.depth[index]) - depth).abs());
            compared += 1;
            seen.insert(id);
        }
    }
    assert!(worst <= tolerance_m, "depth is off by {worst} m");
    assert!(compared > rendered.ids.len() * 9 / 10, "only {compared} pixels could be compared");
    assert!(seen.len() >= solids.len(), "not everything was in view: {seen:?}");
}

#[test]
fn depth_and_ids_of_boxes_agree_with_ray_casting() {
    let at =
        |x, y, z, axis: DVec3, angle| Pose::new(DVec3::new(x, y, z), DQuat::from_axis_angle(axis.normalize(), angle));
    let solids = [
        (Solid::Box { size: DVec3::new(3.0, 3.0, 0.1) }, at(0.0, 0.0, -0.05, DVec3::Z, 0.2), 1),
        (Solid::Box { size: DVec3::splat(0.04) }, at(0.1, 0.1, 0.02, DVec3::Z, 0.5), 70_000),
        (Solid::Box { size: DVec3::new(0.3, 0.02, 0.1) }, at(-0.2, -0.1, 0.2, DVec3::new(1.0, 2.0, 3.0), 1.0), 3),
        (Solid::Box { size: DVec3::new(0.07, 0.07, 0.002) }, at(0.2, -0.1, 0.001, DVec3::Z, 0.1), u32::MAX),
    ]
    .map(|(solid, pose, id)| (PlacedSolid { solid, pose }, id));
    compare(&solids, &from_above(), 2e-5);
    let tilt = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(PI + 0.7);
    compare(&solids, &skew_camera(Pose::new(DVec3::new(0.3, -0.6, 0.8), tilt)), 2e-5);
}

#[test]
fn depth_of_a_cylinder_agrees_with_ray_casting_up_to_its_facets() {
    let pose = Pose::new(DVec3::new(0.05, 0.0, 0.2), DQuat::from_rotation_x(1.1));
    let solids = [(PlacedSolid { solid: Solid::Cylinder { radius: 0.03, height: 0.2 }, pose }, 9)];
    let scene = Scene {
        instances: vec![instance(Mesh::unit_cylinder(), pose, DVec3::new(0.03, 0.03, 0.2), [90; 3], 9)],
        ..Scene::default()
    };
    let camera = from_above();
    let rendered = render(&scene, &camera);
    let (mut compared, mut far) = (0, 0);
    for (index, depth) in rendered.depth.iter().enumerate().filter(|(_, depth)| **depth > 0.0) {
        let (column, row) = (index as u32 % rendered.width, index as u32 / rendered.width);
        let (id, exact) = cast(&solids, &camera, f64::from(column), f64::from(row));
        compared += 1;
        far += usize::from(id != 9 || (f64::from(*depth) - exact).abs() > 5e-4);
    }
    // Only near the silhouette, where the surface turns away, do the facets show.
    assert!(compared > 1000 && far < compared / 20, "{far} of {compared}");
}

#[test]
fn colours_come_out_as_they_went_in() {
    for color in [[255, 0, 0], [128, 128, 128], [10, 200, 90], [3, 60, 250]] {
        let ground = a_box(DVec3::ZERO, DVec3::new(4.0, 4.0, 0.1), color, 1);
        let scene = Scene { instances: vec![ground], lights: ambient_only(1.0), background: [0; 3] };
        let seen = pixel(&render(&scene, &from_above()), 50, 60);
        assert!((0..3).all(|k| seen[k].abs_diff(color[k]) <= 1), "{color:?} became {seen:?}");
    }
    let empty = Scene { background: [12, 130, 240], ..Scene::default() };
    let rendered = render(&empty, &from_above());
    assert!((0..3).all(|k| pixel(&rendered, 402, 296)[k].abs_diff(empty.background[k]) <= 1));
    assert!(rendered.depth.iter().all(|z| *z == 0.0) && rendered.ids.iter().all(|id| *id == 0));
}

#[test]
fn too_much_light_keeps_the_hue() {
    let ground = a_box(DVec3::ZERO, DVec3::new(4.0, 4.0, 0.1), [200, 100, 50], 1);
    let scene = Scene { instances: vec![ground], lights: ambient_only(20.0), background: [0; 3] };
    let [r, g, b] = pixel(&render(&scene, &from_above()), 50, 60);
    // Linear 0.578, 0.127, 0.0319, divided by the first.
    assert!(r == 255 && g.abs_diff(129) <= 1 && b.abs_diff(66) <= 1, "{r} {g} {b}");
}

#[test]
fn light_falls_off_with_angle_and_distance() {
    // Straight below a point light of strength pi at 1 m: reflects exactly its albedo.
    let lights = Lighting {
        points: vec![PointLight { position: DVec3::Z, intensity: std::f32::consts::PI }],
        ..ambient_only(0.0)
    };
    let ground = a_box(-0.05 * DVec3::Z, DVec3::new(4.0, 4.0, 0.1), [188; 3], 1);
    let rendered = render(&Scene { instances: vec![ground], lights, background: [0; 3] }, &from_above());
    let below = pixel(&rendered, 171, 184)[0];
    assert!(below.abs_diff(188) <= 1, "{below}");
    // At distance x from there: cos / d^2 = (1 + x^2)^-1.5; at 0.5 m 0.7155, of linear 0.503 is 0.36.
    let aside = pixel(&rendered, 171 + (0.5 * 371.0) as u32, 184)[0];
    assert!(aside.abs_diff(162) <= 2, "{aside}");
}

#[test]
fn the_default_lights_leave_a_white_table_unclipped_and_a_red_cube_red() {
    let table = a_box(DVec3::new(0.0, 0.0, 0.715), DVec3::new(1.2, 0.7, 0.05), [255; 3], 1);
    let cube = a_box(DVec3::new(0.1, 0.0, 0.76), DVec3::splat(0.04), [220, 20, 20], 2);
    let camera = skew_camera(Pose::new(DVec3::new(0.0, 0.0, 1.5), DQuat::from_rotation_x(PI)));
    let rendered = render(&Scene { instances: vec![table, cube], ..Scene::default() }, &camera);
    for (index, id) in rendered.ids.iter().enumerate() {
        let [r, g, b] = [0, 1, 2].map(|k| rendered.color[3 * index + k]);
        match id {
            1 => assert!(r < 250 && r > 180 && r == g && g == b, "table {r} {g} {b}"),
            2 => assert!(r > 120 && g < 30 && b < 30, "cube {r} {g} {b}"),
            _ => {}
        }
    }
}

#[test]
fn the_sun_casts_shadows_where_ray_casting_says() {
    let direction = DVec3::new(0.5, 0.3, -1.0);
    let lights = Lighting { ambient: 0.2, sun: Sun { direction, intensity: 2.0, shadow_map: 512 }, points: Vec::new() };
    let size = DVec3::new(0.12, 0.08, 0.1);
    let block = PlacedSolid { solid: Solid::Box { size }, pose: Pose::from_yaw(DVec3::new(0.0, 0.0, 0.15), 0.4) };
    let ground = a_box(-0.05 * DVec3::Z, DVec3::new(20.0, 20.0, 0.1), [200; 3], 1);
    let caster = instance(Mesh::unit_box(), block.pose, size, [200; 3], 2);
    let camera = from_above();
    let mut scene = Scene { instances: vec![ground, caster], lights, background: [0; 3] };
    let rendered = render(&scene, &camera);
    let is_shaded = |point: DVec3| block.intersect_ray(point, -direction).is_some();
    let (mut shaded, mut lit) = (0, 0);
    for (index, _) in rendered.ids.iter().enumerate().filter(|(_, id)| **id == 1) {
        let (column, row) = (index as u32 % rendered.width, index as u32 / rendered.width);
        let ray = camera.intrinsics.ray(f64::from(column), f64::from(row));
        let point = camera.pose.transform_point(ray);
        let expected = is_shaded(point);
        let border = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y].iter().any(|d| is_shaded(point + 0.01 * d) != expected);
        if border {
            continue;
        }
        let brightness = pixel(&rendered, column, row)[0];
        assert_eq!(brightness < 150, expected, "brightness {brightness} at {point}");
        if expected { shaded += 1 } else { lit += 1 }
    }
    assert!(shaded > 500 && lit > 50_000, "{shaded} {lit}");
    scene.lights.sun.shadow_map = 0;
    let without = render(&scene, &camera);
    let ground_is_lit = |(index, id): (usize, &u32)| *id != 1 || without.color[3 * index] >= 150;
    assert!(without.ids.iter().enumerate().all(ground_is_lit));
}

#[test]
fn patterns_have_both_colours_and_the_size_they_say() {
    let share = |kind| {
        let mut ground = a_box(DVec3::ZERO, DVec3::new(4.0, 4.0, 0.1), [250, 0, 0], 1);
        ground.material.pattern = Some(Pattern { kind, color: [0, 0, 250], cell_m: 0.1 });
        let rendered =
            render(&Scene { instances: vec![ground], lights: ambient_only(1.0), background: [0; 3] }, &from_above());
        let painted = rendered.color.chunks_exact(3).filter(|rgb| rgb[2] > 200 && rgb[0] < 5).count();
        let plain = rendered.color.chunks_exact(3).filter(|rgb| rgb[0] > 200 && rgb[2] < 5).count();
        assert_eq!(painted + plain, rendered.ids.len());
        let blue: Vec<bool> = (0..rendered.width).map(|column| pixel(&rendered, column, 100)[2] > 200).collect();
        let changes = blue.windows(2).filter(|pair| pair[0] != pair[1]).count();
        (painted as f64 / rendered.ids.len() as f64, changes)
    };
    // The row shows 403 / 371 * 0.95 m = 1.03 m: ten borders of cells, give or take one.
    for kind in [PatternKind::Checker, PatternKind::Stripes] {
        let (painted, changes) = share(kind);
        assert!((painted - 0.5).abs() < 0.1 && (9..=11).contains(&changes), "{kind:?}: {painted}, {changes}");
    }
    let (painted, _) = share(PatternKind::Speckle);
    assert!(painted > 0.05 && painted < 0.35, "{painted}");
}

#[test]
fn open_meshes_show_both_sides_and_closed_ones_only_their_outside() {
    let corners = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
    for triangle in [[0, 1, 2], [0, 2, 1]] {
        let mesh = Mesh::from_triangles("sheet", &corners, &[triangle]).unwrap();
        let sheet = instance(mesh, Pose::IDENTITY, DVec3::ONE, [200; 3], 4);
        let rendered = render(&Scene { instances: vec![sheet], ..Scene::default() }, &from_above());
        let index = (184 * rendered.width + 171) as usize;
        assert!(rendered.ids[index] == 4 && (rendered.depth[index] - 1.0).abs() < 1e-4);
        assert!(pixel(&rendered, 171, 184)[0] > 100, "the back is lit like a front");
    }
    let around_the_camera = a_box(DVec3::Z, DVec3::ONE, [200; 3], 5);
    let rendered = render(&Scene { instances: vec![around_the_camera], ..Scene::default() }, &from_above());
    assert!(rendered.ids.iter().all(|id| *id == 0));
}

#[test]
fn frames_repeat_exactly_whatever_was_drawn_between() {
    let scene = |height: f64| Scene {
        instances: (1..40)
            .map(|id| {
                let at = DVec3::new(0.02 * f64::from(id) - 0.4, 0.01 * f64::from(id), height);
                a_box(at, DVec3::splat(0.05), [200, 5 * id as u8, 40], id)
            })
            .collect(),
        ..Scene::default()
    };
    let camera = from_above();
    let first = render(&scene(0.1), &camera);
    // Other sizes, more of them than are kept, and other meshes at addresses that may have been freed.
    for width in 100..112 {
        let mut other = camera.clone();
        other.intrinsics.width = width;
        let rendered = render(&scene(0.3), &other);
        assert_eq!((rendered.width, rendered.ids.len()), (width, width as usize * 297));
        assert!(rendered.ids.iter().any(|id| *id != 0));
    }
    assert!(render(&scene(0.1), &camera) == first);
}

#[test]
fn what_cannot_be_drawn_is_refused_with_its_reason() {
    let camera = from_above();
    let refused = |change: &dyn Fn(&mut Scene, &mut CameraModel)| {
        let block = a_box(DVec3::ZERO, DVec3::ONE, [9; 3], 1);
        let (mut scene, mut camera) = (Scene { instances: vec![block], ..Scene::default() }, camera.clone());
        change(&mut scene, &mut camera);
        try_render(&scene, &camera).unwrap_err().to_string()
    };
    assert!(refused(&|scene, _| scene.instances[0].id = 0).contains("id 0 is reserved"));
    assert!(refused(&|scene, _| scene.instances[0].scale.y = 0.0).contains("`unit box`"));
    assert!(refused(&|scene, _| scene.instances[0].pose.translation.x = f64::NAN).contains("rigid motion"));
    assert!(refused(&|scene, _| scene.lights.sun.direction = DVec3::ZERO).contains("no length"));
    assert!(refused(&|scene, _| scene.lights.sun.shadow_map = 9999).contains("9999"));
    let point = PointLight { position: DVec3::Z, intensity: 1.0 };
    assert!(refused(&|scene, _| scene.lights.points = vec![point; 5]).contains("5 point lights, the limit is 4"));
    assert!(refused(&|_, camera| camera.intrinsics.fx = -1.0).contains("`skew`"));
    assert!(refused(&|_, camera| camera.intrinsics.width = 0).contains("0 x 297"));
}
