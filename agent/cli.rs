//! The command line and its exit codes.

#[cfg(feature = "learned")]
pub mod learn;
pub mod memory;
pub mod trace;

use crate::{
    bench,
    bench::{perception::PerceptionPart, planner::PlannerPart, rmbench::Block, world::WorldPart},
    config, demo, doctor,
    inject::Injection,
    library,
    llm::{self, LlmId},
    perceive, run, scenario, serve,
};
use acm_actors::{
    AgentError,
    episode::Until,
    remote::{Address, FrameMode},
    settings::Stage,
    trace::FrameDetail,
};
use acm_sim::Setting;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::{path::PathBuf, process::ExitCode, str::FromStr};

/// How the process ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// 0: success; for a range of seeds, all solved.
    Success,
    /// 1: failed.
    Failed,
    /// 2: unusable input.
    Unusable,
    /// 3: the agent gave up honestly; for a range, none failed but some gave up.
    GaveUp,
    /// 130: interrupted.
    Interrupted,
}

impl Exit {
    /// The process's exit code.
    pub fn code(self) -> u8 {
        match self {
            Exit::Success => 0,
            Exit::Failed => 1,
            Exit::Unusable => 2,
            Exit::GaveUp => 3,
            Exit::Interrupted => 130,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit.code())
    }
}

/// Analytic concept-centric memory: an agent runtime for robots that must remember.
#[derive(Debug, Parser)]
#[command(name = "acm", version, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scenario with the agent and let the judge decide.
    Run(RunArgs),
    /// Tell the story of one episode, then of the same robot without its memory.
    Demo(DemoArgs),
    /// Ground real RGB-D frames into objects with identities; no simulator.
    Perceive(PerceiveArgs),
    /// List, check, describe or draw scenarios.
    #[command(subcommand)]
    Scenario(ScenarioCommand),
    /// List the templates in this program, or draw them.
    Library(LibraryArgs),
    /// Run the simulator in a process of its own.
    #[command(subcommand)]
    Sim(SimCommand),
    /// Ask, check, export and forget what a memory folder holds.
    #[command(subcommand)]
    Memory(memory::MemoryCommand),
    /// Look into the traces that `acm run --trace` writes.
    #[command(subcommand)]
    Trace(trace::TraceCommand),
    /// Measure figures and print them beside what they are to reach.
    #[command(subcommand)]
    Bench(BenchCommand),
    /// Train the learned estimator of template parameters, and compare it with the geometric one.
    #[cfg(feature = "learned")]
    #[command(subcommand)]
    Learn(learn::LearnCommand),
    /// The other process of a bench: takes frames and says when.
    #[command(hide = true)]
    BenchReader(BenchReaderArgs),
    /// List the language models of a configuration, or try them.
    #[command(subcommand)]
    Llm(LlmCommand),
    /// Show or check a configuration file.
    #[command(subcommand)]
    Config(ConfigCommand),
    /// Say what this machine has of what ACM needs.
    Doctor,
}

/// The verbs of `acm llm`.
#[derive(Debug, Subcommand)]
pub enum LlmCommand {
    /// The language models of a configuration: where they are, which key they need, at which stages they are asked.
    List(LlmListArgs),
    /// Ask one language model, or all, a tiny question: is the schema heeded, are images taken, what does it cost.
    Check(LlmCheckArgs),
}

/// Arguments of `acm llm list`.
#[derive(Debug, Args)]
pub struct LlmListArgs {
    /// The configuration; ./acm.toml if not given and there.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm llm check`.
#[derive(Debug, Args)]
pub struct LlmCheckArgs {
    /// A backend of the configuration; all of them if not given.
    pub id: Option<String>,
    /// The configuration; ./acm.toml if not given and there.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// The verbs of `acm config`.
#[derive(Debug, Subcommand)]
pub enum ConfigCommand {
    /// Print all that holds, defaults included, as such a file.
    Show {
        /// The configuration; ./acm.toml if not given and there.
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
    /// Say whether a file is sound, and which variables it names that are not set. Nobody is asked.
    Check {
        /// The file; ./acm.toml if not given.
        file: Option<PathBuf>,
    },
}

/// One seed or a range that includes both ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seeds {
    /// First seed.
    pub first: u64,
    /// Last seed, included.
    pub last: u64,
    /// Whether a range was written, even one of a single seed.
    pub range: bool,
}

impl FromStr for Seeds {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            text.parse::<u64>().map_err(|e| format!("`{text}` is not a seed ({e}): write 7, or 0..49 with both ends"))
        };
        let Some((first, last)) = text.split_once("..") else {
            let seed = number(text)?;
            return Ok(Seeds { first: seed, last: seed, range: false });
        };
        let (first, last) = (number(first)?, number(last.strip_prefix('=').unwrap_or(last))?);
        if first > last || last - first >= 1_000_000 {
            return Err(format!("the range {first}..{last} must rise and hold at most 1,000,000 seeds"));
        }
        Ok(Seeds { first, last, range: true })
    }
}

