//! One episode: simulator, agent, judge.

use crate::{
    inject::{Faults, FrameTap},
    llm::Llm,
    trace::recording::{Recording, Stage, TraceRequest},
};
use acm_actors::{
    Agent,
    agent::Interrupt,
    episode::Until,
    host::Outside,
    message::Message,
    remote::{HostVerdict, RemoteRobot},
    report::{Ending, EpisodeReport},
    settings::{Settings, Signal},
    trace::Trace,
};
use acm_concept::{
    embodiment::{Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    expectation::Expectation,
    task::TaskSpec,
    template::TemplateLibrary,
};
use acm_perception::Grounder;
use acm_planner::{GiveUpCause, Lexicon};
use acm_runtime::{envelope::Role, journal::Journal, system::PanicAt};
use acm_sim::{AuditReport, OracleVerdict, Scenario, SharedRenderer, SimOptions, SimTimings, Simulation};
use anyhow::Context;
use serde::Serialize;
use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Instant,
};

/// How an episode is to be run.
#[derive(Debug, Clone, Default)]
pub struct EpisodeConfig {
    /// Name of the memory.
    pub method: String,
    /// What the agent goes by.
    pub settings: Settings,
    /// What is otherwise from a moment on.
    pub fork: Option<Fork>,
    /// Instruction instead of the scenario's own.
    pub instruction: Option<String>,
    /// Folder of a memory that lasts.
    pub memory: Option<PathBuf>,
    /// Faults.
    pub faults: Faults,
    /// Whether the robot may not move.
    pub no_motion: bool,
    /// Another sensor profile.
    pub sensor: Option<String>,
    /// Keeps frames on their way to the agent.
    pub frames: Option<FrameTap>,
    /// Where all of the run is written down.
    pub trace: Option<TraceRequest>,
    /// For tests: the actor of this name panics at its nth message.
    pub panic_at: Option<(String, u64)>,
    /// The language model that reads instructions; the rules do without one.
    pub llm: Option<Llm>,
    /// What it is asked for.
    pub stages: Vec<acm_actors::settings::Stage>,
    /// For benches: a wrong answer of the model is neither asked for again nor replaced.
    pub llm_alone: bool,
    /// The event at which the run ends.
    pub until: Option<Until>,
    /// The words that start such a run from the command line; empty where it was not started there. For the trace.
    pub arguments: Vec<String>,
}

/// What is otherwise from a moment of a run on.
#[derive(Debug, Clone, PartialEq)]
pub struct Fork {
    /// The moment.
    pub begins: Signal,
    /// Faults of the cameras that begin then.
    pub cameras: Faults,
    /// What the agent goes by from then on.
    pub settings: Settings,
}

/// What an episode came to, from both sides.
#[derive(Debug, Clone, Serialize)]
pub struct EpisodeResult {
    /// The seed.
    pub seed: u64,
    /// The agent says done and the judge's strict predicate holds.
    pub solved: bool,
    /// The agent says done and the judge says no.
    pub false_success: bool,
    /// Whether anybody judged; without a judge the verdict says so and holds nothing.
    pub judged: bool,
    /// The judge.
    pub verdict: OracleVerdict,
    /// The kind of failure to blame, if it was not solved.
    pub cause: Option<GiveUpCause>,
    /// The agent's report.
    pub report: EpisodeReport,
    /// Equal for equal initial worlds.
    pub world: String,
    /// What the physics audit found; an episode with a violation is void, which the verdict says. Empty where the world
    /// is not ours.
    pub audit: AuditReport,
    /// Motion commands that reached the robot.
    pub motion_commands: u64,
    /// Wall time of the whole episode, seconds.
    pub wall_s: f64,
    /// Wall time by what it went to, seconds.
    pub spent_s: BTreeMap<String, f64>,
}

