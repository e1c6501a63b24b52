//! The template library: parametric part templates read from text files.
//!
//! A template is data (paper, section "Stable Prior Knowledge"): parameters with units and ranges, solids and
//! frames as expressions over them, bindings of manipulation functions, and its semantic synopsis. The file
//! format is described in docs/templates.md.

mod raw;
mod rest;
mod shape;
mod typical;

pub use rest::Rest;
use shape::SolidSpec;

use crate::{
    expression::{Expression, ExpressionError},
    literal::{Literal, ParseLiteralError},
    pose::Pose,
    solid::PlacedSolid,
};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;

/// Largest template file that is read, bytes.
pub const MAX_TEMPLATE_BYTES: usize = 64 * 1024;
/// Most parameters of one template.
pub const MAX_PARAMETERS: usize = 24;
/// Most parts of one template.
pub const MAX_PARTS: usize = 16;

/// Parameter values by name, as [`Expression::evaluate`] takes them.
pub type Values<'a> = [(&'a str, f64)];

/// Unit of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Metres.
    M,
    /// Radians.
    Rad,
    /// A plain number.
    One,
}

/// One dimension of the parameter space Omega_tau.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSpec {
    /// Name, used in expressions.
    pub name: String,
    /// Unit of value and range.
    pub unit: Unit,
    /// Smallest valid value.
    pub min: f64,
    /// Largest valid value.
    pub max: f64,
    /// First guess as an expression over the measures of a segment (see [`MEASURES`]).
    pub initial: Expression,
    /// A parameter that perception does not fit but takes as is: its value is `initial`.
    pub fixed: bool,
}

/// What perception measures of a segment before it knows a template; first guesses are written over these.
///
/// `extent_x`, `extent_y`: sides of the smallest upright rectangle round the segment seen from above, the longer
/// first; `extent_z`: height above the support; `circle_radius`: radius of the circle fitted to its outline seen
/// from above. Metres.
pub const MEASURES: [&str; 4] = ["extent_x", "extent_y", "extent_z", "circle_radius"];

/// By which evidence a part of this template stands out from what it lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SeenBy {
    /// It rises above the support: depth shows it.
    Depth,
    /// It is as flat as the support: only colour shows it.
    Color,
}

/// A noun under which people speak of a part, with the condition that its parameters must meet.
#[derive(Debug, Clone, PartialEq)]
pub struct Noun {
    /// The noun, singular, lower case.
    pub noun: String,
    /// Condition over the parameters; `None` if it always applies.
    pub when: Option<Expression>,
}

/// The semantic library's entry: (tau, d, a, u), and the nouns that lead to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Synopsis {
    /// What the template looks like.
    pub description: String,
    /// How it can be interacted with.
    pub affordance: String,
    /// What it is used for.
    pub intended_use: String,
    /// Nouns, the most specific first.
    pub nouns: Vec<Noun>,
}

/// A part of an object that is described by one template: a frame that moves with the parameters, and what the part
/// affords. A template that names no parts has one, [`WHOLE`], whose frame is the base frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PartSpec {
    /// Name: `base`, `lid`.
    pub name: String,
    /// Affordance words of this part.
    pub affordances: Vec<String>,
    position: [Expression; 3],
    /// Rotation about the base frame's z axis, after the tilt, radians.
    yaw: Expression,
    /// Rotation about the base frame's y axis, radians.
    tilt: Expression,
}

/// The name of the part of templates that name none.
pub const WHOLE: &str = "whole";

/// A named frame of the part, as expressions over the parameters. Its z axis points out of the part.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSpec {
    /// Name that function bindings refer to.
    pub name: String,
    /// Index of the part with which it moves; `None` for the base frame.
    part: Option<usize>,
    position: [Expression; 3],
    yaw: Expression,
    /// Takes z to the direction out of the part.
    out: DQuat,
    /// Turn about that direction, radians.
    turn: Expression,
}

/// A manipulation function f of F_tau: a function kind bound to a frame, with conditions and effects.
#[derive(Debug, Clone, PartialEq)]
pub struct FunctionBinding {
    /// Name, which is the skill's name: `pick`.
    pub name: String,
    /// Function kind, implemented in acm-skills: `grasp-from-above`.
    pub kind: String,
    /// The frame it acts at.
    pub frame: String,
    /// Named arguments as expressions over the parameters.
    pub arguments: BTreeMap<String, Expression>,
    /// What must hold before; variables `?self`, `?support`, `?destination`.
    pub preconditions: Vec<Literal>,
    /// What is declared to hold after.
    pub effects: Vec<Literal>,
}

