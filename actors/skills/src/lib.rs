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
//! | `primitives` | the nine (a grasp with fingers or a cup): state machines with intermediate checks |
//! | [`retreat`](mod@retreat) | the motion home, so that the cameras see the table |
//! | `run`, `sequence` | perform a function primitive by primitive and write the report; a function as a list of steps |
//! | `arm` | for robots with joints: inverse kinematics, planning round what is perceived, which arm |
//! | `motion`, `advance` | paths, guarded motion |
//! | `approach`, `clearance` | approaches from any side and from above, free space |
//! | `articulation` | joints of doors and drawers, fitted to the way of the hand |
//! | `geometry`, `hand` | frames, what the hand felt and was told |

mod advance;
mod approach;
mod arm;
mod articulation;
mod clearance;
pub mod controller;
mod functions;
mod geometry;
mod hand;
mod motion;
mod primitives;
pub mod retreat;
mod run;
mod sequence;

pub use controller::{Controller, StartError, Tick, kinds, required_arguments, start};
pub use retreat::{Retreat, RetreatTick, retreat};
