//! One thing of the shared data in two states of one of its joints, as a camera sees it, with what is true of it.

use super::Family;
use acm_concept::{
    camera::{CameraModel, FrameHeader, Intrinsics, Mount, RgbdFrame},
    ids::FrameId,
    pose::Pose,
    time::Time,
};
use acm_render::{Instance, Lighting, Material, Mesh, Rendered, Renderer, Scene, Sun, sensor::SensorProfile};
use acm_sim::{Mechanism, MechanismJoint, Surface};
use anyhow::Context;
use glam::{DMat3, DQuat, DVec3};
use rand::{Rng, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use std::{f64::consts::PI, sync::Arc};

/// The two states are at least so far apart, radians or metres; a joint that cannot do that is not asked for.
const APART: [f64; 2] = [15.0 * PI / 180.0, 0.04];
/// The axis is not asked of a part that shows fewer pixels in the state that shows more of it.
pub const LEAST_PIXELS: usize = 200;
/// How far the camera stands from what it looks at, metres, and its angles from the thing's front.
const DISTANCE_M: [f64; 2] = [0.8, 1.5];
const AROUND_DEG: f64 = 40.0;
const ELEVATION_DEG: [f64; 2] = [5.0, 35.0];
const FOV_Y_DEG: f64 = 50.0;
const SIZE_PX: [u32; 2] = [640, 480];
/// The image is so many times as high as the thing, where the distance allows it.
const MARGIN: f64 = 1.15;
/// The wall stands so far behind the thing, the floor lies so far below it, metres.
const WALL_M: f64 = 0.02;
const FLOOR_M: f64 = 0.01;
/// Ids of the surroundings; links come after them.
const FLOOR: u32 = 1;
const WALL: u32 = 2;
const FIRST: u32 = 3;
/// Noise has a stream of its own, so that it never shifts what is drawn.
const STREAM_SENSOR: u64 = 1;
/// Time between the two frames, seconds.
const BETWEEN_S: f64 = 1.0;

/// A thing whose part was moved between two frames.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The two frames, with the nominal calibration.
    pub frames: [RgbdFrame; 2],
    /// Which pixels of each truly show the moved part.
    pub part: [Vec<bool>; 2],
    /// Whether one of the two shows enough of it to tell its axis.
    pub shows: bool,
    /// The joint as it truly is, in the world.
    pub truth: Truth,
}

/// A joint as it truly is.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Its link's name.
    pub name: String,
    /// Whether it turns; else it slides.
    pub is_hinge: bool,
    /// A point of its axis in the world, metres.
    pub origin: DVec3,
    /// Its direction.
    pub axis: DVec3,
    /// How far it was moved, radians or metres.
    pub moved: f64,
    /// Where the camera's errors of calibration put point and direction: what a perfect reading of its frames gives.
    pub seen: (DVec3, DVec3),
}

/// What came of drawing a trial.
#[derive(Debug)]
pub enum Drawn {
    /// One to be judged, and how many joints were drawn before it that nobody can move: their part is shut in.
    Trial(Box<Trial>, usize),
    /// All of so many joints have a part that is shut in.
    ShutIn(usize),
}

/// Draws the trial of a seed: the first joint, in random order, whose part is not shut in.
///
/// # Errors
/// The renderer fails.
pub fn draw(renderer: &mut Renderer, family: &Family, thing: &Mechanism, seed: u64) -> anyhow::Result<Drawn> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut joints: Vec<(MechanismJoint, [f64; 2])> =
        thing.joints().into_iter().filter_map(|joint| Some((reach(&joint)?, joint))).map(|(r, j)| (j, r)).collect();
    joints.shuffle(&mut rng);
    let count = joints.len();
    for (shut_in, (joint, range)) in joints.into_iter().enumerate() {
        let least = APART[usize::from(!joint.is_hinge)];
        let states = loop {
            let states = [(); 2].map(|()| rng.random_range(range[0]..=range[1]));
            if (states[0] - states[1]).abs() >= least {
                break states;
            }
        };
        if let Some(trial) = look(renderer, family, thing, &joint, states, &mut rng, seed)? {
            return Ok(Drawn::Trial(Box::new(trial), shut_in));
        }
    }
    Ok(Drawn::ShutIn(count))
}