/// How headings of a part are equivalent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum YawSymmetry {
    /// Any heading looks the same.
    Continuous,
    /// Headings that differ by a full turn divided by this number look the same.
    Fold(u32),
}

impl YawSymmetry {
    /// The heading equivalent to `yaw` that is nearest to `reference`, radians.
    ///
    /// ```
    /// # use acm_concept::template::YawSymmetry;
    /// use std::f64::consts::PI;
    /// assert!((YawSymmetry::Fold(2).nearest(PI, 0.1) - 0.0).abs() < 1e-12);
    /// assert_eq!(YawSymmetry::Continuous.nearest(1.0, 0.1), 0.1);
    /// ```
    pub fn nearest(self, yaw: f64, reference: f64) -> f64 {
        match self {
            YawSymmetry::Continuous => reference,
            YawSymmetry::Fold(fold) => {
                let step = std::f64::consts::TAU / f64::from(fold.max(1));
                yaw - ((yaw - reference) / step).round() * step
            }
        }
    }
    /// Smallest difference between two headings, radians.
    pub fn difference(self, a: f64, b: f64) -> f64 {
        (self.nearest(a, b) - b).abs()
    }
}

#[derive(Debug, Clone, PartialEq)]
struct SymmetryRule {
    fold: u32,
    when: Option<Expression>,
}

/// A part template m = (tau, Omega, F) together with its synopsis.
///
/// A part's base frame has its origin at the middle of the bottom and z up.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// Template type tau.
    pub name: String,
    /// Whether perception tries it only where the instruction speaks of such a thing or memory expects one.
    pub on_call: bool,
    /// Semantic entry.
    pub synopsis: Synopsis,
    /// How it stands out from its support.
    pub seen_by: SeenBy,
    /// Prior odds against other templates that fit as well, 1 for the plain ones.
    pub prior: f64,
    /// Whether such a thing is found by itself, as a cup is; a door or a handle is found on what it belongs to.
    pub stands_alone: bool,
    /// Parts P_i, the main one first: manipulation functions are bound to it.
    pub parts: Vec<PartSpec>,
    /// Parameter space Omega.
    pub parameters: Vec<ParameterSpec>,
    /// Further conditions that parameters must meet together.
    pub constraints: Vec<Expression>,
    solids: Vec<SolidSpec>,
    frames: Vec<FrameSpec>,
    symmetry: Vec<SymmetryRule>,
    /// Ways to come to rest besides upright on its bottom.
    pub rests: Vec<Rest>,
    /// Manipulation functions F.
    pub functions: Vec<FunctionBinding>,
}

/// Why a template file was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TemplateError {
    /// Not TOML, an unknown field, or a value of the wrong type.
    #[error("template file {file}: {reason}")]
    Format {
        /// The file's name.
        file: String,
        /// The parser's message, with a suggestion where a field's name is near a known one.
        reason: String,
    },
    /// A parameter range or prior that makes no sense.
    #[error("template file {file}: parameter `{parameter}` {reason}")]
    Parameter {
        /// The file's name.
        file: String,
        /// The parameter.
        parameter: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An expression that cannot be read.
    #[error("template file {file}, {place}: {source}")]
    Expression {
        /// The file's name.
        file: String,
        /// Where in the file.
        place: String,
        /// What is wrong.
        source: ExpressionError,
    },
    /// A literal that cannot be read.
    #[error("template file {file}, function `{function}`: {source}")]
    Literal {
        /// The file's name.
        file: String,
        /// The function.
        function: String,
        /// What is wrong.
        source: ParseLiteralError,
    },
    /// A function that names a frame which the template does not have.
    #[error("template file {file}: function `{function}` acts at frame `{frame}`, which is not among: {known}")]
    UnknownFrame {
        /// The file's name.
        file: String,
        /// The function.
        function: String,
        /// The frame it names.
        frame: String,
        /// The frames there are.
        known: String,
    },
    /// A solid or frame that names a part which the template does not have.
    #[error("template file {file}: {what} belongs to part `{part}`, which is not among: {known}")]
    UnknownPart {
        /// The file's name.
        file: String,
        /// The solid or frame.
        what: String,
        /// The part it names.
        part: String,
        /// The parts there are.
        known: String,
    },
    /// Two files declare the same template type.
    #[error("template file {file}: the template type `{name}` is declared twice")]
    Duplicate {
        /// The second file's name.
        file: String,
        /// The type.
        name: String,
    },
}

