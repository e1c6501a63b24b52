//! The outline that is turned about an axis to give a round solid: cup, bowl, bottle, ring, cone.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Fewest and most corners of a profile.
pub const PROFILE_CORNERS: [usize; 2] = [3, 12];
/// Edges that rise by less than this are level, metres.
const LEVEL_M: f64 = 1e-12;

/// A polygon in the half plane of radius (x, at least 0) and height (y), metres. Corners run counter-clockwise, and the
/// middle of its heights is 0.
///
/// An edge that lies on the axis bounds nothing. A polygon that crosses itself is solid where it is crossed an odd number
/// of times on the way out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<DVec2>", into = "Vec<DVec2>")]
pub struct Profile {
    corners: [DVec2; PROFILE_CORNERS[1]],
    count: usize,
}

impl TryFrom<Vec<DVec2>> for Profile {
    type Error = String;
    fn try_from(corners: Vec<DVec2>) -> Result<Profile, String> {
        let [fewest, most] = PROFILE_CORNERS;
        let made = corners.iter().all(|c| c.is_finite()).then(|| Profile::centred(&corners)).flatten();
        made.map(|(profile, _)| profile).ok_or_else(|| format!("a profile needs {fewest} to {most} finite corners"))
    }
}
impl From<Profile> for Vec<DVec2> {
    fn from(profile: Profile) -> Vec<DVec2> {
        profile.corners().to_vec()
    }
}

impl Profile {
    /// A profile from corners (radius, height) in either sense, and the height that is its middle; `None` for too few
    /// or too many corners. Radii below 0 count as 0.
    pub fn centred(corners: &[DVec2]) -> Option<(Profile, f64)> {
        if !(PROFILE_CORNERS[0]..=PROFILE_CORNERS[1]).contains(&corners.len()) {
            return None;
        }
        let heights = || corners.iter().map(|c| c.y);
        let middle = 0.5 * (heights().fold(f64::INFINITY, f64::min) + heights().fold(f64::NEG_INFINITY, f64::max));
        let mut profile = Profile { corners: [DVec2::ZERO; PROFILE_CORNERS[1]], count: corners.len() };
        for (place, corner) in profile.corners.iter_mut().zip(corners) {
            *place = DVec2::new(corner.x.max(0.0), corner.y - middle);
        }
        if profile.edges().map(|[a, b]| a.perp_dot(b)).sum::<f64>() < 0.0
            && let Some(used) = profile.corners.get_mut(..corners.len())
        {
            used.reverse();
        }
        Some((profile, middle))
    }
    /// Corners (radius, height), counter-clockwise. Metres.
    pub fn corners(&self) -> &[DVec2] {
        self.corners.get(..self.count).unwrap_or(&self.corners)
    }
    /// Edges from corner to corner, counter-clockwise: what rises bounds the solid outwards, what falls towards the axis.
    pub fn edges(&self) -> impl Iterator<Item = [DVec2; 2]> + '_ {
        let corners = self.corners();
        corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| [*a, *b])
    }
    /// Largest radius, metres.
    pub fn radius(&self) -> f64 {
        self.corners().iter().map(|c| c.x).fold(0.0, f64::max)
    }
    /// Full height, metres.
    pub fn height(&self) -> f64 {
        2.0 * self.corners().iter().map(|c| c.y).fold(0.0, f64::max)
    }

    /// Signed distance from a point (radius, height), negative inside. Metres.
    pub(super) fn signed_distance(&self, point: DVec2) -> f64 {
        let surface = self.edges().filter(|[a, b]| a.x > 0.0 || b.x > 0.0);
        let nearest = surface.map(|[a, b]| {
            let along = b - a;
            let share = ((point - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            point.distance_squared(a + along * share)
        });
        let distance = nearest.fold(f64::INFINITY, f64::min).sqrt();
        if self.holds(point) { -distance } else { distance }
    }
    fn holds(&self, point: DVec2) -> bool {
        let crossed = |[a, b]: &[DVec2; 2]| {
            (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
        };
        self.edges().filter(crossed).count() % 2 == 1
    }

    /// First stretch of a ray within the solid that does not end behind the origin.
    pub(super) fn intersect_ray(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        // Each edge of the profile sweeps a cone, a cylinder or a ring, which the ray meets at most twice.
        let mut met = [f64::INFINITY; 2 * PROFILE_CORNERS[1]];
        let mut places = met.iter_mut();
        for at in self.edges().flat_map(|edge| meets(edge, origin, direction)).flatten() {
            if let Some(place) = places.next() {
                *place = at;
            }
        }
        met.sort_by(f64::total_cmp);
        let mut stretch: Option<(f64, f64)> = None;
        for (from, to) in met.iter().zip(met.iter().skip(1)) {
            if *to == f64::INFINITY {
                break;
            }
            let middle = origin + direction * (0.5 * (from + to));
            let inside = self.holds(DVec2::new(middle.x.hypot(middle.y), middle.z));
            stretch = match stretch {
                Some((enter, _)) if inside => Some((enter, *to)),
                Some((_, leave)) if leave >= 0.0 => break,
                _ => inside.then_some((*from, *to)),
            };
        }
        stretch.filter(|(_, leave)| *leave >= 0.0)
    }

    /// Volume in cubic metres.
    pub(super) fn volume(&self) -> f64 {
        let slice = |[a, b]: [DVec2; 2]| (b.y - a.y) * (a.x * a.x + a.x * b.x + b.x * b.x);
        std::f64::consts::PI / 3.0 * self.edges().map(slice).sum::<f64>()
    }
}

/// Where a ray meets the surface that an edge of a profile sweeps.
fn meets([a, b]: [DVec2; 2], origin: DVec3, direction: DVec3) -> [Option<f64>; 2] {
    let rise = b.y - a.y;
    if a.x == 0.0 && b.x == 0.0 {
        return [None, None];
    }
    if rise.abs() < LEVEL_M {
        let at = (a.y - origin.z) / direction.z;
        let radius = (origin + direction * at).truncate().length();
        let on_ring = at.is_finite() && (a.x.min(b.x)..=a.x.max(b.x)).contains(&radius);
        return [on_ring.then_some(at), None];
    }
    // x^2 + y^2 = (radius + slope t)^2 along the ray.
    let slope = (b.x - a.x) / rise;
    let (radius, grows) = (a.x + slope * (origin.z - a.y), slope * direction.z);
    let (flat, way) = (origin.truncate(), direction.truncate());
    let square = way.length_squared() - grows * grows;
    let half = flat.dot(way) - radius * grows;
    let rest = flat.length_squared() - radius * radius;
    let on_edge = |at: f64| {
        let height = origin.z + direction.z * at;
        (at.is_finite() && (a.y.min(b.y)..=a.y.max(b.y)).contains(&height)).then_some(at)
    };
    if square.abs() < 1e-14 * direction.length_squared() {
        return [on_edge(-0.5 * rest / half), None];
    }
    let discriminant = half * half - square * rest;
    if discriminant < 0.0 {
        return [None, None];
    }
    let root = discriminant.sqrt();
    [on_edge((-half - root) / square), on_edge((-half + root) / square)]
}
