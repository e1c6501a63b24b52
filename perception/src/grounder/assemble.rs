//! From ranked hypotheses to a grounded object: calibrated uncertainty, canonical heading, appearance, confidence.

use crate::{
    config::GrounderConfig,
    fit::{Evidence, Profile, profile},
    hypotheses::{self, Context, Hypothesis, Misfit},
    scene::Scene,
};
use acm_concept::{
    object::{GroundedObject, GroundedPart, Observability, ParameterEstimate, PixelSupport, PoseEstimate},
    pose::Pose,
    template::{PartSpec, Template, Unit},
};
use glam::{DQuat, DVec2, DVec3};

/// A thing is truncated if more than this share of its outline is not its own.
const CUT_SHARE: f64 = 0.12;

/// The object that a segment's hypotheses make, or `None` if there are none.
pub(super) fn object(
    scene: &Scene,
    context: Context,
    ranked: &[Hypothesis],
    evidence: &Evidence,
    pixels: &[usize],
    certainty: f64,
) -> Option<GroundedObject> {
    let categories = hypotheses::categories(ranked, context);
    let (category, _) = categories.first()?;
    let offers = |h: &&Hypothesis| {
        let values = h.model.placement(&h.minimum.state).values;
        h.model.template.nouns(&h.model.template.named(&values)).iter().any(|noun| noun == category)
    };
    let best = ranked.iter().find(offers).or(ranked.first())?;
    let support = PixelSupport::from_indices(pixels, scene.grid.width, scene.grid.len())?;
    let appearance = scene.scan.appearance(&inner(scene, pixels));
    let (on_surface, on_outline) = best.explained(evidence);
    // What is cut off all round may be anything.
    let whole = 1.0 - 0.6 * evidence.cut_share();
    let explained = on_surface * (0.4 + 0.6 * on_outline) * whole;
    let remembered = context.remembered.map(|known| known.part);
    let parts = parts(scene, best, evidence, appearance, remembered)?;
    Some(GroundedObject {
        category: category.clone(),
        categories,
        parts,
        appearance,
        confidence: (certainty * explained * (1.0 - (-(pixels.len() as f64) / 150.0).exp())).clamp(0.0, 1.0),
        truncated: evidence.cut_share() > CUT_SHARE,
        expected: None,
        readings: Vec::new(),
        support,
    })
}

/// The pixels away from the segment's border, where colours mix; all of them if few are left.
fn inner(scene: &Scene, pixels: &[usize]) -> Vec<usize> {
    let mut mask = vec![false; scene.grid.len()];
    pixels.iter().for_each(|&pixel| mask[pixel] = true);
    let deep = |&&pixel: &&usize| scene.grid.neighbours(pixel).all(|n| mask[n]);
    let inner: Vec<usize> = pixels.iter().filter(deep).copied().collect();
    if inner.len() * 3 > pixels.len() { inner } else { pixels.to_vec() }
}

