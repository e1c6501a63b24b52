//! Turns the text of an object model into its meaning and refuses what makes no sense.

use super::{
    Lamp, Link, ObjectModel, Piece, Weight, is_name,
    joint::{Detents, Follows, Joint, JointKind, Latch, Notches, Press, Spring},
    raw::{RawDetents, RawJoint, RawJointKind, RawLink, RawModel, RawSolid},
    shape::Shape,
    variables,
};
use acm_concept::{expression::Expression, solid::PlacedSolid};
use glam::DVec3;

const MAX_SOLIDS: usize = 64;
const MAX_LINKS: usize = 32;
const MAX_SIZE_M: f64 = 3.0;
const MAX_COLORS: usize = 16;
const MAX_NOTCHES: usize = 64;

type Problem = String;

impl RawModel {
    /// The model, or what makes no sense in it.
    pub(crate) fn meaning(&self) -> Result<ObjectModel, Problem> {
        let count = self.solid.len() + self.link.iter().map(|link| link.solid.len()).sum::<usize>();
        if self.solid.is_empty() || count > MAX_SOLIDS {
            return Err(format!("needs 1 to {MAX_SOLIDS} solids, has {count}"));
        }
        if self.link.len() > MAX_LINKS {
            return Err(format!("has {} links, {MAX_LINKS} are possible", self.link.len()));
        }
        density("density_kg_m3", self.density_kg_m3)?;
        friction("friction", self.friction)?;
        let mut links = vec![Link {
            name: "base".into(),
            parent: 0,
            weight: Weight::Density(self.density_kg_m3),
            friction: self.friction,
            pieces: self.solid.iter().map(piece).collect::<Result<_, _>>()?,
            joint: None,
        }];
        for raw in &self.link {
            let link = self.link(raw, &links).map_err(|problem| format!("link `{}`: {problem}", raw.name))?;
            links.push(link);
        }
        let model = ObjectModel::new(self.model.clone(), self.summary.clone(), self.fixed, links);
        check_shows(&model)?;
        Ok(model)
    }

    fn link(&self, raw: &RawLink, before: &[Link]) -> Result<Link, Problem> {
        if !is_name(&raw.name) {
            return Err("a name needs a lower-case letter first, then lower-case letters, digits, underscores".into());
        }
        if before.iter().any(|link| link.name == raw.name) {
            return Err("there are two of that name".into());
        }
        if raw.solid.is_empty() {
            return Err("needs at least one [[link.solid]]".into());
        }
        let find = |name: &str| {
            let found = before.iter().position(|link| link.name == name);
            found.ok_or_else(|| format!("there is no link `{name}` before it"))
        };
        let parent = find(&raw.parent)?;
        let weight = match (raw.mass_kg, raw.density_kg_m3) {
            (Some(_), Some(_)) => return Err("has mass_kg and density_kg_m3; give one".into()),
            (Some(mass), None) if !(mass > 0.0 && mass <= 500.0) => {
                return Err(format!("mass_kg = {mass} must lie in (0, 500]"));
            }
            (Some(mass), None) => Weight::Mass(mass),
            (None, given) => {
                let value = given.unwrap_or(self.density_kg_m3);
                density("density_kg_m3", value)?;
                Weight::Density(value)
            }
        };
        let surface = raw.friction.unwrap_or(self.friction);
        friction("friction", surface)?;
        let joint = raw.joint.as_ref().map(|joint| meaning_of_joint(joint, before, find)).transpose()?;
        Ok(Link {
            name: raw.name.clone(),
            parent,
            weight,
            friction: surface,
            pieces: raw.solid.iter().map(piece).collect::<Result<_, _>>()?,
            joint,
        })
    }
}

