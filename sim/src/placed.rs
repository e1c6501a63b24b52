//! One copy of an object as it is really made: stretched, recoloured, a little off its model, joints at their start.

use crate::{
    layout::{LayoutError, number, vector},
    model::{
        self, Link, ObjectModel, Piece, Weight,
        normalise::{self, Original},
        shape::Shape,
    },
    random::Scope,
    scenario::{ObjectSpec, RawPerturb},
    texture::{self, with_hue},
};
use acm_concept::{
    expression::Expression,
    pose::Pose,
    solid::{Enclosure, Solid},
};
use acm_render::Pattern;
use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rapier3d::parry::shape::SharedShape;
use std::sync::Arc;

/// An object at its start.
#[derive(Debug, Clone)]
pub(crate) struct Placed {
    /// Its name, with `_0`, `_1`, ... for copies.
    pub(crate) name: String,
    /// Index of its specification.
    pub(crate) spec: usize,
    pub(crate) model: Arc<ObjectModel>,
    pub(crate) fixed: bool,
    /// As in its model, but as this copy is made: `joint.start` is where this copy's joint starts.
    pub(crate) links: Vec<Link>,
    /// Pairs of links that do not feel each other.
    pub(crate) passing: Vec<(usize, usize)>,
    /// Of its base frame.
    pub(crate) pose: Pose,
    /// What is painted over its colours.
    pub(crate) texture: Option<Pattern>,
}

impl Placed {
    pub(crate) fn build(
        name: String,
        index: usize,
        spec: &ObjectSpec,
        make: &Make,
        pose: Pose,
        dice: &mut Dice,
    ) -> Placed {
        let (grow, bevel) = deviation(spec.perturb, &mut dice.details);
        let link = |(at, link): (usize, &Link)| {
            // What moves must still fit into its base, so that only the base differs from its model.
            let (grow, bevel) = if at == 0 { (grow, bevel) } else { (DVec3::ZERO, 0.0) };
            let pieces = link.pieces.iter().map(|piece| make.apply(perturbed(piece, grow, bevel))).collect();
            let mut joint = link.joint.as_ref().map(|joint| joint.scaled(make.scale));
            if let (Some(joint), Some((_, start))) = (&mut joint, make.starts.iter().find(|(link, _)| *link == at)) {
                joint.start = *start;
            }
            let friction = make.friction.unwrap_or(link.friction);
            Link { pieces, joint, weight: make.weight(link), friction, ..link.clone() }
        };
        let model = make.model.clone();
        let mut links: Vec<Link> = model.links.iter().enumerate().map(link).collect();
        if let Some(loaded) = &model.loaded {
            for (link, original) in links.iter_mut().zip(&loaded.originals) {
                normalise(link, original.as_ref(), &mut dice.dynamics);
            }
        }
        let mut object = Placed {
            name,
            spec: index,
            fixed: spec.fixed,
            links,
            passing: model.passing.clone(),
            model,
            pose,
            texture: make.texture,
        };
        object.stand_on_base();
        object
    }

    /// A perturbed solid is centred where the model's is; the object must still stand on its base frame.
    fn stand_on_base(&mut self) {
        let (lowest, _) = self.bounds();
        for link in &mut self.links {
            for piece in &mut link.pieces {
                piece.pose.translation.z -= lowest.z;
            }
            if let Some(joint) = &mut link.joint {
                joint.origin.z -= lowest.z;
            }
        }
    }