/// The parts of the fitted template, the main one first: each in its own frame, with the parameters they share.
fn parts(
    scene: &Scene,
    hypothesis: &Hypothesis,
    evidence: &Evidence,
    appearance: acm_concept::color::Appearance,
    remembered: Option<&GroundedPart>,
) -> Option<Vec<GroundedPart>> {
    let (model, minimum) = (&hypothesis.model, &hypothesis.minimum);
    let template = model.template;
    let placement = model.placement(&minimum.state);
    let misfit = hypothesis.misfit(evidence);
    let calibration = Calibration::new(scene, &scene.world.transform_point(placement.pose.translation), misfit);
    let deviation = |index: usize| deviation(hypothesis, index);
    let (parameters, drift_m) = match hypothesis.tracked {
        // Nothing of its size was measured anew.
        Some(known) => {
            let prior =
                |p: &ParameterEstimate| ParameterEstimate { observability: Observability::PriorOnly, ..p.clone() };
            (known.parameters.iter().map(prior).collect(), DVec2::ZERO)
        }
        None => {
            let profile = profile(model, evidence, minimum);
            (measured_parameters(hypothesis, &profile, &calibration), profile.drift_m)
        }
    };
    let reach = model.solids(&minimum.state).iter().map(|s| s.half_extents().truncate().length()).fold(0.01, f64::max);
    let position_sigma_m = DVec3::new(
        calibration.length(deviation(0)).hypot(drift_m.x),
        calibration.length(deviation(1)).hypot(drift_m.y),
        calibration.length(model.base_index().map_or(0.0, deviation)),
    );
    let yaw_sigma_rad = model.yaw_index().map_or(0.01, |i| calibration.angle(deviation(i), reach));
    let base = world_pose(scene, hypothesis, remembered)?;
    let part = |(index, (spec, frame)): (usize, (&PartSpec, Pose))| GroundedPart {
        template: template.name.clone(),
        name: spec.name.clone(),
        parameters: parameters.clone(),
        pose: PoseEstimate { pose: base * frame, position_sigma_m, yaw_sigma_rad },
        affordances: spec.affordances.clone(),
        functions: if index == 0 { template.functions.iter().map(|f| f.name.clone()).collect() } else { Vec::new() },
        appearance,
    };
    let frames = template.part_frames(&template.named(&placement.values)).ok()?;
    Some(template.parts.iter().zip(frames).enumerate().map(part).collect())
}

fn deviation(hypothesis: &Hypothesis, index: usize) -> f64 {
    hypothesis.minimum.covariance[(index, index)].max(0.0).sqrt()
}

fn measured_parameters(
    hypothesis: &Hypothesis,
    profile: &Profile,
    calibration: &Calibration<'_>,
) -> Vec<ParameterEstimate> {
    let (model, minimum) = (&hypothesis.model, &hypothesis.minimum);
    let values = model.placement(&minimum.state).values;
    let spread = |low: f64, high: f64| (high - low).abs() / 12f64.sqrt();
    let size = |i: usize, fitted: f64| calibration.size(fitted, values[i], growth(model.template, &values, i));
    let estimate = |(i, &observability): (usize, &Observability)| {
        let spec = &model.template.parameters[i];
        let fitted = model.parameter_index(i).map_or(0.0, |index| deviation(hypothesis, index));
        let sigma = match (observability, spec.unit) {
            (Observability::PriorOnly, _) => spread(spec.min, spec.max),
            (Observability::Interval { low, high }, _) => size(i, fitted).max(spread(low, high)),
            (Observability::Observed, Unit::M) => size(i, fitted),
            (Observability::Observed, _) => calibration.angle(fitted, 0.05),
        };
        ParameterEstimate { name: spec.name.clone(), value: values[i], sigma, observability }
    };
    profile.parameters.iter().enumerate().map(estimate).collect()
}

/// How much the larger extent across (x) and the height (y) of a template's solids grow with a parameter: 2 of a
/// diameter with its radius. What moves neither counts as an extent across of its own.
fn growth(template: &Template, values: &[f64], parameter: usize) -> DVec2 {
    const STEP: f64 = 1e-4;
    let extents = |values: &[f64]| {
        let solids = template.solids(&template.named(values)).unwrap_or_default();
        let bounds = solids.iter().map(|solid| solid.bounds());
        let (low, high) =
            bounds.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |all, own| (all.0.min(own.0), all.1.max(own.1)));
        high - low
    };
    let mut moved = values.to_vec();
    moved[parameter] += STEP;
    let grown = ((extents(&moved) - extents(values)) / STEP).abs();
    let growth = DVec2::new(grown.x.max(grown.y), grown.z);
    if growth.is_finite() && growth.max_element() > 0.1 { growth } else { DVec2::X }
}

