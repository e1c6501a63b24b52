//! The running world: physics, hand, mechanisms, what third parties do, and the judge who watches.

use crate::{
    audit::{self, Audit, AuditReport},
    body::{Body, true_objects},
    contact::{Contacts, TickForces},
    event::{self, Event},
    gripper::{self, Grip, Gripper, TICK_S},
    layout::{Layout, LayoutError, Placed},
    oracle::{Judge, OracleVerdict},
    profile::PhysicsProfile,
    report::{SimError, SimOptions, SimTimings, TrueObject},
    scenario::{JudgeSpec, Scenario, SurfaceSpec, WorldSpec},
    slip::Slip,
    snapshot::WorldState,
    state,
};
use acm_concept::{
    embodiment::{Command, EmbodimentError, Feedback, RobotDescription},
    pose::Pose,
    time::Time,
};
use rapier3d::prelude::{ColliderBuilder, ColliderHandle, PhysicsWorld, RigidBodyBuilder, Vector};
use rustix::time::ClockId;

/// How long the world settles before the episode begins, seconds.
const SETTLE_S: f64 = 0.5;
/// An object that turns or shifts more than this while settling was not placed at rest: degrees, metres.
const SETTLED: (f64, f64) = (3.0, 0.01);
/// Commands may exceed the speed limits by this factor, which absorbs rounding.
const TOLERANCE: f64 = 1.0 + 1e-6;