/// Runs episodes: holds what they share.
pub struct Runner {
    runtime: tokio::runtime::Runtime,
    renderer: Option<SharedRenderer>,
    library: Arc<TemplateLibrary>,
    lexicon: Option<Lexicon>,
    interrupt: Interrupt,
}

impl Runner {
    /// Starts the renderer and the runtime.
    pub fn new() -> anyhow::Result<Runner> {
        Runner::with_library(acm_memory::default_library()?)
    }

    /// As [`Runner::new`], with another template library.
    pub fn with_library(library: TemplateLibrary) -> anyhow::Result<Runner> {
        let renderer = Arc::new(Mutex::new(acm_render::Renderer::new()?));
        Ok(Runner { renderer: Some(renderer), ..Runner::without_renderer(library)? })
    }

    /// As [`Runner::with_library`], for worlds that have eyes of their own.
    pub fn without_renderer(library: TemplateLibrary) -> anyhow::Result<Runner> {
        // Ports block while they render or step the world, so one worker more than one.
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        Ok(Runner {
            runtime,
            renderer: None,
            library: Arc::new(library),
            lexicon: None,
            interrupt: Interrupt::default(),
        })
    }

    /// The same renderer and runtime settings for agents with other words: another library and another lexicon.
    pub fn with_words(&self, library: TemplateLibrary, lexicon: Lexicon) -> anyhow::Result<Runner> {
        let other = Runner::without_renderer(library)?;
        Ok(Runner { renderer: self.renderer.clone(), lexicon: Some(lexicon), ..other })
    }

    /// Another one beside this: the same renderer and words, but a runtime and an interrupt of its own, so that two episodes
    /// run at a time.
    ///
    /// # Errors
    /// The runtime cannot be started.
    pub fn beside(&self) -> anyhow::Result<Runner> {
        let other = Runner::without_renderer((*self.library).clone())?;
        Ok(Runner { renderer: self.renderer.clone(), lexicon: self.lexicon.clone(), ..other })
    }

    /// Ends the running episode when the process is interrupted from the keyboard.
    pub fn end_on_ctrl_c(&self) {
        let interrupt = self.interrupt.clone();
        // The one task outside the actors: it only waits for the signal.
        #[allow(clippy::disallowed_methods)]
        self.runtime.spawn(async move {
            if tokio::signal::ctrl_c().await.is_ok() {
                interrupt.interrupt();
            }
        });
    }

    /// The template library.
    pub fn library(&self) -> &Arc<TemplateLibrary> {
        &self.library
    }
    /// What the renderer runs on.
    pub fn adapter(&self) -> String {
        let adapter =
            |renderer: &SharedRenderer| renderer.lock().unwrap_or_else(PoisonError::into_inner).adapter().to_string();
        self.renderer.as_ref().map_or_else(|| "nothing".into(), adapter)
    }
    /// The renderer, which takes a second to start and is shared.
    ///
    /// # Errors
    /// The runner was made without one.
    pub fn renderer(&self) -> anyhow::Result<SharedRenderer> {
        self.renderer.clone().context("this runner has no renderer")
    }

    /// Runs one episode.
    pub fn run(
        &self,
        scenario: &Scenario,
        seed: u64,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
    ) -> anyhow::Result<EpisodeResult> {
        let sensor = config.sensor.as_deref().unwrap_or_else(|| scenario.sensor());
        let stage = Stage { world: scenario.name(), sensor, renderer: &self.adapter() };
        recorded(&stage, seed, config, |trace| self.episode(scenario, seed, config, journal, trace))
    }

