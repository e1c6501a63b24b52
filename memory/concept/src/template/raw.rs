//! The text of a template file, before its meaning is checked.

use super::{shape::RawSolid, *};
use crate::expression::Expression;
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, PI};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTemplate {
    template: String,
    seen_by: SeenBy,
    #[serde(default = "one")]
    prior: f64,
    #[serde(default = "yes")]
    stands_alone: bool,
    #[serde(default)]
    affordances: Vec<String>,
    synopsis: RawSynopsis,
    parameter: Vec<RawParameter>,
    #[serde(default)]
    constraints: Vec<String>,
    #[serde(default)]
    part: Vec<RawPart>,
    solid: Vec<RawSolid>,
    #[serde(default)]
    frame: Vec<RawFrame>,
    #[serde(default)]
    symmetry: Vec<RawSymmetry>,
    #[serde(default)]
    rest: Vec<RawRest>,
    #[serde(default)]
    function: Vec<RawFunction>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSynopsis {
    description: String,
    affordance: String,
    intended_use: String,
    nouns: Vec<RawNoun>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawNoun {
    noun: String,
    when: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawParameter {
    name: String,
    unit: Unit,
    min: f64,
    max: f64,
    initial: String,
    #[serde(default)]
    fixed: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPart {
    name: String,
    #[serde(default)]
    affordances: Vec<String>,
    #[serde(default = "origin")]
    position: [String; 3],
    #[serde(default = "zero")]
    yaw: String,
    #[serde(default = "zero")]
    tilt: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrame {
    name: String,
    part: Option<String>,
    position: [String; 3],
    #[serde(default = "zero")]
    yaw: String,
    /// The axis of the part's frame along which this frame's z axis points.
    #[serde(default = "up")]
    out: RawOut,
    #[serde(default = "zero")]
    turn: String,
}

/// A direction out of a part.
#[derive(Clone, Copy, Deserialize)]
enum RawOut {
    #[serde(rename = "x")]
    X,
    #[serde(rename = "-x")]
    MinusX,
    #[serde(rename = "y")]
    Y,
    #[serde(rename = "-y")]
    MinusY,
    #[serde(rename = "z")]
    Z,
    #[serde(rename = "-z")]
    MinusZ,
}

impl RawOut {
    /// The rotation that takes z to this axis and leaves y level.
    fn rotation(self) -> DQuat {
        let over = DQuat::from_rotation_y(FRAC_PI_2);
        match self {
            RawOut::X => over,
            RawOut::MinusX => DQuat::from_rotation_z(PI) * over,
            RawOut::Y => DQuat::from_rotation_z(FRAC_PI_2) * over,
            RawOut::MinusY => DQuat::from_rotation_z(-FRAC_PI_2) * over,
            RawOut::Z => DQuat::IDENTITY,
            RawOut::MinusZ => DQuat::from_rotation_y(PI),
        }
    }
}

fn up() -> RawOut {
    RawOut::Z
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSymmetry {
    fold: u32,
    when: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRest {
    up: RawAxis,
    #[serde(default = "one_fold")]
    fold: u32,
    #[serde(default = "seldom")]
    prior: f64,
    #[serde(default)]
    like_upright: bool,
}

/// An axis of the base frame.
#[derive(Clone, Copy, Deserialize)]
enum RawAxis {
    #[serde(rename = "x")]
    X,
    #[serde(rename = "-x")]
    MinusX,
    #[serde(rename = "y")]
    Y,
    #[serde(rename = "-y")]
    MinusY,
    #[serde(rename = "-z")]
    MinusZ,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFunction {
    name: String,
    kind: String,
    frame: String,
    #[serde(default)]
    arguments: BTreeMap<String, String>,
    #[serde(default)]
    preconditions: Vec<String>,
    #[serde(default)]
    effects: Vec<String>,
}

fn yes() -> bool {
    true
}
fn one() -> f64 {
    1.0
}
fn one_fold() -> u32 {
    1
}
/// Odds of a rest whose file does not give them.
fn seldom() -> f64 {
    0.2
}
fn zero() -> String {
    "0".into()
}
fn origin() -> [String; 3] {
    [zero(), zero(), zero()]
}

/// Names that the expression reader takes for numbers.
const CONSTANTS: [&str; 6] = ["e", "E", "PI", "TAU", "π", "τ"];

pub(super) fn parse(file: &str, text: &str) -> Result<Template, TemplateError> {
    let format = |reason: String| TemplateError::Format { file: file.into(), reason };
    if text.len() > MAX_TEMPLATE_BYTES {
        return Err(format(format!("larger than {MAX_TEMPLATE_BYTES} bytes")));
    }
    let raw: RawTemplate = toml::from_str(text).map_err(|e| format(crate::suggest::suggest(e.to_string())))?;
    Meaning { file, names: raw.parameter.iter().map(|p| p.name.as_str()).collect() }.template(&raw)
}

/// Turns raw text into meaning; knows which names expressions may use.
struct Meaning<'a> {
    file: &'a str,
    names: Vec<&'a str>,
}

impl Meaning<'_> {
    fn template(&self, raw: &RawTemplate) -> Result<Template, TemplateError> {
        if raw.parameter.is_empty() || raw.parameter.len() > MAX_PARAMETERS {
            let reason = format!("needs 1 to {MAX_PARAMETERS} parameters, has {}", raw.parameter.len());
            return Err(TemplateError::Format { file: self.file.into(), reason });
        }
        if raw.solid.is_empty() {
            return Err(TemplateError::Format {
                file: self.file.into(),
                reason: "needs at least one [[solid]]".into(),
            });
        }
        if !(raw.prior.is_finite() && raw.prior > 0.0) {
            let reason = format!("prior {} must be a positive number", raw.prior);
            return Err(TemplateError::Format { file: self.file.into(), reason });
        }
        // First, so that a bad parameter is named itself and not by the expressions that use it.
        let parameters = raw.parameter.iter().map(|p| self.parameter(p)).collect::<Result<_, _>>()?;
        let parts = self.parts(raw)?;
        let frames = raw.frame.iter().map(|f| self.frame(f, &parts)).collect::<Result<Vec<_>, _>>()?;
        let symmetry = raw.symmetry.iter().map(|rule| {
            let when = rule.when.as_deref().map(|text| self.expression("symmetry", text)).transpose()?;
            Ok(SymmetryRule { fold: rule.fold, when })
        });
        Ok(Template {
            name: raw.template.clone(),
            on_call: false,
            synopsis: self.synopsis(&raw.synopsis)?,
            seen_by: raw.seen_by,
            prior: raw.prior,
            stands_alone: raw.stands_alone,
            parameters,
            constraints: self.expressions("constraints", &raw.constraints)?,
            solids: raw.solid.iter().map(|s| self.solid(s, &parts)).collect::<Result<_, _>>()?,
            parts,
            functions: raw.function.iter().map(|f| self.function(f, &frames)).collect::<Result<_, _>>()?,
            symmetry: symmetry.collect::<Result<_, _>>()?,
            rests: raw.rest.iter().map(|rest| self.rest(rest)).collect::<Result<_, _>>()?,
            frames,
        })
    }

    fn parameter(&self, raw: &RawParameter) -> Result<ParameterSpec, TemplateError> {
        let wrong =
            |reason: String| TemplateError::Parameter { file: self.file.into(), parameter: raw.name.clone(), reason };
        if self.names.iter().filter(|name| **name == raw.name).count() > 1 {
            return Err(wrong("is declared twice".into()));
        }
        if CONSTANTS.contains(&raw.name.as_str()) {
            return Err(wrong(
                "has the name of a constant, which expressions would read instead; choose another".into(),
            ));
        }
        if MEASURES.contains(&raw.name.as_str()) {
            return Err(wrong("has the name of a segment measure; choose another".into()));
        }
        if !(raw.min.is_finite() && raw.max.is_finite() && raw.min < raw.max) {
            return Err(wrong(format!("has the range {} to {}: min must be below max", raw.min, raw.max)));
        }
        if raw.unit == Unit::M && (raw.min <= 0.0 || raw.max > 5.0) {
            return Err(wrong(format!("has the range {} to {} m: lengths must lie in (0, 5] m", raw.min, raw.max)));
        }
        let initial = self.expression_over(&format!("parameter `{}`", raw.name), &raw.initial, &MEASURES)?;
        if let Some(value) = initial.evaluate(&[]).ok().filter(|value| !(raw.min..=raw.max).contains(value)) {
            return Err(wrong(format!("starts at {value}, out of its range {} to {}", raw.min, raw.max)));
        }
        Ok(ParameterSpec {
            name: raw.name.clone(),
            unit: raw.unit,
            min: raw.min,
            max: raw.max,
            initial,
            fixed: raw.fixed,
        })
    }

    fn synopsis(&self, raw: &RawSynopsis) -> Result<Synopsis, TemplateError> {
        let noun = |raw: &RawNoun| {
            let place = format!("noun `{}`", raw.noun);
            let when = raw.when.as_deref().map(|text| self.expression(&place, text)).transpose()?;
            Ok(Noun { noun: raw.noun.to_lowercase(), when })
        };
        Ok(Synopsis {
            description: raw.description.clone(),
            affordance: raw.affordance.clone(),
            intended_use: raw.intended_use.clone(),
            nouns: raw.nouns.iter().map(noun).collect::<Result<_, _>>()?,
        })
    }

    /// The parts that the file names; the template's own affordances are those of the main one.
    fn parts(&self, raw: &RawTemplate) -> Result<Vec<PartSpec>, TemplateError> {
        let whole =
            RawPart { name: WHOLE.into(), affordances: Vec::new(), position: origin(), yaw: zero(), tilt: zero() };
        let named: Vec<&RawPart> =
            if raw.part.is_empty() { vec![&whole] } else { raw.part.iter().take(MAX_PARTS + 1).collect() };
        if named.len() > MAX_PARTS {
            let reason = format!("has more than {MAX_PARTS} parts");
            return Err(TemplateError::Format { file: self.file.into(), reason });
        }
        let part = |(index, raw_part): (usize, &&RawPart)| {
            if named.iter().take(index).any(|other| other.name == raw_part.name) {
                let reason = format!("the part `{}` is declared twice", raw_part.name);
                return Err(TemplateError::Format { file: self.file.into(), reason });
            }
            let place = format!("part `{}`", raw_part.name);
            let own = if index == 0 { raw.affordances.as_slice() } else { &[] };
            Ok(PartSpec {
                name: raw_part.name.clone(),
                affordances: own.iter().chain(&raw_part.affordances).cloned().collect(),
                position: self.triple(&place, &raw_part.position)?,
                yaw: self.expression(&place, &raw_part.yaw)?,
                tilt: self.expression(&place, &raw_part.tilt)?,
            })
        };
        named.iter().enumerate().map(part).collect()
    }

    fn solid(&self, raw: &RawSolid, parts: &[PartSpec]) -> Result<SolidSpec, TemplateError> {
        let part = self.part("a solid", &raw.part, parts)?.unwrap_or(0);
        let format = |reason: String| TemplateError::Format { file: self.file.into(), reason };
        SolidSpec::read(raw, part, format, |text| self.expression("solid", text))
    }

    /// The index of a part that a solid or frame names.
    fn part(&self, what: &str, name: &Option<String>, parts: &[PartSpec]) -> Result<Option<usize>, TemplateError> {
        let Some(name) = name else { return Ok(None) };
        let place = parts.iter().position(|part| part.name == *name);
        place.map(Some).ok_or_else(|| TemplateError::UnknownPart {
            file: self.file.into(),
            what: what.into(),
            part: name.clone(),
            known: parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>().join(", "),
        })
    }

    fn frame(&self, raw: &RawFrame, parts: &[PartSpec]) -> Result<FrameSpec, TemplateError> {
        let place = format!("frame `{}`", raw.name);
        let part = self.part(&place, &raw.part, parts)?;
        let (position, yaw) = (self.triple(&place, &raw.position)?, self.expression(&place, &raw.yaw)?);
        let (out, turn) = (raw.out.rotation(), self.expression(&place, &raw.turn)?);
        Ok(FrameSpec { name: raw.name.clone(), part, position, yaw, out, turn })
    }

    fn rest(&self, raw: &RawRest) -> Result<Rest, TemplateError> {
        if !(raw.prior.is_finite() && raw.prior > 0.0) {
            let reason = format!("rest: prior {} must be a positive number", raw.prior);
            return Err(TemplateError::Format { file: self.file.into(), reason });
        }
        let up = match raw.up {
            RawAxis::X => DVec3::X,
            RawAxis::MinusX => DVec3::NEG_X,
            RawAxis::Y => DVec3::Y,
            RawAxis::MinusY => DVec3::NEG_Y,
            RawAxis::MinusZ => DVec3::NEG_Z,
        };
        let symmetry = if raw.fold == 0 { YawSymmetry::Continuous } else { YawSymmetry::Fold(raw.fold) };
        Ok(Rest { up, symmetry, prior: raw.prior, like_upright: raw.like_upright })
    }

    fn function(&self, raw: &RawFunction, frames: &[FrameSpec]) -> Result<FunctionBinding, TemplateError> {
        if !frames.iter().any(|frame| frame.name == raw.frame) {
            return Err(TemplateError::UnknownFrame {
                file: self.file.into(),
                function: raw.name.clone(),
                frame: raw.frame.clone(),
                known: frames.iter().map(|frame| frame.name.as_str()).collect::<Vec<_>>().join(", "),
            });
        }
        let place = format!("function `{}`", raw.name);
        let argument = |(name, text): (&String, &String)| Ok((name.clone(), self.expression(&place, text)?));
        let literal = |text: &String| {
            let wrong = |source| TemplateError::Literal { file: self.file.into(), function: raw.name.clone(), source };
            Literal::parse(text).map_err(wrong)
        };
        Ok(FunctionBinding {
            name: raw.name.clone(),
            kind: raw.kind.clone(),
            frame: raw.frame.clone(),
            arguments: raw.arguments.iter().map(argument).collect::<Result<_, _>>()?,
            preconditions: raw.preconditions.iter().map(literal).collect::<Result<_, _>>()?,
            effects: raw.effects.iter().map(literal).collect::<Result<_, _>>()?,
        })
    }

    fn triple(&self, place: &str, texts: &[String; 3]) -> Result<[Expression; 3], TemplateError> {
        let [x, y, z] = texts;
        Ok([self.expression(place, x)?, self.expression(place, y)?, self.expression(place, z)?])
    }
    fn expressions(&self, place: &str, texts: &[String]) -> Result<Vec<Expression>, TemplateError> {
        texts.iter().map(|text| self.expression(place, text)).collect()
    }
    fn expression(&self, place: &str, text: &str) -> Result<Expression, TemplateError> {
        self.expression_over(place, text, &self.names)
    }
    fn expression_over(&self, place: &str, text: &str, names: &[&str]) -> Result<Expression, TemplateError> {
        Expression::parse(text, names).map_err(|source| TemplateError::Expression {
            file: self.file.into(),
            place: place.into(),
            source,
        })
    }
}
