//! The text of an object model, before its meaning is checked. The doc comments are the fields' documentation in the
//! JSON schema.

use crate::scenario::Color;
use acm_concept::{
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::Deserialize;

/// A kind of object that scenarios place. Its base frame lies at the middle of its bottom, z up.
///
/// It has a base, and links that move against it. Everything is written down in the base frame as it is when all
/// joints are at zero.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawModel {
    /// Name that scenario files refer to.
    pub(crate) model: String,
    /// What it is, one line.
    pub(crate) summary: String,
    /// Whether its base stands still whatever touches it. Default: false.
    #[serde(default)]
    pub(crate) fixed: bool,
    /// Density of its solids, kg/m3. Default: 700, a light wood.
    #[serde(default = "wood")]
    pub(crate) density_kg_m3: f64,
    /// Coulomb friction of its surface; a contact takes the mean of both surfaces, the gripper's pads excepted.
    /// Default: 0.5.
    #[serde(default = "half")]
    pub(crate) friction: f64,
    /// The solids of its base.
    pub(crate) solid: Vec<RawSolid>,
    /// What moves against the base or against another link.
    #[serde(default)]
    pub(crate) link: Vec<RawLink>,
}

/// A part that moves: a door, a drawer, a knob, a button's cap, a gauge's needle.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLink {
    /// Its name, and its joint's: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// The link that it hangs on, declared before it. Default: `base`.
    #[serde(default = "base")]
    pub(crate) parent: String,
    /// Its mass, kilograms. Default: from its density.
    #[serde(default)]
    pub(crate) mass_kg: Option<f64>,
    /// Density of its solids, kg/m3. Default: the model's.
    #[serde(default)]
    pub(crate) density_kg_m3: Option<f64>,
    /// Coulomb friction of its surface. Default: the model's.
    #[serde(default)]
    pub(crate) friction: Option<f64>,
    /// Its solids.
    pub(crate) solid: Vec<RawSolid>,
    /// How it hangs on its parent. Default: it is fixed to it.
    #[serde(default)]
    pub(crate) joint: Option<RawJoint>,
}

/// A joint of one freedom. Positions are radians for a hinge and metres for a slider, forces newton metres or
/// newtons.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawJoint {
    /// Whether it turns or slides.
    pub(crate) kind: RawJointKind,
    /// A point of a hinge's axis, metres. Default: the base frame's origin, which serves a slider.
    #[serde(default)]
    pub(crate) origin: [f64; 3],
    /// Direction of the axis. Need not have unit length.
    pub(crate) axis: [f64; 3],
    /// Smallest and largest position. Default: without end.
    #[serde(default)]
    pub(crate) range: Option<[f64; 2]>,
    /// Position at which it counts as closed. Default: zero, or the end of the range that is nearest to zero.
    #[serde(default)]
    pub(crate) closed: Option<f64>,
    /// Position at the start, if the scenario does not say otherwise. Default: as `closed`.
    #[serde(default)]
    pub(crate) start: Option<f64>,
    /// Dry friction. Default: 0.
    #[serde(default)]
    pub(crate) friction: f64,
    /// Damping: force per speed. Default: 0.
    #[serde(default)]
    pub(crate) damping: f64,
    /// A spring.
    #[serde(default)]
    pub(crate) spring: Option<RawSpring>,
    /// A catch at the closed position.
    #[serde(default)]
    pub(crate) latch: Option<RawLatch>,
    /// Positions in which it rests.
    #[serde(default)]
    pub(crate) detents: Option<RawDetents>,
    /// Counts presses.
    #[serde(default)]
    pub(crate) press: Option<RawPress>,
    /// The joint of another link, declared before it, that moves this one.
    #[serde(default)]
    pub(crate) follows: Option<RawFollows>,
    /// A gauge: what it shows is an expression over the object's own variables, such as `door_open * 1.5`. A
    /// scenario can give another one, over all of the judge's variables. An empty text waits for the scenario's.
    #[serde(default)]
    pub(crate) shows: Option<String>,
}

/// Whether a link turns or slides.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RawJointKind {
    /// It turns about the axis.
    Hinge,
    /// It slides along the axis.
    Slider,
}

/// A spring that pulls the joint to a position.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawSpring {
    /// Force per position.
    pub(crate) stiffness: f64,
    /// Where it pulls to. Default: 0.
    #[serde(default)]
    pub(crate) rest: f64,
    /// Force with which it already presses against the stop there. Default: 0.
    #[serde(default)]
    pub(crate) preload: f64,
}

