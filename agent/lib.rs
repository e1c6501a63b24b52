//! Composition of ACM: the only place that names both the agent and the simulator.
//!
//! | module | holds |
//! |---|---|
//! | [`cli`] | the command line and its exit codes |
//! | [`config`] | what the agent goes by, as a file |
//! | [`episode`] | one episode: simulator, agent, judge |
//! | [`run`] | `acm run`: one episode told, or a range of seeds counted |
//! | [`remote`] | `acm run --robot`: an episode on a robot in another process |
//! | [`serve`] | `acm sim serve`: the simulator as such a robot |
//! | [`inject`] | faults that can be put between the agent and its world |
//! | [`llm`] | which language model reads instructions, if any |
//! | [`memory`] | `acm memory`: asks, checks, exports and forgets what a memory folder holds |
//! | [`narrate`] | the story of an episode, told from its messages |
//! | [`live`] | how a run goes on, while it does |
//! | [`demo`] | `acm demo`: the first minute |
//! | [`perceive`] | `acm perceive`: real frames, no simulator |
//! | [`mod@bench`] | `acm bench`: figures beside what they are to reach |
//! | `learn` | `acm learn`: the learned estimator (feature `learned`) |
//! | [`tools`] | the tools of perception that a user names, opened |
//! | [`scenario`], [`library`], [`doctor`] | `acm scenario`, `acm library`, `acm doctor` |
//! | [`trace`] | `acm trace`: a run written down, and looked into |
//! | [`video`] | `acm run --video`: an episode as moving pictures |
//! | [`embed`] | what the pages of `acm demo` and `acm trace` have in common |
//! | [`words`] | words for what memory holds |
//! | [`statistics`] | proportions with intervals |

pub mod bench;
pub mod cli;
pub mod config;
pub mod demo;
pub mod doctor;
pub mod embed;
pub mod episode;
pub mod inject;
#[cfg(feature = "learned")]
pub mod learn;
pub mod library;
pub mod live;
pub mod llm;
pub mod memory;
pub mod narrate;
pub mod perceive;
pub mod remote;
pub mod run;
pub mod scenario;
pub mod serve;
pub mod statistics;
pub mod tools;
pub mod trace;
pub mod video;
pub mod words;
