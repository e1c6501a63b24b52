//! The running world: physics, robot, mechanisms, what third parties do, and the judge who watches.

use crate::{
    body::{Body, true_objects},
    contact::Contacts,
    event::{self, Event},
    layout::{Layout, LayoutError, Placed},
    oracle::{Judge, OracleVerdict},
    profile::PhysicsProfile,
    report::{SimError, SimOptions, SimTimings, TrueObject},
    robot::{Robot, TICK_S},
    scenario::{JudgeSpec, Scenario, SurfaceSpec, WorldSpec},
    slip::Slip,
    state,
};
use acm_concept::{
    embodiment::{Command, EmbodimentError, Feedback},
    pose::Pose,
    time::Time,
};
use rapier3d::prelude::{ColliderBuilder, ColliderHandle, PhysicsWorld, RigidBodyBuilder, Vector};
use rustix::time::ClockId;

/// How long the world settles before the episode begins, seconds.
const SETTLE_S: f64 = 0.5;
/// An object that turns or shifts more than this while settling was not placed at rest: degrees, metres.
const SETTLED: (f64, f64) = (3.0, 0.01);

/// Everything that is simulated. The episode's handles share one.
pub(crate) struct World {
    pub(crate) physics: PhysicsWorld,
    pub(crate) profile: PhysicsProfile,
    pub(crate) robot: Robot,
    pub(crate) bodies: Vec<Body>,
    pub(crate) surfaces: Vec<(ColliderHandle, SurfaceSpec)>,
    pub(crate) contacts: Contacts,
    pub(crate) timings: SimTimings,
    events: Vec<Event>,
    slip: Option<Slip>,
    judge: Judge,
    pub(crate) state: Vec<f64>,
    pub(crate) constants: Vec<f64>,
    pub(crate) bystanders: Vec<usize>,
    steps: u64,
    motion: bool,
    stopped: bool,
}

impl World {
    /// Builds the world of a seed and lets it settle.
    pub(crate) fn new(scenario: &Scenario, options: &SimOptions) -> Result<World, SimError> {
        let layout = Layout::draw(&scenario.world, options.seed).map_err(|source| SimError::Layout {
            scenario: scenario.name.clone(),
            seed: options.seed,
            source: source.into(),
        })?;
        let mut world = World::build(scenario, options, &layout)?;
        world.settle(options.seed)?;
        Ok(world)
    }

    fn build(scenario: &Scenario, options: &SimOptions, layout: &Layout) -> Result<World, SimError> {
        let spec = &scenario.world;
        let profile = PhysicsProfile::DEFAULT;
        let mut physics = PhysicsWorld::new();
        physics.gravity = Vector::new(0.0, 0.0, -9.81);
        physics.integration_parameters = profile.parameters();
        let surfaces =
            spec.surfaces.iter().map(|surface| (insert_surface(&mut physics, surface), surface.clone())).collect();
        let insert =
            |object: &Placed| Body::insert(&mut physics, object.clone(), spec.objects[object.spec].count.is_some());
        let bodies: Vec<Body> = layout.objects.iter().map(insert).collect();
        let camera = spec.cameras.first().map(|camera| camera.model.clone());
        let robot = Robot::build(&mut physics, &spec.robot);
        let variables = state::names(scenario);
        let layout_error = |source: LayoutError| SimError::Layout {
            scenario: scenario.name.clone(),
            seed: options.seed,
            source: source.into(),
        };
        let events = event::build(spec, layout, &variables).map_err(layout_error)?;
        Ok(World {
            bystanders: bystanders(spec, &scenario.judge, &bodies),
            judge: Judge::new(&scenario.judge, &variables),
            constants: state::constants(spec, layout),
            state: vec![0.0; variables.len()],
            slip: options.slip_at.map(|carry| Slip::new(carry, options.seed, camera)),
            contacts: Contacts::default(),
            timings: SimTimings::default(),
            motion: options.motion,
            stopped: false,
            steps: 0,
            events,
            surfaces,
            bodies,
            robot,
            profile,
            physics,
        })
    }

