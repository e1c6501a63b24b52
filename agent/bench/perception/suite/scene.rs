//! A scene: things on a table, drawn from a seed.

use super::{
    plan::{Plan, RowKind},
    thing::{Thing, Workshop},
};
use acm_concept::{
    camera::{CameraModel, Intrinsics, Mount},
    color::Lab,
    pose::Pose,
};
use acm_render::{Lighting, Material, Pattern, PatternKind, Sun};
use glam::{DMat3, DQuat, DVec2, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Height of the table, metres: the lights are made for it.
pub const TABLE_M: f64 = 0.74;
/// The camera looks at a point so high above the table, metres.
const AIM_M: f64 = 0.03;
/// Things lie within this share of what half the image's height shows at the camera's distance.
const IN_VIEW: f64 = 0.95;
/// Attempts to find room for one thing.
const MAX_PLACES: usize = 40;
/// The name by which the camera's calibration errors are drawn.
const CAMERA: &str = "head";

/// Things on a table, and a camera that looks at them.
#[derive(Debug, Clone)]
pub struct Scene {
    /// What stands on the table.
    pub things: Vec<Thing>,
    /// The table's colour.
    pub table: [u8; 3],
    /// The lights.
    pub lights: Lighting,
    /// The camera as perception is told of it.
    pub camera: CameraModel,
}

/// What kind of scene is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Of what.
    pub kind: RowKind,
    /// Whether things touch.
    pub touching: bool,
}

impl Scene {
    /// Draws once; `None` where there is no room.
    ///
    /// # Errors
    /// A thing cannot be made.
    pub fn draw(
        plan: &Plan,
        wanted: Wanted,
        workshop: &mut Workshop,
        rng: &mut ChaCha8Rng,
    ) -> anyhow::Result<Option<Scene>> {
        let small = wanted.kind == RowKind::SmallCubes;
        let [least, most] = if small { plan.small_cubes.count } else { plan.layout.count };
        let count = rng.random_range(least..=most);
        let [near, far] = plan.camera.distance_m;
        let distance = if small { plan.small_cubes.distance_m } else { rng.random_range(near..=far) };
        let table = plan.look.tables[rng.random_range(0..plan.look.tables.len())];
        let camera = camera(plan, small, distance, rng);
        let lights = lights(rng);
        let room = IN_VIEW * distance * (0.5 * plan.camera.fov_y_deg.to_radians()).tan();
        let mut scene = Scene { things: Vec::new(), table, lights, camera };
        while scene.things.len() < count {
            let pair = wanted.touching && scene.things.len() + 2 <= count;
            let group = if pair {
                let [first, second] = [(); 2].map(|()| thing(plan, wanted.kind, table, workshop, rng));
                pair_of(plan, first?, second?, rng)
            } else {
                Some(vec![thing(plan, wanted.kind, table, workshop, rng)?])
            };
            let Some(group) = group else { return Ok(None) };
            if !scene.add(plan, group, room, rng) {
                return Ok(None);
            }
        }
        Ok(Some(scene))
    }

    /// Finds room for things that stay together, whose poses are about a common middle.
    fn add(&mut self, plan: &Plan, group: Vec<Thing>, room: f64, rng: &mut ChaCha8Rng) -> bool {
        let reach = |thing: &Thing| thing.pose.translation.truncate().length() + thing.outlines.radius();
        let free = room - group.iter().map(reach).fold(0.0, f64::max);
        if free <= 0.0 {
            return false;
        }
        for _ in 0..MAX_PLACES {
            let (far, turn) = (free * rng.random::<f64>().sqrt(), rng.random_range(0.0..TAU));
            let at = DVec3::new(far * turn.cos(), far * turn.sin(), TABLE_M);
            let motion = Pose::from_yaw(at, rng.random_range(0.0..TAU));
            let moved = |thing: &Thing| Thing { pose: motion * thing.pose, ..thing.clone() };
            let placed: Vec<Thing> = group.iter().map(moved).collect();
            // Above each other they would still hide each other's places, so heights are not told apart.
            let apart = |a: &Thing, b: &Thing| footprint_gap(a, b) >= plan.layout.spaced_gap_m;
            if placed.iter().all(|new| self.things.iter().all(|old| apart(new, old))) {
                let first = self.things.len();
                let renumbered = |thing: Thing| Thing { touches: thing.touches.map(|other| first + other), ..thing };
                self.things.extend(placed.into_iter().map(renumbered));
                return true;
            }
        }
        false
    }
}

/// Gap of two things as if both stood on the table, metres.
fn footprint_gap(a: &Thing, b: &Thing) -> f64 {
    let flat = |thing: &Thing| Pose { translation: thing.pose.translation.with_z(TABLE_M), ..thing.pose };
    a.outlines.gap(&flat(a), &b.outlines, &flat(b))
}

fn thing(
    plan: &Plan,
    kind: RowKind,
    table: [u8; 3],
    workshop: &mut Workshop,
    rng: &mut ChaCha8Rng,
) -> anyhow::Result<Thing> {
    let material = material(plan, table, rng);
    match kind {
        RowKind::Exact => workshop.of_template(false, material, rng),
        RowKind::Perturbed => workshop.of_template(true, material, rng),
        RowKind::Foreign => workshop.foreign(rng),
        RowKind::SmallCubes => {
            let plan = &plan.small_cubes;
            let edge_m = plan.edges_m[rng.random_range(0..plan.edges_m.len())];
            workshop.of_one_length(&plan.template, edge_m, material)
        }
    }
}