/// What the agent does when memory cannot decide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OnUnknownArg {
    /// Give up and say what is not known.
    Abstain,
    /// Draw one of the candidates.
    Guess,
}

impl From<OnUnknownArg> for acm_concept::task::OnUnknown {
    fn from(arg: OnUnknownArg) -> Self {
        match arg {
            OnUnknownArg::Abstain => acm_concept::task::OnUnknown::Abstain,
            OnUnknownArg::Guess => acm_concept::task::OnUnknown::Guess,
        }
    }
}

/// Arguments of `acm run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// A scenario's name (`acm scenario list`) or a scenario file; a file that exists goes first.
    #[arg(required_unless_present = "robot")]
    pub scenario: Option<String>,
    /// Run on the robot that a host at this address has (tcp://HOST:PORT or unix:///PATH); it sets the task.
    #[arg(long, value_name = "URL", conflicts_with_all = ["scenario", "sensor"])]
    pub robot: Option<Address>,
    /// How frames come from that robot: auto, shared-memory, inline.
    #[arg(long, value_name = "WAY", default_value = "auto", requires = "robot")]
    pub frames: FrameMode,
    /// End the run at an event: instruction.
    #[arg(long, value_name = "EVENT")]
    pub until: Option<Until>,
    /// A seed, or a range A..B that includes both ends.
    #[arg(long, default_value = "0")]
    pub seed: Seeds,
    /// The memory: acm, or another one to compare with, such as reactive (docs/rmbench.md lists them).
    #[arg(long, default_value = "acm")]
    pub method: String,
    /// What to do when memory cannot decide: abstain if neither this nor the configuration says.
    #[arg(long, value_enum)]
    pub on_unknown: Option<OnUnknownArg>,
    /// What the agent goes by and which language models there are: a TOML file such as acm.example.toml; ./acm.toml if
    /// not given and there.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The language model that is asked: rules (none), scripted=FILE, replay=FILE, or a backend of the configuration
    /// (docs/llm.md). If not given, the variable ACM_LLM names it, else the configuration.
    #[arg(long, value_name = "ID")]
    pub llm: Option<LlmId>,
    /// What it is asked for: parse (to read the instruction), select (to choose among several ways), reflect (to go on
    /// after a failure). If not given, what the configuration says, else parse.
    #[arg(long, value_name = "STAGE,...", value_delimiter = ',')]
    pub llm_stages: Option<Vec<Stage>>,
    /// Give this instruction instead of the scenario's own.
    #[arg(long)]
    pub instruction: Option<String>,
    /// Keep memory in this folder, and go on with what it holds.
    #[arg(long, value_name = "DIR")]
    pub memory: Option<PathBuf>,
    /// Template files instead of the built-in library.
    #[arg(long, value_name = "DIR")]
    pub library: Option<PathBuf>,
    /// A fault: black-frames, freeze-frames, misplaced-frame@N, misplaced-frame@N:MM, wipe-memory@EVENT,
    /// transplant-memory=DIR@EVENT, slip@N, drop@N. May be given more than once.
    #[arg(long, value_name = "FAULT")]
    pub inject: Vec<Injection>,
    /// Refuse every motion, as on a robot that must not move.
    #[arg(long)]
    pub no_motion: bool,
    /// Another sensor profile than the scenario's: none, d435, d435-hard.
    #[arg(long, value_name = "PROFILE")]
    pub sensor: Option<String>,
    /// Set a field of the scenario otherwise, as in robot.model=panda. May be given more than once.
    #[arg(long, value_name = "PATH=VALUE", conflicts_with = "robot")]
    pub set: Vec<Setting>,
    /// Write every message, effect and change of memory into this MCAP file. Of a range, or in a folder, each run has
    /// a file of its own.
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// What the trace keeps of each frame beside its hash: full, thumbnail or hash.
    #[arg(long, value_name = "DETAIL", default_value = "thumbnail")]
    pub trace_frames: FrameDetail,
    /// Draw the episode into this GIF: what is seen, what is remembered, what is planned. One seed only.
    #[arg(long, value_name = "FILE.gif")]
    pub video: Option<PathBuf>,
    /// Show how the run goes on while it does: on a terminal a block that is drawn anew, elsewhere a line for each
    /// message worth telling. With --json on standard error.
    #[arg(long)]
    pub live: bool,
    /// Print the results as JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

