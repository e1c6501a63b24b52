//! The meaning of a scenario file: what the simulator builds, what the judge decides, what the agent is told.

use super::raw::{Color, RawPerturb, TextureKind};
use crate::{
    mishap::MishapKind,
    model::ObjectModel,
    random::{DrawSpec, StreamKind},
    robot::RobotModel,
};
use acm_concept::{
    camera::CameraModel,
    expression::Expression,
    task::{Budgets, Further},
};
use glam::DVec3;
use std::sync::Arc;

/// What the simulator builds.
#[derive(Debug, Clone)]
pub(crate) struct WorldSpec {
    pub(crate) surfaces: Vec<SurfaceSpec>,
    /// `None` for the usual lights.
    pub(crate) lighting: Option<LightSpec>,
    pub(crate) cameras: Vec<CameraSpec>,
    pub(crate) robot: RobotModel,
    pub(crate) stream: StreamKind,
    pub(crate) attempts: u32,
    pub(crate) draws: Vec<DrawSpec>,
    pub(crate) rejects: Vec<RejectSpec>,
    pub(crate) objects: Vec<ObjectSpec>,
    pub(crate) places: Vec<PlaceSpec>,
    pub(crate) events: Vec<EventSpec>,
    pub(crate) regions: Vec<RegionSpec>,
    pub(crate) fluents: Vec<FluentSpec>,
    pub(crate) rules: Vec<RuleSpec>,
    pub(crate) points: Vec<PointSpec>,
    pub(crate) derived: Vec<DerivedSpec>,
    pub(crate) mishaps: Vec<(MishapKind, u32)>,
}

#[derive(Debug, Clone)]
pub(crate) struct LightSpec {
    pub(crate) ambient: Expression,
    pub(crate) sun_direction: [Expression; 3],
    pub(crate) sun: Expression,
    /// Position and strength.
    pub(crate) points: Vec<([Expression; 3], Expression)>,
}

#[derive(Debug, Clone)]
pub(crate) struct RegionSpec {
    pub(crate) name: String,
    pub(crate) of: Option<Reference>,
    pub(crate) low: [Expression; 3],
    pub(crate) high: [Expression; 3],
}

