//! One answer against the truth, and the figures of many.

use super::trial::{Trial, Truth};
use crate::bench::Row;
use acm_perception::articulation::{JointModel, MovedPart, NotTold};

/// The part is found if its pixels overlap the true ones by so much, in the frame that shows more of it.
const FOUND_IOU: f64 = 0.5;
/// The axis is right within these.
const WITHIN_DEG: f64 = 5.0;
const WITHIN_M: f64 = 0.02;

/// What became of one trial.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Scored {
    /// Whether enough of the part shows to be asked for its axis.
    pub shows: bool,
    /// Whether some part was told at all.
    pub told: bool,
    /// Intersection over union of its pixels in the frame that shows more of it.
    pub iou: f64,
    /// Whether its joint turns or slides as it truly does.
    pub kind_right: bool,
    /// Angle between the axes, degrees; of a joint of the right kind.
    pub off_deg: f64,
    /// Distance of the axes beside the part, metres; of a hinge of the right kind.
    pub off_m: f64,
    /// How many further parts were told: none else moved.
    pub further: usize,
    /// The same distances for a perfect reading of these frames: what the camera's errors of calibration alone do.
    pub bias: (f64, f64),
    /// How far the axis is off, in standard deviations as they were told: direction, place.
    pub sigmas: [f64; 2],
}

impl Scored {
    fn part_and_joint(&self) -> bool {
        self.told && self.kind_right && self.iou >= FOUND_IOU
    }
    fn axis(&self) -> bool {
        self.told && self.kind_right && within(self.off_deg, self.off_m)
    }

    /// A row of one trial.
    pub fn row(&self, name: &str, truth: &Truth) -> Row {
        let flag = |value: bool| f64::from(u8::from(value));
        let values = [
            ("hinge", flag(truth.is_hinge)),
            ("moved", truth.moved),
            ("shows", flag(self.shows)),
            ("told", flag(self.told)),
            ("iou", self.iou),
            ("joint_right", flag(self.kind_right)),
            ("off_deg", self.off_deg),
            ("off_mm", self.off_m * 1e3),
            ("bias_mm", self.bias.1 * 1e3),
            ("good", flag(self.part_and_joint() && self.axis())),
        ];
        Row::new(format!("{name} {}", truth.name), values)
    }
}

fn within(deg: f64, metres: f64) -> bool {
    deg <= WITHIN_DEG && metres <= WITHIN_M
}

/// Compares the first part that was told with the one that was moved.
pub fn score(trial: &Trial, answer: &Result<Vec<MovedPart>, NotTold>) -> Scored {
    let truth = &trial.truth;
    let (origin, axis) = truth.seen;
    let mut scored = Scored { shows: trial.shows, bias: distance(truth, axis, Some(origin)), ..Scored::default() };
    let Some((part, further)) = answer.as_ref().ok().and_then(|parts| parts.split_first()) else { return scored };
    let [before, after] = &trial.part;
    let shows = |pixels: &[bool]| pixels.iter().filter(|shown| **shown).count();
    let (own, true_pixels) = if shows(before) > shows(after) { (&part.before, before) } else { (&part.after, after) };
    let both = own.iter().filter(|pixel| true_pixels.get(**pixel).copied().unwrap_or(false)).count();
    scored.told = true;
    scored.iou = both as f64 / (own.len() + shows(true_pixels) - both).max(1) as f64;
    scored.further = further.len();
    let (is_hinge, axis, point, sigma) = match part.joint {
        JointModel::Revolute { axis, point, sigma, .. } => (true, axis, Some(point), sigma),
        JointModel::Prismatic { axis, sigma, .. } => (false, axis, None, [sigma[0], 0.0, 0.0]),
    };
    scored.kind_right = is_hinge == truth.is_hinge;
    if scored.kind_right {
        (scored.off_deg, scored.off_m) = distance(truth, axis, point);
        let over = |error: f64, sigma: f64| if sigma > 0.0 { error / sigma } else { 0.0 };
        scored.sigmas = [over(scored.off_deg.to_radians(), sigma[0]), over(scored.off_m, sigma[1])];
    }
    scored
}

/// Angle of an axis to the true one, degrees, and the distance of its point from the true axis, metres; 0 for a slide.
fn distance(truth: &Truth, axis: glam::DVec3, point: Option<glam::DVec3>) -> (f64, f64) {
    let deg = axis.dot(truth.axis).abs().min(1.0).acos().to_degrees();
    let away = |point: glam::DVec3| (point - truth.origin).reject_from_normalized(truth.axis).length();
    (deg, point.filter(|_| truth.is_hinge).map_or(0.0, away))
}

/// Many trials.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    scored: Vec<Scored>,
    shut_in: usize,
}

impl Tally {
    /// Adds a trial.
    pub fn add(&mut self, scored: &Scored) {
        self.scored.push(*scored);
    }
    /// Adds joints that were passed over: their parts are shut in.
    pub fn pass_over(&mut self, joints: usize) {
        self.shut_in += joints;
    }
    /// Adds all of another one.
    pub fn join(&mut self, other: &Tally) {
        self.scored.extend(&other.scored);
        self.shut_in += other.shut_in;
    }
    /// Trials.
    pub fn asked(&self) -> usize {
        self.scored.len()
    }
    /// Joints that were passed over.
    pub fn shut_in(&self) -> usize {
        self.shut_in
    }
    /// Trials whose part shows too little to be asked for its axis.
    pub fn hidden(&self) -> usize {
        self.scored.len() - self.showing().count()
    }

    fn showing(&self) -> impl Iterator<Item = &Scored> {
        self.scored.iter().filter(|scored| scored.shows)
    }
    fn share(&self, holds: impl Fn(&Scored) -> bool) -> f64 {
        self.scored.iter().filter(|scored| holds(scored)).count() as f64 / self.scored.len().max(1) as f64
    }
    fn share_of_showing(&self, holds: impl Fn(&Scored) -> bool) -> f64 {
        self.showing().filter(|scored| holds(scored)).count() as f64 / self.showing().count().max(1) as f64
    }

    /// The figures, by the names of the targets; none without a trial.
    pub fn figures(&self) -> Vec<(&'static str, f64)> {
        if self.scored.is_empty() {
            return Vec::new();
        }
        vec![
            ("articulation_part_and_joint", self.share(Scored::part_and_joint)),
            ("articulation_axis", self.share_of_showing(Scored::axis)),
        ]
    }

    /// A row with the figures and what they are made of.
    pub fn row(&self, name: String) -> Row {
        let more = [
            ("trials", self.scored.len() as f64),
            ("hidden", self.hidden() as f64),
            ("passed_over", self.shut_in as f64),
            ("not_told", self.share(|scored| !scored.told)),
            ("part_found", self.share(|scored| scored.told && scored.iou >= FOUND_IOU)),
            ("joint_right", self.share(|scored| scored.kind_right)),
            ("axis_of_a_perfect_reading", self.share_of_showing(|scored| within(scored.bias.0, scored.bias.1))),
            ("further_parts", self.scored.iter().map(|scored| scored.further as f64).sum()),
            (
                "axis_within_2_sigma",
                self.share_of_showing(|scored| scored.axis() && scored.sigmas.iter().all(|off| *off <= 2.0)),
            ),
        ];
        Row::new(name, self.figures().into_iter().chain(more))
    }
}