impl Template {
    /// Reads one template file.
    pub fn parse(file: &str, text: &str) -> Result<Template, TemplateError> {
        raw::parse(file, text)
    }
    /// The solids of all parts with the given parameter values, in the base frame.
    pub fn solids(&self, values: &Values) -> Result<Vec<PlacedSolid>, ExpressionError> {
        let frames = self.part_frames(values)?;
        let mut solids = Vec::with_capacity(self.solids.len());
        for spec in &self.solids {
            let frame = frames.get(spec.part).copied().unwrap_or(Pose::IDENTITY);
            let first = solids.len();
            spec.evaluate(values, &mut solids)?;
            for placed in solids.iter_mut().skip(first) {
                placed.pose = frame * placed.pose;
            }
        }
        Ok(solids)
    }
    /// The frames of the parts in the base frame, in their order.
    pub fn part_frames(&self, values: &Values) -> Result<Vec<Pose>, ExpressionError> {
        let frame = |part: &PartSpec| {
            let tilt = DQuat::from_rotation_y(part.tilt.evaluate(values)?);
            let yaw = part.yaw.evaluate(values)?;
            let turn = if yaw == 0.0 { tilt } else { DQuat::from_rotation_z(yaw) * tilt };
            Ok(Pose::new(vector(&part.position, values)?, turn))
        };
        self.parts.iter().map(frame).collect()
    }
    /// The solids of one part, in that part's frame; none if the template has no part of that name.
    pub fn part_solids(&self, part: &str, values: &Values) -> Result<Vec<PlacedSolid>, ExpressionError> {
        let index = self.parts.iter().position(|spec| spec.name == part);
        let mut solids = Vec::new();
        for spec in self.solids.iter().filter(|spec| Some(spec.part) == index) {
            spec.evaluate(values, &mut solids)?;
        }
        Ok(solids)
    }
    /// Affordance words of all parts.
    pub fn affordances(&self) -> impl Iterator<Item = &str> {
        self.parts.iter().flat_map(|part| part.affordances.iter().map(String::as_str))
    }
    /// Names of its frames.
    pub fn frame_names(&self) -> impl Iterator<Item = &str> {
        self.frames.iter().map(|frame| frame.name.as_str())
    }
    /// A frame of a part with the given parameter values, in its base frame; `None` if there is no such frame.
    pub fn frame(&self, name: &str, values: &Values) -> Result<Option<Pose>, ExpressionError> {
        let Some(spec) = self.frames.iter().find(|frame| frame.name == name) else { return Ok(None) };
        let upright = Pose::from_yaw(vector(&spec.position, values)?, spec.yaw.evaluate(values)?);
        let turned = spec.out * DQuat::from_rotation_z(spec.turn.evaluate(values)?);
        let upright_alone = turned == DQuat::IDENTITY;
        let own = if upright_alone { upright } else { upright * Pose::new(DVec3::ZERO, turned) };
        let Some(part) = spec.part else { return Ok(Some(own)) };
        Ok(self.part_frames(values)?.get(part).map(|frame| *frame * own))
    }
    /// The symmetry of a part with the given parameter values.
    pub fn yaw_symmetry(&self, values: &Values) -> Result<YawSymmetry, ExpressionError> {
        for rule in &self.symmetry {
            let applies = match &rule.when {
                Some(condition) => condition.evaluate(values)? != 0.0,
                None => true,
            };
            if applies {
                return Ok(if rule.fold == 0 { YawSymmetry::Continuous } else { YawSymmetry::Fold(rule.fold) });
            }
        }
        Ok(YawSymmetry::Fold(1))
    }
    /// The symmetry that holds at all parameter values: headings that it calls equivalent are so always.
    pub fn common_symmetry(&self) -> YawSymmetry {
        let certain = self.symmetry.iter().any(|rule| rule.when.is_none());
        // What no rule covers has no symmetry but the full turn. No fold at all, 0, is a multiple of every other.
        let folds = self.symmetry.iter().map(|rule| rule.fold).chain((!certain).then_some(1));
        match folds.fold(0, greatest_common_divisor) {
            0 => YawSymmetry::Continuous,
            fold => YawSymmetry::Fold(fold),
        }
    }
    /// The symmetry about the vertical of a part that is turned by `rotation` from its upright stance: that of the
    /// rest in which it is, none for a stance that the template does not name.
    pub fn symmetry_at(&self, values: &Values, rotation: DQuat) -> Result<YawSymmetry, ExpressionError> {
        let up = rotation.inverse() * DVec3::Z;
        if up.z > rest::NEAR_COSINE {
            return self.yaw_symmetry(values);
        }
        Ok(self.rests.iter().find(|rest| rest.holds(up)).map_or(YawSymmetry::Fold(1), |rest| rest.symmetry))
    }
    /// The nouns that fit the given parameter values, the most specific first.
    pub fn nouns(&self, values: &Values) -> Vec<&str> {
        let fits = |noun: &&Noun| match &noun.when {
            Some(condition) => condition.evaluate(values).is_ok_and(|value| value != 0.0),
            None => true,
        };
        self.synopsis.nouns.iter().filter(fits).map(|noun| noun.noun.as_str()).collect()
    }
    /// First parameter values from the measures of a segment (in the order of [`MEASURES`]), clamped into range.
    pub fn initial_values(&self, measures: [f64; 4]) -> Result<Vec<f64>, ExpressionError> {
        let measures: Vec<(&str, f64)> = MEASURES.iter().copied().zip(measures).collect();
        self.parameters.iter().map(|p| Ok(p.initial.evaluate(&measures)?.clamp(p.min, p.max))).collect()
    }
    /// Pairs parameter values with their names.
    pub fn named<'a>(&'a self, values: &[f64]) -> Vec<(&'a str, f64)> {
        self.parameters.iter().map(|p| p.name.as_str()).zip(values.iter().copied()).collect()
    }
    /// Whether all constraints hold at the given values.
    pub fn admits(&self, values: &Values) -> bool {
        let in_range = |p: &ParameterSpec| {
            values.iter().find(|(name, _)| *name == p.name).is_some_and(|(_, v)| (p.min..=p.max).contains(v))
        };
        self.parameters.iter().all(in_range)
            && self.constraints.iter().all(|c| c.evaluate(values).is_ok_and(|value| value != 0.0))
    }
    /// A manipulation function by name.
    pub fn function(&self, name: &str) -> Option<&FunctionBinding> {
        self.functions.iter().find(|function| function.name == name)
    }
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

