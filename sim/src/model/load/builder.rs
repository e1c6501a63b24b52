//! Puts loaded links together: everything in one frame, which stands in the middle below the object.

use super::{
    Wanted, convex,
    mesh::{self, Triangles},
    plain_name,
};
use crate::model::{
    Link, Loaded, ObjectModel, Piece, Weight,
    joint::Joint,
    normalise::{self, Original},
    shape::{Hull, Shape},
};
use acm_concept::{pose::Pose, solid::Solid};
use acm_render::Mesh;
use glam::{DVec3, Vec3};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

const MAX_LINKS: usize = 128;
const MAX_PIECES: usize = 2048;
const MAX_TRIANGLES: usize = 1_000_000;
/// Largest extent of a loaded object, metres.
const MAX_SIZE_M: f64 = 20.0;
/// Colours of links for which a file has none.
const COLORS: [[u8; 3]; 6] =
    [[196, 190, 180], [168, 140, 104], [150, 160, 168], [178, 120, 96], [128, 150, 120], [120, 124, 150]];

/// A shape as a file gives it, in the frame of its own pose. Metres.
#[derive(Debug, Clone)]
pub(super) enum Form {
    Box(DVec3),
    Cylinder { radius: f64, height: f64 },
    Capsule { radius: f64, height: f64 },
    Ball(f64),
    Ellipsoid(DVec3),
    Mesh { path: PathBuf, scale: DVec3 },
}

/// How a shape is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    Felt,
    Seen,
    Both,
}

#[derive(Debug, Default)]
pub(super) struct Builder {
    wanted: Wanted,
    links: Vec<Link>,
    originals: Vec<Option<Original>>,
    masses: Vec<Option<f64>>,
    warnings: Vec<String>,
    meshes: BTreeMap<PathBuf, Arc<Triangles>>,
    triangles: usize,
}

impl Builder {
    pub(super) fn of(wanted: Wanted) -> Builder {
        Builder { wanted, ..Builder::default() }
    }