/// Everything that is simulated. The episode's handles share one.
pub(crate) struct World {
    pub(crate) physics: PhysicsWorld,
    pub(crate) profile: PhysicsProfile,
    pub(crate) robot: RobotDescription,
    pub(crate) gripper: Gripper,
    pub(crate) bodies: Vec<Body>,
    pub(crate) surfaces: Vec<(ColliderHandle, SurfaceSpec)>,
    pub(crate) contacts: Contacts,
    pub(crate) timings: SimTimings,
    /// The hand's commanded pose at the end of the last tick.
    pub(crate) target: Pose,
    pub(crate) grip: Grip,
    pub(crate) events: Vec<Event>,
    pub(crate) slip: Option<Slip>,
    pub(crate) judge: Judge,
    pub(crate) audit: Audit,
    pub(crate) state: Vec<f64>,
    pub(crate) constants: Vec<f64>,
    pub(crate) bystanders: Vec<usize>,
    pub(crate) steps: u64,
    pub(crate) forces: TickForces,
    motion: bool,
    pub(crate) stopped: bool,
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
        let robot = gripper::description(spec.home, spec.workspace);
        let gripper = Gripper::build(&mut physics, &robot);
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
            audit: Audit::default(),
            constants: state::constants(spec, layout),
            state: vec![0.0; variables.len()],
            target: robot.home,
            grip: Grip { opening_m: robot.max_opening_m, force_n: robot.max_grip_force_n },
            slip: options.slip_at.map(|carry| Slip::new(carry, options.seed, camera)),
            contacts: Contacts::default(),
            forces: TickForces::default(),
            timings: SimTimings::default(),
            motion: options.motion,
            stopped: false,
            steps: 0,
            events,
            surfaces,
            bodies,
            gripper,
            robot,
            profile,
            physics,
        })
    }

    /// Lets objects come to rest before the first frame. An object that tips over was placed wrongly.
    fn settle(&mut self, seed: u64) -> Result<(), SimError> {
        let start: Vec<Pose> = self.bodies.iter().map(|body| body.pose(&self.physics)).collect();
        for _ in 0..(SETTLE_S / self.profile.step_s()).round() as u32 {
            self.gripper.drive(&mut self.physics, &self.target, self.grip);
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
        self.contacts.read(&self.physics, &self.gripper);
        self.refresh_state();
        self.look_for_causes();
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
        if let Some(reason) = self.refusal(command) {
            return Err(EmbodimentError::Refused { reason });
        }
        self.grip = Grip { opening_m: command.opening_m, force_n: command.grip_force_n };
        self.tick(command.tcp);
        Ok(self.feedback())
    }

    fn refusal(&self, command: &Command) -> Option<String> {
        let robot = &self.robot;
        if !(command.tcp.is_valid() && command.opening_m.is_finite() && command.grip_force_n.is_finite()) {
            return Some("it holds numbers that are not finite, or a rotation that is not one".into());
        }
        if !robot.reaches(command.tcp.translation) {
            let (low, high) = (robot.workspace_min, robot.workspace_max);
            return Some(format!("{} lies outside of the workspace {low} to {high} m", command.tcp.translation));
        }
        let shift = command.tcp.translation.distance(self.target.translation) / robot.tick_s;
        if shift > robot.max_speed_m_s * TOLERANCE {
            return Some(format!("it asks for {shift:.3} m/s, the fastest is {} m/s", robot.max_speed_m_s));
        }
        let turn = command.tcp.angle_to(&self.target) / robot.tick_s;
        // The angle between nearly equal rotations is only known to about 1e-7.
        if turn > robot.max_turn_rad_s * TOLERANCE + 1e-4 {
            return Some(format!("it asks for {turn:.3} rad/s, the fastest is {} rad/s", robot.max_turn_rad_s));
        }
        if !(0.0..=robot.max_opening_m * TOLERANCE).contains(&command.opening_m) {
            return Some(format!("an opening of {} m is not in 0 to {} m", command.opening_m, robot.max_opening_m));
        }
        if !(0.0..=robot.max_grip_force_n * TOLERANCE).contains(&command.grip_force_n) {
            return Some(format!("a force of {} N is not in 0 to {} N", command.grip_force_n, robot.max_grip_force_n));
        }
        None
    }

    /// Advances by one control tick while the commanded pose moves evenly to `target`.
    fn tick(&mut self, target: Pose) {
        let started = cpu_s(ClockId::ThreadCPUTime);
        let from = self.target;
        let steps = (TICK_S * f64::from(self.profile.steps_per_second)).round() as u32;
        self.forces = TickForces::default();
        for step in 1..=steps {
            self.step(&from.interpolate(&target, f64::from(step) / f64::from(steps)));
        }
        self.target = target;
        let (tcp, now_s) = (self.gripper.tcp(&self.physics), self.seconds());
        let pads = self.forces.mean().0.map(|force| tcp.inverse().transform_vector(force));
        self.audit.grip(pads, self.robot.max_grip_force_n, now_s);
        self.timings.physics_s += cpu_s(ClockId::ThreadCPUTime) - started;
    }

    fn step(&mut self, target: &Pose) {
        let now_s = self.seconds();
        for event in &mut self.events {
            event.step(&mut self.physics, &mut self.bodies, &self.state, now_s);
        }
        self.gripper.drive(&mut self.physics, target, self.grip);
        self.physics.step();
        self.steps += 1;
        for body in &mut self.bodies {
            body.count_presses(&self.physics);
        }
        self.contacts.read(&self.physics, &self.gripper);
        self.forces.add(&self.contacts, self.gripper.wrist_force(&self.physics));
        // Taken out and put back, because what happens in a slip looks at the whole world.
        if let Some(mut slip) = self.slip.take() {
            slip.step(self);
            self.slip = Some(slip);
        }
        self.look_for_causes();
        self.refresh_state();
        self.judge.step(&self.state, self.seconds(), self.profile.step_s());
    }

    fn look_for_causes(&mut self) {
        let robot = audit::Robot {
            bodies: &self.gripper.bodies(),
            tcp: self.gripper.tcp(&self.physics),
            max_speed_m_s: self.robot.max_speed_m_s,
        };
        self.audit.step(&self.physics, &robot, self.seconds());
    }

    /// What happened without a cause so far.
    pub(crate) fn audit(&self) -> &AuditReport {
        self.audit.report()
    }
    /// Something outside of the world moves a body on purpose.
    pub(crate) fn excuse(&mut self, body: usize) {
        if let Some(body) = self.bodies.get(body) {
            self.audit.excuse(body.handle);
        }
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

    /// What the hand measures.
    pub(crate) fn feedback(&self) -> Feedback {
        let tcp = self.gripper.tcp(&self.physics);
        let (pads, wrist) = self.forces.mean();
        Feedback {
            time: self.now(),
            tcp,
            joints: Vec::new(),
            opening_m: self.gripper.opening(&self.physics),
            commanded_opening_m: self.grip.opening_m,
            pad_force_n: pads.map(|force| tcp.inverse().transform_vector(force)),
            wrist_force_n: wrist,
        }
    }

    /// Stops all motion; the hand stays where it is.
    pub(crate) fn stop(&mut self) {
        self.stopped = true;
        self.target = self.gripper.tcp(&self.physics);
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
            self.tick(self.target);
        }
        Ok(self.now())
    }

    /// How the episode stands. The judge looks a little further than the present, so that a stage that has to hold
    /// for a while is not missed by an agent that stops at once; the world itself does not advance.
    pub(crate) fn verdict(&mut self) -> OracleVerdict {
        let Ok(now) = WorldState::of(self) else { return self.audit.void(self.judge.verdict(&self.state)) };
        let until = self.seconds() + self.judge.settle_s();
        while self.seconds() < until {
            self.step(&self.target.clone());
        }
        let verdict = self.judge.verdict(&self.state);
        now.put_into(self);
        self.audit.void(verdict)
    }

    pub(crate) fn truth(&self) -> Vec<TrueObject> {
        true_objects(self)
    }
}

/// Longest single wait, seconds.
const MAX_WAIT_S: f64 = 3600.0;

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
