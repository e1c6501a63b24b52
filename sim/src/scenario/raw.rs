//! The text of a scenario file, before its meaning is checked. The doc comments are the fields' documentation in
//! the JSON schema.

mod fluent;

pub(crate) use fluent::{RawDerived, RawFluent, RawPoint, RawRegion, RawRule};

use crate::{mishap::MishapKind, model::RawModel, random::StreamKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A number, or an expression over named draws such as `"0.1 + radius * cos(phase + TAU * i / n)"`.
///
/// Operators: `+ - * / ^`, `< <= > >=` (1 or 0), `&& ||`, `min(a, b)`, `max(a, b)`, `abs sqrt sin cos floor round`
/// and the usual functions; constants `PI`, `TAU`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Number {
    /// A plain number.
    Plain(f64),
    /// An expression.
    Expression(String),
}

/// A colour as `"#rrggbb"`, 8-bit sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub(crate) struct Color(pub(crate) [u8; 3]);

impl TryFrom<String> for Color {
    type Error = String;
    fn try_from(text: String) -> Result<Color, String> {
        let wrong = || format!("`{text}` is not a colour: write it like `#rrggbb`");
        let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii()).ok_or_else(wrong)?;
        let channel = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).map_err(|e| format!("{}: {e}", wrong()));
        Ok(Color([channel(0)?, channel(2)?, channel(4)?]))
    }
}
impl From<Color> for String {
    fn from(Color([r, g, b]): Color) -> String {
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}

/// A scenario: the world, what is random in it, what the agent is told, and how the outcome is judged.
///
/// Metres, seconds, newtons; angles in degrees where the field says so, else in radians. World frame with z up.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawScenario {
    /// Name of the scenario, lower case with dashes.
    pub(crate) scenario: String,
    /// What it is about, one line.
    pub(crate) summary: String,
    /// What the agent is told.
    pub(crate) task: RawTask,
    /// Bodies that never move: tables, walls.
    pub(crate) surface: Vec<RawSurface>,
    /// Lights; the default is ambient 0.5, a sun of 0.5 along (0, 0.5, -1) and points of 1 at (1, 0, 1.8) and
    /// (-1, 0, 1.8).
    #[serde(default)]
    pub(crate) light: Option<RawLight>,
    /// Cameras; the first is the main one.
    pub(crate) camera: Vec<RawCamera>,
    /// The robot.
    #[serde(default)]
    pub(crate) robot: RawRobot,
    /// What is random, drawn in the order of the file.
    #[serde(default)]
    pub(crate) random: Option<RawRandom>,
    /// Object models of this file alone, besides those that ship with the simulator.
    #[serde(default)]
    pub(crate) model: Vec<RawModel>,
    /// The objects.
    #[serde(default)]
    pub(crate) object: Vec<RawObject>,
    /// Named points of the start layout, for rejection rules and for the judge: `NAME_x`, `NAME_y`, `NAME_z`.
    #[serde(default)]
    pub(crate) place: Vec<RawPlace>,
    /// What third parties do.
    #[serde(default)]
    pub(crate) event: Vec<RawEvent>,
    /// Boxes in space of which is known what is in them.
    #[serde(default)]
    pub(crate) region: Vec<RawRegion>,
    /// Quantities that are not poses: temperatures, counters, timers.
    #[serde(default)]
    pub(crate) fluent: Vec<RawFluent>,
    /// What changes fluents.
    #[serde(default)]
    pub(crate) rule: Vec<RawRule>,
    /// Points that move with objects: `NAME_x`, `NAME_y`, `NAME_z` are variables of the judge.
    #[serde(default)]
    pub(crate) point: Vec<RawPoint>,
    /// Numbers that follow from the judge's variables, under names of their own.
    #[serde(default)]
    pub(crate) derived: Vec<RawDerived>,
    /// What goes wrong in every episode.
    #[serde(default)]
    pub(crate) fault: Vec<RawFault>,
    /// How the outcome is judged. Never shown to the agent.
    pub(crate) judge: RawJudge,
}

/// What the agent is told.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawTask {
    /// The instruction in plain language.
    pub(crate) instruction: String,
    /// Other wordings of the same instruction.
    #[serde(default)]
    pub(crate) paraphrases: Vec<String>,
    /// When the instruction is given, seconds; until then the agent watches. Default: 0.
    #[serde(default)]
    pub(crate) instruction_at_s: f64,
    /// Limits of the episode.
    pub(crate) budgets: RawBudgets,
    /// Instructions that are given in the same run, each after the agent is done with the one before.
    #[serde(default)]
    pub(crate) then: Vec<RawThen>,
}

