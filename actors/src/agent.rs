//! The builder that puts an agent together, and one episode's run.

use crate::{
    episode::{Episode, FaultEvent, Until, Upheavals},
    executor::ExecutorActor,
    host::{HostPort, Outside},
    llm::LlmPort,
    memory::{MemoryActor, MemoryObserver},
    message::{EPISODE, EXECUTOR, HOST, LLM, MEMORY, Message, PERCEPTION, PLANNER, VERIFIER},
    perception::PerceptionActor,
    planner::PlannerActor,
    report::EpisodeReport,
    settings::{Settings, Signal, Stage, Turning},
    trace::Trace,
    verifier::VerifierActor,
};
use acm_concept::{
    camera::{CameraSource, RgbdFrame},
    embodiment::{Clock, Embodiment},
    task::TaskSpec,
    template::TemplateLibrary,
};
use acm_llm::Backend;
use acm_memory::{Memory, event::Event};
use acm_perception::Grounder;
use acm_planner::{Lexicon, PlanOptions, Planner};
use acm_runtime::{
    envelope::Role,
    frame_bus::{FrameBus, InProcessBus},
    journal::{Both, Journal, JournalError, NoJournal},
    system::{PanicAt, SystemBuilder, SystemError},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, PoisonError, Weak},
    time::Duration,
};
use thiserror::Error;
use tokio::sync::watch;

/// Frames that stay on the bus.
const BUS_FRAMES: usize = 8;
/// Wall time after which an episode that gives no result is held to hang.
const WALL_LIMIT: Duration = Duration::from_secs(600);

