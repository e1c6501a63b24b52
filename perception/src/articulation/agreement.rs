//! How well a motion explains both frames.

use super::{
    change::Changed,
    screw::{Kind, Screw},
    view::{Sight, View},
};
use crate::scan::Tint;
use acm_concept::pose::Pose;
use glam::DVec3;

/// What a moved point costs at most (negative log likelihood against a perfect match): where the other frame looks through
/// it, where something stands before it, where nothing was measured, beside the image.
const THROUGH: f64 = 8.0;
const HIDDEN: f64 = 3.5;
const UNMEASURED: f64 = 3.0;
const OUTSIDE: f64 = 3.0;

/// The same where it meets what did not move; where it is of the part's far side, by what it lies behind the near one.
const STILL: f64 = 1.0;
const FAR_SIDE: f64 = 0.4;
/// Where it is hidden by what changed as well: a part hides its own inside.
const OWN_HIDDEN: f64 = 1.6;
/// An axis that lies so far from all of the part costs as much a point, and farther ones at most so many times that, metres.
const NEAR_M: f64 = 0.03;
/// Near a hinge nothing is seen to move: what moved by less does not count as changed, metres.
const UNSEEN_M: f64 = 0.025;
/// Colours with the light taken out that differ by this are of two surfaces.
const TINT: f32 = 9.0;
const FAR_AXIS: f64 = 1.5;
/// What a radian of turn costs: of like explanations the smaller motion is likelier; doors seldom turn by more than so much.
const PER_RADIAN: f64 = 0.05;
const SELDOM_RAD: f64 = 2.1;
const PER_SELDOM_RADIAN: f64 = 0.8;
/// Directions of a part's two sides, or their measurements, differ by about so much, radians.
const SLANT: f64 = 0.12;
/// A part is about so thick, metres; what lies deeper behind its near side costs more.
const THICK_M: f64 = 0.10;
/// A surface that turns away by less than this cosine from the camera is seen from behind.
const BEHIND: f64 = -0.1;
/// Surfaces that are seen from aside by more than this cosine are hardly measured.
const GRAZING: f64 = 0.2;
/// Directions of surfaces that meet agree within this cosine.
const AGREES: f64 = 0.75;

/// A measured point whose motion is looked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// In the world, metres.
    pub at: DVec3,
    /// Direction of its surface; zero where it is not known.
    pub normal: DVec3,
    pub tint: Tint,
    pub weight: f64,
}

/// Points of both frames whose motion is looked for.
pub(super) struct Evidence<'a, 'b> {
    views: &'a [View<'b>; 2],
    still: &'a [Vec<bool>; 2],
    /// Of each frame.
    pub points: [Vec<Point>; 2],
}