/// The positions that a joint can take, if two of them are far enough apart.
fn reach(joint: &MechanismJoint) -> Option<[f64; 2]> {
    let [low, high] = joint.range.unwrap_or([-PI, PI]);
    (high - low > 1.05 * APART[usize::from(!joint.is_hinge)]).then_some([low, high])
}

fn look(
    renderer: &mut Renderer,
    family: &Family,
    thing: &Mechanism,
    joint: &MechanismJoint,
    states: [f64; 2],
    rng: &mut ChaCha8Rng,
    seed: u64,
) -> anyhow::Result<Option<Trial>> {
    let stages = states.map(|at| thing.surfaces(joint.link, at));
    let moves = |link: usize| thing.moves(joint.link, link);
    let whole = bounds(stages.iter().flatten().map(|(_, surface)| surface));
    let (part_low, part_high) =
        bounds(stages.iter().flatten().filter(|(link, _)| moves(*link)).map(|(_, surface)| surface));
    let camera = camera(family, whole, (part_low, part_high), rng);
    let color = |rng: &mut ChaCha8Rng| [(); 3].map(|()| rng.random_range(60..=220u8));
    let surroundings = surroundings(family, whole, [color(rng), color(rng)]);
    let sun = DVec3::new(rng.random_range(-0.7..=0.7), rng.random_range(-0.7..=0.7), -1.0);
    let usual = Lighting::default();
    let lights = Lighting { sun: Sun { direction: sun, ..usual.sun }, ..usual };
    let mut noise = ChaCha8Rng::seed_from_u64(seed);
    noise.set_stream(STREAM_SENSOR);
    let sensor = SensorProfile::named("d435")?.episode(&mut noise);
    let eye = sensor.true_camera(&camera);
    let mut render = |stage: &[(usize, Surface)]| -> anyhow::Result<Rendered> {
        let instances = stage.iter().map(|(link, surface)| instance(surface, FIRST + *link as u32));
        let instances = instances.chain(surroundings.iter().cloned()).collect();
        let scene = Scene { instances, lights: lights.clone(), background: [200, 200, 205] };
        Ok(renderer.render(&scene, &eye)?)
    };
    let [first, second] = &stages;
    let shut = render(&thing.surfaces(joint.link, joint.rest))?;
    let rendered = [render(first)?, render(second)?];
    let shown = |rendered: &Rendered| -> Vec<bool> {
        rendered.ids.iter().map(|id| *id >= FIRST && moves((*id - FIRST) as usize)).collect()
    };
    let part = [shown(&rendered[0]), shown(&rendered[1])];
    let few = |pixels: &[bool]| pixels.iter().filter(|shown| **shown).count() < LEAST_PIXELS;
    let shows = !part.iter().all(|pixels| few(pixels));
    // What shows, but not when all is shut, is inside, and comes out through closed doors.
    if few(&shown(&shut)) && shows {
        return Ok(None);
    }
    let mut frame = |number: usize| -> anyhow::Result<RgbdFrame> {
        let measured = sensor.measure(&rendered[number], &camera, &mut noise);
        let header = FrameHeader {
            id: FrameId(number as u64),
            camera: camera.name.clone(),
            time: Time::from_seconds(BETWEEN_S * number as f64),
            intrinsics: camera.intrinsics,
            camera_pose: camera.pose,
        };
        RgbdFrame::new(header, measured.color.into(), measured.depth.into()).context("the renderer's frame")
    };
    let frames = [frame(0)?, frame(1)?];
    let (origin, axis) = thing.axis(joint.link).context("the joint has no axis")?;
    let moved = states[1] - states[0];
    // The axis beside the part: farther off a small error of direction is a large one of place.
    let origin = origin + axis * (0.5 * (part_low + part_high) - origin).dot(axis);
    let seen = |at: DVec3| {
        camera.pose.transform_point(eye.pose.inverse().transform_point(at) * sensor.depth_scale(&camera.name))
    };
    let seen = (seen(origin), (seen(origin + axis) - seen(origin)).normalize());
    let truth = Truth { name: joint.name.clone(), is_hinge: joint.is_hinge, origin, axis, moved, seen };
    Ok(Some(Trial { frames, part, shows, truth }))
}

