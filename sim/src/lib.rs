//! The simulated world, its robots and mechanisms, scenario files, and the oracle that judges.
//!
//! A [`Scenario`] is read from a text file; a [`Simulation`] is one episode of it with one seed. The agent gets the
//! task, the robot, the cameras and the clock; the verdict, the truth and the preview are for whoever runs it.
//!
//! | module | holds |
//! |---|---|
//! | `scenario`, `model` | scenario files and object models: raw text to checked meaning |
//! | `random`, `layout` | seeded draws, start layouts, rejection |
//! | `world`, `body`, `gripper`, `contact` | the running physics: objects, mechanisms, the hand, what it feels |
//! | `event`, `slip` | what third parties do, and an injected mishap |
//! | `oracle`, `state` | the judge and its variables |
//! | `audit` | whether whatever happened had a cause |
//! | `snapshot` | all of it as bytes, and back |
//! | `episode`, `scene`, `report` | the handles, the picture, what is reported |
//!
//! Conventions: metres, seconds, newtons; world frame with z up; an object's base frame is the middle of its bottom.
//! The world advances only when the robot is commanded or the clock waits.

mod audit;
mod body;
mod contact;
mod convert;
mod episode;
mod event;
#[cfg(test)]
mod expert;
mod gripper;
mod layout;
mod model;
mod oracle;
mod profile;
mod random;
mod report;
mod scenario;
mod scene;
mod slip;
mod snapshot;
mod state;
mod world;

pub use audit::AuditReport;
pub use episode::{SharedRenderer, Simulation};
pub use layout::LayoutError;
pub use oracle::OracleVerdict;
pub use profile::PhysicsProfile;
pub use random::DrawError;
pub use report::{Preview, SimError, SimOptions, SimTimings, TrueObject};
pub use scenario::{MAX_SCENARIO_BYTES, Scenario, ScenarioError};
pub use snapshot::{Snapshot, SnapshotError};
