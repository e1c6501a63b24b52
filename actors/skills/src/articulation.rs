//! How a part can move against what carries it: along a line or about an axis, and what the path of a hand that
//! moves it tells of that line or axis.

use acm_concept::pose::Pose;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// Nearer to the axis than this, the hand's turn tells more of the joint than its place, metres.
const NEAR_AXIS_M: f64 = 0.03;
/// How far the axis is believed to be off before anything has moved, metres; and how far a measured TCP is off the
/// true arc, because fingers and wrist yield; metres.
const AXIS_SIGMA_M: f64 = 0.02;
const TRACE_SIGMA_M: f64 = 0.002;
/// The same for the direction of a line, radians.
const LINE_SIGMA_RAD: f64 = 0.1;
/// Rounds of the fit; it converges in three or four.
const FIT_ROUNDS: usize = 8;

/// A joint of one degree of freedom (after Sturm et al., "A probabilistic framework for learning kinematic models of
/// articulated objects", 2011: the rigid, prismatic and rotational models; rigid is what does not move).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Articulation {
    /// Along a line.
    Prismatic {
        /// Unit direction of positive travel, world frame.
        direction: DVec3,
    },
    /// About an axis.
    Revolute {
        /// A point of the axis, world frame, metres.
        point: DVec3,
        /// Unit direction of the axis; positive turns are right-handed about it.
        axis: DVec3,
    },
}

impl Articulation {
    /// Where a TCP that is fixed to the part comes to be when the joint travels: metres or radians.
    pub fn carried(&self, from: &Pose, travel: f64) -> Pose {
        match *self {
            Articulation::Prismatic { direction } => Pose::new(from.translation + travel * direction, from.rotation),
            Articulation::Revolute { point, axis } => {
                let turn = DQuat::from_axis_angle(axis, travel);
                Pose::new(point + turn * (from.translation - point), (turn * from.rotation).normalize())
            }
        }
    }
    /// How far the TCP moves for one unit of travel: the radius of the arc, or 1 for a line.
    pub fn lever_m(&self, at: DVec3) -> f64 {
        match *self {
            Articulation::Prismatic { .. } => 1.0,
            Articulation::Revolute { point, axis } => (at - point).reject_from_normalized(axis).length(),
        }
    }
    /// Whether the TCP is so near the axis that it turns rather than travels.
    pub fn turns_in_place(&self, at: DVec3) -> bool {
        matches!(self, Articulation::Revolute { .. }) && self.lever_m(at) < NEAR_AXIS_M
    }
    /// Unit direction in which the TCP moves, or zero on the axis.
    pub fn tangent(&self, at: DVec3) -> DVec3 {
        match *self {
            Articulation::Prismatic { direction } => direction,
            Articulation::Revolute { point, axis } => axis.cross(at - point).normalize_or_zero(),
        }
    }
    /// The travel that a measured TCP tells, given where it began; of all turns the one nearest to `near`.
    pub fn travel(&self, from: &Pose, now: &Pose, near: f64) -> f64 {
        match *self {
            Articulation::Prismatic { direction } => (now.translation - from.translation).dot(direction),
            Articulation::Revolute { point, axis } => {
                let angle = if self.turns_in_place(from.translation) {
                    let turn = now.rotation * from.rotation.inverse();
                    2.0 * turn.xyz().dot(axis).atan2(turn.w)
                } else {
                    let arm = |at: DVec3| (at - point).reject_from_normalized(axis);
                    let (a, b) = (arm(from.translation), arm(now.translation));
                    a.cross(b).dot(axis).atan2(a.dot(b))
                };
                angle + ((near - angle) / std::f64::consts::TAU).round() * std::f64::consts::TAU
            }
        }
    }
    /// The joint as the trace of the TCP and the first belief together tell it: the most probable one under Gaussian
    /// errors of both. The direction of a revolute axis stays, since the arc tells little of it.
    pub fn refined(&self, trace: &[DVec3]) -> Articulation {
        let [first, .., last] = trace else { return *self };
        match *self {
            Articulation::Prismatic { direction } => {
                let way = *last - *first;
                // The part may have gone either way.
                let way = if way.dot(direction) < 0.0 { -way } else { way };
                let weight = (way.length() * LINE_SIGMA_RAD / TRACE_SIGMA_M).powi(2);
                let mean = (direction + weight * way.normalize_or(direction)).normalize_or(direction);
                Articulation::Prismatic { direction: mean }
            }
            Articulation::Revolute { point, axis } => {
                if self.turns_in_place(*first) {
                    return *self;
                }
                let (u, v) = axis.any_orthonormal_pair();
                let flat = |at: DVec3| DVec2::new((at - point).dot(u), (at - point).dot(v));
                let points: Vec<DVec2> = trace.iter().map(|at| flat(*at)).collect();
                let centre = fit_centre(&points);
                Articulation::Revolute { point: point + centre.x * u + centre.y * v, axis }
            }
        }
    }
}