/// A camera before the thing's front that looks at a place between its middle and that of its part.
fn camera(
    family: &Family,
    (low, high): (DVec3, DVec3),
    (part_low, part_high): (DVec3, DVec3),
    rng: &mut ChaCha8Rng,
) -> CameraModel {
    let aim = (0.5 * (low + high)).lerp(0.5 * (part_low + part_high), rng.random_range(0.0..=1.0));
    let around = family.front_rad + rng.random_range(-AROUND_DEG..=AROUND_DEG).to_radians();
    let elevation = rng.random_range(ELEVATION_DEG[0]..=ELEVATION_DEG[1]).to_radians();
    let fits = 0.5 * MARGIN * (high - low).max_element() / (0.5 * FOV_Y_DEG.to_radians()).tan();
    let distance = (fits * rng.random_range(0.9..=1.2)).clamp(DISTANCE_M[0], DISTANCE_M[1]);
    let forward = -DVec3::new(elevation.cos() * around.cos(), elevation.cos() * around.sin(), elevation.sin());
    let right = forward.cross(DVec3::Z).normalize();
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward)).normalize();
    CameraModel {
        name: "camera".into(),
        intrinsics: Intrinsics::from_vertical_fov(SIZE_PX[0], SIZE_PX[1], FOV_Y_DEG.to_radians()),
        pose: Pose::new(aim - forward * distance, rotation),
        mount: Mount::World,
        depth_min_m: 0.1,
        depth_max_m: 6.0,
    }
}

/// A floor under the thing and a wall behind it.
fn surroundings(family: &Family, (low, high): (DVec3, DVec3), colors: [[u8; 3]; 2]) -> [Instance; 2] {
    let mesh = Arc::new(Mesh::unit_box());
    let front = DVec3::new(family.front_rad.cos(), family.front_rad.sin(), 0.0);
    let across = DVec3::Z.cross(front);
    let middle = 0.5 * (low + high);
    let back = DVec3::select(front.cmplt(DVec3::ZERO), high, low).dot(front);
    let behind = front * (back - WALL_M - 0.01);
    let cuboid = |size: DVec3, at: DVec3, color: [u8; 3], id: u32| Instance {
        mesh: Arc::clone(&mesh),
        pose: Pose::new(at, DQuat::from_mat3(&DMat3::from_cols(front, across, DVec3::Z)).normalize()),
        scale: size,
        material: Material::plain(color),
        id,
    };
    let floor = cuboid(DVec3::new(8.0, 8.0, 0.02), middle.with_z(low.z - FLOOR_M - 0.01), colors[0], FLOOR);
    let at = behind + across * middle.dot(across) + DVec3::Z * middle.z;
    [floor, cuboid(DVec3::new(0.02, 8.0, 8.0), at, colors[1], WALL)]
}

fn instance(surface: &Surface, id: u32) -> Instance {
    Instance {
        mesh: Arc::clone(&surface.mesh),
        pose: surface.pose,
        scale: surface.scale,
        material: Material::plain(surface.color),
        id,
    }
}

/// The corners of the box round some surfaces.
fn bounds<'a>(surfaces: impl Iterator<Item = &'a Surface>) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    surfaces.fold(start, |all, surface| {
        let place = |point: &glam::Vec3| surface.pose.transform_point(point.as_dvec3() * surface.scale);
        surface.mesh.positions().iter().map(place).fold(all, |(low, high), at| (low.min(at), high.max(at)))
    })
}
