//! Arms with joints: from where the hand shall be to where the joints must be.
//!
//! Primitives command the TCP and know no joints. [`Drive`] stands between them and the robot: it follows the commanded
//! TCP with the joints tick by tick, and plans long motions in joint space round what is perceived. All of it is pure:
//! random restarts and samples come from a fixed seed.
//!
//! | module | holds |
//! |---|---|
//! | `kinematics` | Jacobian, inverse kinematics with limits, redundancy and restarts |
//! | `scene` | what the arm must keep clear of, and how far a configuration is from it |
//! | `plan` | RRT-Connect and shortcuts |
//! | `timing` | time along a joint path within limits of speed and acceleration |
//! | `drive` | the running arm: follows, plans, refuses |
//! | `choice` | which of several arms takes a skill |

pub(crate) mod choice;
mod drive;
mod kinematics;
mod plan;
mod scene;
mod timing;

pub(crate) use drive::Drive;
pub(crate) use scene::Scene;
