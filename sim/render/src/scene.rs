//! What is drawn: instances of meshes, materials, lights.

use crate::mesh::Mesh;
use acm_concept::pose::Pose;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Most instances of a scene.
pub const MAX_INSTANCES: usize = 20_000;
/// Most triangles of a scene, counted once per instance.
pub const MAX_TRIANGLES: usize = 4_000_000;
/// Most point lights of a scene.
pub const MAX_POINT_LIGHTS: usize = 4;
/// Largest edge of the shadow map, texels.
pub const MAX_SHADOW_MAP: u32 = 2048;

/// Everything that a camera can see.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The things in it, at most [`MAX_INSTANCES`].
    pub instances: Vec<Instance>,
    /// The lights.
    pub lights: Lighting,
    /// Colour (8-bit sRGB) where no instance is hit. Depth and id are 0 there.
    pub background: [u8; 3],
}

/// One mesh in the world.
#[derive(Debug, Clone)]
pub struct Instance {
    /// The shape. Instances that share the `Arc` share one upload and one draw call.
    pub mesh: Arc<Mesh>,
    /// Pose of the mesh's frame in the world.
    pub pose: Pose,
    /// Factors along the mesh's own axes, applied before the pose. Positive.
    pub scale: DVec3,
    /// Its surface.
    pub material: Material,
    /// What [`crate::Rendered::ids`] holds where this instance is seen. Several instances may share an id; 0 is
    /// reserved for "nothing" and refused.
    pub id: u32,
}

/// A matt surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Colour in 8-bit sRGB: what the surface looks like under light of strength 1.
    pub color: [u8; 3],
    /// A pattern painted over the colour.
    #[serde(default)]
    pub pattern: Option<Pattern>,
}

impl Material {
    /// One colour (8-bit sRGB), no pattern.
    pub fn plain(color: [u8; 3]) -> Material {
        Material { color, pattern: None }
    }
}

/// A procedural pattern in the mesh's scaled frame: it sticks to the object and keeps its size in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pattern {
    /// Its form.
    pub kind: PatternKind,
    /// Its colour, 8-bit sRGB.
    pub color: [u8; 3],
    /// Edge of a cell, metres. Positive.
    pub cell_m: f64,
}

/// The form of a [`Pattern`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PatternKind {
    /// Squares, every other one painted.
    Checker,
    /// Bands across the x axis (across y on faces that look along x), every other one painted.
    Stripes,
    /// Squares, one in six painted, irregularly.
    Speckle,
}

/// The lights of a scene. A surface of albedo 1 reflects `ambient + (sum of irradiances) / pi`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lighting {
    /// Light that reaches every surface alike.
    pub ambient: f32,
    /// The one light that casts shadows.
    pub sun: Sun,
    /// Lights without shadows, at most [`MAX_POINT_LIGHTS`].
    pub points: Vec<PointLight>,
}

/// Parallel light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sun {
    /// Direction in which the light travels, in the world. Need not have unit length, must not be zero.
    pub direction: DVec3,
    /// Irradiance of a surface that faces it.
    pub intensity: f32,
    /// Edge of the shadow map in texels, at most [`MAX_SHADOW_MAP`]; 0 casts no shadows. The map covers what the
    /// camera sees, not the whole scene.
    pub shadow_map: u32,
}

/// Light from a point, weaker with the square of the distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PointLight {
    /// Where it is, in the world.
    pub position: DVec3,
    /// Irradiance of a surface that faces it from 1 m.
    pub intensity: f32,
}

impl Default for Lighting {
    /// RMBench's lights: ambient 0.5, sun of 0.5 along (0, 0.5, -1) with shadows, points of 1 at (±1, 0, 1.8).
    /// A white table at z = 0.74 comes out at about 0.9 of full white.
    fn default() -> Self {
        let point = |x| PointLight { position: DVec3::new(x, 0.0, 1.8), intensity: 1.0 };
        Lighting {
            ambient: 0.5,
            sun: Sun { direction: DVec3::new(0.0, 0.5, -1.0), intensity: 0.5, shadow_map: 512 },
            points: vec![point(1.0), point(-1.0)],
        }
    }
}