/// A further instruction. It is given once the agent is done with the one before it, and has the task's budgets anew.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawThen {
    /// The instruction in plain language.
    pub(crate) instruction: String,
    /// How long the agent watches before it is given, seconds. Default: 0.
    #[serde(default)]
    pub(crate) after_s: f64,
}

/// Limits of the episode.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawBudgets {
    /// Simulated seconds after the instruction.
    pub(crate) seconds: f64,
    /// Skills that may be executed.
    pub(crate) skills: u32,
    /// Frames that may be perceived.
    pub(crate) frames: u32,
}

/// A fixed box.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawSurface {
    /// Name, for messages.
    pub(crate) name: String,
    /// Edge lengths along x, y, z, metres.
    pub(crate) size: [f64; 3],
    /// Its centre, metres.
    pub(crate) position: [f64; 3],
    /// Colour.
    pub(crate) color: Color,
    /// Coulomb friction. Default: 0.5.
    #[serde(default = "half")]
    pub(crate) friction: f64,
    /// Whether objects may be set down on its top. Default: false.
    #[serde(default)]
    pub(crate) support: bool,
    /// Patterns painted over its colour: the first whose `when` holds. Default: none.
    #[serde(default)]
    pub(crate) texture: Vec<RawTexture>,
}

/// A pattern of a second colour, as on a tiled table or on printed card.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawTexture {
    /// Its form.
    pub(crate) kind: TextureKind,
    /// The second colour.
    pub(crate) color: Color,
    /// Hue of the second colour, degrees, its saturation and brightness kept. Default: its own.
    #[serde(default)]
    pub(crate) hue_deg: Option<Number>,
    /// Edge of a cell, metres, 0.001 to 1. Default: 0.03.
    #[serde(default)]
    pub(crate) cell_m: Option<Number>,
    /// Condition over draws. Default: it always holds.
    #[serde(default)]
    pub(crate) when: Option<String>,
}

/// The form of a pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum TextureKind {
    /// Squares, every other one painted.
    Checker,
    /// Bands, every other one painted.
    Stripes,
    /// Squares, one in six painted, irregularly.
    Speckle,
}

/// Lights.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLight {
    /// Light that reaches every surface alike, 0-1. This and the other numbers of lights can use plain draws.
    pub(crate) ambient: Number,
    /// Direction in which the sun's light travels.
    pub(crate) sun_direction: [Number; 3],
    /// Strength of the sun.
    pub(crate) sun: Number,
    /// Lights at points, without shadows.
    #[serde(default)]
    pub(crate) point: Vec<RawPointLight>,
}

/// A light at a point.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPointLight {
    /// Where, metres.
    pub(crate) position: [Number; 3],
    /// Strength at 1 m.
    pub(crate) intensity: Number,
}

/// An RGB-D camera.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawCamera {
    /// Name.
    pub(crate) name: String,
    /// Where it is, metres; on the hand, in the frame of the tool centre point.
    pub(crate) position: [f64; 3],
    /// Direction of view. Need not have unit length.
    pub(crate) forward: [f64; 3],
    /// Direction of the image's left edge.
    pub(crate) left: [f64; 3],
    /// Image width, pixels. Default: 640.
    #[serde(default = "width")]
    pub(crate) width: u32,
    /// Image height, pixels. Default: 480.
    #[serde(default = "height")]
    pub(crate) height: u32,
    /// Full vertical opening angle, degrees.
    pub(crate) fov_y_deg: f64,
    /// Smallest depth that is measured, metres. Default: 0.2.
    #[serde(default = "depth_min")]
    pub(crate) depth_min_m: f64,
    /// Largest depth that is measured, metres. Default: 6.
    #[serde(default = "depth_max")]
    pub(crate) depth_max_m: f64,
    /// Name of the sensor profile. Default: `d435`, with per-episode bias.
    #[serde(default = "d435")]
    pub(crate) sensor: String,
    /// What carries it: `world`, where it stands still, or `hand`. Default: `world`.
    #[serde(default)]
    pub(crate) mount: RawMount,
    /// Factor by which its colours are too bright; can use plain draws. Default: 1.
    #[serde(default = "one")]
    pub(crate) exposure: Number,
}

/// What carries a camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RawMount {
    /// It stands still.
    #[default]
    World,
    /// It moves with the hand.
    Hand,
}