    /// Lets objects come to rest before the first frame. An object that tips over was placed wrongly.
    fn settle(&mut self, seed: u64) -> Result<(), SimError> {
        let start: Vec<Pose> = self.bodies.iter().map(|body| body.pose(&self.physics)).collect();
        for _ in 0..(SETTLE_S / self.profile.step_s()).round() as u32 {
            self.robot.drive(&mut self.physics, 1.0);
            self.physics.step();
        }
        for (body, start) in self.bodies.iter_mut().zip(start) {
            let pose = body.pose(&self.physics);
            let (turn, shift) = (pose.angle_to(&start).to_degrees(), pose.translation.distance(start.translation));
            if turn > SETTLED.0 || shift > SETTLED.1 {
                let name = body.placed.name.clone();
                return Err(SimError::Unstable { object: name, seed, turn_deg: turn, shift_m: shift });
            }
            body.start = pose;
        }
        self.contacts.read(&self.physics, &self.robot);
        self.refresh_state();
        Ok(())
    }

    /// Seconds since the episode began.
    pub(crate) fn seconds(&self) -> f64 {
        self.steps as f64 * self.profile.step_s()
    }
    pub(crate) fn now(&self) -> Time {
        Time(self.steps * 1_000_000_000 / u64::from(self.profile.steps_per_second))
    }

    /// One control tick towards a command.
    pub(crate) fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        if !self.motion {
            return Err(EmbodimentError::MotionDisabled);
        }
        if self.stopped {
            return Err(EmbodimentError::Stopped);
        }
        self.robot.aim(command).map_err(|reason| EmbodimentError::Refused { reason })?;
        self.tick().map_or_else(|| Ok(self.feedback()), |reason| Err(EmbodimentError::ProtectiveStop { reason }))
    }

    /// Advances by one control tick while the robot moves evenly to its aim. Says why it stopped on the way.
    fn tick(&mut self) -> Option<String> {
        let started = cpu_s(ClockId::ThreadCPUTime);
        let steps = (TICK_S * f64::from(self.profile.steps_per_second)).round() as u32;
        self.robot.begin();
        for step in 1..=steps {
            self.step(f64::from(step) / f64::from(steps));
        }
        self.timings.physics_s += cpu_s(ClockId::ThreadCPUTime) - started;
        self.robot.end()
    }

    /// One physics step; `fraction` is the share of the control tick that is behind after it.
    fn step(&mut self, fraction: f64) {
        let now_s = self.seconds();
        for event in &mut self.events {
            event.step(&mut self.physics, &mut self.bodies, &self.state, now_s);
        }
        self.robot.drive(&mut self.physics, fraction);
        self.physics.step();
        self.steps += 1;
        for body in &mut self.bodies {
            body.count_presses(&self.physics);
        }
        self.contacts.read(&self.physics, &self.robot);
        self.robot.feel(&self.physics, &self.contacts);
        // Taken out and put back, because what happens in a slip looks at the whole world.
        if let Some(mut slip) = self.slip.take() {
            slip.step(self);
            self.slip = Some(slip);
        }
        self.refresh_state();
        self.judge.step(&self.state, self.seconds(), self.profile.step_s());
    }

    fn refresh_state(&mut self) {
        let mut values = std::mem::take(&mut self.state);
        state::fill(self, &mut values);
        self.state = values;
    }

    /// Whether someone stands before a camera.
    pub(crate) fn is_covered(&self, camera: usize) -> bool {
        self.events.iter().any(|event| event.covers(camera))
    }

    /// What the robot measures.
    pub(crate) fn feedback(&self) -> Feedback {
        self.robot.feedback(&self.physics, self.now())
    }

    /// Stops all motion; the robot stays where it is.
    pub(crate) fn stop(&mut self) {
        self.stopped = true;
        self.robot.stop(&self.physics);
    }

    /// Takes a stop back.
    pub(crate) fn resume(&mut self) {
        self.stopped = false;
    }

    /// Lets the world go on with the robot holding still.
    pub(crate) fn wait_until(&mut self, moment: Time) -> Result<Time, EmbodimentError> {
        if moment.seconds_since(self.now()) > MAX_WAIT_S {
            let reason = format!("a wait until {moment} is longer than {MAX_WAIT_S} s");
            return Err(EmbodimentError::Refused { reason });
        }
        while self.now() < moment {
            if let Some(reason) = self.tick() {
                return Err(EmbodimentError::ProtectiveStop { reason });
            }
        }
        Ok(self.now())
    }

    /// How the episode stands. The judge looks a little further than the present, so that a stage that has to hold
    /// for a while is not missed by an agent that stops at once; the world itself does not advance.
    pub(crate) fn verdict(&mut self) -> OracleVerdict {
        let Ok(ahead) = copy(&self.physics) else { return self.judge.verdict(&self.state) };
        let saved = Saved::take(self, ahead);
        let until = self.seconds() + self.judge.settle_s();
        while self.seconds() < until {
            self.step(1.0);
        }
        let verdict = self.judge.verdict(&self.state);
        saved.restore(self);
        verdict
    }

    pub(crate) fn truth(&self) -> Vec<TrueObject> {
        true_objects(self)
    }
}

