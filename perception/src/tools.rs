//! Tools that help perception: what finds, cuts out, names, places and measures things, behind one set of traits.
//!
//! Geometry is behind each of them ([`Geometric`]); a network, a server or a user's own code may be put beside it
//! (docs/perception-tools.md). A tool is asked about one frame at a time and answers with an [`Outcome`]: what it
//! found, a part of it, why it abstains, or how it failed. Nothing that a tool says is believed unchecked:
//! [`Tools`] asks, measures how long it took, and turns an answer that is late or makes no sense into a failure.
//!
//! | module | holds |
//! |---|---|
//! | `asked` | the traits and what a tool is told |
//! | `outcome`, `found` | what a tool answers, and the values in it |
//! | `check` | what an answer must keep to |
//! | `bundle` | the tools of one agent, and how they are asked |
//! | `geometric` | the pipeline's own steps behind the traits |
//! | [`conformance`] | what every implementation must pass |

pub mod conformance;

mod asked;
mod bundle;
mod check;
mod found;
mod geometric;
mod outcome;

pub use asked::{
    Detector, NoStopwatch, ParamEstimator, PartRecogniser, PartView, PoseEstimator, Prompts, Request, Segmenter,
    Stopwatch, Tool,
};
pub use bundle::{ToolCall, Tools};
pub use check::MAX_FOUND;
pub use found::{Detection, Mask, ParamBelief, PartHypothesis, PoseBelief};
pub use geometric::Geometric;
pub use outcome::{Answer, Gap, Identity, Outcome, Reason, ToolError, ToolMeta};