/// The robot that has the task.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RawRobot {
    /// Its model: `floating-gripper` (a two-finger hand on a wrist of limited force), `floating-suction` (the same with a
    /// suction cup), `panda`, `panda-suction` (a 7-joint arm with either), `dual-panda` (two arms with a hand each).
    pub(crate) model: String,
    /// Where the tool centre point of a hand without an arm waits, metres; the hand looks down. Default: above the back of
    /// the table. An arm waits where its model says.
    pub(crate) home: Option<[f64; 3]>,
    /// Corners of the workspace box, smallest and largest coordinates, metres. Default: the model's.
    pub(crate) workspace: Option<[[f64; 3]; 2]>,
}

impl Default for RawRobot {
    fn default() -> Self {
        RawRobot { model: "floating-gripper".into(), home: None, workspace: None }
    }
}

/// What is random.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRandom {
    /// The generator. It is seeded with the episode's seed.
    pub(crate) stream: StreamKind,
    /// How often rejected layouts are drawn anew before the scenario is given up. Default: 1000.
    #[serde(default = "attempts")]
    pub(crate) attempts: u32,
    /// Named draws, made in the order of the file. Expressions after a draw can use its name.
    #[serde(default)]
    pub(crate) draw: Vec<RawDraw>,
    /// Layouts that are drawn anew.
    #[serde(default)]
    pub(crate) reject: Vec<RawReject>,
}

/// A named draw. Where `count`, or a permutation's `of`, is a plain number, the single values are plain draws too, under
/// `NAME_0`, `NAME_1` and so on.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, tag = "kind", rename_all = "kebab-case")]
pub(crate) enum RawDraw {
    /// Uniform between two bounds.
    Uniform {
        /// Name.
        name: String,
        /// Lower bound.
        low: Number,
        /// Upper bound.
        high: Number,
        /// Draw a list of so many values.
        #[serde(default)]
        count: Option<Number>,
    },
    /// Normally distributed.
    Normal {
        /// Name.
        name: String,
        /// Mean. Default: 0.
        #[serde(default = "zero")]
        mean: Number,
        /// Standard deviation. Default: 1.
        #[serde(default = "one")]
        deviation: Number,
        /// Draw a list of so many values.
        #[serde(default)]
        count: Option<Number>,
    },
    /// A whole number, both ends included.
    Integer {
        /// Name.
        name: String,
        /// Smallest value.
        low: Number,
        /// Largest value.
        high: Number,
        /// Draw a list of so many values.
        #[serde(default)]
        count: Option<Number>,
    },
    /// One of a list of numbers.
    Choice {
        /// Name.
        name: String,
        /// The numbers.
        from: Vec<f64>,
        /// Draw a list of so many values.
        #[serde(default)]
        count: Option<Number>,
    },
    /// A random order of 0, 1, ... `of` - 1.
    Permutation {
        /// Name.
        name: String,
        /// How many.
        of: Number,
    },
    /// No draw, but a number that follows from the draws before it.
    Value {
        /// Name.
        name: String,
        /// Expression over plain draws before it.
        is: Number,
    },
}

/// Layouts in which two things are too near each other, or in which a condition holds, are drawn anew.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawReject {
    /// Two names of objects or places. The same name twice: any two copies of that object.
    #[serde(default)]
    pub(crate) between: Option<[String; 2]>,
    /// Smallest gap between their solids, metres. Goes with `between`.
    #[serde(default)]
    pub(crate) nearer_than_m: Option<f64>,
    /// A condition over plain draws and places, instead of `between`.
    #[serde(default)]
    pub(crate) when: Option<String>,
    /// The draw from which on all is drawn anew. Default: the first.
    #[serde(default)]
    pub(crate) redraw_from: Option<String>,
    /// The draw after which `when` is looked at, before the next draw is made; it can then use the plain draws up to that
    /// one, and no places. So the loops of another program that draws until something fits are met number by number.
    /// Default: after the whole layout.
    #[serde(default)]
    pub(crate) after: Option<String>,
}