    /// A world that stays between the agents that live in it, one after the other; see [`Runner::run_in`].
    ///
    /// # Errors
    /// The seed gives no world, or this runner has no renderer.
    pub fn world<'s>(&self, scenario: &'s Scenario, seed: u64, config: &EpisodeConfig) -> anyhow::Result<World<'s>> {
        let options = SimOptions {
            seed,
            slip_at: config.faults.slip_at,
            drop_at: config.faults.drop_at,
            sensor: config.sensor.clone(),
            motion: !config.no_motion,
            camera_size: None,
        };
        let simulation = Simulation::new(scenario, &options, self.renderer()?).context("the world cannot be built")?;
        let digest = simulation.world_digest();
        Ok(World { scenario, seed, simulation, digest })
    }

    /// Runs one agent in a world as the agents before it have left it.
    ///
    /// # Errors
    /// As [`Runner::run`].
    pub fn run_in(
        &self,
        world: &World<'_>,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
    ) -> anyhow::Result<EpisodeResult> {
        // An agent that has ended stopped its robot.
        world.simulation.resume();
        let sensor = config.sensor.as_deref().unwrap_or_else(|| world.scenario.sensor());
        let stage = Stage { world: world.scenario.name(), sensor, renderer: &self.adapter() };
        recorded(&stage, world.seed, config, |trace| self.live_in(world, config, journal, trace))
    }

    fn episode(
        &self,
        scenario: &Scenario,
        seed: u64,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
        trace: Option<Arc<Trace>>,
    ) -> anyhow::Result<EpisodeResult> {
        let started = now();
        let world = self.world(scenario, seed, config)?;
        let built_s = started.elapsed().as_secs_f64();
        let mut result = self.live_in(&world, config, journal, trace)?;
        result.spent_s.insert("world-building".into(), built_s);
        result.wall_s += built_s;
        Ok(result)
    }

    fn live_in(
        &self,
        world: &World<'_>,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
        trace: Option<Arc<Trace>>,
    ) -> anyhow::Result<EpisodeResult> {
        let (started, simulation) = (now(), &world.simulation);
        let before = simulation.timings();
        let outside =
            Outside { embodiment: simulation.embodiment(), cameras: simulation.camera(), clock: simulation.clock() };
        let mut lived = self.live(simulation.task(), outside, world.seed, config, journal, trace)?;
        split_host_time(&mut lived.spent_s, &before, &simulation.timings());
        let judged = !matches!(lived.report.ending, Ending::Until { .. });
        let verdict = judged.then(|| simulation.verdict());
        let result = lived.result(world.seed, world.digest.clone(), verdict, started);
        Ok(EpisodeResult { audit: simulation.audit(), ..result })
    }

    /// Runs one episode on a robot in another process. The seed is that of the agent's own draws. A host that is lost
    /// on the way ends the episode; then there is no verdict.
    pub fn run_remote(
        &self,
        robot: &RemoteRobot,
        seed: u64,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
    ) -> anyhow::Result<EpisodeResult> {
        let world = robot.address().to_string();
        let stage = Stage { world: &world, sensor: "the host's", renderer: "the host's" };
        recorded(&stage, seed, config, |trace| self.episode_remote(robot, seed, config, journal, trace))
    }

    fn episode_remote(
        &self,
        robot: &RemoteRobot,
        seed: u64,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
        trace: Option<Arc<Trace>>,
    ) -> anyhow::Result<EpisodeResult> {
        let started = now();
        let outside = Outside { embodiment: robot.embodiment(), cameras: robot.camera(), clock: robot.clock() };
        let mut lived = self.live(robot.task().clone(), outside, seed, config, journal, trace)?;
        let verdict = match &lived.report.ending {
            // Nobody has done anything yet that could be judged, and a lost host judges nothing.
            Ending::Until { .. } | Ending::Broken { .. } => Ok(None),
            _ => robot.done(&lived.report),
        };
        let verdict = verdict.unwrap_or_else(|error| {
            lived.report.ending = Ending::Broken { reason: error.to_string() };
            None
        });
        Ok(lived.result(seed, String::new(), verdict.map(verdict_of), started))
    }

    /// Lets an agent live in a world.
    pub(crate) fn live(
        &self,
        mut task: TaskSpec,
        outside: Outside,
        seed: u64,
        config: &EpisodeConfig,
        journal: Arc<dyn Journal<Message>>,
        trace: Option<Arc<Trace>>,
    ) -> anyhow::Result<Lived> {
        let perceive = again(&self.library, &config.settings, outside.embodiment.description());
        let memory = acm_baselines::by_name(
            &config.method,
            Arc::clone(&self.library),
            config.memory.as_deref(),
            Some(perceive),
        )?;
        let donor = config.faults.transplant.as_ref().map(|(donor, _)| donor);
        let donated = donor.map(|donor| acm_memory::read_events(donor)).transpose()?.unwrap_or_default();
        let panic_at = config.panic_at.as_ref().or(config.faults.panic_at.as_ref());
        let agent = Agent::builder(Arc::clone(&self.library), memory)
            .settings(config.settings.clone())
            .then(config.fork.as_ref().map(|fork| (fork.begins.clone(), fork.settings.clone())))
            .seed(seed)
            .lexicon(self.lexicon.clone())
            .wipe_at(config.faults.wipe_at.clone())
            .transplant_at(config.faults.transplant.as_ref().map(|(_, at)| at.clone()), donated.into())
            .until(config.until)
            .llm(config.llm.as_ref().map(Llm::backend))
            .stages(config.stages.iter().copied())
            .aided(!config.llm_alone)
            .journal(journal)
            .trace(trace.clone())
            .panic_at(panic_at.and_then(|(name, message)| role(name).map(|role| PanicAt { role, message: *message })))
            .build()?;
        if let Some(instruction) = &config.instruction {
            task.instruction.clone_from(instruction);
        }
        let commands = Arc::new(AtomicU64::new(0));
        let robot =
            Box::new(Counted { robot: outside.embodiment, commands: Arc::clone(&commands), motion: !config.no_motion });
        let mut cameras = config.faults.cameras(outside.cameras, None);
        if let Some(fork) = &config.fork {
            cameras = fork.cameras.cameras(cameras, Some(fork.begins.clone()));
        }
        if let Some(tap) = &config.frames {
            cameras = tap.cameras(cameras);
        }
        let run = self.runtime.block_on(agent.run(task, robot, cameras, outside.clock, &self.interrupt))?;
        let mut spent_s: BTreeMap<String, f64> =
            run.spent.iter().map(|(role, time)| (role.to_string(), time.as_secs_f64())).collect();
        if let Some(trace) = trace {
            spent_s.insert("trace".into(), trace.spent().as_secs_f64());
        }
        Ok(Lived { report: run.report, spent_s, commands: commands.load(Ordering::Relaxed) })
    }
}

