//! How a link hangs on its parent, and everything that acts along its one axis.

use acm_concept::pose::Pose;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Ranges of a hinge that are wider than this are taken as a free turn, radians: the engine tells angles apart
/// within one turn only.
pub(crate) const FULL_TURN: f64 = 2.0 * PI - 0.2;

/// Whether a link turns or slides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JointKind {
    Hinge,
    Slider,
}

/// A joint of one freedom. Positions are radians or metres, forces newton metres or newtons.
///
/// Every link's frame lies on the object's base frame when all joints are at zero, so that origin and axis are
/// written in one frame for all links.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Joint {
    pub(crate) kind: JointKind,
    pub(crate) origin: DVec3,
    /// Of length 1.
    pub(crate) axis: DVec3,
    /// `None` turns or slides without end.
    pub(crate) range: Option<[f64; 2]>,
    /// Where it counts as closed.
    pub(crate) closed: f64,
    pub(crate) start: f64,
    /// Dry friction.
    pub(crate) friction: f64,
    /// Force per speed.
    pub(crate) damping: f64,
    pub(crate) spring: Option<Spring>,
    pub(crate) latch: Option<Latch>,
    pub(crate) detents: Option<Detents>,
    pub(crate) press: Option<Press>,
    pub(crate) follows: Option<Follows>,
}

/// Pulls to `rest`; there it already pulls with the preload, against the stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spring {
    pub(crate) stiffness: f64,
    pub(crate) rest: f64,
    pub(crate) preload: f64,
}

/// Holds the joint at its closed position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Latch {
    /// What it takes to leave, besides friction.
    pub(crate) force: f64,
    /// It holds, and catches again, nearer than this.
    pub(crate) within: f64,
}

/// Positions in which the joint rests.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Detents {
    /// What it takes to leave one, besides friction.
    pub(crate) force: f64,
    pub(crate) at: Notches,
}

/// Where detents are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Notches {
    /// At these positions, ascending.
    At(Vec<f64>),
    /// At the multiples of this.
    Every(f64),
}

/// Counts a press once per stroke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Press {
    /// Pressed once it is farther from closed than this.
    pub(crate) pressed: f64,
    /// Ready again once it is nearer than this.
    pub(crate) rearmed: f64,
}

/// What drives a joint that nobody is meant to move by hand.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Follows {
    /// Another link's joint: `ratio * position + offset`.
    Joint { link: usize, ratio: f64, offset: f64 },
    /// An expression over the object's own variables, or none before the scenario gives one.
    Expression(Option<String>),
}

impl Joint {
    /// A joint without anything acting along it.
    pub(crate) fn new(kind: JointKind, origin: DVec3, axis: DVec3, range: Option<[f64; 2]>) -> Joint {
        let range = range.filter(|[low, high]| kind == JointKind::Slider || high - low < FULL_TURN);
        let zero = range.map_or(0.0, |[low, high]| 0.0_f64.clamp(low, high));
        Joint {
            kind,
            origin,
            axis: axis.normalize_or(DVec3::Z),
            range,
            closed: zero,
            start: zero,
            friction: 0.0,
            damping: 0.0,
            spring: None,
            latch: None,
            detents: None,
            press: None,
            follows: None,
        }
    }

    /// Motion of the child's frame in the parent's at a position.
    pub(crate) fn motion(&self, position: f64) -> Pose {
        match self.kind {
            JointKind::Slider => Pose::from_translation(self.axis * position),
            JointKind::Hinge => {
                let turn = DQuat::from_axis_angle(self.axis, position);
                Pose::new(self.origin - turn * self.origin, turn)
            }
        }
    }

    /// How far it can go from closed; 0 for one without end.
    pub(crate) fn stroke(&self) -> f64 {
        self.range.map_or(0.0, |[low, high]| (high - self.closed).max(self.closed - low))
    }

    /// How far it is open, 0 to 1; 0 for one without end.
    pub(crate) fn opened(&self, position: f64) -> f64 {
        let stroke = self.stroke();
        if stroke > 0.0 { ((position - self.closed).abs() / stroke).min(1.0) } else { 0.0 }
    }