/// An object, or several alike.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawObject {
    /// Name: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// Its model: one that ships with the simulator, or one of this file. Either this, `models` or `model_file`.
    #[serde(default)]
    pub(crate) model: Option<String>,
    /// Several models, of which each episode takes the one with the number `which`. They have neither joints nor lamps.
    #[serde(default)]
    pub(crate) models: Vec<String>,
    /// Number of the model in `models`, from 0: an expression over draws.
    #[serde(default)]
    pub(crate) which: Option<Number>,
    /// A URDF or MJCF file instead: a path relative to this file, or `data:` and a path below the folder that the
    /// variable `ACM_DATA` names. `#BODY` after an MJCF file takes one of its bodies.
    #[serde(default)]
    pub(crate) model_file: Option<String>,
    /// How many copies. In a copy's expressions `i` is its number from 0, `n` the count, and the name of a list of
    /// draws stands for the list's value at `i`.
    #[serde(default)]
    pub(crate) count: Option<Number>,
    /// Where its base frame is (the middle of its bottom), metres; with `on`, relative to the top of that object.
    #[serde(default)]
    pub(crate) position: Option<[Number; 3]>,
    /// Heading, radians; with `on`, relative to that object. Default: 0.
    #[serde(default)]
    pub(crate) yaw: Option<Number>,
    /// The object that it stands on, declared before this one.
    #[serde(default)]
    pub(crate) on: Option<RawReference>,
    /// Factors by which sizes and places of its solids are stretched along its axes; angles stay. Default: 1.
    #[serde(default)]
    pub(crate) scale: Option<[Number; 3]>,
    /// Positions of its joints at the start, by name, radians or metres. Default: the model's.
    #[serde(default)]
    pub(crate) joints: BTreeMap<String, Number>,
    /// What its lamps and gauges show, by name: expressions over the judge's variables. Default: the model's.
    #[serde(default)]
    pub(crate) shows: BTreeMap<String, String>,
    /// Whether its base stands still whatever touches it. Default: the model's.
    #[serde(default)]
    pub(crate) fixed: Option<bool>,
    /// Hue of its colours, degrees (0 red, 120 green, 240 blue), their saturation and brightness kept. Default: the
    /// model's own.
    #[serde(default)]
    pub(crate) hue_deg: Option<Number>,
    /// Patterns painted over its colours: the first whose `when` holds. Default: none.
    #[serde(default)]
    pub(crate) texture: Vec<RawTexture>,
    /// Density of its solids instead of the model's, kg/m3, 1 to 25000.
    #[serde(default)]
    pub(crate) density_kg_m3: Option<Number>,
    /// Coulomb friction of its surface instead of the model's, 0 to 2.
    #[serde(default)]
    pub(crate) friction: Option<Number>,
    /// Deviations of single copies from the model, drawn from a stream of their own.
    #[serde(default)]
    pub(crate) perturb: Option<RawPerturb>,
}

/// An object, or one copy of several.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawReference {
    /// Name of the object.
    pub(crate) object: String,
    /// Which copy, from 0. Default: 0.
    #[serde(default)]
    pub(crate) index: Option<Number>,
}

/// A joint of an object that has no copies.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawJointReference {
    /// Name of the object.
    pub(crate) object: String,
    /// Name of the joint.
    pub(crate) joint: String,
}

/// How far real copies differ from their model.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPerturb {
    /// Share of the copies that differ, 0-1. Default: 0.3.
    #[serde(default = "third")]
    pub(crate) share: f64,
    /// Every edge length changes by up to this much, metres, at most 0.01. Default: 0.0015.
    #[serde(default = "jitter")]
    pub(crate) size_m: f64,
    /// Width of the bevel at the edges of boxes, metres, at most 0.01. Default: 0.001.
    #[serde(default = "bevel")]
    pub(crate) bevel_m: f64,
}

/// A named point of the start layout.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPlace {
    /// Name: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// The base frame of an object.
    #[serde(default)]
    pub(crate) of: Option<RawReference>,
    /// The mean of all copies of an object.
    #[serde(default)]
    pub(crate) centroid_of: Option<String>,
    /// A point, metres.
    #[serde(default)]
    pub(crate) position: Option<[Number; 3]>,
}

/// A third party carries an object from where it is to another place, or covers or freezes cameras, or jams a joint for a
/// while.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawEvent {
    /// Name, for messages.
    pub(crate) name: String,
    /// Happens this long after the start, or after `when` first holds, seconds. Default: 0.
    #[serde(default)]
    pub(crate) after_s: f64,
    /// Condition over the judge's variables that starts the timer. Default: the start of the episode.
    #[serde(default)]
    pub(crate) when: Option<String>,
    /// What is carried.
    #[serde(default)]
    pub(crate) carry: Option<RawReference>,
    /// Names of the cameras that are covered instead: their frames are black and without depth, so that what happens
    /// meanwhile is not seen.
    #[serde(default)]
    pub(crate) cover: Vec<String>,
    /// Names of the cameras that stop instead: for as long as it takes they go on delivering their last picture.
    #[serde(default)]
    pub(crate) freeze: Vec<String>,
    /// A joint that sticks instead: for as long as it takes it stays where it is, whoever pulls.
    #[serde(default)]
    pub(crate) jam: Option<RawJointReference>,
    /// Where the base frame of what is carried comes to stand, metres. Expressions can use places and plain draws.
    #[serde(default)]
    pub(crate) to: Option<[Number; 3]>,
    /// Its heading there, radians. Default: 0.
    #[serde(default)]
    pub(crate) yaw: Option<Number>,
    /// How long it takes, seconds: 0.02 to 600, or 0 for at once, as what slips out of a hand. Default: 1.
    #[serde(default = "one_f64")]
    pub(crate) over_s: f64,
    /// How high it is lifted on the way, metres. Default: 0.1.
    #[serde(default = "lift")]
    pub(crate) lift_m: f64,
}