#[derive(Debug, Clone)]
pub(crate) struct FluentSpec {
    pub(crate) name: String,
    pub(crate) start: Expression,
    /// Over all variables, per second.
    pub(crate) rate: Option<Expression>,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct RuleSpec {
    pub(crate) when: Expression,
    /// Index of the fluent and its new value.
    pub(crate) set: Vec<(usize, Expression)>,
}

/// A point that moves with an object.
#[derive(Debug, Clone)]
pub(crate) struct PointSpec {
    pub(crate) name: String,
    pub(crate) of: Reference,
    pub(crate) at: [Expression; 3],
}

/// A number that follows from other variables.
#[derive(Debug, Clone)]
pub(crate) struct DerivedSpec {
    pub(crate) name: String,
    pub(crate) is: Expression,
}

#[derive(Debug, Clone)]
pub(crate) struct SurfaceSpec {
    pub(crate) name: String,
    pub(crate) size: DVec3,
    pub(crate) position: DVec3,
    pub(crate) color: Color,
    pub(crate) friction: f64,
    pub(crate) support: bool,
    pub(crate) textures: Vec<TextureSpec>,
}

#[derive(Debug, Clone)]
pub(crate) struct TextureSpec {
    pub(crate) kind: TextureKind,
    pub(crate) color: Color,
    pub(crate) hue_deg: Option<Expression>,
    pub(crate) cell_m: Option<Expression>,
    pub(crate) when: Option<Expression>,
}

#[derive(Debug, Clone)]
pub(crate) struct CameraSpec {
    /// Nominal calibration.
    pub(crate) model: CameraModel,
    pub(crate) sensor: String,
    pub(crate) exposure: Expression,
}

#[derive(Debug, Clone)]
pub(crate) struct RejectSpec {
    pub(crate) rule: RejectRule,
    /// Index of the first draw that is drawn anew.
    pub(crate) redraw_from: usize,
    /// Index of the draw after which it looks at once; `None` for after the whole layout.
    pub(crate) after: Option<usize>,
}

/// What makes a layout unusable.
#[derive(Debug, Clone)]
pub(crate) enum RejectRule {
    Near { between: [String; 2], nearer_than_m: f64 },
    When(Expression),
}

#[derive(Debug, Clone)]
pub(crate) struct ObjectSpec {
    pub(crate) name: String,
    pub(crate) model: Arc<ObjectModel>,
    /// Of several models, which one it is made from, from 0.
    pub(crate) choice: Option<ModelChoice>,
    pub(crate) fixed: bool,
    /// Links, and where their joints start.
    pub(crate) starts: Vec<(usize, Expression)>,
    /// Lamps and gauges, and what they show instead of what the model says.
    pub(crate) shows: Vec<(String, Expression)>,
    pub(crate) count: Option<Expression>,
    pub(crate) position: [Expression; 3],
    pub(crate) yaw: Expression,
    pub(crate) on: Option<Reference>,
    pub(crate) scale: Option<[Expression; 3]>,
    pub(crate) hue_deg: Option<Expression>,
    pub(crate) textures: Vec<TextureSpec>,
    pub(crate) density_kg_m3: Option<Expression>,
    pub(crate) friction: Option<Expression>,
    pub(crate) perturb: Option<RawPerturb>,
}

/// Models of one object, of which each episode chooses one. None of them has joints or lamps.
#[derive(Debug, Clone)]
pub(crate) struct ModelChoice {
    pub(crate) models: Vec<Arc<ObjectModel>>,
    pub(crate) which: Expression,
}

/// A copy of an object; the index is `None` for one that has no copies.
#[derive(Debug, Clone)]
pub(crate) struct Reference {
    pub(crate) object: String,
    pub(crate) index: Option<Expression>,
}

#[derive(Debug, Clone)]
pub(crate) struct PlaceSpec {
    pub(crate) name: String,
    pub(crate) at: PlaceAt,
}

#[derive(Debug, Clone)]
pub(crate) enum PlaceAt {
    Object(Reference),
    CentroidOf(String),
    Position([Expression; 3]),
}

#[derive(Debug, Clone)]
pub(crate) struct EventSpec {
    pub(crate) name: String,
    pub(crate) after_s: f64,
    pub(crate) when: Option<Expression>,
    pub(crate) over_s: f64,
    pub(crate) deed: DeedSpec,
}

/// What a third party does.
#[derive(Debug, Clone)]
pub(crate) enum DeedSpec {
    Carry {
        object: Reference,
        to: [Expression; 3],
        yaw: Expression,
        lift_m: f64,
    },
    /// Indices of the cameras.
    Cover {
        cameras: Vec<usize>,
    },
    /// Index of the link whose joint it is.
    Jam {
        object: String,
        link: usize,
    },
    /// Indices of the cameras.
    Freeze {
        cameras: Vec<usize>,
    },
}

/// What the judge decides.
#[derive(Debug, Clone)]
pub(crate) struct JudgeSpec {
    pub(crate) moves: Vec<String>,
    pub(crate) strict: PredicateSpec,
    pub(crate) faithful: Option<PredicateSpec>,
}

#[derive(Debug, Clone)]
pub(crate) struct PredicateSpec {
    pub(crate) stages: Vec<StageSpec>,
    pub(crate) violations: Vec<ViolationSpec>,
}

#[derive(Debug, Clone)]
pub(crate) struct StageSpec {
    pub(crate) name: String,
    pub(crate) when: Expression,
    pub(crate) hold_s: f64,
    pub(crate) at_end: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct ViolationSpec {
    pub(crate) name: String,
    pub(crate) when: Expression,
    /// Index of the stage until which it counts.
    pub(crate) before: Option<usize>,
}

/// What the agent is told, but for the cameras.
#[derive(Debug, Clone)]
pub(crate) struct TaskTemplate {
    pub(crate) instruction: String,
    pub(crate) instruction_at_s: f64,
    pub(crate) budgets: Budgets,
    pub(crate) then: Vec<Further>,
}