impl RunArgs {
    /// The words that start this run again, but for its seed, its memory and what it leaves: runs that may be compared
    /// seed by seed have the same. `llm` is the model that is asked, and `stages` for what, whoever has said so.
    pub fn words(&self, llm: &LlmId, stages: &[Stage]) -> Vec<String> {
        let mut words: Vec<String> = self.scenario.iter().cloned().collect();
        let mut option = |name: &str, value: Option<String>| {
            words.extend(value.into_iter().flat_map(|value| [format!("--{name}"), value]));
        };
        let path = |path: &PathBuf| path.display().to_string();
        option("robot", self.robot.as_ref().map(ToString::to_string));
        option("until", self.until.map(|until| until.to_string()));
        option("method", Some(self.method.clone()));
        let on_unknown = self.on_unknown.and_then(|on_unknown| on_unknown.to_possible_value());
        option("on-unknown", on_unknown.map(|value| value.get_name().to_owned()));
        option("llm", (*llm != LlmId::Rules).then(|| llm.to_string()));
        let names = || stages.iter().map(|stage| stage.name()).collect::<Vec<_>>().join(",");
        option("llm-stages", (*llm != LlmId::Rules && *stages != [Stage::Parse]).then(names));
        option("instruction", self.instruction.clone());
        option("library", self.library.as_ref().map(path));
        self.inject.iter().for_each(|fault| option("inject", Some(fault.to_string())));
        option("sensor", self.sensor.clone());
        self.set.iter().for_each(|setting| option("set", Some(setting.to_string())));
        words.extend(self.no_motion.then(|| "--no-motion".to_owned()));
        words
    }
}

/// Arguments of `acm demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// The episode's seed.
    #[arg(long, default_value_t = 7)]
    pub seed: u64,
    /// Where the demo leaves its page, its traces and its memory.
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    pub out: PathBuf,
    /// Most further seeds; fewer are run where more would not fit into the minute.
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub more_seeds: u64,
    /// Also write four pictures of the story, with captions, into this file (.png or .jpg).
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
}