/// Perception of stored frames, as the agent perceives them: for memories that keep frames.
fn again(library: &Arc<TemplateLibrary>, settings: &Settings, robot: &RobotDescription) -> acm_baselines::Perceive {
    let (grounder, robot) = (Grounder::new(Arc::clone(library), settings.perception.clone()), robot.clone());
    Arc::new(move |frame, feedback, expectation| {
        let expectation = Expectation { time: frame.header.time, robot: robot.body(feedback), ..expectation.clone() };
        grounder.ground(frame, &expectation)
    })
}

/// Runs an episode into a trace, where one is wanted.
fn recorded(
    stage: &Stage<'_>,
    seed: u64,
    config: &EpisodeConfig,
    run: impl FnOnce(Option<Arc<Trace>>) -> anyhow::Result<EpisodeResult>,
) -> anyhow::Result<EpisodeResult> {
    let Some(request) = &config.trace else { return run(None) };
    let recording = Recording::begin(request, stage, seed, config)?;
    let result = run(Some(recording.trace()));
    let finished = recording.end(&result);
    // What went wrong first is what is told.
    result.and_then(|result| finished.map(|()| result))
}

/// A scenario's world with one seed. It goes on where the last agent has left it.
pub struct World<'s> {
    scenario: &'s Scenario,
    seed: u64,
    simulation: Simulation,
    /// Equal for equal initial worlds.
    digest: String,
}

