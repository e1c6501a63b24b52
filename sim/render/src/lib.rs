//! Headless RGB-D renderer and depth-sensor model.
//!
//! A [`Scene`] of lit, coloured [`Mesh`] instances goes in; colour, exact depth and instance ids of every pixel come
//! out of one pass ([`Renderer::render`]). It needs no display and no vendor's driver: Vulkan (a GPU, or Mesa's
//! lavapipe) is taken where there is one, OpenGL through EGL (Mesa's llvmpipe) otherwise.
//!
//! What a real camera would have delivered instead of the exact depth is [`sensor`]'s business.
//!
//! | module | holds |
//! |---|---|
//! | [`scene`], [`mesh`] | what is drawn: instances, materials, lights; triangle meshes |
//! | [`renderer`], [`adapter`] | the renderer and the devices it can run on |
//! | [`sensor`] | noise, holes, occlusion shadows and calibration errors of a stereo depth camera |
//!
//! Conventions: metres; world frame with z up; camera frames with x right, y down, z forward; pixel (0, 0) has its
//! centre at image coordinates (0, 0).

pub mod adapter;
mod batch;
pub mod mesh;
mod pipeline;
mod projection;
pub mod renderer;
pub mod scene;
pub mod sensor;
mod shadow;
mod targets;

pub use adapter::{AdapterReport, adapters};
pub use mesh::{Mesh, MeshError};
pub use renderer::{RenderError, Rendered, Renderer, RendererError};
pub use scene::{Instance, Lighting, Material, Pattern, PatternKind, PointLight, Scene, Sun};
