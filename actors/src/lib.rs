//! The typed messages, the five actors of ACM and the episode loop that joins them.
//!
//! ```text
//! episode -look-> memory -expected-> perception -capture-> host
//!    ^                |                   ^---- frame ----'
//!    |                '<--- percepts -----'
//!    |-- updated view
//!    |-verify-> verifier -verdict-> episode -settle-> memory
//!    |-decide-> planner  -decided-> episode
//!    '-execute-> executor <-command/moved-> host;  executor -skill-ended-> episode -record-> memory
//! ```
//!
//! One request is in flight at a time, so the order of messages is total and a run can be repeated. The actors
//! are pure cores (see [`acm_runtime::core`]); only the [`host`] port touches a camera, a clock or a robot, and only the
//! [`llm`] port asks a model.
//!
//! | module | holds |
//! |---|---|
//! | [`agent`] | the builder that puts an agent together, and one episode's run |
//! | [`message`] | every message between the actors |
//! | [`settings`] | what an agent goes by |
//! | [`trace`] | all of a run in one file |
//! | [`replay`] | the world of a recorded run |
//! | [`report`] | what an episode came to |
//! | [`episode`] | the closed loop (the paper's Algorithm 1) |
//! | [`perception`], [`memory`], [`planner`], [`executor`], [`verifier`] | the five actors |
//! | [`host`] | the port to the outside world |
//! | [`llm`] | the port to a language model, where one is used |
//! | [`tools`] | perception's tools in other processes |
//! | [`remote`] | an outside world in another process |

pub mod agent;
pub mod episode;
pub mod executor;
pub mod host;
pub mod llm;
pub mod memory;
pub mod message;
pub mod perception;
pub mod planner;
pub mod remote;
pub mod replay;
pub mod report;
pub mod settings;
pub mod tools;
pub mod trace;
pub mod verifier;

pub use agent::{Agent, AgentBuilder, AgentError};
