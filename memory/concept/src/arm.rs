//! A serial arm: joint frames, limits, link capsules, and forward kinematics.
//!
//! Frames follow the convention of URDF: a joint's frame is given in the frame of the link before it, and the joint
//! turns about an axis through that frame's origin. Link 0 is the base and does not move; link `i` is what joint `i`
//! (counted from 1) moves.

use crate::{
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
use std::ops::{Deref, DerefMut};

/// Most joints of one arm.
pub const MAX_JOINTS: usize = 8;

/// Frames of the base and of every link, world frame. Those beyond the last link repeat it.
pub type LinkFrames = [Pose; MAX_JOINTS + 1];

/// Positions of an arm's joints, radians. Small enough to be copied with every command.
///
/// ```
/// # use acm_concept::arm::Joints;
/// let mut joints = Joints::new(&[0.1, -0.2]).unwrap();
/// joints[1] = 0.3;
/// assert_eq!(&joints[..], [0.1, 0.3]);
/// assert!(Joints::new(&[0.0; 9]).is_none());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joints {
    count: u8,
    values: [f64; MAX_JOINTS],
}

impl Joints {
    /// `None` for more than [`MAX_JOINTS`].
    pub fn new(values: &[f64]) -> Option<Joints> {
        let mut joints = Joints { count: u8::try_from(values.len()).ok()?, values: [0.0; MAX_JOINTS] };
        joints.values.get_mut(..values.len())?.copy_from_slice(values);
        Some(joints)
    }
    /// The same number of joints, each from its index.
    pub fn map(&self, mut value: impl FnMut(usize) -> f64) -> Joints {
        let mut mapped = *self;
        mapped.iter_mut().enumerate().for_each(|(index, slot)| *slot = value(index));
        mapped
    }
    /// Straight-line interpolation; `fraction` 0 is `self`, 1 is `other`.
    pub fn lerp(&self, other: &Joints, fraction: f64) -> Joints {
        if fraction == 1.0 {
            return *other;
        }
        self.map(|i| self[i] + fraction * (other[i] - self[i]))
    }
    /// Largest difference of one joint, radians.
    pub fn farthest(&self, other: &Joints) -> f64 {
        self.iter().zip(other.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

impl Deref for Joints {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        self.values.split_at(usize::from(self.count)).0
    }
}

impl DerefMut for Joints {
    fn deref_mut(&mut self) -> &mut [f64] {
        self.values.split_at_mut(usize::from(self.count)).0
    }
}

impl Serialize for Joints {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Joints {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let values = Vec::<f64>::deserialize(deserializer)?;
        Joints::new(&values).ok_or_else(|| D::Error::custom(format!("{} joints, at most {MAX_JOINTS}", values.len())))
    }
}

/// One turning joint and its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointDescription {
    /// Its name.
    pub name: String,
    /// Its frame in the frame of the link before it, at position 0.
    pub frame: Pose,
    /// The unit axis about which it turns, in its own frame.
    pub axis: DVec3,
    /// Smallest position, radians.
    pub min_rad: f64,
    /// Largest position, radians.
    pub max_rad: f64,
    /// Fastest motion, radians per second.
    pub max_speed_rad_s: f64,
    /// Strongest acceleration, radians per second squared.
    pub max_acceleration_rad_s2: f64,
    /// Largest torque, newton metres.
    pub max_torque_nm: f64,
}

/// A part of a link as a swept sphere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LinkCapsule {
    /// Index of the link: 0 is the base.
    pub link: usize,
    /// One end of the axis, link frame, metres.
    pub from: DVec3,
    /// Its other end.
    pub to: DVec3,
    /// Radius, metres.
    pub radius_m: f64,
}

/// A serial arm that carries a hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArmDescription {
    /// Where its base stands in the world.
    pub base: Pose,
    /// The joints from the base outwards; at most [`MAX_JOINTS`].
    pub joints: Vec<JointDescription>,
    /// What the links fill, the hand left out.
    pub capsules: Vec<LinkCapsule>,
    /// What the hand fills, as parts of the last link. Cameras see the hand's own solids.
    pub hand: Vec<LinkCapsule>,
    /// The tool centre point in the frame of the last link.
    pub tool: Pose,
    /// Joint positions at which the arm waits.
    pub home: Joints,
}

