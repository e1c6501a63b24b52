//! From seed to start layout: draws, object poses, rejection.

use crate::{
    convert::to_engine,
    placed::{Dice, Make, Placed, solids_at},
    random::{DrawError, Draws, Scope, Stream, count},
    scenario::{PlaceAt, Reference, RejectRule, RejectSpec, WorldSpec},
};
use acm_concept::{
    expression::{Expression, ExpressionError},
    pose::Pose,
};
use glam::DVec3;
use rapier3d::parry::{query, shape::SharedShape};
use thiserror::Error;

/// Most objects of one world.
pub(crate) const MAX_OBJECTS: usize = 256;

/// A start layout.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) draws: Draws,
    pub(crate) objects: Vec<Placed>,
    pub(crate) places: Vec<(String, DVec3)>,
}

/// Why no layout could be made of a seed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LayoutError {
    /// A draw failed.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// An expression failed.
    #[error("{name}: {source}")]
    Expression {
        /// The object or place.
        name: String,
        /// What is wrong.
        source: ExpressionError,
    },
    /// A value of an object or place that makes no sense.
    #[error("{name}: {reason}")]
    Value {
        /// The object or place.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// Every layout was rejected.
    #[error("no layout passed the rejection rules in {attempts} attempts; loosen them or raise random.attempts")]
    Rejected {
        /// How many were tried.
        attempts: u32,
    },
}

impl Layout {
    /// Draws until no rule rejects.
    pub(crate) fn draw(world: &WorldSpec, seed: u64) -> Result<Layout, LayoutError> {
        let mut stream = Stream::new(world.stream, seed);
        let mut draws = Draws::default();
        let mut from = 0;
        for _ in 0..world.attempts {
            if let Some(again) = draw_on(world, from, &mut draws, &mut stream)? {
                from = again;
                continue;
            }
            let layout = Layout::of(world, &draws, seed)?;
            match layout.rejected_by(world)? {
                None => return Ok(layout),
                Some(rule) => from = rule.redraw_from,
            }
        }
        Err(LayoutError::Rejected { attempts: world.attempts })
    }

    fn of(world: &WorldSpec, draws: &Draws, seed: u64) -> Result<Layout, LayoutError> {
        let mut dice = Dice::new(seed);
        let mut layout = Layout { draws: draws.clone(), objects: Vec::new(), places: Vec::new() };
        for index in 0..world.objects.len() {
            layout.add(world, index, &mut dice)?;
        }
        for place in &world.places {
            let point = match &place.at {
                PlaceAt::Object(reference) => layout.find(world, reference)?.pose.translation,
                PlaceAt::CentroidOf(object) => layout.centroid(world, object)?,
                PlaceAt::Position(position) => vector(&place.name, position, &draws.scope())?,
            };
            layout.places.push((place.name.clone(), point));
        }
        Ok(layout)
    }

    fn add(&mut self, world: &WorldSpec, index: usize, dice: &mut Dice) -> Result<(), LayoutError> {
        let spec = &world.objects[index];
        let scope = self.draws.scope();
        let copies = match &spec.count {
            Some(expression) => count(&spec.name, evaluate(&spec.name, expression, &scope)?)?,
            None => 1,
        };
        if self.objects.len() + copies > MAX_OBJECTS {
            let reason = format!("more than {MAX_OBJECTS} objects");
            return Err(LayoutError::Value { name: spec.name.clone(), reason });
        }
        for copy in 0..copies {
            let scope = if spec.count.is_some() { self.draws.scope_at(copy, copies) } else { scope.clone() };
            let local =
                Pose::from_yaw(vector(&spec.name, &spec.position, &scope)?, evaluate(&spec.name, &spec.yaw, &scope)?);
            let pose = match &spec.on {
                Some(reference) => {
                    let support = self.find(world, reference)?;
                    let top = Pose::from_translation(DVec3::Z * support.height());
                    support.pose * top * local
                }
                None => local,
            };
            let name = if spec.count.is_some() { format!("{}_{copy}", spec.name) } else { spec.name.clone() };
            let make = Make::of(spec, &scope)?;
            self.objects.push(Placed::build(name, index, spec, &make, pose, dice));
        }
        Ok(())
    }

    /// The copy of an object that a reference means.
    pub(crate) fn find(&self, world: &WorldSpec, reference: &Reference) -> Result<&Placed, LayoutError> {
        let name = &reference.object;
        let index = match &reference.index {
            Some(expression) => evaluate(name, expression, &self.draws.scope())?,
            None => 0.0,
        };
        let mut copies = self.objects.iter().filter(|object| world.objects[object.spec].name == *name);
        let found = (index >= 0.0 && index.fract() == 0.0).then(|| copies.nth(index as usize)).flatten();
        found.ok_or_else(|| LayoutError::Value { name: name.clone(), reason: format!("has no copy number {index}") })
    }

