//! What an arm must keep clear of, all of it perceived, and how far a configuration is from it.

use acm_concept::{
    arm::{ArmDescription, Joints},
    embodiment::RobotDescription,
    pose::Pose,
    solid::{Enclosure, PlacedSolid, Solid},
};
use glam::{DQuat, DVec3};
use parry3d::{
    math as engine, query,
    shape::{Capsule, SharedShape},
};
use std::f64::consts::FRAC_PI_2;

/// Distances beyond this are all the same, metres.
pub(crate) const FAR_M: f64 = 0.05;
/// Links of the arm must stay this far from each other, metres.
const SELF_MARGIN_M: f64 = 0.01;
/// Links below this one stand where they stand, or turn in place.
const FIRST_MOVING: usize = 2;
/// Half the side of the plate that stands for the floor, and its thickness, metres.
const FLOOR_M: (f64, f64) = (2.0, 0.1);

/// The moving parts of an arm and what surrounds it.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    arm: ArmDescription,
    /// The box that the TCP may not leave.
    workspace: [DVec3; 2],
    /// Whether the hand holds something, which is kept level where that is possible.
    pub holding: bool,
    /// Capsules of the links, with the link's index.
    links: Vec<(usize, Capsule)>,
    /// The hand with its fingers, and what it holds, in the TCP frame.
    hand: Vec<(engine::Pose, SharedShape)>,
    obstacles: Vec<(engine::Pose, SharedShape)>,
    /// Where the hand may not go below, which does not count for the hand itself: it works there.
    floor: (engine::Pose, SharedShape),
}

impl Scene {
    /// The hand open by `opening_m`, with solids `held` in the TCP frame, among perceived obstacles.
    pub fn new(
        robot: &RobotDescription,
        arm: &ArmDescription,
        opening_m: f64,
        held: &[PlacedSolid],
        obstacles: &[PlacedSolid],
    ) -> Scene {
        let hand = robot.solids(&Pose::IDENTITY, opening_m);
        // The workspace ends a finger's length above what the arm stands at; no link has any business below that.
        let floor_m = robot.workspace_min.z - crate::geometry::tip_reach_m(robot);
        let floor = PlacedSolid {
            solid: Solid::Box { size: DVec3::new(2.0 * FLOOR_M.0, 2.0 * FLOOR_M.0, FLOOR_M.1) },
            pose: Pose::from_translation(arm.base.translation.with_z(floor_m - 0.5 * FLOOR_M.1)),
        };
        let capsule = |part: &acm_concept::arm::LinkCapsule| {
            (part.link, Capsule::new(part.from.as_vec3(), part.to.as_vec3(), part.radius_m as f32))
        };
        Scene {
            workspace: [robot.workspace_min, robot.workspace_max],
            holding: !held.is_empty(),
            links: arm.capsules.iter().filter(|part| part.link >= FIRST_MOVING).map(capsule).collect(),
            hand: hand.iter().chain(held).map(placed).collect(),
            obstacles: obstacles.iter().map(placed).collect(),
            floor: placed(&floor),
            arm: arm.clone(),
        }
    }

    /// The arm in it.
    pub fn arm(&self) -> &ArmDescription {
        &self.arm
    }

    /// Whether no part of the arm is too near to another.
    pub fn is_untangled(&self, joints: &Joints) -> bool {
        self.arm.self_collision(&self.arm.frames(joints), SELF_MARGIN_M).is_none()
    }

    /// Whether the arm may be there: in the workspace, untangled, and clear of everything by a margin.
    pub fn is_clear(&self, joints: &Joints, margin_m: f64) -> bool {
        let [low, high] = self.workspace;
        let tcp = self.arm.tcp(joints).translation;
        let inside = tcp.cmpge(low).all() && tcp.cmple(high).all();
        inside && self.is_untangled(joints) && self.clearance(joints) >= margin_m
    }