impl ArmDescription {
    /// Frames of base and links in the world. Joints that are missing in `joints` stand at 0.
    pub fn frames(&self, joints: &[f64]) -> LinkFrames {
        let mut frames = [self.base; MAX_JOINTS + 1];
        let mut at = self.base;
        let mut positions = joints.iter();
        let mut chain = self.joints.iter();
        for frame in frames.iter_mut().skip(1) {
            if let Some(joint) = chain.next() {
                let turn = DQuat::from_axis_angle(joint.axis, positions.next().copied().unwrap_or(0.0));
                at = at * joint.frame * Pose::new(DVec3::ZERO, turn);
            }
            *frame = at;
        }
        frames
    }
    /// Pose of the tool centre point in the world.
    pub fn tcp(&self, joints: &[f64]) -> Pose {
        let [.., last] = self.frames(joints);
        last * self.tool
    }
    /// What the links fill, in the world: each capsule as the cylinder round it.
    pub fn solids(&self, joints: &[f64]) -> Vec<PlacedSolid> {
        let frames = self.frames(joints);
        self.capsules.iter().map(|capsule| capsule.cylinder(&frames)).collect()
    }
    /// All that it fills: links and hand.
    pub fn parts(&self) -> impl Iterator<Item = &LinkCapsule> {
        self.capsules.iter().chain(&self.hand)
    }
    /// The first joint that is beyond its limits by more than `tolerance_rad`, or not a number, in a sentence.
    pub fn limit_broken(&self, joints: &[f64], tolerance_rad: f64) -> Option<String> {
        if joints.len() != self.joints.len() {
            return Some(format!("{} joint positions for {} joints", joints.len(), self.joints.len()));
        }
        self.joints.iter().zip(joints).find_map(|(joint, &at)| {
            let inside = at >= joint.min_rad - tolerance_rad && at <= joint.max_rad + tolerance_rad;
            (!inside)
                .then(|| format!("{} at {at:.4} rad is not in {} to {} rad", joint.name, joint.min_rad, joint.max_rad))
        })
    }
    /// Two parts of the arm that are nearer to each other than `margin_m`, in a sentence. Links that are next to each
    /// other on the chain, or have one between them, touch by construction and do not count.
    pub fn self_collision(&self, frames: &LinkFrames, margin_m: f64) -> Option<String> {
        self.parts().enumerate().find_map(|(index, one)| {
            let mut others = self.parts().skip(index + 1).filter(|other| one.link.abs_diff(other.link) > 2);
            others.find_map(|other| {
                let gap = one.gap_m(frames, other, frames);
                (gap < margin_m).then(|| touching(("link", one.link), ("link", other.link), gap))
            })
        })
    }
    /// Parts of two arms that are nearer to each other than `margin_m`, in a sentence.
    pub fn collision_with(
        &self,
        frames: &LinkFrames,
        other: &ArmDescription,
        other_frames: &LinkFrames,
        margin_m: f64,
    ) -> Option<String> {
        self.parts().find_map(|one| {
            other.parts().find_map(|two| {
                let gap = one.gap_m(frames, two, other_frames);
                (gap < margin_m).then(|| touching(("link", one.link), ("the other arm's link", two.link), gap))
            })
        })
    }
    /// No point of the arm is ever farther from the first joint than this, metres.
    pub fn reach_m(&self) -> f64 {
        let links: f64 = self.joints.iter().skip(1).map(|joint| joint.frame.translation.length()).sum();
        links + self.tool.translation.length()
    }
    /// Whether a TCP position is near enough to the arm to be worth a try: necessary, not sufficient.
    pub fn may_reach(&self, position: DVec3) -> bool {
        let shoulder = self.joints.first().map_or(self.base, |joint| self.base * joint.frame);
        position.distance(shoulder.translation) <= self.reach_m()
    }
}

fn touching(one: (&str, usize), other: (&str, usize), gap_m: f64) -> String {
    format!("{} {} and {} {} would be {:.0} mm apart", one.0, one.1, other.0, other.1, 1e3 * gap_m)
}

impl LinkCapsule {
    /// The ends of its axis in the world.
    pub fn ends(&self, frames: &LinkFrames) -> [DVec3; 2] {
        let frame = frames.get(self.link).copied().unwrap_or_default();
        [frame.transform_point(self.from), frame.transform_point(self.to)]
    }
    /// Distance to another capsule, negative where they overlap, metres.
    pub fn gap_m(&self, frames: &LinkFrames, other: &LinkCapsule, other_frames: &LinkFrames) -> f64 {
        segment_distance(self.ends(frames), other.ends(other_frames)) - self.radius_m - other.radius_m
    }
    /// The cylinder that holds it, in the world.
    fn cylinder(&self, frames: &LinkFrames) -> PlacedSolid {
        let [from, to] = self.ends(frames);
        let along = (to - from).try_normalize().unwrap_or(DVec3::Z);
        let solid = Solid::Cylinder { radius: self.radius_m, height: from.distance(to) + 2.0 * self.radius_m };
        PlacedSolid { solid, pose: Pose::new(0.5 * (from + to), DQuat::from_rotation_arc(DVec3::Z, along)) }
    }
}

