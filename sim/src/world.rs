//! The running world: physics, robot, mechanisms, what third parties do, and the judge who watches.

use crate::{
    audit::{Audit, AuditReport},
    body::Body,
    contact::Contacts,
    derived::Derived,
    event::{self, Event},
    fluent::Fluents,
    layout::{Layout, LayoutError, number, vector},
    mishap::{Mishap, MishapKind},
    oracle::{Judge, OracleVerdict},
    placed::Placed,
    profile::PhysicsProfile,
    report::{SimError, SimOptions, SimTimings},
    robot::{Robot, TICK_S},
    scenario::{CameraSpec, JudgeSpec, Scenario, SurfaceSpec, WorldSpec},
    snapshot::WorldState,
    state, texture,
    truth::{TrueObject, true_objects},
};
use acm_concept::{
    camera::{CameraModel, Mount},
    embodiment::{Command, EmbodimentError, Feedback},
    expression::Expression,
    pose::Pose,
    time::Time,
};
use acm_render::{Lighting, Pattern, PointLight, Sun};
use glam::DVec3;
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
    pub(crate) events: Vec<Event>,
    pub(crate) mishaps: Vec<Mishap>,
    pub(crate) fluents: Fluents,
    pub(crate) derived: Derived,
    pub(crate) judge: Judge,
    pub(crate) audit: Audit,
    pub(crate) lighting: Lighting,
    /// Factors by which the cameras' colours are too bright.
    pub(crate) exposures: Vec<f64>,
    /// Where the hands were when the episode began.
    pub(crate) hands_start: Vec<DVec3>,
    /// What is painted on each surface.
    pub(crate) textures: Vec<Option<Pattern>>,
    /// Names of the judge's variables, and their values.
    pub(crate) variables: Vec<String>,
    pub(crate) state: Vec<f64>,
    pub(crate) constants: Vec<f64>,
    pub(crate) bystanders: Vec<usize>,
    pub(crate) steps: u64,
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
        let mut bodies: Vec<Body> = layout.objects.iter().map(insert).collect();
        let robot = Robot::build(&mut physics, &spec.robot);
        let variables = state::names(scenario);
        for body in &mut bodies {
            body.set_shows(state::shows(&spec.objects[body.placed.spec], &variables));
        }
        let layout_error = |source: LayoutError| SimError::Layout {
            scenario: scenario.name.clone(),
            seed: options.seed,
            source: source.into(),
        };
        let events = event::build(spec, layout, &variables).map_err(layout_error)?;
        for event in &events {
            event.prepare(&mut physics, &mut bodies);
        }
        Ok(World {
            bystanders: bystanders(spec, &scenario.judge, &bodies),
            judge: Judge::new(&scenario.judge, &variables),
            audit: Audit::default(),
            constants: state::constants(spec, layout),
            state: vec![0.0; variables.len()],
            mishaps: mishaps(spec, options),
            fluents: Fluents::build(spec, layout, &variables).map_err(layout_error)?,
            derived: Derived::build(spec, layout, &variables).map_err(layout_error)?,
            lighting: lighting(spec, layout).map_err(layout_error)?,
            hands_start: Vec::new(),
            exposures: exposures(spec, layout).map_err(layout_error)?,
            textures: textures(spec, layout).map_err(layout_error)?,
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
            variables,
        })
    }

    /// Lets objects come to rest before the first frame. An object that tips over was placed wrongly.
    fn settle(&mut self, seed: u64) -> Result<(), SimError> {
        let start: Vec<Pose> = self.bodies.iter().map(|body| body.pose(&self.physics)).collect();
        for _ in 0..(SETTLE_S / self.profile.step_s()).round() as u32 {
            self.refresh_state();
            for body in &self.bodies {
                body.act(&mut self.physics, &self.state);
            }
            self.robot.drive(&mut self.physics, 1.0, false);
            self.physics.step();
            for body in &mut self.bodies {
                body.measure(&self.physics);
            }
        }
        for (body, start) in self.bodies.iter_mut().zip(start) {
            let pose = body.pose(&self.physics);
            let (turn, shift) = (pose.angle_to(&start).to_degrees(), pose.translation.distance(start.translation));
            if turn > SETTLED.0 || shift > SETTLED.1 {
                let name = body.placed.name.clone();
                return Err(SimError::Unstable { object: name, seed, turn_deg: turn, shift_m: shift });
            }
            body.start = pose;
            body.measure(&self.physics);
        }
        self.contacts.read(&self.physics, &self.robot);
        self.hands_start = self.robot.hands(&self.physics).map(|hand| hand.at).collect();
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
        let step = |event: &mut Event| event.step(&mut self.physics, &mut self.bodies, &self.state, now_s);
        let set_down: Vec<usize> = self.events.iter_mut().filter_map(step).collect();
        set_down.into_iter().for_each(|body| self.excuse(body));
        for body in &self.bodies {
            body.act(&mut self.physics, &self.state);
        }
        let drops = self.mishaps.iter().any(|mishap| mishap.drops(self));
        self.robot.drive(&mut self.physics, fraction, drops);
        self.physics.step();
        self.steps += 1;
        for body in &mut self.bodies {
            body.measure(&self.physics);
        }
        self.contacts.read(&self.physics, &self.robot);
        self.robot.feel(&self.physics, &self.contacts);
        // Taken out and put back, because what happens in a mishap looks at the whole world.
        let mut mishaps = std::mem::take(&mut self.mishaps);
        for mishap in &mut mishaps {
            mishap.step(self);
        }
        self.mishaps = mishaps;
        self.look_for_causes();
        self.fluents.step(&self.state, self.profile.step_s());
        self.refresh_state();
        self.judge.step(&self.state, self.seconds(), self.profile.step_s());
    }

    fn look_for_causes(&mut self) {
        let hands: Vec<_> = self.robot.hands(&self.physics).collect();
        let now_s = self.seconds();
        self.audit.step(&self.physics, &self.robot.bodies(), &hands, now_s);
    }

    /// What happened without a cause so far.
    pub(crate) fn audit(&self) -> &AuditReport {
        self.audit.report()
    }
    /// Something outside of the world moves an object on purpose.
    pub(crate) fn excuse(&mut self, body: usize) {
        for handle in self.bodies.get(body).into_iter().flat_map(Body::handles) {
            self.audit.excuse(handle);
        }
    }

    fn refresh_state(&mut self) {
        let mut values = std::mem::take(&mut self.state);
        state::fill(self, &mut values);
        self.state = values;
    }

    /// A camera with its pose in the world, wherever it is mounted. The hand's pose is measured without error, so that
    /// the same serves for the true and for the nominal camera.
    pub(crate) fn placed(&self, camera: &CameraModel) -> CameraModel {
        match camera.mount {
            Mount::World => camera.clone(),
            Mount::Hand => {
                let pose = self.robot.tcp(&self.physics) * camera.pose;
                CameraModel { pose, ..camera.clone() }
            }
        }
    }

    /// Whether a camera is stuck at its last picture.
    pub(crate) fn is_frozen(&self, camera: usize) -> bool {
        self.events.iter().any(|event| event.freezes(camera))
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
        let Ok(now) = WorldState::of(self) else { return self.audit.void(self.judge.verdict(&self.state)) };
        let until = self.seconds() + self.judge.settle_s();
        while self.seconds() < until {
            self.step(1.0);
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

/// What the scenario and the run want to go wrong.
fn mishaps(spec: &WorldSpec, options: &SimOptions) -> Vec<Mishap> {
    let camera = spec.cameras.first().map(|camera| camera.model.clone());
    let asked = [(MishapKind::Slip, options.slip_at), (MishapKind::Drop, options.drop_at)];
    let asked = asked.into_iter().filter_map(|(kind, carry)| Some((kind, carry?)));
    let all = spec.mishaps.iter().copied().chain(asked);
    all.map(|(kind, carry)| Mishap::new(kind, carry, options.seed, camera.clone())).collect()
}

fn lighting(spec: &WorldSpec, layout: &Layout) -> Result<Lighting, LayoutError> {
    let Some(light) = &spec.lighting else { return Ok(Lighting::default()) };
    let scope = layout.scope();
    let number = |expression: &Expression| number("light", expression, &scope);
    let point = |(position, intensity): &([Expression; 3], Expression)| {
        Ok(PointLight { position: vector("light", position, &scope)?, intensity: number(intensity)? as f32 })
    };
    let direction = vector("light", &light.sun_direction, &scope)?;
    Ok(Lighting {
        ambient: number(&light.ambient)? as f32,
        sun: Sun { direction, intensity: number(&light.sun)? as f32, ..Lighting::default().sun },
        points: light.points.iter().map(point).collect::<Result<_, LayoutError>>()?,
    })
}

fn textures(spec: &WorldSpec, layout: &Layout) -> Result<Vec<Option<Pattern>>, LayoutError> {
    let scope = layout.scope();
    spec.surfaces.iter().map(|surface| texture::chosen(&surface.name, &surface.textures, &scope)).collect()
}

fn exposures(spec: &WorldSpec, layout: &Layout) -> Result<Vec<f64>, LayoutError> {
    let scope = layout.scope();
    let exposure = |camera: &CameraSpec| {
        let (name, range) = (&camera.model.name, 0.05..=20.0);
        let value = number(name, &camera.exposure, &scope)?;
        let reason = || format!("an exposure of {value} must lie in {} to {}", range.start(), range.end());
        if range.contains(&value) {
            Ok(value)
        } else {
            Err(LayoutError::Value { name: name.clone(), reason: reason() })
        }
    };
    spec.cameras.iter().map(exposure).collect()
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