    /// Smallest distance from the arm's links to the floor: metres, negative below it, at most [`FAR_M`].
    pub fn above_floor(&self, joints: &Joints) -> f64 {
        let frames = self.arm.frames(joints);
        let (there, floor) = &self.floor;
        let distance = |nearest, (link, capsule): &(usize, Capsule)| {
            let at = to_engine(&frames.get(*link).copied().unwrap_or_default());
            nearer(&at, capsule, there, floor, nearest)
        };
        f64::from(self.links.iter().fold(FAR_M as f32, distance))
    }

    /// Smallest distance from the arm, the hand and what it holds to anything perceived: metres, negative inside, at
    /// most [`FAR_M`].
    pub fn clearance(&self, joints: &Joints) -> f64 {
        let frames = self.arm.frames(joints);
        let [.., last] = frames;
        let tcp = to_engine(&(last * self.arm.tool));
        let mut nearest = FAR_M as f32;
        for (link, capsule) in &self.links {
            let at = to_engine(&frames.get(*link).copied().unwrap_or_default());
            for (there, obstacle) in self.obstacles.iter().chain([&self.floor]) {
                nearest = nearer(&at, capsule, there, obstacle, nearest);
            }
        }
        for (local, part) in &self.hand {
            let at = tcp * *local;
            for (there, obstacle) in &self.obstacles {
                nearest = nearer(&at, &*part.0, there, obstacle, nearest);
            }
        }
        f64::from(nearest)
    }
}

/// The distance between two shapes if it is below `nearest`, else `nearest`.
fn nearer(
    at: &engine::Pose,
    part: &dyn parry3d::shape::Shape,
    there: &engine::Pose,
    obstacle: &SharedShape,
    nearest: f32,
) -> f32 {
    // An unsupported pair of shapes cannot occur: all are convex.
    let contact = query::contact(at, part, there, &*obstacle.0, nearest.max(0.0)).ok().flatten();
    contact.map_or(nearest, |contact| contact.dist.min(nearest))
}

/// Of a solid that is neither, the box or cylinder round it is kept clear of.
fn placed(part: &PlacedSolid) -> (engine::Pose, SharedShape) {
    match part.solid.enclosure() {
        Enclosure::Box { size } => {
            let half = (0.5 * size).as_vec3();
            (to_engine(&part.pose), SharedShape::cuboid(half.x, half.y, half.z))
        }
        Enclosure::Cylinder { radius, height } => {
            // The library's cylinders stand along y.
            let z_up = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(FRAC_PI_2));
            (to_engine(&(part.pose * z_up)), SharedShape::cylinder((0.5 * height) as f32, radius as f32))
        }
    }
}