/// Smallest distance between two line segments, metres. After C. Ericson, Real-Time Collision Detection, 5.1.9.
pub fn segment_distance(one: [DVec3; 2], other: [DVec3; 2]) -> f64 {
    let (d1, d2, r) = (one[1] - one[0], other[1] - other[0], one[0] - other[0]);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    let share = |value: f64, length: f64| if length > 1e-18 { (value / length).clamp(0.0, 1.0) } else { 0.0 };
    let (b, c) = (d1.dot(d2), d1.dot(r));
    let crossing = a * e - b * b;
    let mut s = if crossing > 1e-18 { ((b * f - c * e) / crossing).clamp(0.0, 1.0) } else { 0.0 };
    let t = share(b * s + f, e);
    s = share(b * t - c, a);
    (one[0] + d1 * s).distance(other[0] + d2 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    /// Two links of 0.4 m and 0.3 m that turn about z and about y.
    fn arm() -> ArmDescription {
        let joint = |name: &str, x: f64, axis| JointDescription {
            name: name.into(),
            frame: Pose::from_translation(DVec3::new(x, 0.0, 0.0)),
            axis,
            min_rad: -2.0,
            max_rad: 2.0,
            max_speed_rad_s: 1.0,
            max_acceleration_rad_s2: 5.0,
            max_torque_nm: 10.0,
        };
        ArmDescription {
            base: Pose::from_translation(DVec3::Z),
            joints: vec![joint("turn", 0.0, DVec3::Z), joint("nod", 0.4, DVec3::Y)],
            capsules: vec![LinkCapsule { link: 2, from: DVec3::ZERO, to: DVec3::X * 0.3, radius_m: 0.05 }],
            hand: vec![],
            tool: Pose::from_translation(DVec3::X * 0.3),
            home: Joints { count: 2, values: [0.0; MAX_JOINTS] },
        }
    }

    #[test]
    fn the_tool_goes_where_the_joints_say() {
        let arm = arm();
        assert!(arm.tcp(&[0.0, 0.0]).translation.distance(DVec3::new(0.7, 0.0, 1.0)) < 1e-12);
        assert!(arm.tcp(&[FRAC_PI_2, 0.0]).translation.distance(DVec3::new(0.0, 0.7, 1.0)) < 1e-12);
        assert!(arm.tcp(&[0.0, FRAC_PI_2]).translation.distance(DVec3::new(0.4, 0.0, 0.7)) < 1e-12);
        let [solid] = arm.solids(&[0.0, FRAC_PI_2])[..] else { panic!("one capsule") };
        assert!(solid.pose.translation.distance(DVec3::new(0.4, 0.0, 0.85)) < 1e-12);
        assert_eq!(solid.solid, Solid::Cylinder { radius: 0.05, height: 0.4 });
    }

    #[test]
    fn a_joint_beyond_its_limit_is_named() {
        let arm = arm();
        assert_eq!(arm.limit_broken(&[0.0, 1.9], 0.0), None);
        assert_eq!(arm.limit_broken(&[0.0, 2.1], 0.0).unwrap(), "nod at 2.1000 rad is not in -2 to 2 rad");
        assert!(arm.limit_broken(&[f64::NAN, 0.0], 0.0).unwrap().starts_with("turn"));
        assert_eq!(arm.limit_broken(&[0.0], 0.0).unwrap(), "1 joint positions for 2 joints");
    }

    #[test]
    fn joints_travel_as_a_plain_list() {
        let joints = Joints::new(&[0.5, -1.0]).unwrap();
        let text = serde_json::to_string(&joints).unwrap();
        assert_eq!(text, "[0.5,-1.0]");
        assert_eq!(serde_json::from_str::<Joints>(&text).unwrap(), joints);
        assert!(serde_json::from_str::<Joints>("[0,0,0,0,0,0,0,0,0]").is_err());
    }

    proptest! {
        #[test]
        fn the_distance_of_segments_is_that_of_their_nearest_points(
            p in prop::array::uniform12(-1.0..1.0f64), s in 0.0..1.0f64, t in 0.0..1.0f64,
        ) {
            let point = |i: usize| DVec3::new(p[i], p[i + 1], p[i + 2]);
            let (one, other) = ([point(0), point(3)], [point(6), point(9)]);
            let distance = segment_distance(one, other);
            let sampled = one[0].lerp(one[1], s).distance(other[0].lerp(other[1], t));
            prop_assert!(distance <= sampled + 1e-12);
            prop_assert!((segment_distance(other, one) - distance).abs() < 1e-9);
            // A fine grid comes near it from above.
            let grid = (0..=40).flat_map(|i| (0..=40).map(move |j| (f64::from(i) / 40.0, f64::from(j) / 40.0)));
            let best = grid.map(|(s, t)| one[0].lerp(one[1], s).distance(other[0].lerp(other[1], t)))
                .fold(f64::INFINITY, f64::min);
            prop_assert!(best - distance < 0.09);
        }
    }
}
