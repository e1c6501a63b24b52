//! A thing of a scene: its surfaces, and what is true of it.

use super::{deviation::Deviation, outline::Outlines, plan::Plan};
use acm_concept::{
    pose::Pose,
    solid::{PlacedSolid, Solid},
    template::{SeenBy, Template, TemplateLibrary, Unit},
};
use acm_render::{Material, Mesh, MeshError};
use acm_sim::Surface;
use anyhow::{Context, bail};
use glam::DVec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::{collections::BTreeMap, sync::Arc};

/// Drawings of a template's parameters before it is given up.
const MAX_DRAWS: usize = 20_000;

/// A thing that stands upright in the world.
#[derive(Debug, Clone)]
pub struct Thing {
    /// What it is made of, in its base frame.
    pub pieces: Vec<Piece>,
    /// What it was drawn from; `None` for a foreign mesh.
    pub template: Option<Parameters>,
    /// Where its surfaces are, in its base frame.
    pub outlines: Outlines,
    /// Its base frame, the middle of its bottom, in the world.
    pub pose: Pose,
    /// The thing that it touches or stands on, or that stands on it, by its place in the scene.
    pub touches: Option<usize>,
}

/// A drawn surface in the base frame of its thing.
#[derive(Debug, Clone)]
pub struct Piece {
    /// Shared by all things of the same shape.
    pub mesh: Arc<Mesh>,
    /// Along the mesh's own axes.
    pub scale: DVec3,
    /// In the base frame.
    pub pose: Pose,
    /// Colour and pattern.
    pub material: Material,
}

/// Template and parameter values.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The template's type.
    pub template: String,
    /// In the template's order, metres and radians.
    pub values: Vec<f64>,
}

impl Thing {
    /// Extents along the axes of the base frame, metres.
    pub fn extents(&self) -> DVec3 {
        let (low, high) = self.outlines.bounds();
        high - low
    }
    fn of(pieces: Vec<Piece>, template: Option<Parameters>) -> Thing {
        let outlines = Outlines::of(pieces.iter().flat_map(triangles));
        Thing { pieces, template, outlines, pose: Pose::IDENTITY, touches: None }
    }
}

/// The triangles of a piece in the base frame of its thing.
pub(super) fn triangles(piece: &Piece) -> impl Iterator<Item = [DVec3; 3]> + '_ {
    let point = |index: &u32| {
        let own = piece.mesh.positions().get(*index as usize).copied().unwrap_or_default();
        piece.pose.transform_point(own.as_dvec3() * piece.scale)
    };
    piece.mesh.indices().chunks_exact(3).map(move |corners| match corners {
        [a, b, c] => [a, b, c].map(point),
        _ => [DVec3::ZERO; 3],
    })
}

/// Foreign meshes by file: each is read once.
#[derive(Debug, Default)]
pub struct Foreign(BTreeMap<String, Vec<Surface>>);

/// Makes things.
pub struct Workshop<'a> {
    plan: &'a Plan,
    library: &'a TemplateLibrary,
    cuboid: Arc<Mesh>,
    cylinder: Arc<Mesh>,
    foreign: &'a mut Foreign,
}

impl<'a> Workshop<'a> {
    /// One for a plan.
    pub fn new(plan: &'a Plan, library: &'a TemplateLibrary, foreign: &'a mut Foreign) -> Workshop<'a> {
        let (cuboid, cylinder) = (Arc::new(Mesh::unit_box()), Arc::new(Mesh::unit_cylinder()));
        Workshop { plan, library, cuboid, cylinder, foreign }
    }

    /// A thing that fits a template of the plan exactly, or is a little off.
    pub fn of_template(&self, perturbed: bool, material: Material, rng: &mut ChaCha8Rng) -> anyhow::Result<Thing> {
        let sum: f64 = self.plan.templates.iter().map(|template| template.weight).sum();
        let mut left = rng.random_range(0.0..sum);
        let chosen = self.plan.templates.iter().find(|template| {
            left -= template.weight;
            left < 0.0
        });
        let name = chosen.or(self.plan.templates.first()).map_or("", |template| template.name.as_str());
        let template = self.template(name)?;
        let values = self.values(template, rng)?;
        let deviation = perturbed.then(|| Deviation::draw(&self.plan.perturbation, rng));
        self.made(template, values, deviation, material)
    }

    /// A thing all of whose lengths are `length_m`.
    pub fn of_one_length(&self, name: &str, length_m: f64, material: Material) -> anyhow::Result<Thing> {
        let template = self.template(name)?;
        self.made(template, vec![length_m; template.parameters.len()], None, material)
    }

    /// A mesh that nobody here made, in its own colours, as large as is drawn.
    pub fn foreign(&mut self, rng: &mut ChaCha8Rng) -> anyhow::Result<Thing> {
        let plan = &self.plan.foreign;
        let file = &plan.files[rng.random_range(0..plan.files.len())];
        let largest_m = rng.random_range(plan.largest_m[0]..=plan.largest_m[1]);
        if !self.foreign.0.contains_key(file) {
            self.foreign.0.insert(file.clone(), acm_sim::surfaces(file)?);
        }
        let surfaces = self.foreign.0.get(file).map(Vec::as_slice).unwrap_or_default();
        let own: Vec<Piece> = surfaces.iter().map(|surface| piece(surface, 1.0)).collect();
        let points = own.iter().flat_map(triangles).flatten();
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.fold(start, |(low, high), point| (low.min(point), high.max(point)));
        let shrink = largest_m / (high - low).max_element();
        // What is seen may end elsewhere than what is felt.
        let bottom = (0.5 * (low + high)).with_z(low.z) * shrink;
        let placed = |surface: &Surface| {
            let own = piece(surface, shrink);
            Piece { pose: Pose::from_translation(-bottom) * own.pose, ..own }
        };
        Ok(Thing::of(surfaces.iter().map(placed).collect(), None))
    }

    fn template(&self, name: &str) -> anyhow::Result<&'a Template> {
        self.library.get(name).with_context(|| format!("there is no template `{name}`"))
    }

