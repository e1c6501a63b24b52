//! Things whose pixels and templates are given: estimators of parameters are trained on what is seen of them and compared
//! with the geometric one on it.
//!
//! Segmentation and the choice among templates are left out. Everything else is that of [`Grounder`](crate::Grounder): the
//! plane, the evidence of a segment, the first guess and the fit.

use crate::{
    config::GrounderConfig,
    fit::{Base, Evidence},
    hypotheses::{self, Measured},
    scan::Scan,
    scene::Scene,
    segments::{NONE, Segments},
    support::{self, Upright},
};
use acm_concept::{
    camera::RgbdFrame,
    object::Blindness,
    pose::Pose,
    template::{SeenBy, Template},
};
use glam::{DVec2, DVec3};

/// An upright part as it is estimated: where it is and how large.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Pose of its base frame in the support frame.
    pub pose: Pose,
    /// All parameter values in the template's order.
    pub values: Vec<f64>,
}

/// What is seen of one thing. The *support frame* has z up and z = 0 on the plane.
#[derive(Debug, Clone)]
pub struct GivenThing {
    /// Pose of the camera in the support frame, as far as its nominal calibration and the plane tell.
    pub camera: Pose,
    /// Measured points of the surface, support frame, metres: those of all pixels, or of [`MOST_POINTS`] of them and some.
    pub points: Vec<DVec3>,
    evidence: Evidence,
    measured: Measured,
}

/// Of more pixels than twice these some are passed over.
pub const MOST_POINTS: usize = 2048;

/// What a frame shows of the things whose pixels are given.
///
/// `labels` has the place of its thing + 1 for every pixel, 0 for what is none; `bases_m` is the height over the plane on
/// which each of them stands. `None` stands for a thing of which too little is seen to be fitted.
///
/// # Errors
/// The frame shows no plane, or nothing at all.
pub fn things(
    frame: &RgbdFrame,
    labels: &[u16],
    bases_m: &[f64],
    config: &GrounderConfig,
) -> Result<Vec<Option<GivenThing>>, Blindness> {
    let scan = Scan::read(frame, config).map_err(|(blindness, _)| blindness)?;
    let own = vec![false; scan.grid.len()];
    let up = frame.header.camera_pose.rotation.inverse() * DVec3::Z;
    let upright = Upright { up, max_angle_rad: config.max_support_tilt_rad };
    let plane = support::find(&scan, &own, upright, None, config).ok_or(Blindness::NoSupport)?;
    let scene = Scene::new(&scan, &plane, &frame.header.camera_pose, own, config);
    let name = |pixel: usize| match labels.get(pixel) {
        // Where nothing was measured nothing belongs to a segment, as in the pipeline.
        Some(label) if *label > 0 && scene.is_known(pixel) => u32::from(*label) - 1,
        _ => NONE,
    };
    let labels: Vec<u32> = (0..scene.grid.len()).map(name).collect();
    let segments = Segments { inner: vec![false; labels.len()], labels, count: bases_m.len() };
    let pixels = segments.pixels();
    let thing = |(pixels, base_m): (&Vec<usize>, &f64)| {
        (pixels.len() >= scene.min_segment_px()).then(|| GivenThing::of(&scene, &segments, pixels, *base_m))
    };
    Ok(pixels.iter().zip(bases_m).map(thing).collect())
}

impl GivenThing {
    fn of(scene: &Scene, segments: &Segments, pixels: &[usize], base_m: f64) -> GivenThing {
        let evidence = Evidence::of_segment(scene, segments, pixels);
        let plan: Vec<DVec2> = evidence.points.iter().map(|p| p.position.truncate()).collect();
        let height_m = evidence.top_m() - base_m;
        let measured = Measured { plan, height_m, base: Base::At(base_m), seen_by: SeenBy::Depth };
        let step = (pixels.len() / MOST_POINTS).max(1);
        let points = pixels.iter().step_by(step).filter_map(|&pixel| scene.measured(pixel)).collect();
        GivenThing { camera: scene.camera, points, evidence, measured }
    }

    /// The geometric first guess: of the starts over all headings the one with the least cost, before any fit.
    pub fn guess(&self, template: &Template) -> Option<Estimate> {
        hypotheses::given::guess(template, &self.measured, &self.evidence)
    }

    /// The geometric estimate: the best starts brought near to a minimum, and the best of these fitted.
    pub fn fit(&self, template: &Template) -> Option<Estimate> {
        hypotheses::given::fit(template, &self.measured, &self.evidence)
    }

    /// The same fit from a start of somebody else's.
    pub fn fit_from(&self, template: &Template, start: &Estimate) -> Option<Estimate> {
        hypotheses::given::fit_from(template, &self.measured, &self.evidence, start)
    }

    /// How badly an estimate explains what is seen: its negative log likelihood, up to a constant of the thing's.
    pub fn cost(&self, template: &Template, estimate: &Estimate) -> Option<f64> {
        hypotheses::given::cost_of(template, &self.measured, &self.evidence, estimate)
    }
}