    pub(super) fn warn(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    /// Starts a link; the shapes that follow are its. Says its number.
    pub(super) fn link(
        &mut self,
        name: &str,
        parent: usize,
        mass_kg: Option<f64>,
        joint: Option<(Joint, Original)>,
    ) -> Result<usize, String> {
        let number = self.links.len();
        if number == MAX_LINKS {
            return Err(format!("more than {MAX_LINKS} links"));
        }
        let wanted = if number == 0 { "base".into() } else { plain_name(name) };
        let taken = |name: &str| self.links.iter().any(|link| link.name == name);
        let numbered = (2..).map(|count| format!("{wanted}_{count}"));
        let name = std::iter::once(wanted.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or(wanted);
        let (joint, original) = joint.unzip();
        self.links.push(Link { name, parent, weight: Weight::Density(1.0), friction: 0.5, pieces: Vec::new(), joint });
        self.originals.push(original);
        self.masses.push(mass_kg);
        Ok(number)
    }

    pub(super) fn links(&mut self) -> &mut [Link] {
        &mut self.links
    }

    /// Adds a shape to the last link. A mesh that cannot be read is left out with a warning.
    pub(super) fn shape(
        &mut self,
        form: &Form,
        pose: Pose,
        color: Option<[u8; 3]>,
        used: Use,
        friction: Option<f64>,
    ) -> Result<(), String> {
        let number = self.links.len() - 1;
        let color = color.unwrap_or(COLORS[number % COLORS.len()]);
        let made = match form {
            Form::Mesh { path, scale } => match self.mesh(path) {
                Ok(mesh) => self.of_mesh(&mesh, path, *scale, &pose, used)?,
                Err(problem) => {
                    self.warn(format!("link `{}`: {problem}; it is left out", self.links[number].name));
                    return Ok(());
                }
            },
            plain => vec![(solid(plain)?, pose, used)],
        };
        let link = &mut self.links[number];
        if let Some(friction) = friction.filter(|friction| (0.0..=5.0).contains(friction)) {
            link.friction = friction;
        }
        for (shape, pose, used) in made {
            let piece = Piece::new(shape, pose, color);
            link.pieces.push(Piece { solid: used != Use::Seen, shown: used != Use::Felt, ..piece });
        }
        let count: usize = self.links.iter().map(|link| link.pieces.len()).sum();
        if count > MAX_PIECES { Err(format!("more than {MAX_PIECES} shapes")) } else { Ok(()) }
    }

    fn mesh(&mut self, path: &Path) -> Result<Arc<Triangles>, String> {
        if let Some(known) = self.meshes.get(path) {
            return Ok(known.clone());
        }
        let read = Arc::new(mesh::read(path)?);
        self.meshes.insert(path.to_path_buf(), read.clone());
        Ok(read)
    }

    /// A mesh's surface and hulls, both with their corners in the object's frame, so that they stretch with it.
    fn of_mesh(
        &mut self,
        mesh: &Triangles,
        path: &Path,
        scale: DVec3,
        pose: &Pose,
        used: Use,
    ) -> Result<Vec<(Shape, Pose, Use)>, String> {
        self.triangles += mesh.corners.len();
        if self.triangles > MAX_TRIANGLES {
            return Err(format!("more than {MAX_TRIANGLES} triangles in all"));
        }
        let place = |point: &Vec3| pose.transform_point(point.as_dvec3() * scale).as_vec3();
        let mut placed = Triangles { positions: mesh.positions.iter().map(place).collect(), ..mesh.clone() };
        if scale.element_product() < 0.0 {
            // A mirrored triangle looks the other way.
            placed.corners.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let mut made = Vec::new();
        if used != Use::Felt {
            match Mesh::from_triangles(name, &placed.positions, &placed.corners) {
                Ok(mesh) => {
                    let surface = Shape::Surface { mesh: Arc::new(mesh), scale: DVec3::ONE };
                    made.push((surface, Pose::IDENTITY, Use::Seen));
                }
                Err(problem) => self.warn(problem.to_string()),
            }
        }
        if used != Use::Seen && self.wanted == Wanted::Whole {
            let hulls = convex::decompose(&placed);
            made.extend(hulls.into_iter().map(|hull| (Shape::Hull(hull), Pose::IDENTITY, Use::Felt)));
        }
        Ok(made)
    }

    /// The object, standing on its base frame, with weights put right.
    pub(super) fn finish(mut self, summary: String, fixed: bool) -> Result<ObjectModel, String> {
        let pieces = || self.links.iter().flat_map(|link| &link.pieces);
        if self.wanted == Wanted::Whole && !pieces().any(|piece| piece.solid) {
            return Err("has nothing that could be touched".into());
        }
        let all = pieces().map(|piece| piece.bounds(&Pose::IDENTITY));
        let (low, high) = all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        let size = high - low;
        if !(size.is_finite() && size.max_element() <= MAX_SIZE_M) {
            return Err(format!("measures {size} m, the limit is {MAX_SIZE_M} m"));
        }
        self.shift(-(0.5 * (low + high)).with_z(low.z));
        for (link, mass) in self.links.iter_mut().zip(&self.masses) {
            link.weight = normalise::weight(*mass, link.volume(), link.joint.is_some());
        }
        let loaded = Loaded { warnings: self.warnings, originals: self.originals, masses_kg: self.masses };
        let model = ObjectModel::new(String::new(), summary, fixed, self.links);
        Ok(ObjectModel { loaded: Some(Arc::new(loaded)), ..model })
    }

    fn shift(&mut self, by: DVec3) {
        let shift = by.as_vec3();
        for link in &mut self.links {
            for piece in &mut link.pieces {
                match &mut piece.shape {
                    // Its corners are moved and not its frame, so that it stretches about the object's frame.
                    Shape::Hull(hull) => {
                        let points: Vec<Vec3> = hull.points.iter().map(|point| *point + shift).collect();
                        match Hull::new(&points) {
                            Some(moved) => *hull = Arc::new(moved),
                            None => piece.pose.translation += by,
                        }
                    }
                    _ => piece.pose.translation += by,
                }
            }
            if let Some(joint) = &mut link.joint {
                joint.origin += by;
            }
        }
    }
}

fn solid(form: &Form) -> Result<Shape, String> {
    let shape = match *form {
        Form::Box(size) => Shape::Solid(Solid::Box { size }),
        Form::Cylinder { radius, height } => Shape::Solid(Solid::Cylinder { radius, height }),
        Form::Capsule { radius, height } => Shape::Capsule { radius, height },
        Form::Ball(radius) => Shape::Ball { radius },
        Form::Ellipsoid(half) => {
            let points: Vec<Vec3> = ball_points().map(|point| (point * half).as_vec3()).collect();
            Shape::Hull(Arc::new(Hull::new(&points).ok_or("an ellipsoid without volume")?))
        }
        Form::Mesh { .. } => return Err("a mesh is no plain solid".into()),
    };
    let volume = shape.volume();
    if volume.is_finite() && volume > 0.0 { Ok(shape) } else { Err(format!("a shape without volume: {form:?}")) }
}

fn ball_points() -> impl Iterator<Item = DVec3> {
    (1..6).flat_map(|ring| {
        let (across, up) = (f64::from(ring) / 6.0 * std::f64::consts::PI).sin_cos();
        (0..8).map(move |step| {
            let (sine, cosine) = (f64::from(step) / 8.0 * std::f64::consts::TAU).sin_cos();
            DVec3::new(across * cosine, across * sine, up)
        })
    })
}
