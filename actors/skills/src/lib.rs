//! Primitives and the manipulation functions built from them, as pure controllers.
//!
//! A controller is a function from feedback to command with some memory of its own: it has no clock, no
//! randomness, no input or output, and knows no simulator. Whoever runs it performs each command for one control
//! tick of the robot and hands the new feedback back:
//!
//! ```
//! use acm_concept::{embodiment::{Embodiment, EmbodimentError}, skill::{SkillInvocation, SkillReport}};
//! use acm_skills::{Controller, Tick, start};
//!
//! fn execute(arm: &mut dyn Embodiment, invocation: &SkillInvocation) -> Result<SkillReport, Box<dyn std::error::Error>> {
//!     let mut controller = start(invocation, arm.description(), &arm.feedback())?;
//!     let mut feedback = arm.feedback();
//!     loop {
//!         match controller.tick(&feedback) {
//!             Tick::Act(command) => feedback = arm.command(&command)?,
//!             Tick::Finished(report) => return Ok(*report),
//!         }
//!     }
//! }
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`controller`] | [`start`], [`kinds`], what a controller is and why one cannot start |
//! | `functions` | the function kinds: sequences of primitives with what the hand felt |
//! | `primitives` | reach, grasp (with fingers or a cup), move, push, release: state machines with intermediate checks |
//! | [`retreat`](mod@retreat) | the motion home, so that the cameras see the table |
//! | `run` | performs a function primitive by primitive and writes the report |
//! | `arm` | for robots with joints: inverse kinematics, planning round what is perceived, which arm |
//! | `motion`, `descent`, `clearance`, `geometry`, `hand` | paths, guarded lowering, free space, frames, what the hand felt and was told |
//!
//! The hand works pointing down: the TCP's z axis along the world's -z.

mod arm;
mod clearance;
pub mod controller;
mod descent;
mod functions;
mod geometry;
mod hand;
mod motion;
mod primitives;
pub mod retreat;
mod run;

pub use controller::{Controller, StartError, Tick, kinds, start};
pub use retreat::{Retreat, RetreatTick, retreat};