/// Longest single wait, seconds.
const MAX_WAIT_S: f64 = 3600.0;

/// What a look ahead changes.
struct Saved {
    physics: PhysicsWorld,
    bodies: Vec<Body>,
    robot: Robot,
    contacts: Contacts,
    judge: Judge,
    events: Vec<Event>,
    slip: Option<Slip>,
    state: Vec<f64>,
    steps: u64,
}

impl Saved {
    /// Puts the present aside; the world goes on with a copy of its physics.
    fn take(world: &mut World, ahead: PhysicsWorld) -> Saved {
        Saved {
            physics: std::mem::replace(&mut world.physics, ahead),
            bodies: world.bodies.clone(),
            robot: world.robot.clone(),
            contacts: world.contacts.clone(),
            judge: world.judge.clone(),
            events: world.events.clone(),
            slip: world.slip.clone(),
            state: world.state.clone(),
            steps: world.steps,
        }
    }
    fn restore(self, world: &mut World) {
        world.physics = self.physics;
        world.bodies = self.bodies;
        world.robot = self.robot;
        world.contacts = self.contacts;
        world.judge = self.judge;
        world.events = self.events;
        world.slip = self.slip;
        world.state = self.state;
        world.steps = self.steps;
    }
}

/// A copy that goes on exactly as the original would. The engine's state has no other way of being copied.
fn copy(physics: &PhysicsWorld) -> Result<PhysicsWorld, bincode::Error> {
    bincode::deserialize(&bincode::serialize(physics)?)
}

fn insert_surface(physics: &mut PhysicsWorld, surface: &SurfaceSpec) -> ColliderHandle {
    let half = (surface.size * 0.5).as_vec3();
    let body = RigidBodyBuilder::fixed().translation(surface.position.as_vec3());
    let collider = ColliderBuilder::cuboid(half.x, half.y, half.z).friction(surface.friction as f32);
    physics.insert(body, collider).1
}

/// Places of the objects that the task is not to move.
fn bystanders(spec: &WorldSpec, judge: &JudgeSpec, bodies: &[Body]) -> Vec<usize> {
    let is_bystander = |body: &Body| !judge.moves.contains(&spec.objects[body.placed.spec].name);
    bodies.iter().enumerate().filter(|(_, body)| is_bystander(body)).map(|(index, _)| index).collect()
}

/// Processor time in seconds.
pub(crate) fn cpu_s(clock: ClockId) -> f64 {
    let time = rustix::time::clock_gettime(clock);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

#[cfg(test)]
mod tests;