/// The pose in the world. Among equivalent headings it is the one nearest to zero; of a part that lies as memory knows
/// it the one nearest to the remembered, because there the base frame sits at one end. A small tilt of the plane is
/// calibration error: the part is then reported as exactly upright, or exactly in its rest.
fn world_pose(scene: &Scene, hypothesis: &Hypothesis, remembered: Option<&GroundedPart>) -> Option<Pose> {
    let model = &hypothesis.model;
    let mut state = hypothesis.minimum.state.clone();
    let turn = model.rest.map_or(DQuat::IDENTITY, |rest| rest.turn());
    // Heading of the part as if it were stood upright.
    let heading = |pose: &Pose| Pose::new(DVec3::ZERO, pose.rotation * turn.inverse()).yaw();
    let placed = |state: &[f64]| scene.world * model.placement(state).pose;
    let placement = model.placement(&state);
    let named = model.template.named(&placement.values);
    let symmetry = match model.rest {
        Some(rest) => rest.symmetry,
        None => model.template.yaw_symmetry(&named).ok()?,
    };
    let same_rest = |part: &&GroundedPart| {
        part.template == model.template.name && model.rest.is_some_and(|rest| rest.holds(part.up()))
    };
    let reference = remembered.filter(same_rest).map_or(0.0, |part| heading(&part.pose.pose));
    let fitted = heading(&placed(&state));
    let yaw = symmetry.nearest(fitted, reference);
    if let Some(index) = model.yaw_index() {
        state[index] += yaw - fitted;
    }
    let world = placed(&state);
    let upright = DQuat::from_rotation_z(yaw) * turn;
    let normal = scene.world.transform_vector(DVec3::Z);
    if normal.angle_between(DVec3::Z) <= scene.config.upright_tolerance_rad {
        return Some(Pose::new(world.translation, upright));
    }
    Some(Pose::new(world.translation, DQuat::from_rotation_arc(DVec3::Z, normal) * upright))
}

/// Turns the standard deviations of a fit into honest ones. Places err with the camera's calibration:
/// sigma^2 = (k sigma_fit)^2 + floor^2 + (share z)^2. Sizes do not, but things are not quite of their template's shape:
/// sigma^2 = sigma_fit^2 + floor^2 + shape^2, where the shape is told by how far outline and surface are from the fitted
/// ones and by how much the walls lean; of a height by the outline, and by a share of itself.
struct Calibration<'a> {
    config: &'a GrounderConfig,
    systematic_m: f64,
    /// One pixel of the image at the thing, metres.
    pixel_m: f64,
    misfit: Misfit,
}

impl Calibration<'_> {
    fn new<'a>(scene: &Scene<'a>, position: &DVec3, misfit: Misfit) -> Calibration<'a> {
        let camera = (scene.world * scene.camera).inverse();
        let distance = camera.transform_point(*position).z.max(0.0);
        Calibration {
            config: scene.config,
            systematic_m: scene.config.sigma_floor_m.hypot(scene.config.sigma_range * distance),
            pixel_m: distance / scene.scan.intrinsics.fx,
            misfit,
        }
    }
    /// `growth` is how much the extent across and the height grow with the parameter.
    fn size(&self, fitted: f64, value: f64, growth: DVec2) -> f64 {
        let (config, misfit) = (self.config, &self.misfit);
        let shape = if growth.y > growth.x {
            let outline_m = misfit.outline_px * self.pixel_m;
            (config.size_sigma_top * outline_m / growth.y).hypot(config.size_sigma_share * value)
        } else {
            let outline_m = (misfit.outline_px - config.size_outline_px).max(0.0) * self.pixel_m;
            let surface_m = config.size_sigma_surface_m * (misfit.surface - config.size_surface).max(0.0);
            let lean_m = config.size_sigma_lean * misfit.lean_m;
            (config.size_sigma_walls * outline_m).hypot(surface_m).hypot(lean_m) / growth.x
        };
        fitted.hypot(shape).hypot(config.size_sigma_floor_m)
    }
    fn length(&self, fitted: f64) -> f64 {
        (self.config.sigma_factor * fitted).hypot(self.systematic_m)
    }
    /// An angle over a lever of `reach_m`.
    fn angle(&self, fitted: f64, reach_m: f64) -> f64 {
        (self.config.sigma_factor * fitted)
            .hypot(0.5 * self.systematic_m / reach_m.max(0.005))
            .min(std::f64::consts::PI)
    }
}