    /// Parameter values whose thing is as large as the plan wants.
    fn values(&self, template: &Template, rng: &mut ChaCha8Rng) -> anyhow::Result<Vec<f64>> {
        let layout = &self.plan.layout;
        let fixed = template.initial_values([0.0; 4])?;
        for _ in 0..MAX_DRAWS {
            let draw = |(spec, fixed): (&acm_concept::template::ParameterSpec, &f64)| match spec.unit {
                _ if spec.fixed => *fixed,
                Unit::M if spec.min > 0.0 => (rng.random_range(spec.min.ln()..=spec.max.ln())).exp(),
                _ => rng.random_range(spec.min..=spec.max),
            };
            let values: Vec<f64> = template.parameters.iter().zip(&fixed).map(draw).collect();
            let named = template.named(&values);
            if !template.admits(&named) {
                continue;
            }
            let extents = extents(&template.solids(&named)?);
            let thick = template.seen_by == SeenBy::Color || extents.min_element() >= layout.thinnest_m;
            if thick && (layout.largest_m[0]..=layout.largest_m[1]).contains(&extents.max_element()) {
                return Ok(values);
            }
        }
        bail!("layout.largest_m: no {} of that size was drawn in {MAX_DRAWS} attempts", template.name)
    }

    fn made(
        &self,
        template: &Template,
        values: Vec<f64>,
        deviation: Option<Deviation>,
        material: Material,
    ) -> anyhow::Result<Thing> {
        let solids = template.solids(&template.named(&values))?;
        let deviation = deviation.map(|whole| if solids.len() > 1 { whole.without_draft() } else { whole });
        let piece = |placed: &PlacedSolid| self.solid(placed, deviation, material);
        let pieces = solids.iter().map(piece).collect::<Result<_, _>>()?;
        Ok(Thing::of(pieces, Some(Parameters { template: template.name.clone(), values })))
    }

    fn solid(
        &self,
        placed: &PlacedSolid,
        deviation: Option<Deviation>,
        material: Material,
    ) -> Result<Piece, MeshError> {
        let (mesh, scale) = match (deviation, placed.solid) {
            (Some(deviation), solid) => {
                (Arc::new(deviation.mesh(&solid, self.plan.perturbation.most_of_solid)?), DVec3::ONE)
            }
            (None, Solid::Box { size }) => (self.cuboid.clone(), size),
            (None, Solid::Cylinder { radius, height }) => (self.cylinder.clone(), DVec3::new(radius, radius, height)),
            (None, solid) => (Arc::new(Deviation::default().mesh(&solid, 0.0)?), DVec3::ONE),
        };
        Ok(Piece { mesh, scale, pose: placed.pose, material })
    }
}

fn piece(surface: &Surface, shrink: f64) -> Piece {
    Piece {
        mesh: surface.mesh.clone(),
        scale: surface.scale * shrink,
        pose: Pose::new(surface.pose.translation * shrink, surface.pose.rotation),
        material: Material::plain(surface.color),
    }
}

/// Extents of some solids together, metres.
fn extents(solids: &[PlacedSolid]) -> DVec3 {
    let ends = |placed: &PlacedSolid| {
        let half = placed.half_extents();
        (placed.pose.translation - half, placed.pose.translation + half)
    };
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = solids.iter().map(ends).fold(start, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    high - low
}