/// Arguments of `acm perceive`.
#[derive(Debug, Args)]
pub struct PerceiveArgs {
    /// Colour image: 8-bit PNG. May be given more than once, with as many --depth, for several frames in order.
    #[arg(long, value_name = "FILE", requires = "depth", required_unless_present = "frames")]
    pub color: Vec<PathBuf>,
    /// Depth image registered to the colour: 16-bit grey PNG of the same size, 0 where nothing was measured.
    #[arg(long, value_name = "FILE", requires = "color")]
    pub depth: Vec<PathBuf>,
    /// A folder of frames instead: STEM_color.png beside STEM_depth.png (or with `-` or `.` for the `_`), taken in
    /// the order of their names, numbers in them by value.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["color", "depth"])]
    pub frames: Option<PathBuf>,
    /// fx,fy,cx,cy in pixels; the centre of the upper left pixel is 0,0.
    #[arg(long, value_name = "FX,FY,CX,CY", allow_hyphen_values = true)]
    pub intrinsics: String,
    /// Metres per unit of the depth image.
    #[arg(long, value_name = "M", default_value_t = 0.001, allow_hyphen_values = true)]
    pub depth_scale: f64,
    /// Pose of the camera (x right, y down, z ahead) in a world whose z is up, for all frames: metres and a unit
    /// quaternion. Without a pose the plane is z = 0, x the camera's right, the origin under the camera.
    #[arg(long, value_name = "X,Y,Z,QX,QY,QZ,QW", allow_hyphen_values = true)]
    pub camera_pose: Option<String>,
    /// A text file with a line `STEM x y z qx qy qz qw` for every frame; `#` begins a comment.
    #[arg(long, value_name = "FILE", conflicts_with = "camera_pose")]
    pub camera_poses: Option<PathBuf>,
    /// What perception goes by: a TOML file with `[perception]` and `[tools]`, such as `[tools]` with
    /// `segmenter = "http://127.0.0.1:8765"` (docs/perception-tools.md).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Keep what is seen in this memory folder, and go on with what it holds.
    #[arg(long, value_name = "DIR")]
    pub memory: Option<PathBuf>,
    /// Draw outlines, ids, sizes and fitted solids over the colour image: a PNG for one frame; for several, or with
    /// --frames, a folder that receives STEM_overlay.png.
    #[arg(long, value_name = "PATH")]
    pub overlay: Option<PathBuf>,
    /// Write a 16-bit PNG with one value an object, 0 for the background: a file, or a folder that receives
    /// STEM_label.png.
    #[arg(long, value_name = "PATH")]
    pub labels: Option<PathBuf>,
    /// Print JSON (docs/perceive.md) instead of text.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `acm library`.
#[derive(Debug, Args)]
pub struct LibraryArgs {
    /// Groups to list, such as core or kitchen; all if none is named.
    pub groups: Vec<String>,
    /// Write library.md and a picture of each template below this folder instead.
    #[arg(long, value_name = "DIR", conflicts_with = "groups")]
    pub gallery: Option<PathBuf>,
}

/// The verbs of `acm scenario`.
#[derive(Debug, Subcommand)]
pub enum ScenarioCommand {
    /// Names and summaries of the scenarios in this program.
    List,
    /// Check a scenario file.
    Check {
        /// The file, or a scenario's name.
        file: String,
    },
    /// The JSON schema of scenario files, with every field described.
    Schema,
    /// Count how many different start worlds the seeds of a scenario give.
    Worlds {
        /// A scenario's name or file.
        file: String,
        /// The seeds: a range A..B that includes both ends.
        #[arg(long, value_name = "SEEDS", default_value = "0..99")]
        seed: Seeds,
    },
    /// Draw the initial world as the agent's main camera sees it.
    Preview {
        /// A scenario's name or file.
        file: String,
        /// The seed.
        #[arg(long, default_value_t = 0)]
        seed: u64,
        /// Set a field of the scenario otherwise, as in robot.model=panda. May be given more than once.
        #[arg(long, value_name = "PATH=VALUE")]
        set: Vec<Setting>,
        /// The PNG to write.
        #[arg(short, long, value_name = "PNG")]
        out: PathBuf,
        /// Also print what is where (the simulator's truth, which no agent sees).
        #[arg(long)]
        info: bool,
    },
}

/// The verbs of `acm sim`.
#[derive(Debug, Subcommand)]
pub enum SimCommand {
    /// Host a scenario's world for `acm run --robot`, until it is interrupted. The world stays between agents.
    Serve(ServeArgs),
}

/// Arguments of `acm sim serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// A scenario's name (`acm scenario list`) or a scenario file; a file that exists goes first.
    pub scenario: String,
    /// The world's seed.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Where to listen: tcp://HOST:PORT (port 0 takes a free one) or unix:///PATH. There is no password.
    #[arg(long, value_name = "URL", default_value = "tcp://127.0.0.1:7400")]
    pub listen: Address,
    /// Another sensor profile than the scenario's: none, d435, d435-hard.
    #[arg(long, value_name = "PROFILE")]
    pub sensor: Option<String>,
    /// Set a field of the scenario otherwise, as in robot.model=panda. May be given more than once.
    #[arg(long, value_name = "PATH=VALUE")]
    pub set: Vec<Setting>,
    /// How frames go to the agent: auto, shared-memory, inline.
    #[arg(long, value_name = "WAY", default_value = "auto")]
    pub frames: FrameMode,
    /// A fault of the world: slip@N or drop@N.
    #[arg(long, value_name = "FAULT")]
    pub inject: Vec<Injection>,
    /// Refuse every motion.
    #[arg(long)]
    pub no_motion: bool,
}