/// Why an agent could not be built or its episode ended without a report.
#[derive(Debug, Error)]
pub enum AgentError {
    /// The task names no camera.
    #[error("the task has no camera: the agent needs at least one")]
    NoCamera,
    /// The settings name tools of perception. What a tool answers is an effect that the trace does not hold yet, and a run
    /// that asked one could not be replayed.
    #[error(
        "the settings name `tools.{0}`: a run asks no tools, as it could not be replayed; they help `acm perceive`"
    )]
    Tools(&'static str),
    /// The planner's lexicon is broken.
    #[error(transparent)]
    Lexicon(#[from] acm_planner::LexiconError),
    /// The actors could not be started or gave no result.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The trace could not be begun.
    #[error(transparent)]
    Trace(#[from] JournalError),
}

/// What an agent is made of. Everything has a default but the world and the memory.
pub struct AgentBuilder {
    library: Arc<TemplateLibrary>,
    memory: Arc<Mutex<Box<dyn Memory>>>,
    settings: Settings,
    then: Option<(Signal, Settings)>,
    seed: u64,
    lexicon: Option<Lexicon>,
    journal: Arc<dyn Journal<Message>>,
    trace: Option<Arc<Trace>>,
    upheavals: Upheavals,
    donated: Arc<[Event]>,
    until: Option<Until>,
    panic_at: Option<PanicAt>,
    llm: Option<Arc<dyn Backend>>,
    stages: BTreeSet<Stage>,
    aided: bool,
}

impl AgentBuilder {
    /// What the agent goes by.
    pub fn settings(mut self, settings: Settings) -> Self {
        self.settings = settings;
        self
    }
    /// What it goes by from a signal on.
    pub fn then(mut self, then: Option<(Signal, Settings)>) -> Self {
        self.then = then;
        self
    }
    /// Seed of the draws that guessing makes.
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }
    /// Another lexicon than the one that ships inside the binary.
    pub fn lexicon(mut self, lexicon: Option<Lexicon>) -> Self {
        self.lexicon = lexicon;
        self
    }
    /// Where messages are written before they are handled.
    pub fn journal(mut self, journal: Arc<dyn Journal<Message>>) -> Self {
        self.journal = journal;
        self
    }
    /// Writes all of a run into a trace: messages, frames, changes of memory. One run for one trace.
    pub fn trace(mut self, trace: Option<Arc<Trace>>) -> Self {
        self.trace = trace;
        self
    }
    /// Wipes memory at an event, as a fault for tests.
    pub fn wipe_at(mut self, event: Option<FaultEvent>) -> Self {
        self.upheavals.wipe_at = event;
        self
    }
    /// Puts what another memory came to into this one's place at an event, as a fault for tests.
    pub fn transplant_at(mut self, event: Option<FaultEvent>, donated: Arc<[Event]>) -> Self {
        (self.upheavals.transplant_at, self.donated) = (event, donated);
        self
    }
    /// Ends each run at an event; see [`crate::report::Ending::Until`].
    pub fn until(mut self, until: Option<Until>) -> Self {
        self.until = until;
        self
    }
    /// Makes an actor panic, as a fault for tests.
    pub fn panic_at(mut self, panic_at: Option<PanicAt>) -> Self {
        self.panic_at = panic_at;
        self
    }
    /// Lets a language model read instructions; the rules read them without one, and where it fails.
    pub fn llm(mut self, llm: Option<Arc<dyn Backend>>) -> Self {
        self.llm = llm;
        self
    }
    /// What the model is asked for; to read instructions alone if this is not said.
    pub fn stages(mut self, stages: impl IntoIterator<Item = Stage>) -> Self {
        self.stages = stages.into_iter().collect();
        self
    }
    /// Leaves the model to itself if `false`, to measure what the aid is worth: see [`PlannerActor::aided`].
    pub fn aided(mut self, aided: bool) -> Self {
        self.aided = aided;
        self
    }
    /// The agent.
    pub fn build(mut self) -> Result<Agent, AgentError> {
        let later = self.then.iter().map(|(_, settings)| settings);
        if let Some((field, _)) = std::iter::once(&self.settings).chain(later).find_map(|all| all.tools.named().next())
        {
            return Err(AgentError::Tools(field));
        }
        let planner = self.lexicon.take().map_or_else(Planner::new, |lexicon| Ok(Planner::with_lexicon(lexicon)))?;
        Ok(Agent { parts: self, planner: Arc::new(planner) })
    }
}

/// An agent that can run episodes over one memory.
pub struct Agent {
    parts: AgentBuilder,
    planner: Arc<Planner>,
}

/// An episode's result with what it cost.
#[derive(Debug, Clone)]
pub struct EpisodeRun {
    /// What the agent says of it.
    pub report: EpisodeReport,
    /// Wall time that each actor's handlers took.
    pub spent: BTreeMap<Role, Duration>,
}

/// Asks a running episode to end.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<tokio::sync::Notify>);

impl Interrupt {
    /// Ends the episode: the robot is stopped, memory keeps all that was written.
    pub fn interrupt(&self) {
        self.0.notify_one();
    }
}

impl Agent {
    /// Begins an agent with a library and a memory.
    pub fn builder(library: Arc<TemplateLibrary>, memory: Box<dyn Memory>) -> AgentBuilder {
        AgentBuilder {
            library,
            memory: Arc::new(Mutex::new(memory)),
            settings: Settings::default(),
            then: None,
            seed: 0,
            lexicon: None,
            journal: Arc::new(NoJournal),
            trace: None,
            upheavals: Upheavals::default(),
            donated: Arc::default(),
            until: None,
            panic_at: None,
            llm: None,
            stages: BTreeSet::from([Stage::Parse]),
            aided: true,
        }
    }

    /// The memory that the agent writes.
    pub fn memory(&self) -> Arc<Mutex<Box<dyn Memory>>> {
        Arc::clone(&self.parts.memory)
    }

    /// Runs one episode. Must be called within a tokio runtime of at least two worker threads.
    pub async fn run(
        &self,
        task: TaskSpec,
        embodiment: Box<dyn Embodiment>,
        cameras: Box<dyn CameraSource>,
        clock: Box<dyn Clock>,
        interrupt: &Interrupt,
    ) -> Result<EpisodeRun, AgentError> {
        let camera = task.cameras.first().ok_or(AgentError::NoCamera)?.name.clone();
        let began = clock.now().0;
        let cameras = match &self.parts.trace {
            Some(trace) => {
                let memory = self.parts.memory.lock().unwrap_or_else(PoisonError::into_inner);
                trace.begin(&task, embodiment.description(), &**memory)?;
                trace.cameras(cameras)
            }
            None => cameras,
        };
        let outside = Arc::new(Mutex::new(Outside { embodiment, cameras, clock }));
        let robot = Arc::clone(&outside);
        let (end_calls, ending) = watch::channel(false);
        let mut system = self.system(task, camera, outside, ending).starts_at(began).start().await?;
        system.send(EPISODE, Message::Begin);
        let result = tokio::select! {
            biased;
            result = system.result(WALL_LIMIT) => result,
            () = interrupt.0.notified() => {
                // Not by message: the robot must stop even if its port has a queue or is ended before it comes to it.
                tokio::task::block_in_place(|| robot.lock().unwrap_or_else(PoisonError::into_inner).embodiment.stop());
                system.send(EPISODE, Message::Interrupt);
                end_calls.send_replace(true);
                system.result(WALL_LIMIT).await
            }
        };
        end_calls.send_replace(true);
        let spent = system.stop().await;
        match result? {
            Message::Ended(report) => Ok(EpisodeRun { report: *report, spent }),
            Message::ActorFailed { role, reason, .. } => {
                Err(SystemError::Ended(format!("the {role} actor failed: {reason}")).into())
            }
            other => Err(SystemError::Ended(format!("unexpected result {other:?}")).into()),
        }
    }

    fn system(
        &self,
        task: TaskSpec,
        camera: String,
        outside: Arc<Mutex<Outside>>,
        ending: watch::Receiver<bool>,
    ) -> SystemBuilder<Message> {
        let parts = &self.parts;
        let bus: Arc<dyn FrameBus<RgbdFrame>> = Arc::new(InProcessBus::new(BUS_FRAMES));
        let robot = outside.lock().unwrap_or_else(PoisonError::into_inner).embodiment.description().clone();
        let settings = Turning::new(parts.settings.clone(), parts.then.clone());
        let library = Arc::clone(&parts.library);
        let grounder =
            settings.clone().map(|settings| Arc::new(Grounder::new(Arc::clone(&library), settings.perception)));
        let seed = parts.seed;
        let options = settings.map(|settings| PlanOptions { on_unknown: settings.on_unknown, seed });
        let (memory, upheavals, until) = (Arc::downgrade(&parts.memory), parts.upheavals.clone(), parts.until);
        let donated = Arc::clone(&parts.donated);
        let planner = Arc::clone(&self.planner);
        let (frames, seen, kept) = (Arc::clone(&bus), Arc::clone(&bus), bus);
        let (eyes, hands, plans) = (robot.clone(), robot.clone(), robot);
        let journal: Arc<dyn Journal<Message>> = match &parts.trace {
            Some(trace) => Arc::new(Both(Arc::clone(trace) as Arc<dyn Journal<Message>>, Arc::clone(&parts.journal))),
            None => Arc::clone(&parts.journal),
        };
        let observer = parts.trace.clone().map(|trace| trace as Arc<dyn MemoryObserver>);
        let (llm, aided) = (parts.llm.clone(), parts.aided);
        let stages = llm.as_ref().map(|_| parts.stages.clone()).unwrap_or_default();
        let system = SystemBuilder::new(1, journal)
            .actor(EPISODE, Box::new(move || Box::new(Episode::new(task.clone(), upheavals.clone()).until(until))))
            .actor(
                HOST,
                Box::new(move || Box::new(HostPort::new(Arc::clone(&outside), camera.clone(), Arc::clone(&frames)))),
            )
            .actor(
                PERCEPTION,
                Box::new(move || Box::new(PerceptionActor::new(grounder.clone(), eyes.clone(), Arc::clone(&seen)))),
            )
            .actor(
                MEMORY,
                Box::new(move || {
                    let actor = MemoryActor::new(Weak::clone(&memory), Arc::clone(&kept)).donated(Arc::clone(&donated));
                    Box::new(actor.observed_by(observer.clone()))
                }),
            )
            .actor(
                PLANNER,
                Box::new(move || {
                    let (planner, library) = (Arc::clone(&planner), Arc::clone(&library));
                    Box::new(
                        PlannerActor::new(planner, library, plans.clone(), options.clone())
                            .asking(stages.clone())
                            .aided(aided),
                    )
                }),
            )
            .actor(EXECUTOR, Box::new(move || Box::new(ExecutorActor::new(hands.clone()))))
            .actor(VERIFIER, Box::new(|| Box::new(VerifierActor)))
            .notify(
                EPISODE,
                Box::new(|failure| Message::ActorFailed {
                    role: failure.role.0,
                    reason: failure.reason,
                    restarted: failure.restarted,
                }),
            )
            .panic_at(parts.panic_at);
        match llm {
            Some(llm) => system.actor(LLM, Box::new(move || Box::new(LlmPort::new(Arc::clone(&llm), ending.clone())))),
            None => system,
        }
    }
}
