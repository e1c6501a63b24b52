//! One episode of a scenario, and the handles through which an agent lives in it.

use crate::{
    audit::AuditReport,
    body::Body,
    model::info,
    oracle::OracleVerdict,
    report::{Preview, SimError, SimOptions, SimTimings},
    scenario::{Scenario, TaskTemplate},
    scene::{Ids, Stage, fnv, state_hash},
    snapshot::{self, SavedRng, Snapshot, SnapshotError, Whole, WorldState},
    truth::TrueObject,
    world::{World, cpu_s},
};
use acm_concept::{
    camera::{CameraError, CameraModel, CameraSource, FrameHeader, Intrinsics, MAX_PIXELS, RgbdFrame},
    embodiment::{Clock, Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    ids::FrameId,
    plane::Plane,
    task::TaskSpec,
    time::Time,
};
use acm_render::{
    Renderer,
    sensor::{SensorEpisode, SensorProfile},
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rustix::time::ClockId;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A renderer that several simulations share: making one is expensive.
pub type SharedRenderer = Arc<Mutex<Renderer>>;

/// One episode. The handles share one world and can go to other threads.
///
/// ```
/// # use acm_sim::{Scenario, SimOptions, Simulation};
/// let scenario = Scenario::open("put-back-block")?;
/// let simulation = Simulation::without_renderer(&scenario, &SimOptions::default())?;
/// let mut robot = simulation.embodiment();
/// let here = robot.feedback();
/// let command = acm_concept::embodiment::Command::hand(here.tcp, 0.08, 20.0);
/// assert!((robot.command(&command)?.time.seconds() - 0.02).abs() < 1e-9);
/// assert!(!simulation.verdict().strict);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Simulation {
    shared: Arc<Mutex<World>>,
    task: TaskTemplate,
    cameras: Vec<Camera>,
    stage: Arc<Stage>,
    renderer: Option<SharedRenderer>,
    /// Of the camera source that was handed out last.
    eyes: Mutex<Arc<Mutex<Eyes>>>,
    seed: u64,
}

#[derive(Debug, Clone)]
struct Camera {
    nominal: CameraModel,
    sensor: SensorEpisode,
}

impl Simulation {
    /// Builds the world of a seed and lets it settle.
    ///
    /// # Errors
    /// A seed without a valid layout, an object that is not at rest, an unknown sensor profile, an image size that
    /// is not possible.
    pub fn new(scenario: &Scenario, options: &SimOptions, renderer: SharedRenderer) -> Result<Simulation, SimError> {
        let simulation = Simulation::without_renderer(scenario, options)?;
        Ok(Simulation { renderer: Some(renderer), ..simulation })
    }

    /// As [`Simulation::new`], for work that takes no pictures: its cameras fail.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn without_renderer(scenario: &Scenario, options: &SimOptions) -> Result<Simulation, SimError> {
        let world = World::new(scenario, options)?;
        let cameras = cameras(scenario, options)?;
        let stage = Stage::new(&world)?;
        Ok(Simulation {
            shared: Arc::new(Mutex::new(world)),
            task: scenario.task.clone(),
            eyes: Mutex::new(Arc::new(Mutex::new(Eyes::new(options.seed, cameras.len())))),
            cameras,
            stage: Arc::new(stage),
            renderer: None,
            seed: options.seed,
        })
    }

    /// The task as the agent gets it.
    pub fn task(&self) -> TaskSpec {
        TaskSpec {
            instruction: self.task.instruction.clone(),
            instruction_at_s: self.task.instruction_at_s,
            budgets: self.task.budgets,
            then: self.task.then.clone(),
            cameras: self.cameras.iter().map(|camera| camera.nominal.clone()).collect(),
        }
    }

    /// The robot.
    pub fn embodiment(&self) -> Box<dyn Embodiment> {
        let robot = self.world().robot.description.clone();
        Box::new(Robot { shared: self.shared.clone(), robot })
    }

    /// The cameras. Frames are numbered from 0 by each source.
    pub fn camera(&self) -> Box<dyn CameraSource> {
        let eyes = Arc::new(Mutex::new(Eyes::new(self.seed, self.cameras.len())));
        *lock(&self.eyes) = eyes.clone();
        Box::new(Cameras {
            shared: self.shared.clone(),
            models: self.cameras.iter().map(|camera| camera.nominal.clone()).collect(),
            cameras: self.cameras.clone(),
            stage: self.stage.clone(),
            renderer: self.renderer.clone(),
            eyes,
        })
    }

    /// The clock.
    pub fn clock(&self) -> Box<dyn Clock> {
        Box::new(WorldClock { shared: self.shared.clone() })
    }

    /// Lets a robot that was stopped be commanded again, as a person does who has looked why.
    pub fn resume(&self) {
        self.world().resume();
    }

    /// How the episode stands. Reading it does not change the world.
    pub fn verdict(&self) -> OracleVerdict {
        self.world().verdict()
    }

    /// Equal for equal start worlds: where which solids are, to 0.1 mm and 0.01 rad, whatever their names.
    pub fn world_digest(&self) -> String {
        let world = self.world();
        // Whole numbers: a rounded float could still be a negative zero.
        let rounded = |v: glam::DVec3| (v * 1e4).round().as_i64vec3();
        let line = |body: &Body| {
            let yaw = (body.start.yaw() * 1e2).round() as i64;
            let color = body.placed.color();
            let joints: Vec<i64> =
                body.joints.iter().map(|(_, joint)| (joint.joint.start * 1e3).round() as i64).collect();
            let (at, size) = (rounded(body.start.translation), rounded(body.placed.size()));
            // Things may differ in a mark alone.
            let pieces = body.placed.links.iter().flat_map(|link| &link.pieces).map(|piece| {
                let (low, high) = piece.bounds(&acm_concept::pose::Pose::IDENTITY);
                format!("{} {} {:?}", rounded(low), rounded(high), piece.color)
            });
            let pieces: Vec<String> = pieces.collect();
            format!("{at} {yaw} {size} {color:?} {joints:?} {pieces:?}")
        };
        let mut lines: Vec<String> = world.bodies.iter().map(line).collect();
        lines.sort();
        format!("{:016x}", fnv(lines.join("\n").bytes()))
    }

    /// The objects as they truly are now. For analysing failures; never for the agent.
    pub fn truth(&self) -> Vec<TrueObject> {
        self.world().truth()
    }

    /// Tells the truth at any moment of an episode, to whoever follows one. For judging; never for the agent.
    pub fn witness(&self) -> impl Fn() -> Vec<TrueObject> + Send + Sync + 'static {
        let shared = self.shared.clone();
        move || lock(&shared).truth()
    }

    /// What each object is made of, for people: its name, and lines about its links and joints.
    pub fn inventory(&self) -> Vec<(String, Vec<String>)> {
        let world = self.world();
        let of = |body: &Body| {
            let lines = info::lines(&body.placed.model, &body.placed.links, &body.joints);
            (body.placed.name.clone(), lines)
        };
        world.bodies.iter().map(of).collect()
    }

    /// The judge's variables as they are now, by name. For analysing failures; never for the agent.
    pub fn variables(&self) -> Vec<(String, f64)> {
        let world = self.world();
        world.variables.iter().cloned().zip(world.state.iter().copied()).collect()
    }

    /// Processor time taken so far.
    pub fn timings(&self) -> SimTimings {
        self.world().timings
    }

    /// What happened without a cause so far; see [`AuditReport`].
    pub fn audit(&self) -> AuditReport {
        self.world().audit().clone()
    }

    /// The whole simulation at this moment, the camera source that was handed out last included.
    ///
    /// # Errors
    /// The engine's state cannot be written down.
    pub fn snapshot(&self) -> Result<Snapshot, SnapshotError> {
        let world_digest = self.world_digest();
        let world = WorldState::of(&self.world())?;
        let eyes = lock(&self.eyes).clone();
        let eyes = lock(&eyes).save();
        Snapshot::pack(&Whole { world_digest, world, eyes })
    }

    /// Puts the simulation where one of the same scenario, seed and options was when the snapshot was made. The handles
    /// that were given out stay good. On an error nothing has changed.
    ///
    /// # Errors
    /// The snapshot is damaged, or of another world.
    pub fn restore(&self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        let whole = snapshot.unpack()?;
        if whole.world_digest != self.world_digest() || !whole.world.fits(&self.world()) {
            return Err(SnapshotError::OtherWorld);
        }
        whole.world.put_into(&mut self.world());
        let eyes = lock(&self.eyes).clone();
        *lock(&eyes) = Eyes::restore(whole.eyes);
        Ok(())
    }

    /// Equal for worlds whose bodies have bit-identical poses.
    pub fn state_hash(&self) -> u64 {
        state_hash(&self.world())
    }

    /// The world as a camera sees it now, without sensor errors; `None` is the main camera.
    ///
    /// # Errors
    /// No renderer, no such camera, or the renderer fails.
    pub fn preview(&self, camera: Option<&str>) -> Result<Preview, SimError> {
        let renderer = self.renderer.as_ref().ok_or(SimError::NoRenderer)?;
        let world = self.world();
        let mut cameras = self.cameras.iter().enumerate();
        let found = cameras.find(|(_, c)| camera.is_none_or(|name| c.nominal.name == name));
        let (at, camera) = found.ok_or_else(|| SimError::NoCamera { name: camera.unwrap_or_default().into() })?;
        let mut renderer = lock(renderer);
        let mut rendered = renderer.render(&self.stage.scene(&world), &world.placed(&camera.nominal))?;
        expose(&mut rendered.color, world.exposures.get(at).copied().unwrap_or(1.0));
        let color = image::RgbImage::from_raw(rendered.width, rendered.height, rendered.color).unwrap_or_default();
        Ok(Preview { color, ids: rendered.ids, legend: Ids::of(&world).legend(&world) })
    }

    fn world(&self) -> MutexGuard<'_, World> {
        lock(&self.shared)
    }
}