impl World<'_> {
    /// The simulation: for judging and drawing, never for an agent.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }
}

/// An episode before it is judged.
pub(crate) struct Lived {
    report: EpisodeReport,
    spent_s: BTreeMap<String, f64>,
    commands: u64,
}

impl Lived {
    fn result(self, seed: u64, world: String, verdict: Option<OracleVerdict>, started: Instant) -> EpisodeResult {
        let judged = verdict.is_some();
        let verdict = verdict.unwrap_or_else(|| verdict_of(HostVerdict::default()));
        let done = self.report.ending == Ending::Done;
        let solved = done && verdict.strict;
        EpisodeResult {
            seed,
            solved,
            false_success: done && judged && !verdict.strict,
            cause: if solved || !judged { None } else { Some(blame(&self.report, &verdict)) },
            judged,
            verdict,
            report: self.report,
            world,
            audit: AuditReport::default(),
            motion_commands: self.commands,
            wall_s: started.elapsed().as_secs_f64(),
            spent_s: self.spent_s,
        }
    }
}

/// A host's verdict as one of ours.
fn verdict_of(verdict: HostVerdict) -> OracleVerdict {
    let HostVerdict { strict, faithful, stages, violations, explanation } = verdict;
    OracleVerdict { strict, faithful, stages, violations, explanation }
}

/// The actor of this name.
pub(crate) fn role(name: &str) -> Option<Role> {
    use acm_actors::message::{EPISODE, EXECUTOR, HOST, LLM, MEMORY, PERCEPTION, PLANNER, VERIFIER};
    let roles = [EPISODE, EXECUTOR, HOST, LLM, MEMORY, PERCEPTION, PLANNER, VERIFIER];
    roles.into_iter().find(|known| known.0 == name)
}

/// The host's time is the world's: physics, rendering and sensor noise are what it consists of.
fn split_host_time(spent_s: &mut BTreeMap<String, f64>, before: &SimTimings, after: &SimTimings) {
    let host = spent_s.remove("host").unwrap_or(0.0);
    let parts = [
        ("physics", after.physics_s - before.physics_s),
        ("render", after.render_s - before.render_s),
        ("noise", after.noise_s - before.noise_s),
    ];
    let known: f64 = parts.iter().map(|(_, seconds)| seconds).sum();
    spent_s.extend(parts.map(|(name, seconds)| (name.to_string(), seconds)));
    spent_s.insert("host-other".into(), (host - known).max(0.0));
}

/// What to blame: what the agent itself named, else what the judge found not to hold.
fn blame(report: &EpisodeReport, verdict: &OracleVerdict) -> GiveUpCause {
    match &report.ending {
        Ending::GaveUp { cause, .. } => *cause,
        Ending::NotUnderstood { .. } => GiveUpCause::Plan,
        _ => {
            report.cause().unwrap_or(if verdict.violations.is_empty() { GiveUpCause::Place } else { GiveUpCause::Plan })
        }
    }
}

/// Counts the motion commands that reach the robot, or lets none through.
struct Counted {
    robot: Box<dyn Embodiment>,
    commands: Arc<AtomicU64>,
    motion: bool,
}

impl Embodiment for Counted {
    fn description(&self) -> &RobotDescription {
        self.robot.description()
    }
    fn feedback(&self) -> Feedback {
        self.robot.feedback()
    }
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        self.commands.fetch_add(1, Ordering::Relaxed);
        match self.motion {
            true => self.robot.command(command),
            false => Err(EmbodimentError::MotionDisabled),
        }
    }
    fn stop(&mut self) {
        self.robot.stop();
    }
}

/// Wall time is measured here and printed; no decision depends on it.
#[allow(clippy::disallowed_methods)]
fn now() -> Instant {
    Instant::now()
}