/// Centre of the circle through points of a plane whose prior lies at the origin: Gauss-Newton over centre and radius.
fn fit_centre(points: &[DVec2]) -> DVec2 {
    let mean = |centre: DVec2| points.iter().map(|at| at.distance(centre)).sum::<f64>() / points.len() as f64;
    let (mut centre, mut radius) = (DVec2::ZERO, mean(DVec2::ZERO));
    // Readings come so densely that neighbours share their error: all together they weigh as much as ten.
    let weight = (10.0 / points.len() as f64).min(1.0) / (TRACE_SIGMA_M * TRACE_SIGMA_M);
    let prior = 1.0 / (AXIS_SIGMA_M * AXIS_SIGMA_M);
    for _ in 0..FIT_ROUNDS {
        let mut normal = DMat3::from_diagonal(DVec3::new(prior, prior, 1e-6 * prior));
        let mut right = -prior * centre.extend(0.0);
        for at in points {
            let row = -(*at - centre).normalize_or_zero().extend(1.0);
            let residual = at.distance(centre) - radius;
            normal += DMat3::from_cols(weight * row.x * row, weight * row.y * row, weight * row.z * row);
            right -= weight * residual * row;
        }
        let step = normal.inverse() * right;
        if !step.is_finite() {
            break;
        }
        centre += step.truncate();
        radius += step.z;
    }
    centre
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn arc(centre: DVec3, radius: f64, angle: f64) -> Vec<DVec3> {
        (0..=30)
            .map(|i| {
                centre
                    + radius * DVec3::new((angle * f64::from(i) / 30.0).cos(), (angle * f64::from(i) / 30.0).sin(), 0.0)
            })
            .collect()
    }

    proptest! {
        #[test]
        fn a_carried_hand_tells_the_travel(x in -0.5..0.5f64, y in -0.5..0.5f64, travel in -2.8..2.8f64, slide in any::<bool>()) {
            let joint = if slide {
                Articulation::Prismatic { direction: DVec3::new(0.6, 0.0, 0.8) }
            } else {
                Articulation::Revolute { point: DVec3::new(0.1, 0.2, 0.3), axis: DVec3::new(0.0, 0.6, 0.8) }
            };
            let from = Pose::from_yaw(DVec3::new(x, y, 0.4), x);
            let told = joint.travel(&from, &joint.carried(&from, travel), travel);
            prop_assert!((told - travel).abs() < 1e-9, "{told}");
        }
    }

    #[test]
    fn the_arc_corrects_the_axis() {
        let truth = DVec3::new(0.01, -0.008, 0.0);
        let believed = Articulation::Revolute { point: DVec3::ZERO, axis: DVec3::Z };
        let Articulation::Revolute { point, .. } = believed.refined(&arc(truth, 0.4, 1.2)) else { unreachable!() };
        assert!(point.distance(truth) < 0.002, "{point}");
        // A short arc tells little: the first belief stands.
        let Articulation::Revolute { point, .. } = believed.refined(&arc(truth, 0.4, 0.02)) else { unreachable!() };
        assert!(point.distance(truth) > 0.006, "{point}");
    }

    #[test]
    fn the_way_corrects_the_line() {
        let believed = Articulation::Prismatic { direction: DVec3::X };
        let trace: Vec<DVec3> = (0..20).map(|i| f64::from(i) * 0.01 * DVec3::new(0.995, 0.0998, 0.0)).collect();
        let Articulation::Prismatic { direction } = believed.refined(&trace) else { unreachable!() };
        assert!(direction.angle_between(DVec3::new(0.995, 0.0998, 0.0)) < 0.005, "{direction}");
    }
}