/// Streams of the episode's seed: 1 and 2 belong to layout and mishap.
const STREAM_BIAS: u64 = 3;
const STREAM_NOISE: u64 = 4;

/// A panic elsewhere leaves the world between two steps, which is a valid state.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn cameras(scenario: &Scenario, options: &SimOptions) -> Result<Vec<Camera>, SimError> {
    let mut bias = ChaCha8Rng::seed_from_u64(options.seed);
    bias.set_stream(STREAM_BIAS);
    let camera = |spec: &crate::scenario::CameraSpec| {
        let profile = SensorProfile::named(options.sensor.as_deref().unwrap_or(&spec.sensor))?;
        let mut nominal = spec.model.clone();
        if let Some((width, height)) = options.camera_size {
            let pixels = width as usize * height as usize;
            if width.min(height) < 16 || pixels > MAX_PIXELS {
                return Err(SimError::CameraSize { width, height });
            }
            let old = nominal.intrinsics;
            let fov_y = 2.0 * (0.5 * f64::from(old.height) / old.fy).atan();
            nominal.intrinsics = Intrinsics::from_vertical_fov(width, height, fov_y);
        }
        Ok(Camera { nominal, sensor: profile.episode(&mut bias) })
    };
    scenario.world.cameras.iter().map(camera).collect()
}

