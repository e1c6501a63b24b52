//! What a foreign object looks like: its seen surfaces alone, without a world, for benches that only draw.

use crate::{
    model::{
        self, Piece,
        load::{self, Wanted},
        shape::Shape,
    },
    scene,
};
use acm_concept::{pose::Pose, solid::Enclosure};
use acm_render::{Mesh, MeshError};
use glam::DVec3;
use std::{path::Path, sync::Arc};
use thiserror::Error;

/// A seen surface of an object whose joints all stand at their start.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The triangles.
    pub mesh: Arc<Mesh>,
    /// Factors along the mesh's own axes, applied before the pose.
    pub scale: DVec3,
    /// Pose of the mesh in the object's base frame, which is the middle of the bottom of its bounding box, z up. Metres.
    pub pose: Pose,
    /// 8-bit sRGB.
    pub color: [u8; 3],
}

/// Why the surfaces of an object cannot be had.
#[derive(Debug, Error)]
pub enum SurfacesError {
    /// The file cannot be read, or makes no sense.
    #[error("object {0}")]
    Load(String),
    /// A plain shape cannot be drawn.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Nothing of it is seen.
    #[error("object {0} has nothing that could be seen")]
    Empty(String),
}

/// The seen surfaces of an object of a URDF or MJCF file, named as a scenario's `model_file` names it.
///
/// # Errors
/// One line with the file and what of it is wrong.
pub fn surfaces(model_file: &str) -> Result<Vec<Surface>, SurfacesError> {
    let object = load::load(model_file, Path::new(""), Wanted::Surfaces).map_err(SurfacesError::Load)?;
    let links = model::poses(&object.links, |_, joint| joint.start);
    let mut found = Vec::new();
    for (link, at) in object.links.iter().zip(links) {
        for piece in link.pieces.iter().filter(|piece| piece.shown) {
            found.extend(of_piece(piece, &at)?);
        }
    }
    if found.is_empty() { Err(SurfacesError::Empty(model_file.into())) } else { Ok(found) }
}

/// What is seen of a piece whose link stands at a pose.
pub(crate) fn of_piece(piece: &Piece, link: &Pose) -> Result<Vec<Surface>, MeshError> {
    let pose = *link * piece.pose;
    let surface = |mesh: Arc<Mesh>, pose: Pose, scale: DVec3| Surface { mesh, scale, pose, color: piece.color };
    Ok(match &piece.shape {
        Shape::Solid(solid) => match solid.enclosure() {
            Enclosure::Box { size } => vec![surface(Arc::new(Mesh::unit_box()), pose, size)],
            Enclosure::Cylinder { radius, height } => {
                vec![surface(Arc::new(Mesh::unit_cylinder()), pose, DVec3::new(radius, radius, height))]
            }
        },
        Shape::Capsule { radius, height } => {
            let ball = Arc::new(scene::unit_ball()?);
            let end = |side: f64| {
                let pose = pose * Pose::from_translation(DVec3::Z * (side * height));
                surface(Arc::clone(&ball), pose, DVec3::splat(*radius))
            };
            let middle = surface(Arc::new(Mesh::unit_cylinder()), pose, DVec3::new(*radius, *radius, *height));
            vec![middle, end(-0.5), end(0.5)]
        }
        Shape::Ball { radius } => vec![surface(Arc::new(scene::unit_ball()?), pose, DVec3::splat(*radius))],
        Shape::Surface { mesh, scale } => vec![surface(mesh.clone(), pose, *scale)],
        Shape::Hull(_) => Vec::new(),
    })
}
