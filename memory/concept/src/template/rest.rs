//! How a part comes to rest besides upright: a can on its side, a box on its end.

use super::YawSymmetry;
use glam::{DQuat, DVec3};

/// A direction that deviates from another by less than this cosine's angle (32 degrees) is taken for it.
pub(super) const NEAR_COSINE: f64 = 0.85;

/// A way to come to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// The direction of the base frame that points up.
    pub up: DVec3,
    /// How its headings are equivalent.
    pub symmetry: YawSymmetry,
    /// Odds of finding the part so against finding it upright.
    pub prior: f64,
    /// Whether it then looks like an upright part of other sizes, as a box does on its side: only who knows the part's
    /// sizes can tell.
    pub like_upright: bool,
}

impl Rest {
    /// The rotation from the upright stance: the shortest one that brings `up` to the vertical.
    pub fn turn(&self) -> DQuat {
        DQuat::from_rotation_arc(self.up, DVec3::Z)
    }
    /// Whether a part of which this direction of the base frame points up is in this rest.
    pub fn holds(&self, up: DVec3) -> bool {
        self.up.dot(up) > NEAR_COSINE
    }
}
