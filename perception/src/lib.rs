//! RGB-D frames, nominal calibration and the memory's expectation in; grounded analytic concepts with uncertainty out.
//!
//! Geometry first, without learned weights: the support plane is found; of what rises above it known things are fitted where
//! memory expects them, and what they do not explain is cut into segments; flat patches are found by colour; the templates of
//! the library are fitted to each by robust least squares.
//! [`Grounder::ground`] never fails: a frame that cannot be read is an ordinary answer with a [`Blindness`] and no
//! objects.
//!
//! | module | holds |
//! |---|---|
//! | [`config`], [`grounder`] | thresholds; the whole pipeline |
//! | [`frames`], [`level`](mod@level) | colour and depth files; the camera pose over the dominant plane when none is known |
//! | `scan`, `support`, `scene`, `own` | pixels to points, the plane and its extent, heights, the robot's own pixels |
//! | `segments`, `joins`, `parting`, `patches` | what stands on the plane, put together and cut by what it is; what lies in it |
//! | `frozen` | a camera that has stopped |
//! | `measure`, `fit`, `hypotheses` | first guesses, template fits, the choice among templates |
//! | `reading` | digits, marks, lamps and needles on things |
//! | [`given`] | first guess and fit of things whose pixels are given |
//! | `expected`, `raster` | the comparison with memory's expectation, ray-cast |
//! | [`articulation`] | joints of parts that moved between two frames |
//! | [`tools`] | tools that help: traits, the geometric default, what every implementation must pass |
//! | [`overlay`], [`labels`], [`metrics`] | pictures for a person, label images, segmentation scores |
//!
//! [`Blindness`]: acm_concept::object::Blindness

pub mod articulation;
pub mod config;
pub mod frames;
pub mod given;
pub mod grounder;
pub mod labels;
pub mod level;
pub mod metrics;
pub mod overlay;
pub mod tools;

mod expected;
mod fit;
mod frozen;
mod gather;
mod grid;
mod hypotheses;
mod joins;
mod measure;
mod own;
mod parting;
mod patches;
mod raster;
mod reading;
mod scan;
mod scene;
mod segments;
mod support;
mod surface_tint;

pub use config::GrounderConfig;
pub use frozen::LastPictures;
pub use grounder::{Assisted, AssistedGrounder, Grounder};
pub use level::level;