fn vector(expressions: &[Expression; 3], values: &Values) -> Result<DVec3, ExpressionError> {
    let [x, y, z] = expressions;
    Ok(DVec3::new(x.evaluate(values)?, y.evaluate(values)?, z.evaluate(values)?))
}

/// The template and semantic libraries: fixed during an episode, ordered by template type.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TemplateLibrary {
    templates: BTreeMap<String, Template>,
}

impl TemplateLibrary {
    /// Reads a library from named texts.
    pub fn parse<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<TemplateLibrary, TemplateError> {
        let mut templates = BTreeMap::new();
        for (file, text) in files {
            let template = Template::parse(file, text)?;
            let name = template.name.clone();
            if templates.insert(name.clone(), template).is_some() {
                return Err(TemplateError::Duplicate { file: file.into(), name });
            }
        }
        Ok(TemplateLibrary { templates })
    }
    /// The library of one template.
    pub fn of_one(template: Template) -> TemplateLibrary {
        TemplateLibrary { templates: BTreeMap::from([(template.name.clone(), template)]) }
    }
    /// This library and those templates of another one that it does not have, which are [on call](Template::on_call).
    pub fn with_on_call(mut self, other: TemplateLibrary) -> TemplateLibrary {
        for (name, template) in other.templates {
            self.templates.entry(name).or_insert(Template { on_call: true, ..template });
        }
        self
    }
    /// A template by type.
    pub fn get(&self, name: &str) -> Option<&Template> {
        self.templates.get(name)
    }
    /// The solids of a grounded part, in its own frame; `None` if its template is not in the library or cannot be
    /// evaluated at its parameters.
    pub fn solids_of(&self, part: &crate::object::GroundedPart) -> Option<Vec<PlacedSolid>> {
        self.get(&part.template)?.part_solids(&part.name, &part.values()).ok()
    }
    /// Extents of all parts' solids together along the axes of the first part's frame, metres; `None` without solids.
    pub fn extents_of(&self, parts: &[crate::object::GroundedPart]) -> Option<DVec3> {
        let to_first = parts.first()?.pose.pose.inverse();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for part in parts {
            for placed in self.solids_of(part).unwrap_or_default() {
                let pose = to_first * part.pose.pose * placed.pose;
                let ends = PlacedSolid { pose, ..placed }.bounds();
                (low, high) = (low.min(ends.0), high.max(ends.1));
            }
        }
        (low.x <= high.x).then(|| high - low)
    }
    /// All templates in the order of their names.
    pub fn iter(&self) -> impl Iterator<Item = &Template> {
        self.templates.values()
    }
    /// The templates that carry a noun.
    pub fn with_noun<'a>(&'a self, noun: &'a str) -> impl Iterator<Item = &'a Template> {
        self.iter().filter(move |template| template.synopsis.nouns.iter().any(|n| n.noun == noun))
    }
}

#[cfg(test)]
mod tests;