/// The exit code of an error: most are unusable input, a failed agent is a failure.
pub fn exit_of_error(error: &anyhow::Error) -> Exit {
    match error.downcast_ref::<AgentError>() {
        Some(AgentError::System(_)) => Exit::Failed,
        _ => Exit::Unusable,
    }
}

/// The benches.
#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// The same episodes with one language model after another, and with one that errs at a given rate.
    Ablation(AblationArgs),
    /// Real labelled frames and foreign meshes (found through the variable ACM_DATA), and rendered tables with their truth.
    Perception(PerceptionArgs),
    /// Who is who when a scene is seen again: identical things in a row, and household rooms (found through the variable
    /// ACM_DATA), beside the paper's rule.
    Identity(BenchArgs),
    /// Goals of published tasks (found through the variable ACM_DATA): solved or not, each plan simulated.
    Planner(PlannerArgs),
    /// The engine under memory at 1e4, 1e5 and 1e6 objects: questions, commits, recovery, power failures, forgetting.
    Memory(MemoryArgs),
    /// Memories side by side on the tasks of RMBench: two judges, intervals, one page. What was run is kept and gone on with.
    Rmbench(RmbenchArgs),
    /// Frames between processes, messages between actors, what a trace costs, how fast an actor is replaced.
    Runtime(BenchArgs),
    /// Physics beside MuJoCo, grasps, primitives, rendering, pace, physics audit, snapshots.
    World(WorldArgs),
}

/// Arguments of every bench.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Most episodes or frames; all that there are if not given.
    #[arg(long, value_name = "N")]
    pub episodes: Option<usize>,
    /// A tenth of the repetitions: to see that it works, not to compare.
    #[arg(long)]
    pub quick: bool,
    /// Write the result, with all rows, into this file.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Compare with the targets of this file instead of the built-in ones.
    #[arg(long, value_name = "FILE")]
    pub against: Option<PathBuf>,
}

/// Arguments of `acm bench ablation`.
#[derive(Debug, Args)]
pub struct AblationArgs {
    /// What every bench takes; the episodes are those of each scenario with each backend.
    #[command(flatten)]
    pub common: BenchArgs,
    /// Language models, as `acm run --llm` names them.
    #[arg(long, value_name = "ID,...", value_delimiter = ',', default_value = "rules")]
    pub backends: Vec<LlmId>,
    /// What they are asked for; parse if not given.
    #[arg(long, value_name = "STAGE,...", value_delimiter = ',')]
    pub llm_stages: Option<Vec<Stage>>,
    /// The configuration; ./acm.toml if not given and there.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Scenarios; all of this program if not given.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub scenarios: Vec<String>,
    /// The first seed.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed_from: u64,
    /// The memory.
    #[arg(long, default_value = "acm")]
    pub method: String,
    /// Shares of wrong answers of a model that errs; 0, 0.1, 0.3 and 0.6 if not given.
    #[arg(long, value_name = "SHARE,...", value_delimiter = ',')]
    pub rates: Option<Vec<f64>>,
    /// Leave out the model that errs.
    #[arg(long)]
    pub no_degradation: bool,
}

/// Arguments of `acm bench rmbench`.
#[derive(Debug, Args)]
pub struct RmbenchArgs {
    /// What every bench takes; the episodes are those that this call runs at most, the others stay for the next one.
    #[command(flatten)]
    pub common: BenchArgs,
    /// Where results and pictures are kept, and what is gone on with.
    #[arg(long, value_name = "DIR", default_value = "out/rmbench")]
    pub out: PathBuf,
    /// Tasks; the nine that are scored if not given.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub tasks: Vec<String>,
    /// Memories (docs/rmbench.md); all if not given.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub memories: Vec<String>,
    /// What they do when they cannot decide.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "abstain,guess")]
    pub on_unknown: Vec<OnUnknownArg>,
    /// Blocks of seeds: development (from 0), published (from 100000), fresh (from --fresh-from).
    #[arg(long, value_name = "BLOCK,...", value_enum, value_delimiter = ',', default_value = "published")]
    pub blocks: Vec<Block>,
    /// Seeds of each block; 100 if not given.
    #[arg(long, value_name = "N")]
    pub seeds: Option<u64>,
    /// First seed of the fresh block.
    #[arg(long, value_name = "N", default_value_t = 110_000)]
    pub fresh_from: u64,
    /// Also the jittered variant of every task.
    #[arg(long)]
    pub jittered: bool,
    /// Also run acm on so many seeds of each task with frames that are all black.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub black_frames: u64,
    /// Another robot than the tasks' own, such as dual-panda.
    #[arg(long, value_name = "MODEL")]
    pub robot: Option<String>,
    /// Another sensor profile than the tasks' own: none, d435, d435-hard.
    #[arg(long, value_name = "PROFILE")]
    pub sensor: Option<String>,
    /// Episodes at a time; as many as there are processors if not given.
    #[arg(long, value_name = "N")]
    pub workers: Option<usize>,
    /// The page with all tables; page.html beside the results if not given.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
}