/// A catch, magnetic or with a ball: it holds the joint closed, and takes hold again when the joint comes back.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLatch {
    /// Force that it takes to leave the closed position, besides friction.
    pub(crate) force: f64,
    /// It holds while the joint is nearer to closed than this, and draws it in again from there.
    pub(crate) within: f64,
}

/// Positions in which a joint rests, such as those of a knob.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawDetents {
    /// Force that it takes to leave one, besides friction.
    pub(crate) force: f64,
    /// The positions. Either these or `every`.
    #[serde(default)]
    pub(crate) at: Vec<f64>,
    /// The positions are the multiples of this.
    #[serde(default)]
    pub(crate) every: Option<f64>,
}

/// A counter that counts once per stroke.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPress {
    /// It is pressed once the joint is farther from closed than this.
    pub(crate) pressed: f64,
    /// It is ready for the next press once the joint is nearer to closed than this.
    pub(crate) rearmed: f64,
}

/// A joint that another one moves, as a burner's flame follows its knob. What follows does not push back.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawFollows {
    /// The link whose joint moves this one.
    pub(crate) joint: String,
    /// Position of this one for a position of the other.
    pub(crate) ratio: f64,
    /// Position of this one when the other is at zero. Default: 0.
    #[serde(default)]
    pub(crate) offset: f64,
}

/// A solid of an object model.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, tag = "shape", rename_all = "kebab-case")]
pub(crate) enum RawSolid {
    /// A cuboid.
    Box {
        /// Edge lengths along x, y, z, metres.
        size: [f64; 3],
        /// Its centre in the base frame, metres.
        position: [f64; 3],
        /// Heading about z, degrees. Default: 0.
        #[serde(default)]
        yaw_deg: f64,
        /// Turn about its own y axis after the heading, degrees: positive lowers its +x end. Default: 0.
        #[serde(default)]
        tilt_deg: f64,
        /// Colour.
        color: Color,
        /// Whether its colour shows something.
        #[serde(default)]
        lamp: Option<RawLamp>,
    },
    /// A cylinder about z.
    Cylinder {
        /// Radius, metres.
        radius: f64,
        /// Full height, metres.
        height: f64,
        /// Its centre in the base frame, metres.
        position: [f64; 3],
        /// Direction of its axis. Default: z.
        #[serde(default = "up")]
        axis: [f64; 3],
        /// Colour.
        color: Color,
        /// Whether its colour shows something.
        #[serde(default)]
        lamp: Option<RawLamp>,
    },
}

/// A solid whose colour shows something: its own colour for 0, the first of `colors` for 1, and so on.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLamp {
    /// Name by which a scenario gives it another expression.
    pub(crate) name: String,
    /// The colours.
    pub(crate) colors: Vec<Color>,
    /// Expression over the object's own variables, such as `door_open > 0.1`. Default: none, it waits for the
    /// scenario's.
    #[serde(default)]
    pub(crate) shows: Option<String>,
}

fn wood() -> f64 {
    700.0
}
fn half() -> f64 {
    0.5
}
fn base() -> String {
    "base".into()
}
fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

impl RawSolid {
    /// The solid in the base frame; `None` if a cylinder's axis has no direction.
    pub(super) fn placed(&self) -> Option<PlacedSolid> {
        Some(match *self {
            RawSolid::Box { size, position, yaw_deg, tilt_deg, .. } => PlacedSolid {
                solid: Solid::Box { size: size.into() },
                pose: Pose::from_yaw(position.into(), yaw_deg.to_radians())
                    * Pose::new(DVec3::ZERO, DQuat::from_rotation_y(tilt_deg.to_radians())),
            },
            RawSolid::Cylinder { radius, height, position, axis, .. } => {
                let axis = DVec3::from(axis).try_normalize()?;
                let turn = DQuat::from_rotation_arc(DVec3::Z, axis);
                PlacedSolid { solid: Solid::Cylinder { radius, height }, pose: Pose::new(position.into(), turn) }
            }
        })
    }
    pub(super) fn color(&self) -> Color {
        match *self {
            RawSolid::Box { color, .. } | RawSolid::Cylinder { color, .. } => color,
        }
    }
    pub(super) fn lamp(&self) -> Option<&RawLamp> {
        match self {
            RawSolid::Box { lamp, .. } | RawSolid::Cylinder { lamp, .. } => lamp.as_ref(),
        }
    }
}