struct Robot {
    shared: Arc<Mutex<World>>,
    robot: RobotDescription,
}

impl Embodiment for Robot {
    fn description(&self) -> &RobotDescription {
        &self.robot
    }
    fn feedback(&self) -> Feedback {
        lock(&self.shared).feedback()
    }
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        lock(&self.shared).command(command)
    }
    fn stop(&mut self) {
        lock(&self.shared).stop();
    }
}

struct WorldClock {
    shared: Arc<Mutex<World>>,
}

impl Clock for WorldClock {
    fn now(&self) -> Time {
        lock(&self.shared).now()
    }
    fn wait_until(&mut self, moment: Time) -> Result<Time, EmbodimentError> {
        lock(&self.shared).wait_until(moment)
    }
}

struct Cameras {
    shared: Arc<Mutex<World>>,
    /// The nominal models, as the trait hands them out.
    models: Vec<CameraModel>,
    cameras: Vec<Camera>,
    stage: Arc<Stage>,
    renderer: Option<SharedRenderer>,
    eyes: Arc<Mutex<Eyes>>,
}

/// What a camera source changes from frame to frame.
struct Eyes {
    noise: ChaCha8Rng,
    /// What each camera showed last.
    shown: Vec<Option<Picture>>,
    /// Number of the next frame.
    next: u64,
}

