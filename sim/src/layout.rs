//! From seed to start layout: draws, object poses, rejection.

use crate::{
    convert::to_engine,
    model::{ButtonModel, ModelSolid, ObjectModel},
    random::{DrawError, Draws, Scope, Stream, count},
    scenario::{ObjectSpec, PlaceAt, RawPerturb, Reference, RejectRule, RejectSpec, WorldSpec},
};
use acm_concept::{
    expression::{Expression, ExpressionError},
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rapier3d::parry::{query, shape::SharedShape};
use thiserror::Error;

/// Most objects of one world.
pub(crate) const MAX_OBJECTS: usize = 256;

/// A solid of an object as it is really made, in the object's base frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BuiltSolid {
    pub(crate) placed: PlacedSolid,
    /// Width of the bevel at a box's edges, metres; 0 for sharp edges.
    pub(crate) bevel_m: f64,
    pub(crate) color: [u8; 3],
}

/// An object at its start.
#[derive(Debug, Clone)]
pub(crate) struct Placed {
    /// Its name, with `_0`, `_1`, ... for copies.
    pub(crate) name: String,
    /// Index of its specification.
    pub(crate) spec: usize,
    pub(crate) model: String,
    pub(crate) fixed: bool,
    pub(crate) density: f64,
    pub(crate) friction: f64,
    pub(crate) solids: Vec<BuiltSolid>,
    pub(crate) cap: Vec<BuiltSolid>,
    pub(crate) button: Option<ButtonModel>,
    pub(crate) pose: Pose,
}

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
            for spec in world.draws.iter().skip(from) {
                draws.draw(spec, &mut stream)?;
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
        // A stream of its own, so that perturbing objects never shifts the scenario's draws.
        let mut details = ChaCha8Rng::seed_from_u64(seed);
        details.set_stream(1);
        let mut layout = Layout { draws: draws.clone(), objects: Vec::new(), places: Vec::new() };
        for index in 0..world.objects.len() {
            layout.add(world, index, &mut details)?;
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

    fn add(&mut self, world: &WorldSpec, index: usize, details: &mut ChaCha8Rng) -> Result<(), LayoutError> {
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
            self.objects.push(Placed::build(name, index, spec, &make, pose, details));
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
        for spec in &world.rejects {
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

impl Placed {
    fn build(
        name: String,
        index: usize,
        spec: &ObjectSpec,
        make: &Make,
        pose: Pose,
        details: &mut ChaCha8Rng,
    ) -> Placed {
        let ObjectModel { model, fixed, density_kg_m3, friction, solid, button, .. } = &spec.model;
        let (grow, bevel) = deviation(spec.perturb, details);
        let mut object = Placed {
            name,
            spec: index,
            model: model.clone(),
            fixed: *fixed,
            density: make.density_kg_m3.unwrap_or(*density_kg_m3),
            friction: make.friction.unwrap_or(*friction),
            solids: solid.iter().map(|solid| make.apply(built(solid, grow, bevel))).collect(),
            cap: button.iter().flat_map(|button| &button.solid).map(|solid| built(solid, DVec3::ZERO, 0.0)).collect(),
            button: button.clone(),
            pose,
        };
        object.stand_on_base();
        object
    }

    /// A perturbed solid is centred where the model's is; the object must still stand on its base frame.
    fn stand_on_base(&mut self) {
        let bottom = |built: &BuiltSolid| built.placed.pose.translation.z - built.placed.half_extents().z;
        let lowest = self.solids.iter().map(bottom).fold(f64::INFINITY, f64::min);
        for built in self.solids.iter_mut().chain(&mut self.cap) {
            built.placed.pose.translation.z -= lowest;
        }
    }

    /// Height of its top over its base frame, metres.
    pub(crate) fn height(&self) -> f64 {
        let top = |built: &BuiltSolid| built.placed.pose.translation.z + built.placed.half_extents().z;
        self.solids.iter().chain(&self.cap).map(top).fold(0.0, f64::max)
    }

    /// Extents along the axes of the base frame, metres.
    pub(crate) fn size(&self) -> DVec3 {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = self.solids.iter().chain(&self.cap).fold(start, |(low, high), built| {
            let (centre, half) = (built.placed.pose.translation, built.placed.half_extents());
            (low.min(centre - half), high.max(centre + half))
        });
        high - low
    }
}

/// How one copy is made differently from its model on purpose.
struct Make {
    scale: DVec3,
    hue_deg: Option<f64>,
    density_kg_m3: Option<f64>,
    friction: Option<f64>,
}

/// Factors beyond these make no sense.
const SCALES: std::ops::RangeInclusive<f64> = 0.1..=10.0;
/// From a foam to the heaviest metals, kg/m3.
const DENSITIES: std::ops::RangeInclusive<f64> = 1.0..=25_000.0;
const FRICTIONS: std::ops::RangeInclusive<f64> = 0.0..=2.0;

impl Make {
    fn of(spec: &ObjectSpec, scope: &Scope) -> Result<Make, LayoutError> {
        let scale = match &spec.scale {
            Some(scale) => vector(&spec.name, scale, scope)?,
            None => DVec3::ONE,
        };
        if !scale.to_array().iter().all(|factor| SCALES.contains(factor)) {
            let reason = format!("scale {scale} must lie in 0.1 to 10 along every axis");
            return Err(LayoutError::Value { name: spec.name.clone(), reason });
        }
        let hue_deg = spec.hue_deg.as_ref().map(|hue| evaluate(&spec.name, hue, scope)).transpose()?;
        let density_kg_m3 = within(&spec.name, "density_kg_m3", spec.density_kg_m3.as_ref(), DENSITIES, scope)?;
        let friction = within(&spec.name, "friction", spec.friction.as_ref(), FRICTIONS, scope)?;
        Ok(Make { scale, hue_deg, density_kg_m3, friction })
    }

    /// Stretches sizes and places along the object's axes, angles kept, and turns the hue.
    fn apply(&self, mut built: BuiltSolid) -> BuiltSolid {
        built.placed.solid = match built.placed.solid {
            Solid::Box { size } => Solid::Box { size: size * self.scale },
            Solid::Cylinder { radius, height } => {
                Solid::Cylinder { radius: radius * (self.scale.x * self.scale.y).sqrt(), height: height * self.scale.z }
            }
        };
        built.placed.pose.translation *= self.scale;
        if let Some(hue_deg) = self.hue_deg {
            built.color = with_hue(built.color, hue_deg);
        }
        built
    }
}

/// The colour with another hue, its saturation and brightness (HSV) kept: greys stay grey.
fn with_hue(color: [u8; 3], hue_deg: f64) -> [u8; 3] {
    let [high, low] = [f64::from(color.into_iter().fold(0, u8::max)), f64::from(color.into_iter().fold(255, u8::min))];
    let channel = |offset: f64| {
        let sector = (offset + hue_deg.rem_euclid(360.0) / 60.0) % 6.0;
        let share = sector.min(4.0 - sector).clamp(0.0, 1.0);
        (high - (high - low) * share).round() as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

/// How much each edge grows and how wide the bevel is. Three numbers are always drawn, so that one object's share
/// does not shift the next one's.
fn deviation(perturb: Option<RawPerturb>, details: &mut ChaCha8Rng) -> (DVec3, f64) {
    let Some(perturb) = perturb else { return (DVec3::ZERO, 0.0) };
    let chosen = details.random::<f64>() < perturb.share;
    let mut edge = || (2.0 * details.random::<f64>() - 1.0) * perturb.size_m;
    let grow = DVec3::new(edge(), edge(), edge());
    if chosen { (grow, perturb.bevel_m) } else { (DVec3::ZERO, 0.0) }
}

fn built(solid: &ModelSolid, grow: DVec3, bevel: f64) -> BuiltSolid {
    let PlacedSolid { solid: exact, pose } = solid.placed();
    let grown = match exact {
        Solid::Box { size } => Solid::Box { size: (size + grow).max(size * 0.5) },
        Solid::Cylinder { radius, height } => Solid::Cylinder {
            radius: (radius + 0.5 * grow.x).max(radius * 0.5),
            height: (height + grow.z).max(height * 0.5),
        },
    };
    let bevel_m =
        if matches!(exact, Solid::Box { .. }) { bevel.min(0.4 * grown.half_extents().min_element()) } else { 0.0 };
    BuiltSolid { placed: PlacedSolid { solid: grown, pose }, bevel_m, color: solid.color().0 }
}

/// The collision shape of a solid, and the shape's own frame in the solid's: the engine's cylinders stand along y.
pub(crate) fn shape(solid: &Solid, bevel_m: f64) -> (Pose, SharedShape) {
    match *solid {
        Solid::Box { size } => {
            let half = (size * 0.5 - DVec3::splat(bevel_m)).as_vec3();
            let shape = if bevel_m > 0.0 {
                SharedShape::round_cuboid(half.x, half.y, half.z, bevel_m as f32)
            } else {
                SharedShape::cuboid(half.x, half.y, half.z)
            };
            (Pose::IDENTITY, shape)
        }
        Solid::Cylinder { radius, height } => {
            let z_up = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
            (z_up, SharedShape::cylinder((height * 0.5) as f32, radius as f32))
        }
    }
}

/// The collision shapes of an object that stands at a pose, in the world.
pub(crate) fn solids_at(object: &Placed, pose: &Pose) -> Vec<(Pose, SharedShape)> {
    let solid = |built: &BuiltSolid| {
        let (turn, shape) = shape(&built.placed.solid, 0.0);
        (*pose * built.placed.pose * turn, shape)
    };
    object.solids.iter().map(solid).collect()
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

/// An optional expression whose value must lie in a range.
fn within(
    name: &str,
    field: &str,
    expression: Option<&Expression>,
    range: std::ops::RangeInclusive<f64>,
    scope: &Scope,
) -> Result<Option<f64>, LayoutError> {
    let Some(expression) = expression else { return Ok(None) };
    let value = evaluate(name, expression, scope)?;
    if range.contains(&value) {
        return Ok(Some(value));
    }
    let reason = format!("{field} {value} must lie in {} to {}", range.start(), range.end());
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