    /// The nearest position that it can take.
    pub(crate) fn clamp(&self, position: f64) -> f64 {
        self.range.map_or(position, |[low, high]| position.clamp(low, high))
    }

    /// The same joint of an object that is stretched along its axes.
    pub(crate) fn scaled(&self, scale: DVec3) -> Joint {
        let stretched = self.axis * scale;
        // A hinge's axis keeps its direction, as solids keep their angles.
        let (axis, factor) = match self.kind {
            JointKind::Hinge => (self.axis, 1.0),
            JointKind::Slider => (stretched.normalize_or(self.axis), stretched.length()),
        };
        let mut joint = self.clone();
        joint.origin *= scale;
        joint.axis = axis;
        joint.range = self.range.map(|range| range.map(|end| end * factor));
        joint.closed *= factor;
        joint.start *= factor;
        joint
    }
}

impl Spring {
    /// Where the spring would rest without the stop that the joint is pressed against.
    pub(crate) fn free(&self, joint: &Joint) -> f64 {
        let beyond = self.preload / self.stiffness;
        let at_upper = joint.range.is_some_and(|[low, high]| self.rest > 0.5 * (low + high));
        if at_upper { self.rest + beyond } else { self.rest - beyond }
    }
}

impl Notches {
    /// The nearest notch, and half of the way to its neighbours.
    pub(crate) fn nearest(&self, position: f64) -> (f64, f64) {
        match self {
            Notches::Every(step) => ((position / step).round() * step, 0.5 * step),
            Notches::At(at) => {
                let distance = |notch: &f64| (notch - position).abs();
                let nearest = at.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)));
                let nearest = nearest.unwrap_or(position);
                let others = at.iter().filter(|notch| **notch != nearest).map(|notch| 0.5 * (notch - nearest).abs());
                let half = others.fold(f64::INFINITY, f64::min);
                (nearest, if half.is_finite() { half } else { 0.1 })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn door() -> Joint {
        Joint::new(JointKind::Hinge, DVec3::new(0.2, 0.3, 0.0), DVec3::Z * 2.0, Some([-1.6, 0.0]))
    }

    #[test]
    fn a_hinge_turns_about_its_origin() {
        let motion = door().motion(-std::f64::consts::FRAC_PI_2);
        assert!(motion.transform_point(DVec3::new(0.2, 0.3, 0.5)).distance(DVec3::new(0.2, 0.3, 0.5)) < 1e-12);
        assert!(motion.transform_point(DVec3::new(0.3, 0.3, 0.0)).distance(DVec3::new(0.2, 0.2, 0.0)) < 1e-12);
    }

    #[test]
    fn opened_is_measured_from_closed_whichever_way_it_goes() {
        assert!((door().opened(-0.8) - 0.5).abs() < 1e-12 && door().opened(0.0) == 0.0);
        let swing = Joint::new(JointKind::Hinge, DVec3::ZERO, DVec3::Z, Some([-1.0, 2.0]));
        assert!((swing.closed, swing.start) == (0.0, 0.0) && (swing.opened(-1.0) - 0.5).abs() < 1e-12);
        let far = Joint::new(JointKind::Slider, DVec3::ZERO, DVec3::X, Some([0.1, 0.4]));
        assert!(far.closed == 0.1 && (far.opened(0.25) - 0.5).abs() < 1e-12);
        assert_eq!(Joint::new(JointKind::Hinge, DVec3::ZERO, DVec3::Z, Some([-PI, PI])).range, None);
    }

    #[test]
    fn a_stretched_slider_goes_farther() {
        let drawer = Joint::new(JointKind::Slider, DVec3::ZERO, DVec3::X, Some([0.0, 0.3]));
        assert_eq!(drawer.scaled(DVec3::new(2.0, 1.0, 1.0)).range, Some([0.0, 0.6]));
        assert_eq!(door().scaled(DVec3::splat(2.0)).range, Some([-1.6, 0.0]));
    }

    #[test]
    fn notches_are_found() {
        assert_eq!(Notches::Every(0.5).nearest(0.7), (0.5, 0.25));
        assert_eq!(Notches::At(vec![0.0, 0.4, 1.0]).nearest(0.6), (0.4, 0.2));
    }
}
