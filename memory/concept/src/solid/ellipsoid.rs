//! The distance to an ellipsoid, which has no closed form.

use glam::DVec3;

/// Newton steps; each takes at least a third of the way, and near the end they double the digits.
const STEPS: usize = 80;
/// Relative nearness to the axes' planes below which a point counts as this far from them: on them the nearest point is
/// not unique.
const OFF_PLANE: f64 = 1e-7;

/// Signed distance from a point to an ellipsoid with the given half axes about the origin, negative inside. Metres.
///
/// The nearest surface point x meets `x + t grad(x) = point` for one t: D. Eberly, Distance from a Point to an Ellipse, an
/// Ellipsoid, or a Hyperellipsoid, 2013. In t the condition is convex and falls, so that Newton's steps from below never
/// go too far.
pub(super) fn signed_distance(half: DVec3, point: DVec3) -> f64 {
    let half = half.max(DVec3::splat(1e-9));
    let point = point.abs().max(half * OFF_PLANE);
    let inside = (point / half).length_squared() < 1.0;
    let (squares, weights) = (half * half, half * point);
    let mut t = (weights - squares).max_element();
    for _ in 0..STEPS {
        let below = squares + t;
        let ratio = weights / below;
        let excess = ratio.length_squared() - 1.0;
        let slope = -2.0 * (ratio * ratio / below).element_sum();
        let step = -excess / slope;
        if !step.is_finite() || step <= 1e-14 * (t.abs() + squares.max_element()) {
            break;
        }
        t += step;
    }
    let distance = (squares * point / (squares + t)).distance(point);
    if inside { -distance } else { distance }
}