impl<'a, 'b> Evidence<'a, 'b> {
    /// About `most` of the changed points, evenly taken.
    pub fn of(views: &'a [View<'b>; 2], changed: &'a Changed, most: usize) -> Evidence<'a, 'b> {
        let step = changed.count().div_ceil(most).max(1);
        let points = [0, 1].map(|frame| {
            let view = &views[frame];
            let pixels = changed.pixels(frame);
            // Of two frames that show different amounts of a part neither decides alone.
            let weight = 1.0 / (pixels.len().max(1) as f64).sqrt();
            let point = |pixel: &usize| Point {
                at: view.point(*pixel),
                normal: view.normal[*pixel].as_dvec3(),
                tint: view.tint[*pixel],
                weight,
            };
            pixels.iter().step_by(step).map(point).collect()
        });
        Evidence { views, still: &changed.still, points }
    }

    /// How many points there are.
    pub fn count(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// Sum of the points' weights.
    pub fn weight(&self) -> f64 {
        self.points.iter().flatten().map(|point| point.weight).sum()
    }

    /// Mean cost of a point under a motion; standard deviations are widened.
    pub fn cost(&self, screw: &Screw, widening: f64) -> f64 {
        let motion = screw.pose();
        let ways = [(motion, 0, 1), (motion.inverse(), 1, 0)];
        let costs = ways.iter().flat_map(|(motion, from, to)| {
            self.points[*from].iter().map(|point| point.weight * self.cost_of(point, motion, *to, widening))
        });
        costs.sum::<f64>() / self.weight().max(1e-9) + self.unlikely(screw)
    }

    /// Share of the points' weight whose surface the other frame sees from behind: how thick the part is decides where they
    /// are there, and only its rim tells that.
    pub fn turned_away(&self, screw: &Screw) -> f64 {
        let motion = screw.pose();
        let ways = [(motion, 0, 1), (motion.inverse(), 1, 0)];
        let away = ways.iter().flat_map(|(motion, from, to)| {
            let behind = move |point: &&Point| {
                let at = motion.transform_point(point.at);
                let sight = (self.views[*to].camera.translation - at).normalize();
                motion.transform_vector(point.normal).dot(sight) < BEHIND
            };
            self.points[*from].iter().filter(behind).map(|point| point.weight)
        });
        away.sum::<f64>() / self.weight().max(1e-9)
    }

    /// What a turn costs by itself: a part hangs on a hinge near to it.
    fn unlikely(&self, screw: &Screw) -> f64 {
        if screw.kind == Kind::Prismatic {
            return 0.0;
        }
        let turn = screw.amount.abs();
        let away = |point: &Point| (point.at - screw.point).cross(screw.axis).length_squared();
        let nearest =
            self.points.iter().flat_map(|points| points.iter().step_by(3)).map(away).fold(f64::MAX, f64::min).sqrt();
        let unseen = NEAR_M + UNSEEN_M / (2.0 * (0.5 * screw.amount).sin().abs()).max(0.1);
        ((nearest - unseen) / NEAR_M).clamp(0.0, FAR_AXIS)
            + PER_RADIAN * turn
            + PER_SELDOM_RADIAN * (turn - SELDOM_RAD).max(0.0)
    }

    /// Cost of a point that is moved into a frame.
    fn cost_of(&self, point: &Point, motion: &Pose, to: usize, widening: f64) -> f64 {
        let view = &self.views[to];
        let at = motion.transform_point(point.at);
        let sight = (view.camera.translation - at).normalize();
        let facing = motion.transform_vector(point.normal).dot(sight);
        let (sigmas, metres, pixel) = match view.sight(at) {
            Sight::Outside => return OUTSIDE,
            // No sensor measures a surface from aside.
            Sight::Unmeasured if facing < GRAZING => return FAR_SIDE,
            Sight::Unmeasured => return UNMEASURED,
            Sight::Beyond { sigmas, metres, pixel } => (sigmas / widening, metres, pixel),
        };
        let squared = 0.25 * sigmas * sigmas;
        let still = self.still[to][pixel];
        if sigmas > 0.0 && squared > THROUGH {
            return THROUGH;
        }
        let measured = view.normal[pixel].as_dvec3();
        let known = point.normal != DVec3::ZERO && measured != DVec3::ZERO;
        let parallel = motion.transform_vector(point.normal).dot(measured);
        if facing < GRAZING && (facing < BEHIND || sigmas < 0.0) {
            // Its own near side is before it, as far as the part is thick, and looks the other way.
            let behind = (-metres * measured.dot(sight)).max(0.0);
            let askew = if facing > -GRAZING {
                0.0
            } else if known {
                (1.0 + parallel) / (1.0 - SLANT.cos())
            } else {
                0.0
            };
            return match (sigmas > 0.0, still) {
                (true, _) => squared.max(FAR_SIDE),
                (false, true) => HIDDEN,
                (false, false) => (FAR_SIDE + 0.25 * askew + (behind / THICK_M - 1.0).max(0.0)).min(OWN_HIDDEN),
            };
        }
        let most = match (sigmas > 0.0, still) {
            (true, _) => THROUGH,
            (false, true) => HIDDEN,
            (false, false) => OWN_HIDDEN,
        };
        let mut cost = squared.min(most);
        let other = point.tint.distance(&view.tint[pixel]) > TINT;
        if other || known && parallel < AGREES {
            cost = cost.max(most.min(HIDDEN));
        } else if still {
            cost = cost.max(STILL);
        }
        cost
    }
}
