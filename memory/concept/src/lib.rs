//! The vocabulary of ACM, without any input or output.
//!
//! An object is a set of parts; a part is a parametric template with parameters, a pose, affordances and
//! manipulation functions (paper, section "Analytic concept representation"). Every other crate speaks in
//! these words and nothing here knows a simulator, a file system, an actor or a network.
//!
//! | module | holds |
//! |---|---|
//! | [`ids`], [`time`], [`pose`], [`color`] | readable ids, virtual time, rigid motions, appearance |
//! | [`solid`], [`mesh`], [`expression`], [`template`] | solids and their triangles, expressions over parameters, the template library |
//! | [`object`] | grounded parts and objects as perception reports them |
//! | [`reading`] | marks, lamps and needles as they are read from pixels |
//! | [`literal`] | state literals and three-valued truth |
//! | [`camera`], [`plane`] | frames and their pixels, calibration |
//! | [`embodiment`], [`arm`] | what a real arm takes and reports, its joints and limits; the traits of the outside world |
//! | [`primitive`], [`skill`] | the nine primitives, skill invocations and their reports |
//! | [`expectation`], [`task`] | what memory expects to be seen; what the agent is told of its task |
//!
//! Conventions everywhere: metres, radians, seconds, newtons; world frame with z up; camera frames with x
//! right, y down, z forward.

pub mod arm;
pub mod camera;
pub mod color;
mod convert;
pub mod embodiment;
pub mod expectation;
pub mod expression;
pub mod ids;
pub mod literal;
pub mod mesh;
pub mod object;
pub mod plane;
pub mod pose;
pub mod primitive;
pub mod reading;
pub mod skill;
pub mod solid;
pub mod suggest;
pub mod task;
pub mod template;
pub mod time;
