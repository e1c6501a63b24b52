//! What goes into a simulation and what is read off it.

use crate::{layout::LayoutError, scenario::ScenarioError};
use acm_render::{MeshError, RenderError, sensor::UnknownProfile};
use serde::Serialize;
use thiserror::Error;

/// How an episode is simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct SimOptions {
    /// Seed of everything random: layout, sensor bias, noise, mishaps.
    pub seed: u64,
    /// During this carry, counted from 1, the object is taken out of the hand unseen and set down 5-12 cm away.
    pub slip_at: Option<u32>,
    /// During this carry, counted from 1, the fingers open for a moment and the object falls.
    pub drop_at: Option<u32>,
    /// Sensor profile of all cameras instead of the scenario's.
    pub sensor: Option<String>,
    /// Whether the robot may move.
    pub motion: bool,
    /// Image width and height in pixels instead of the scenario's; the opening angle stays.
    pub camera_size: Option<(u32, u32)>,
}

impl Default for SimOptions {
    fn default() -> Self {
        SimOptions { seed: 0, slip_at: None, drop_at: None, sensor: None, motion: true, camera_size: None }
    }
}

/// Processor time that an episode has taken so far, seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct SimTimings {
    /// Physics, mechanisms and judge: of the calling thread.
    pub physics_s: f64,
    /// Rendering: of the whole process while a frame was drawn, because software renderers have their own threads.
    pub render_s: f64,
    /// Sensor model: of the calling thread.
    pub noise_s: f64,
}

/// The start of an episode as its main camera would see it without any error.
#[derive(Debug, Clone)]
pub struct Preview {
    /// The colour image.
    pub color: image::RgbImage,
    /// For every pixel, row by row, the number of what is seen there; 0 for nothing.
    pub ids: Vec<u32>,
    /// What the numbers mean: number and name, the hand and the surfaces included.
    pub legend: Vec<(u32, String)>,
}

/// Why an episode could not be simulated.
#[derive(Debug, Error)]
pub enum SimError {
    /// The scenario cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The seed gives no start layout.
    #[error("scenario {scenario}, seed {seed}: {source}")]
    Layout {
        /// The scenario.
        scenario: String,
        /// The seed.
        seed: u64,
        /// Why not.
        source: Box<LayoutError>,
    },
    /// An object did not stay where it was placed.
    #[error(
        "with seed {seed} `{object}` is not at rest: it turned by {turn_deg:.1} degrees and moved {shift_m:.3} m; place it on its support"
    )]
    Unstable {
        /// The object.
        object: String,
        /// The seed.
        seed: u64,
        /// By how much it turned, degrees.
        turn_deg: f64,
        /// By how much it moved, metres.
        shift_m: f64,
    },
    /// No such sensor profile.
    #[error(transparent)]
    Sensor(#[from] UnknownProfile),
    /// An image size that cannot be rendered.
    #[error("images of {width}x{height} pixels are not possible; take 16x16 to 4096x4096")]
    CameraSize {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// The picture could not be drawn.
    #[error("the scene cannot be drawn: {0}")]
    Render(#[from] RenderError),
    /// The simulation runs without a renderer.
    #[error("this simulation has no renderer; make it with Simulation::new")]
    NoRenderer,
    /// No camera of that name.
    #[error("there is no camera `{name}` in this scenario")]
    NoCamera {
        /// The name that was asked for.
        name: String,
    },
    /// A mesh could not be made.
    #[error("an object cannot be drawn: {0}")]
    Mesh(#[from] MeshError),
}