    /// Smallest and largest coordinates in the base frame, all joints at zero.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        let pieces = self.links.iter().flat_map(|link| &link.pieces);
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        pieces.map(|piece| piece.bounds(&Pose::IDENTITY)).fold(start, |a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Height of its top over its base frame, metres.
    pub(crate) fn height(&self) -> f64 {
        self.bounds().1.z.max(0.0)
    }

    /// Extents along the axes of the base frame, metres.
    pub(crate) fn size(&self) -> DVec3 {
        let (low, high) = self.bounds();
        high - low
    }

    /// Colour of its first piece.
    pub(crate) fn color(&self) -> Option<[u8; 3]> {
        self.links.iter().flat_map(|link| &link.pieces).map(|piece| piece.color).next()
    }

    /// Poses of its links in the base frame at the start.
    pub(crate) fn start_poses(&self) -> Vec<Pose> {
        model::poses(&self.links, |_, joint| joint.start)
    }
}

/// What is drawn for objects besides what the scenario draws. Streams of their own, so that making objects never
/// shifts the scenario's draws.
pub(crate) struct Dice {
    details: ChaCha8Rng,
    dynamics: ChaCha8Rng,
}

impl Dice {
    pub(crate) fn new(seed: u64) -> Dice {
        let stream = |number: u64| {
            let mut stream = ChaCha8Rng::seed_from_u64(seed);
            stream.set_stream(number);
            stream
        };
        Dice { details: stream(STREAM_DETAILS), dynamics: stream(STREAM_DYNAMICS) }
    }
}

const STREAM_DETAILS: u64 = 1;
const STREAM_DYNAMICS: u64 = 11;

fn normalise(link: &mut Link, original: Option<&Original>, dynamics: &mut ChaCha8Rng) {
    if let (Some(mut joint), Some(original)) = (link.joint.take(), original) {
        normalise::joint(link, &mut joint, original, dynamics);
        link.joint = Some(joint);
    }
}

/// The collision shapes of an object that stands at a pose, its joints at their start, in the world.
pub(crate) fn solids_at(object: &Placed, pose: &Pose) -> Vec<(Pose, SharedShape)> {
    let links = object.links.iter().zip(object.start_poses());
    let shapes = links.flat_map(|(link, at)| link.pieces.iter().filter(|piece| piece.solid).map(move |p| (p, at)));
    let placed = |(piece, at): (&Piece, Pose)| {
        let (turn, shape) = piece.shape.collision(0.0)?;
        Some((*pose * at * piece.pose * turn, shape))
    };
    shapes.filter_map(placed).collect()
}

/// How one copy is made differently from its model on purpose.
pub(crate) struct Make {
    model: Arc<ObjectModel>,
    scale: DVec3,
    hue_deg: Option<f64>,
    texture: Option<Pattern>,
    density_kg_m3: Option<f64>,
    friction: Option<f64>,
    /// Links, and where their joints start.
    starts: Vec<(usize, f64)>,
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
    let value = number(name, expression, scope)?;
    if range.contains(&value) {
        return Ok(Some(value));
    }
    let reason = format!("{field} {value} must lie in {} to {}", range.start(), range.end());
    Err(LayoutError::Value { name: name.into(), reason })
}

/// Factors beyond these make no sense.
const SCALES: std::ops::RangeInclusive<f64> = 0.1..=10.0;
/// From a foam to the heaviest metals, kg/m3.
const DENSITIES: std::ops::RangeInclusive<f64> = 1.0..=25_000.0;
const FRICTIONS: std::ops::RangeInclusive<f64> = 0.0..=2.0;

impl Make {
    pub(crate) fn of(spec: &ObjectSpec, scope: &Scope) -> Result<Make, LayoutError> {
        let wrong = |reason: String| LayoutError::Value { name: spec.name.clone(), reason };
        let scale = match &spec.scale {
            Some(scale) => vector(&spec.name, scale, scope)?,
            None => DVec3::ONE,
        };
        if !scale.to_array().iter().all(|factor| SCALES.contains(factor)) {
            return Err(wrong(format!("scale {scale} must lie in 0.1 to 10 along every axis")));
        }
        let hue_deg = spec.hue_deg.as_ref().map(|hue| number(&spec.name, hue, scope)).transpose()?;
        let mut starts = Vec::new();
        for (link, expression) in &spec.starts {
            let start = number(&spec.name, expression, scope)?;
            let link_name = &spec.model.links[*link].name;
            let joint = spec.model.links[*link].joint.as_ref().map(|joint| joint.scaled(scale));
            if joint.is_some_and(|joint| (joint.clamp(start) - start).abs() > 1e-9) {
                return Err(wrong(format!("its joint `{link_name}` cannot start at {start:.4}")));
            }
            starts.push((*link, start));
        }
        let density_kg_m3 = within(&spec.name, "density_kg_m3", spec.density_kg_m3.as_ref(), DENSITIES, scope)?;
        let friction = within(&spec.name, "friction", spec.friction.as_ref(), FRICTIONS, scope)?;
        let texture = texture::chosen(&spec.name, &spec.textures, scope)?;
        Ok(Make { model: chosen(spec, scope)?, scale, hue_deg, texture, density_kg_m3, friction, starts })
    }

    /// What a link weighs.
    fn weight(&self, link: &Link) -> Weight {
        match (self.density_kg_m3, link.weight) {
            (Some(density), Weight::Density(_)) => Weight::Density(density),
            (_, weight) => weight,
        }
    }

    /// Stretches sizes and places along the object's axes, angles kept, and turns the hue.
    fn apply(&self, mut piece: Piece) -> Piece {
        piece.shape = piece.shape.scaled(self.scale);
        piece.pose.translation *= self.scale;
        if let Some(hue_deg) = self.hue_deg {
            piece.color = with_hue(piece.color, hue_deg);
        }
        piece
    }
}

/// The model of which a copy is made.
fn chosen(spec: &ObjectSpec, scope: &Scope) -> Result<Arc<ObjectModel>, LayoutError> {
    let Some(choice) = &spec.choice else { return Ok(spec.model.clone()) };
    let which = number(&spec.name, &choice.which, scope)?;
    let found = (which >= 0.0 && which.fract() == 0.0).then(|| choice.models.get(which as usize)).flatten();
    found.cloned().ok_or_else(|| {
        let reason = format!("`which` is {which}, it must be a whole number from 0 to {}", choice.models.len() - 1);
        LayoutError::Value { name: spec.name.clone(), reason }
    })
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

fn perturbed(piece: &Piece, grow: DVec3, bevel: f64) -> Piece {
    let Shape::Solid(exact) = piece.shape else { return piece.clone() };
    let grown = match exact.enclosure() {
        Enclosure::Box { size } => Solid::Box { size: (size + grow).max(size * 0.5) },
        Enclosure::Cylinder { radius, height } => Solid::Cylinder {
            radius: (radius + 0.5 * grow.x).max(radius * 0.5),
            height: (height + grow.z).max(height * 0.5),
        },
    };
    let bevel_m =
        if matches!(exact, Solid::Box { .. }) { bevel.min(0.4 * grown.half_extents().min_element()) } else { 0.0 };
    Piece { shape: Shape::Solid(grown), bevel_m, ..piece.clone() }
}