impl Eyes {
    fn new(seed: u64, cameras: usize) -> Eyes {
        let mut noise = ChaCha8Rng::seed_from_u64(seed);
        noise.set_stream(STREAM_NOISE);
        Eyes { noise, shown: vec![None; cameras], next: 0 }
    }
    fn save(&self) -> snapshot::Eyes {
        let planes = |picture: &Picture| (picture.color.to_vec(), picture.depth.to_vec());
        let shown = self.shown.iter().map(|shown| shown.as_ref().map(planes)).collect();
        snapshot::Eyes { noise: SavedRng::of(&self.noise), next: self.next, shown }
    }
    fn restore(saved: snapshot::Eyes) -> Eyes {
        let picture = |(color, depth): (Vec<u8>, Vec<f32>)| Picture { color: color.into(), depth: depth.into() };
        let shown = saved.shown.into_iter().map(|shown| shown.map(picture)).collect();
        Eyes { noise: saved.noise.rng(), shown, next: saved.next }
    }
}

/// Colour and depth of a frame.
#[derive(Clone)]
struct Picture {
    color: Plane<u8>,
    depth: Plane<f32>,
}

impl CameraSource for Cameras {
    fn cameras(&self) -> &[CameraModel] {
        &self.models
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        let failed = |reason: String| CameraError::Failed { name: camera.into(), reason };
        let Some(at) = self.cameras.iter().position(|known| known.nominal.name == camera) else {
            let known = self.models.iter().map(|model| model.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(CameraError::UnknownCamera { name: camera.into(), known });
        };
        let found = &self.cameras[at];
        let renderer = self.renderer.as_ref().ok_or_else(|| failed("the simulation has no renderer".into()))?;
        let (mut world, mut eyes) = (lock(&self.shared), lock(&self.eyes));
        let pixels = found.nominal.intrinsics.pixels();
        let stuck = if world.is_frozen(at) { eyes.shown.get(at).cloned().flatten() } else { None };
        let picture = if let Some(stuck) = stuck {
            stuck
        } else if world.is_covered(at) {
            Picture { color: vec![0; 3 * pixels].into(), depth: vec![0.0; pixels].into() }
        } else {
            let started = cpu_s(ClockId::ProcessCPUTime);
            let scene = self.stage.scene(&world);
            let truth = world.placed(&found.sensor.true_camera(&found.nominal));
            let mut rendered = lock(renderer).render(&scene, &truth).map_err(|e| failed(e.to_string()))?;
            world.timings.render_s += cpu_s(ClockId::ProcessCPUTime) - started;
            let started = cpu_s(ClockId::ThreadCPUTime);
            expose(&mut rendered.color, world.exposures.get(at).copied().unwrap_or(1.0));
            let measured = found.sensor.measure(&rendered, &truth, &mut eyes.noise);
            world.timings.noise_s += cpu_s(ClockId::ThreadCPUTime) - started;
            Picture { color: measured.color.into(), depth: measured.depth.into() }
        };
        let header = FrameHeader {
            id: FrameId(eyes.next),
            camera: camera.into(),
            time: world.now(),
            intrinsics: found.nominal.intrinsics,
            camera_pose: world.placed(&found.nominal).pose,
        };
        eyes.next += 1;
        if let Some(shown) = eyes.shown.get_mut(at) {
            *shown = Some(picture.clone());
        }
        RgbdFrame::new(header, picture.color, picture.depth).map_err(|e| failed(e.to_string()))
    }
}

/// Brightens or darkens 8-bit sRGB colours as a longer or shorter exposure would.
fn expose(color: &mut [u8], exposure: f64) {
    if exposure == 1.0 {
        return;
    }
    // sRGB is near enough to a power of 2.2 of the light.
    let gain = exposure.powf(1.0 / 2.2);
    let table: [u8; 256] = std::array::from_fn(|value| (value as f64 * gain).round().min(255.0) as u8);
    for value in color {
        *value = table[usize::from(*value)];
    }
}

#[cfg(test)]
mod tests;
