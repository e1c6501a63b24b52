//! The simulated world, its robots and mechanisms, scenario files, and the oracle that judges.
//!
//! A [`Scenario`] is read from a text file; a [`Simulation`] is one episode of it with one seed. The agent gets the
//! task, the robot, the cameras and the clock; the verdict, the truth and the preview are for whoever runs it.
//!
//! | module | holds |
//! |---|---|
//! | `scenario`, `model` | scenario files and object models: raw text to checked meaning |
//! | `random`, `layout`, `placed` | seeded draws, start layouts, rejection, how one copy is made |
//! | `world`, `body`, `articulation`, `contact` | the running physics: objects, their joints, what the pads touch |
//! | `robot` | robots as data: arms, wrists, hands, their limits and what they feel |
//! | `event`, `mishap` | what third parties do, and mishaps with what is carried |
//! | `fluent` | regions, named quantities and the rules that change them |
//! | `oracle`, `state` | the judge and its variables |
//! | `audit` | whether whatever happened had a cause |
//! | `snapshot` | all of it as bytes, and back |
//! | `surfaces`, `mechanism` | what a foreign object looks like, without a world; with its joints anywhere |
//! | `episode`, `scene`, `texture`, `truth`, `report` | the handles, the picture, the truth, what is reported |
//!
//! Conventions: metres, seconds, newtons; world frame with z up; an object's base frame is the middle of its bottom.
//! The world advances only when the robot is commanded or the clock waits.

mod articulation;
mod audit;
mod body;
mod contact;
mod convert;
mod derived;
mod episode;
mod event;
#[cfg(test)]
mod expert;
mod fluent;
mod layout;
mod mechanism;
mod mishap;
mod model;
mod oracle;
mod placed;
mod profile;
mod random;
mod report;
#[cfg(test)]
mod rmbench;
mod robot;
mod scenario;
mod scene;
#[cfg(test)]
mod shared_data;
mod snapshot;
mod state;
mod surfaces;
#[cfg(test)]
mod testbed;
mod texture;
mod truth;
mod world;

pub use audit::AuditReport;
pub use episode::{SharedRenderer, Simulation};
pub use layout::LayoutError;
pub use mechanism::{Mechanism, MechanismJoint};
pub use mishap::MishapKind;
pub use oracle::OracleVerdict;
pub use profile::PhysicsProfile;
pub use random::DrawError;
pub use report::{Preview, SimError, SimOptions, SimTimings};
pub use robot::RobotError;
pub use scenario::{MAX_SCENARIO_BYTES, Scenario, ScenarioError, Setting};
pub use snapshot::{Snapshot, SnapshotError};
pub use surfaces::{Surface, SurfacesError, surfaces};
pub use truth::{TrueJoint, TrueLink, TrueObject, TruePiece, TrueShape};