/// Arguments of `acm bench memory`.
#[derive(Debug, Args)]
pub struct MemoryArgs {
    /// What every bench takes.
    #[command(flatten)]
    pub common: BenchArgs,
    /// Draw cost against the number of objects into this file.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// What `scripts/seeded_bugs.py --json FILE` found, to stand beside the other figures.
    #[arg(long, value_name = "FILE")]
    pub defects: Option<PathBuf>,
}

/// Arguments of `acm bench perception`.
#[derive(Debug, Args)]
pub struct PerceptionArgs {
    /// What every bench takes.
    #[command(flatten)]
    pub common: BenchArgs,
    /// Measure these parts alone, in this order.
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_enum)]
    pub only: Vec<PerceptionPart>,
    /// Draw every rendered scene into this folder: what was reported, red outlines of the truth, what became of each thing.
    #[arg(long, value_name = "DIR")]
    pub pictures: Option<PathBuf>,
    /// Draw the rendered scenes from this seed on instead of the suite's own: to work on others than are reported.
    #[arg(long, value_name = "N")]
    pub seed_from: Option<u64>,
}

/// Arguments of `acm bench planner`.
#[derive(Debug, Args)]
pub struct PlannerArgs {
    /// What every bench takes.
    #[command(flatten)]
    pub common: BenchArgs,
    /// Measure these parts alone, in this order.
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_enum)]
    pub only: Vec<PlannerPart>,
}

/// Arguments of `acm bench world`.
#[derive(Debug, Args)]
pub struct WorldArgs {
    /// What every bench takes.
    #[command(flatten)]
    pub common: BenchArgs,
    /// Measure these parts alone, in this order.
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_enum)]
    pub only: Vec<WorldPart>,
}

/// Arguments of the other process of a bench.
#[derive(Debug, Args)]
pub struct BenchReaderArgs {
    /// `bus` or `socket`.
    pub way: String,
    /// Name of the bus, or path of the socket.
    pub name: String,
}

/// Performs a command.
pub fn run(cli: Cli) -> anyhow::Result<Exit> {
    match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Perceive(args) => perceive::run(&args),
        Command::Scenario(command) => scenario::run(&command),
        Command::Library(args) => library::run(&args),
        Command::Sim(SimCommand::Serve(args)) => serve::run(&args),
        Command::Memory(command) => crate::memory::run(&command),
        Command::Trace(command) => crate::trace::run(&command),
        Command::Bench(command) => bench::run(&command),
        #[cfg(feature = "learned")]
        Command::Learn(command) => crate::learn::run(&command),
        Command::BenchReader(args) => bench::runtime::peer::run(&args),
        Command::Llm(LlmCommand::List(args)) => llm::list::run(&args),
        Command::Llm(LlmCommand::Check(args)) => llm::check::run(&args),
        Command::Config(command) => config::run(&command),
        Command::Doctor => doctor::run(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_include_both_ends() {
        assert_eq!("3..5".parse(), Ok(Seeds { first: 3, last: 5, range: true }));
        assert_eq!("8".parse(), Ok(Seeds { first: 8, last: 8, range: false }));
        assert!("5..3".parse::<Seeds>().is_err() && "x".parse::<Seeds>().is_err());
    }

    #[test]
    fn the_command_line_is_well_formed() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
