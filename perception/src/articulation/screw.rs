//! The motions of the two kinds of joints, and their numbers.

use acm_concept::pose::Pose;
use glam::{DQuat, DVec3};

/// The kind of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Revolute,
    Prismatic,
}

/// A motion along a joint from the first frame to the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Screw {
    pub kind: Kind,
    /// Of length 1.
    pub axis: DVec3,
    /// A point of the axis; of no meaning for a slide.
    pub point: DVec3,
    /// Radians or metres.
    pub amount: f64,
}

impl Screw {
    pub fn slide(axis: DVec3, amount: f64) -> Screw {
        Screw { kind: Kind::Prismatic, axis, point: DVec3::ZERO, amount }
    }
    pub fn turn(axis: DVec3, point: DVec3, amount: f64) -> Screw {
        Screw { kind: Kind::Revolute, axis, point, amount }
    }

    /// The motion, from the first frame's state to the second's.
    pub fn pose(&self) -> Pose {
        match self.kind {
            Kind::Prismatic => Pose::from_translation(self.axis * self.amount),
            Kind::Revolute => {
                let turn = DQuat::from_axis_angle(self.axis, self.amount);
                Pose::new(self.point - turn * self.point, turn)
            }
        }
    }

    /// The same axis, its point moved along it to the foot of `near`.
    pub fn anchored(mut self, near: DVec3) -> Screw {
        self.point += self.axis * (near - self.point).dot(self.axis);
        self
    }

    /// How many numbers it has.
    pub fn freedom(&self) -> usize {
        match self.kind {
            Kind::Revolute => 5,
            Kind::Prismatic => 3,
        }
    }

    /// Scales of its numbers for a search: amount, two tilts of the axis (radians), two displacements (metres).
    pub fn scales(&self) -> [f64; 5] {
        let amount = if self.kind == Kind::Revolute { 0.04 } else { 0.01 };
        [amount, 0.04, 0.04, 0.012, 0.012]
    }

    /// Changed by some of its numbers, in the order of [`Screw::scales`].
    pub fn changed(&self, by: &[f64]) -> Screw {
        let (u, v) = self.axis.any_orthonormal_pair();
        let get = |at: usize| by.get(at).copied().unwrap_or(0.0);
        let axis = (self.axis + u * get(1) + v * get(2)).normalize();
        Screw { axis, point: self.point + u * get(3) + v * get(4), amount: self.amount + get(0), ..*self }
    }
}