    fn centroid(&self, world: &WorldSpec, name: &str) -> Result<DVec3, LayoutError> {
        let copies: Vec<DVec3> = self.copies(world, name).map(|object| object.pose.translation).collect();
        if copies.is_empty() {
            return Err(LayoutError::Value { name: name.into(), reason: "has no copies, so no centroid".into() });
        }
        Ok(copies.iter().sum::<DVec3>() / copies.len() as f64)
    }

    fn copies<'a>(&'a self, world: &'a WorldSpec, name: &'a str) -> impl Iterator<Item = &'a Placed> {
        self.objects.iter().filter(move |object| world.objects[object.spec].name == name)
    }

    /// Plain draws and places.
    pub(crate) fn scope(&self) -> Scope {
        let mut scope = self.draws.scope();
        for (name, point) in &self.places {
            for (axis, value) in ["x", "y", "z"].into_iter().zip(point.to_array()) {
                scope.set(&format!("{name}_{axis}"), value);
            }
        }
        scope
    }

    fn rejected_by<'a>(&self, world: &'a WorldSpec) -> Result<Option<&'a RejectSpec>, LayoutError> {
        for spec in world.rejects.iter().filter(|spec| spec.after.is_none()) {
            let rejected = match &spec.rule {
                RejectRule::When(condition) => evaluate("random.reject.when", condition, &self.scope())? != 0.0,
                RejectRule::Near { between, nearer_than_m } => self.gap_between(world, between)? < *nearer_than_m,
            };
            if rejected {
                return Ok(Some(spec));
            }
        }
        Ok(None)
    }

    /// The smallest gap between copies of two things, metres.
    fn gap_between(&self, world: &WorldSpec, between: &[String; 2]) -> Result<f64, LayoutError> {
        let [first, second] = between.each_ref().map(|name| self.shapes(world, name));
        let same = between[0] == between[1];
        let mut smallest = f64::INFINITY;
        for (i, a) in first.iter().enumerate() {
            for (_, b) in second.iter().enumerate().filter(|(j, _)| !same || i < *j) {
                smallest = smallest.min(gap(a, b)?);
            }
        }
        Ok(smallest)
    }

    /// The solids of every copy of an object, or a small ball at a place, in the world.
    fn shapes(&self, world: &WorldSpec, name: &str) -> Vec<Vec<(Pose, SharedShape)>> {
        if let Some((_, point)) = self.places.iter().find(|(place, _)| place == name) {
            return vec![vec![(Pose::from_translation(*point), SharedShape::ball(1e-4))]];
        }
        self.copies(world, name).map(|object| solids_at(object, &object.pose)).collect()
    }
}

/// Makes all draws from one on. Says from which one on to draw anew, if a rule that looks at once rejects.
fn draw_on(
    world: &WorldSpec,
    from: usize,
    draws: &mut Draws,
    stream: &mut Stream,
) -> Result<Option<usize>, LayoutError> {
    for (at, spec) in world.draws.iter().enumerate().skip(from) {
        draws.draw(spec, stream)?;
        for rule in world.rejects.iter().filter(|rule| rule.after == Some(at)) {
            if let RejectRule::When(condition) = &rule.rule
                && evaluate("random.reject.when", condition, &draws.scope())? != 0.0
            {
                return Ok(Some(rule.redraw_from));
            }
        }
    }
    Ok(None)
}

/// Distance between two sets of solids, metres; 0 where they touch or overlap.
pub(crate) fn gap(a: &[(Pose, SharedShape)], b: &[(Pose, SharedShape)]) -> Result<f64, LayoutError> {
    let mut smallest = f64::INFINITY;
    for (pose_a, shape_a) in a {
        for (pose_b, shape_b) in b {
            let distance = query::distance(&to_engine(pose_a), &**shape_a, &to_engine(pose_b), &**shape_b)
                .map_err(|e| LayoutError::Value { name: "random.reject".into(), reason: e.to_string() })?;
            smallest = smallest.min(f64::from(distance.distance));
        }
    }
    Ok(smallest)
}

fn evaluate(name: &str, expression: &Expression, scope: &Scope) -> Result<f64, LayoutError> {
    let value = scope.evaluate(expression).map_err(|source| LayoutError::Expression { name: name.into(), source })?;
    if value.is_finite() {
        return Ok(value);
    }
    let reason = format!("the expression `{}` gives {value}", expression.text());
    Err(LayoutError::Value { name: name.into(), reason })
}

/// Three expressions as a point.
pub(crate) fn vector(name: &str, expressions: &[Expression; 3], scope: &Scope) -> Result<DVec3, LayoutError> {
    let [x, y, z] = expressions;
    Ok(DVec3::new(evaluate(name, x, scope)?, evaluate(name, y, scope)?, evaluate(name, z, scope)?))
}

/// One expression as a number.
pub(crate) fn number(name: &str, expression: &Expression, scope: &Scope) -> Result<f64, LayoutError> {
    evaluate(name, expression, scope)
}

#[cfg(test)]
mod tests;
