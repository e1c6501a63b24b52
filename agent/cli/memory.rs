//! Arguments of `acm memory`.

use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

/// The verbs of `acm memory`.
#[derive(Debug, Subcommand)]
pub enum MemoryCommand {
    /// Count what a memory folder holds.
    Stats {
        /// The folder.
        dir: PathBuf,
        /// Print JSON instead of text.
        #[arg(long)]
        json: bool,
    },
    /// Find objects that fit a description, best first.
    Query(QueryArgs),
    /// Say why each hit ranked where it did, and which filter dropped each near miss.
    Explain(QueryArgs),
    /// Tell what was known of an object, change by change.
    History {
        /// The folder.
        dir: PathBuf,
        /// The object, such as O3.
        object: String,
        /// Print JSON instead of text.
        #[arg(long)]
        json: bool,
    },
    /// Say what each skill rests on: executions, conditions, and how its parameters follow from geometry.
    Skills {
        /// The folder.
        dir: PathBuf,
        /// Only this one, such as S2.
        #[arg(long, value_name = "SKILL")]
        skill: Option<String>,
        /// Print JSON instead of text.
        #[arg(long)]
        json: bool,
    },
    /// Tell how everything was at a moment, as it was known at another.
    At(AtArgs),
    /// Forget objects, regions, sources, or what a policy names, so that no byte of them stays in the folder.
    Forget(ForgetArgs),
    /// Take two identities for one thing; what was seen last is believed.
    Merge {
        /// The folder.
        dir: PathBuf,
        /// The identity that stays, such as O3: the one that was known first has its whole past.
        kept: String,
        /// The one that goes.
        gone: String,
    },
    /// Take an identity for two things: since a moment it was another one.
    Split {
        /// The folder.
        dir: PathBuf,
        /// The identity, such as O3.
        object: String,
        /// Since when: the run's number and seconds in it, as in 2:31.5.
        since: String,
    },
    /// Undo a merge or a split.
    Undo {
        /// The folder.
        dir: PathBuf,
        /// Its number, as `merge` and `split` printed it.
        number: u32,
    },
    /// Write the log anew without what nobody asks for any more; what is believed stays.
    Compact {
        /// The folder.
        dir: PathBuf,
        /// How everything was in so many last runs can still be asked for; of earlier ones only what is believed now.
        #[arg(long, value_name = "N", default_value_t = 1)]
        keep_runs: u32,
    },
    /// Read every byte, check it, and fold the log anew.
    Verify {
        /// The folder.
        dir: PathBuf,
    },
    /// Write what is remembered in a form that others read.
    Export {
        /// The folder.
        dir: PathBuf,
        /// The form.
        #[arg(long, value_enum)]
        format: ExportFormat,
        /// The file to write.
        #[arg(short, long, value_name = "FILE")]
        out: PathBuf,
    },
}

/// Forms of export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// One JSON object a line: every event, then every object as it is now.
    Jsonl,
    /// Tables as SQL text: `sqlite3 memory.db < FILE`.
    Sql,
    /// A PDDL problem: objects and the facts that are known to hold.
    Pddl,
    /// A scene graph as JSON that spark_dsg loads.
    SparkDsg,
    /// A picture of the scene graph.
    Svg,
}

/// A description of objects.
#[derive(Debug, Args)]
pub struct QueryArgs {
    /// The folder.
    pub dir: PathBuf,
    /// Any of these categories, or a kind of one.
    #[arg(long, value_name = "WORD")]
    pub category: Vec<String>,
    /// Has a part of this template.
    #[arg(long, value_name = "WORD")]
    pub template: Vec<String>,
    /// Affords this.
    #[arg(long, value_name = "WORD")]
    pub affordance: Vec<String>,
    /// This state is known to hold, or with `not:` before it known not to hold.
    #[arg(long, value_name = "[not:]WORD")]
    pub state: Vec<String>,
    /// Is in this region.
    #[arg(long, value_name = "WORD")]
    pub region: Option<String>,
    /// Rank by nearness to this place, metres.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub near: Option<String>,
    /// Nothing farther from that place than this, metres.
    #[arg(long, value_name = "M", requires = "near")]
    pub within: Option<f32>,
    /// Stands in a relation to an object, as in on:O3; `on*:O3` over any number of steps.
    #[arg(long, value_name = "RELATION:OBJECT")]
    pub related: Vec<String>,
    /// A number lies between bounds, as in opening:0.1..0.5.
    #[arg(long, value_name = "WORD:LOW..HIGH")]
    pub number: Vec<String>,
    /// At least this sure to exist as described.
    #[arg(long, value_name = "P")]
    pub min_confidence: Option<f32>,
    /// How many hits.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub most: usize,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// A moment, and when it was known.
#[derive(Debug, Args)]
pub struct AtArgs {
    /// The folder.
    pub dir: PathBuf,
    /// The moment: the run's number and seconds in it, as in 2:31.5.
    pub valid: String,
    /// As it was known then; now if not given.
    #[arg(long, value_name = "RUN:SECONDS")]
    pub known: Option<String>,
    /// Print JSON instead of text.
    #[arg(long)]
    pub json: bool,
}

/// What to forget.
#[derive(Debug, Args)]
pub struct ForgetArgs {
    /// The folder.
    pub dir: PathBuf,
    /// An object, such as O3.
    #[arg(long, value_name = "OBJECT")]
    pub object: Vec<String>,
    /// A region, with every object that was ever in it.
    #[arg(long, value_name = "WORD")]
    pub region: Vec<String>,
    /// Everything that a source said, such as `camera head`, with the objects that it spoke of.
    #[arg(long, value_name = "WORD")]
    pub source: Vec<String>,
    /// Objects that were last seen so many runs ago, or longer.
    #[arg(long, value_name = "RUNS")]
    pub older_than: Option<u32>,
    /// All objects but so many, those that were seen last.
    #[arg(long, value_name = "N")]
    pub keep: Option<usize>,
    /// Objects that are less likely than this to exist as described.
    #[arg(long, value_name = "P")]
    pub below: Option<f64>,
    /// Say what would be forgotten, and forget nothing.
    #[arg(long)]
    pub dry_run: bool,
}