fn meaning_of_joint(
    raw: &RawJoint,
    before: &[Link],
    find: impl Fn(&str) -> Result<usize, Problem>,
) -> Result<Joint, Problem> {
    let axis = DVec3::from(raw.axis).try_normalize().ok_or("joint.axis has no direction")?;
    let origin = DVec3::from(raw.origin);
    if !(origin.is_finite() && origin.abs().max_element() <= 10.0) {
        return Err(format!("joint.origin {origin} must lie within 10 m"));
    }
    let kind = match raw.kind {
        RawJointKind::Hinge => JointKind::Hinge,
        RawJointKind::Slider => JointKind::Slider,
    };
    if let Some([low, high]) = raw.range
        && !(low < high && low >= -10.0 && high <= 10.0)
    {
        return Err(format!("joint.range [{low}, {high}] must ascend and lie in -10 to 10"));
    }
    let mut joint = Joint::new(kind, origin, axis, raw.range);
    if raw.range.is_some() && joint.range.is_none() {
        return Err("joint.range of nearly a full turn cannot be kept; leave it out for a free turn".into());
    }
    if kind == JointKind::Slider && joint.range.is_none() {
        return Err("a slider needs joint.range".into());
    }
    let inside = |field: &str, value: f64| {
        let fits = value.is_finite() && joint.range.is_none_or(|[low, high]| (low..=high).contains(&value));
        if fits { Ok(value) } else { Err(format!("joint.{field} = {value} lies outside of the range")) }
    };
    let closed = inside("closed", raw.closed.unwrap_or(joint.closed))?;
    let start = inside("start", raw.start.unwrap_or(closed))?;
    let limited = |field: &str, value: f64, high: f64| {
        let fits = (0.0..=high).contains(&value);
        if fits { Ok(value) } else { Err(format!("joint.{field} = {value} must lie in 0 to {high}")) }
    };
    joint.friction = limited("friction", raw.friction, 1e3)?;
    joint.damping = limited("damping", raw.damping, 1e3)?;
    if let Some(spring) = &raw.spring {
        limited("spring.stiffness", spring.stiffness, 1e5)?;
        limited("spring.preload", spring.preload, 1e3)?;
        if spring.stiffness == 0.0 {
            return Err("joint.spring.stiffness must be more than 0".into());
        }
        let rest = inside("spring.rest", spring.rest)?;
        joint.spring = Some(Spring { stiffness: spring.stiffness, rest, preload: spring.preload });
    }
    if let Some(latch) = &raw.latch {
        limited("latch.force", latch.force, 1e3)?;
        if !(latch.within > 0.0 && latch.within <= 0.5) {
            return Err(format!("joint.latch.within = {} must lie in (0, 0.5]", latch.within));
        }
        joint.latch = Some(Latch { force: latch.force, within: latch.within });
    }
    joint.detents = raw.detents.as_ref().map(detents).transpose()?;
    if let Some(press) = &raw.press {
        let ordered = 0.0 < press.rearmed && press.rearmed < press.pressed && press.pressed < joint.stroke();
        if !ordered {
            return Err("joint.press needs 0 < rearmed < pressed < the stroke".into());
        }
        joint.press = Some(Press { pressed: press.pressed, rearmed: press.rearmed });
    }
    joint.closed = closed;
    joint.start = start;
    joint.follows = match (&raw.follows, &raw.shows) {
        (Some(_), Some(_)) => return Err("joint has `follows` and `shows`; give one".into()),
        (Some(follows), None) => {
            let link = find(&follows.joint)?;
            if before[link].joint.is_none() {
                return Err(format!("joint.follows: link `{}` has no joint", follows.joint));
            }
            if !(follows.ratio.is_finite() && follows.offset.is_finite()) {
                return Err("joint.follows holds numbers that are not finite".into());
            }
            Some(Follows::Joint { link, ratio: follows.ratio, offset: follows.offset })
        }
        (None, Some(text)) => Some(Follows::Expression((!text.is_empty()).then(|| text.clone()))),
        (None, None) => None,
    };
    Ok(joint)
}

fn detents(raw: &RawDetents) -> Result<Detents, Problem> {
    if !(raw.force > 0.0 && raw.force <= 1e3) {
        return Err(format!("joint.detents.force = {} must lie in (0, 1000]", raw.force));
    }
    let at = match (raw.at.as_slice(), raw.every) {
        ([], Some(step)) if step > 1e-4 && step < 10.0 => Notches::Every(step),
        (at @ [_, ..], None) if at.len() <= MAX_NOTCHES && at.is_sorted_by(|a, b| a < b) => Notches::At(at.to_vec()),
        _ => return Err("joint.detents needs either `every`, more than 0.0001, or `at`, ascending".into()),
    };
    Ok(Detents { force: raw.force, at })
}

fn piece(raw: &RawSolid) -> Result<Piece, Problem> {
    let PlacedSolid { solid, pose } = raw.placed().ok_or("a cylinder's axis has no direction")?;
    let size = 2.0 * solid.half_extents();
    let fits = size.is_finite() && size.cmpgt(DVec3::ZERO).all() && size.cmple(DVec3::splat(MAX_SIZE_M)).all();
    if !fits {
        return Err(format!("a solid's size {size} m must lie in (0, {MAX_SIZE_M}] along every axis"));
    }
    if !pose.is_valid() {
        return Err("a solid's position is not finite".into());
    }
    let lamp = raw.lamp().map(|lamp| {
        if !is_name(&lamp.name) || lamp.colors.is_empty() || lamp.colors.len() > MAX_COLORS {
            return Err(format!("lamp `{}` needs a name like those of links, and 1 to {MAX_COLORS} colors", lamp.name));
        }
        let colors = lamp.colors.iter().map(|color| color.0).collect();
        Ok(Lamp { name: lamp.name.clone(), colors, shows: lamp.shows.clone() })
    });
    Ok(Piece { lamp: lamp.transpose()?, ..Piece::new(Shape::Solid(solid), pose, raw.color().0) })
}

/// What gauges and lamps show must be known here, and their names must differ.
fn check_shows(model: &ObjectModel) -> Result<(), Problem> {
    let known = variables::own(model);
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    let mut names: Vec<&str> = Vec::new();
    for (name, text) in model.shows() {
        if names.contains(&name) {
            return Err(format!("two things that show something are called `{name}`"));
        }
        names.push(name);
        if let Some(text) = text {
            Expression::parse(text, &known).map_err(|e| format!("`{name}` shows: {e}"))?;
        }
    }
    Ok(())
}

fn density(field: &str, value: f64) -> Result<(), Problem> {
    let fits = value > 0.0 && value < 30_000.0;
    if fits { Ok(()) } else { Err(format!("{field} = {value} must lie in (0, 30000)")) }
}
fn friction(field: &str, value: f64) -> Result<(), Problem> {
    if (0.0..=5.0).contains(&value) { Ok(()) } else { Err(format!("{field} = {value} must lie in [0, 5]")) }
}