/// Two things that touch, about their common middle; `None` where the one does not carry the other.
fn pair_of(plan: &Plan, first: Thing, second: Thing, rng: &mut ChaCha8Rng) -> Option<Vec<Thing>> {
    if rng.random_bool(plan.layout.stacked_share) {
        return stack(first, second, rng);
    }
    let flush = rng.random_bool(plan.layout.flush_share);
    let quarter = FRAC_PI_2 * f64::from(rng.random_range(0..4));
    let (any_yaw, any_way) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
    let (yaw, way) = if flush { (quarter, FRAC_PI_2 * f64::from(rng.random_range(0..4))) } else { (any_yaw, any_way) };
    let [least, most] = plan.layout.touching_gap_m;
    let wanted_m = rng.random_range(least..=most);
    let direction = DVec2::from_angle(way);
    // Face to face things may still stand beside each other's middles.
    let aside = direction.perp() * rng.random_range(-0.3..=0.3) * first.outlines.radius();
    let at = |far: f64| Pose::from_yaw((direction * far + aside).extend(0.0), yaw);
    let gap = |far: f64| first.outlines.gap(&Pose::IDENTITY, &second.outlines, &at(far));
    let (mut near, mut far) = (0.0, first.outlines.radius() + second.outlines.radius() + aside.length() + 0.01);
    for _ in 0..40 {
        let middle = 0.5 * (near + far);
        if gap(middle) > wanted_m { far = middle } else { near = middle }
    }
    if !(least * 0.5..=most).contains(&gap(far)) {
        return None;
    }
    let half = Pose::from_translation((-0.5 * (direction * far + aside)).extend(0.0));
    Some(vec![
        Thing { pose: half, touches: Some(1), ..first },
        Thing { pose: half * at(far), touches: Some(0), ..second },
    ])
}

/// One on the other, the larger footprint below.
fn stack(first: Thing, second: Thing, rng: &mut ChaCha8Rng) -> Option<Vec<Thing>> {
    let base = |thing: &Thing| thing.extents().truncate().element_product();
    let (below, above) = if base(&first) >= base(&second) { (first, second) } else { (second, first) };
    let (_, high) = below.outlines.bounds();
    for _ in 0..MAX_PLACES {
        let half = 0.5 * below.extents();
        let at = DVec3::new(rng.random_range(-1.0..=1.0) * half.x, rng.random_range(-1.0..=1.0) * half.y, high.z);
        let pose = Pose::from_yaw(at, rng.random_range(0.0..TAU));
        if below.outlines.carries(&Pose::IDENTITY, &above.outlines, &pose) {
            return Some(vec![Thing { touches: Some(1), ..below }, Thing { pose, touches: Some(0), ..above }]);
        }
    }
    None
}

fn material(plan: &Plan, table: [u8; 3], rng: &mut ChaCha8Rng) -> Material {
    let look = &plan.look;
    let table = Lab::from_srgb(table);
    let mut color = || loop {
        let color: [u8; 3] = [(); 3].map(|()| rng.random());
        if Lab::from_srgb(color).distance(&table) >= look.off_table {
            return color;
        }
    };
    let (plain, other) = (color(), color());
    let patterned = rng.random_bool(look.patterned_share);
    let kind = [PatternKind::Checker, PatternKind::Stripes, PatternKind::Speckle][rng.random_range(0..3)];
    let cell_m = rng.random_range(look.pattern_cell_m[0]..=look.pattern_cell_m[1]);
    Material { color: plain, pattern: patterned.then_some(Pattern { kind, color: other, cell_m }) }
}

fn lights(rng: &mut ChaCha8Rng) -> Lighting {
    let usual = Lighting::default();
    let direction = DVec3::new(rng.random_range(-0.7..=0.7), rng.random_range(-0.7..=0.7), -1.0);
    Lighting { sun: Sun { direction, ..usual.sun }, ..usual }
}

fn camera(plan: &Plan, small: bool, distance: f64, rng: &mut ChaCha8Rng) -> CameraModel {
    let [low, high] = plan.camera.elevation_deg;
    let (elevation, around) = (rng.random_range(low..=high).to_radians(), rng.random_range(0.0..TAU));
    let (width, height) = match small {
        true => (plan.small_cubes.width, plan.small_cubes.height),
        false => (plan.camera.width, plan.camera.height),
    };
    let forward = -DVec3::new(elevation.cos() * around.cos(), elevation.cos() * around.sin(), elevation.sin());
    let right = forward.cross(DVec3::Z).normalize();
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward)).normalize();
    CameraModel {
        name: CAMERA.into(),
        intrinsics: Intrinsics::from_vertical_fov(width, height, plan.camera.fov_y_deg.to_radians()),
        pose: Pose::new(DVec3::Z * (TABLE_M + AIM_M) - forward * distance, rotation),
        mount: Mount::World,
        depth_min_m: 0.1,
        depth_max_m: 6.0,
    }
}