/// Something that goes wrong with what the hand carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawFault {
    /// What goes wrong.
    pub(crate) kind: MishapKind,
    /// During which carry, counted from 1. Default: 1.
    #[serde(default = "first")]
    pub(crate) at_carry: u32,
}

/// How the outcome is judged, over the world's true state after every physics step.
///
/// Variables: for every object without `count`: `NAME_x`, `NAME_y`, `NAME_z` (base frame, metres), `NAME_speed`
/// (m/s), `NAME_spin` (rad/s), `NAME_tilt` (rad from upright), `NAME_yaw` (rad, the turn about z that is left when the tilt is
/// undone), `NAME_moved` (metres from its start), `NAME_turned`
/// (rad from its first heading), `NAME_touched` (pads in contact with it); for each of its joints `NAME_JOINT`
/// (position, rad or m), `NAME_JOINT_speed`, `NAME_JOINT_open` (0 closed to 1 wide open; 0 for one that turns without
/// end), with a latch `NAME_JOINT_latched` (1 or 0), with a press counter `NAME_JOINT_pressed` (1 or 0) and
/// `NAME_JOINT_presses` (count); of its first press counter also `NAME_pressed`, `NAME_presses`, `NAME_depth`;
/// `PLACE_x`, `PLACE_y`, `PLACE_z`; `REGION_has_NAME`, `REGION_count`; `POINT_x`, `POINT_y`, `POINT_z`; fluents and derived numbers
/// under their names; `others_moved`
/// (metres, the most that any object not listed in `moves` has
/// moved); `commanded_opening` (share of the largest), `pad_contact` (pads in contact with anything, 0-2), `tcp_x`,
/// `tcp_y`, `tcp_z`, `hands_moved` (metres, the most that a hand is away from where it began), `time` (seconds); plain draws under their names.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawJudge {
    /// Names of the objects that the task is to move; all others are bystanders.
    #[serde(default)]
    pub(crate) moves: Vec<String>,
    /// The predicate that decides.
    pub(crate) strict: RawPredicate,
    /// The predicate as published elsewhere, for comparison.
    #[serde(default)]
    pub(crate) faithful: Option<RawPredicate>,
}

/// Stages that must be reached in their order, and what must never happen.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPredicate {
    /// The stages.
    pub(crate) stage: Vec<RawStage>,
    /// What makes the episode a failure for good.
    #[serde(default)]
    pub(crate) violation: Vec<RawViolation>,
}

/// A stage, reached for good once its condition has held for some time.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawStage {
    /// Name.
    pub(crate) name: String,
    /// Condition.
    pub(crate) when: String,
    /// How long it must hold without a break, seconds. Default: 0, one physics step.
    #[serde(default)]
    pub(crate) hold_s: f64,
    /// Whether it must hold when the outcome is read; reached before and lost does not count. Only the last stage
    /// may ask for it. Default: false.
    #[serde(default)]
    pub(crate) at_end: bool,
}

/// Something that must not happen.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawViolation {
    /// What happened, in words.
    pub(crate) name: String,
    /// Condition.
    pub(crate) when: String,
    /// Counts only until this stage is reached.
    #[serde(default)]
    pub(crate) before: Option<String>,
}

fn half() -> f64 {
    0.5
}
fn width() -> u32 {
    640
}
fn height() -> u32 {
    480
}
fn depth_min() -> f64 {
    0.2
}
fn depth_max() -> f64 {
    6.0
}
fn d435() -> String {
    "d435".into()
}
fn attempts() -> u32 {
    1000
}
fn zero() -> Number {
    Number::Plain(0.0)
}
fn one() -> Number {
    Number::Plain(1.0)
}
fn third() -> f64 {
    0.3
}
fn jitter() -> f64 {
    0.0015
}
fn bevel() -> f64 {
    0.001
}
fn one_f64() -> f64 {
    1.0
}
fn lift() -> f64 {
    0.1
}
fn first() -> u32 {
    1
}