fn to_engine(pose: &Pose) -> engine::Pose {
    engine::Pose::from_parts(pose.translation.as_vec3(), pose.rotation.as_quat().normalize())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use acm_concept::arm::{JointDescription, LinkCapsule};
    use std::f64::consts::FRAC_PI_4;

    /// A 7-joint arm of the common kind: spherical shoulder and wrist, offsets at the elbow.
    pub(crate) fn panda() -> ArmDescription {
        let rows: [([f64; 3], f64, [f64; 2]); 7] = [
            ([0.0, 0.0, 0.333], 0.0, [-2.8973, 2.8973]),
            ([0.0, 0.0, 0.0], -FRAC_PI_2, [-1.7628, 1.7628]),
            ([0.0, -0.316, 0.0], FRAC_PI_2, [-2.8973, 2.8973]),
            ([0.0825, 0.0, 0.0], FRAC_PI_2, [-3.0718, -0.0698]),
            ([-0.0825, 0.384, 0.0], -FRAC_PI_2, [-2.8973, 2.8973]),
            ([0.0, 0.0, 0.0], FRAC_PI_2, [-0.0175, 3.7525]),
            ([0.088, 0.0, 0.0], FRAC_PI_2, [-2.8973, 2.8973]),
        ];
        let joint = |(index, (translation, roll, range)): (usize, &([f64; 3], f64, [f64; 2]))| JointDescription {
            name: format!("joint {}", index + 1),
            frame: Pose::new(DVec3::from(*translation), DQuat::from_rotation_x(*roll)),
            axis: DVec3::Z,
            min_rad: range[0],
            max_rad: range[1],
            max_speed_rad_s: if index < 4 { 2.175 } else { 2.61 },
            max_acceleration_rad_s2: 10.0,
            max_torque_nm: 50.0,
        };
        let along =
            |link, from: f64, to: f64| LinkCapsule { link, from: DVec3::Z * from, to: DVec3::Z * to, radius_m: 0.06 };
        ArmDescription {
            base: Pose::IDENTITY,
            joints: rows.iter().enumerate().map(joint).collect(),
            capsules: vec![
                along(1, -0.27, 0.0),
                along(2, -0.06, 0.06),
                along(3, -0.22, -0.07),
                along(4, -0.06, 0.06),
                along(5, -0.31, -0.06),
                along(6, -0.07, 0.01),
                along(7, 0.06, 0.08),
            ],
            hand: vec![along(7, 0.15, 0.16)],
            tool: Pose::from_yaw(DVec3::Z * 0.2104, -FRAC_PI_4),
            home: Joints::new(&[0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]).unwrap(),
        }
    }

    /// That arm with two fingers, standing at the height of the table.
    pub(crate) fn robot() -> RobotDescription {
        let arm = panda();
        RobotDescription {
            name: "arm".into(),
            hand: vec![PlacedSolid {
                solid: Solid::Box { size: DVec3::new(0.06, 0.2, 0.066) },
                pose: Pose::from_translation(DVec3::new(0.0, 0.0, -0.07)),
            }],
            finger: vec![PlacedSolid {
                solid: Solid::Box { size: DVec3::new(0.022, 0.012, 0.048) },
                pose: Pose::from_translation(DVec3::new(0.0, 0.006, -0.013)),
            }],
            max_opening_m: 0.08,
            max_grip_force_n: 40.0,
            pad_half_length_m: 0.011,
            workspace_min: DVec3::new(-0.9, -0.9, 0.005),
            workspace_max: DVec3::new(0.9, 0.9, 0.8),
            max_speed_m_s: 0.5,
            max_turn_rad_s: 3.0,
            tick_s: 0.02,
            home: arm.tcp(&arm.home),
            arm: Some(arm),
            ..RobotDescription::default()
        }
    }

    fn cube(at: DVec3) -> PlacedSolid {
        PlacedSolid { solid: Solid::Box { size: DVec3::splat(0.04) }, pose: Pose::from_translation(at) }
    }

    #[test]
    fn what_is_held_counts_as_part_of_the_hand() {
        let (robot, arm) = (robot(), panda());
        let below = robot.home.translation - DVec3::Z * 0.12;
        let empty = Scene::new(&robot, &arm, 0.04, &[], &[cube(below)]);
        assert!(empty.clearance(&arm.home) >= FAR_M - 1e-6, "{}", empty.clearance(&arm.home));
        // A rod in the hand reaches down to 70 mm below the TCP: 30 mm above the cube.
        let rod = PlacedSolid {
            solid: Solid::Cylinder { radius: 0.01, height: 0.1 },
            pose: Pose::from_translation(DVec3::Z * 0.02),
        };
        let held = Scene::new(&robot, &arm, 0.02, &[rod], &[cube(below)]);
        assert!((held.clearance(&arm.home) - 0.03).abs() < 1e-3, "{}", held.clearance(&arm.home));
        assert!(held.holding && !empty.holding);
    }

    #[test]
    fn the_elbow_may_not_go_where_the_table_is() {
        let (robot, arm) = (robot(), panda());
        let scene = Scene::new(&robot, &arm, 0.04, &[], &[]);
        assert!(scene.is_clear(&arm.home, 0.02));
        let low = Joints::new(&[0.0, 1.7, 0.0, -1.0, 0.0, 3.0, 0.785]).unwrap();
        assert!(scene.clearance(&low) < 0.05 && !scene.is_clear(&low, 0.05));
    }
}
