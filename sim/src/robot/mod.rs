//! The robot: arms, wrists and hands as bodies of the engine, driven tick by tick within their limits.

mod catalogue;
mod cup;
mod fingers;
mod limits;
mod links;
mod state;
mod wrist;

pub use catalogue::RobotError;
pub(crate) use catalogue::{RobotModel, TICK_S, open};
pub(crate) use state::RobotState;

use crate::{
    audit,
    contact::{Contacts, TickForces},
};
use acm_concept::{
    arm::Joints,
    embodiment::{Command, Feedback, RobotDescription},
    pose::Pose,
    solid::PlacedSolid,
    time::Time,
};
use cup::Cup;
use fingers::Fingers;
use glam::DVec3;
use links::Links;
use rapier3d::prelude::{ColliderHandle, PhysicsWorld, RigidBodyHandle};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use wrist::Wrist;

/// How far the fingers open in a drop, metres.
const DROP_OPENING_M: f64 = 0.02;

/// A robot in the world.
#[derive(Debug, Clone)]
pub(crate) struct Robot {
    /// What the agent is told of it.
    pub(crate) description: RobotDescription,
    limbs: Vec<Limb>,
    /// The arm that was commanded last.
    active: usize,
    /// Why the motion of this tick was ended.
    stopped: Option<String>,
}

/// One hand and what carries it.
#[derive(Debug, Clone)]
struct Limb {
    /// This arm alone.
    robot: RobotDescription,
    wrist: Wrist,
    hand: Hand,
    links: Option<Links>,
    /// Where the commanded motion of this tick begins and ends.
    from: Aim,
    to: Aim,
    /// Where the last physics step put it, and where it was before that.
    at: Aim,
    before: Aim,
    grip: Grip,
    forces: TickForces,
}

/// A commanded configuration.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Aim {
    tcp: Pose,
    joints: Option<Joints>,
}

/// What the hand is to do.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Grip {
    opening_m: f64,
    force_n: f64,
    vacuum: bool,
}

#[derive(Debug, Clone)]
enum Hand {
    Fingers(Fingers),
    Cup(Cup),
}

impl Robot {
    pub(crate) fn build(world: &mut PhysicsWorld, model: &RobotModel) -> Robot {
        let description = model.description.clone();
        let limbs = (0..description.arms()).map(|arm| Limb::build(world, model, description.only(arm))).collect();
        Robot { description, limbs, active: 0, stopped: None }
    }

    /// Takes a command as the aim of the next tick, or says why it is refused.
    pub(crate) fn aim(&mut self, command: &Command) -> Result<(), String> {
        let others: Vec<&Limb> =
            self.limbs.iter().enumerate().filter(|(arm, _)| *arm != command.arm).map(|(_, limb)| limb).collect();
        let limb = self.limbs.get(command.arm);
        let limb =
            limb.ok_or_else(|| format!("there is no arm {}, the robot has {}", command.arm, self.limbs.len()))?;
        let aim = limits::aim(limb, &others, command)?;
        if let Some(limb) = self.limbs.get_mut(command.arm) {
            let (opening_m, force_n) = (command.opening_m, command.grip_force_n);
            limb.grip = Grip { opening_m, force_n, vacuum: command.vacuum };
            limb.to = aim;
        }
        self.active = command.arm;
        Ok(())
    }

    /// Begins a tick.
    pub(crate) fn begin(&mut self) {
        self.limbs.iter_mut().for_each(|limb| limb.forces = TickForces::default());
    }

    /// Drives everything for one physics step; `fraction` is the share of the tick that is behind after it. With `drops`
    /// the hands let go, whatever they were told.
    pub(crate) fn drive(&mut self, world: &mut PhysicsWorld, fraction: f64, drops: bool) {
        self.limbs.iter_mut().for_each(|limb| limb.drive(world, fraction, drops));
    }

    /// Takes what is felt after a physics step. A link that is obstructed stops its arm where it was before.
    pub(crate) fn feel(&mut self, world: &PhysicsWorld, contacts: &Contacts) {
        for (index, limb) in self.limbs.iter_mut().enumerate() {
            limb.forces.add(contacts, index, limb.wrist.force(world));
            if let Some(reason) = limb.links.as_mut().and_then(|links| links.obstructed(world)) {
                (limb.from, limb.to, limb.at) = (limb.before, limb.before, limb.before);
                self.stopped.get_or_insert(reason);
            }
        }
    }

    /// Ends a tick: what was commanded is where the next one begins. Says why the motion was ended early.
    pub(crate) fn end(&mut self) -> Option<String> {
        self.limbs.iter_mut().for_each(|limb| limb.from = limb.to);
        self.stopped.take()
    }

    /// Holds still from now on where it is measured to be.
    pub(crate) fn stop(&mut self, world: &PhysicsWorld) {
        for limb in &mut self.limbs {
            let here = if limb.links.is_some() { limb.at } else { Aim { tcp: limb.wrist.tcp(world), joints: None } };
            (limb.from, limb.to) = (here, here);
        }
    }

    /// What the arm that was commanded last measures, the others with it.
    pub(crate) fn feedback(&self, world: &PhysicsWorld, time: Time) -> Feedback {
        let felt = |(arm, limb): (usize, &Limb)| limb.feedback(world, time, arm);
        let (mut active, others): (Vec<_>, Vec<_>) =
            self.limbs.iter().enumerate().map(felt).partition(|felt| felt.arm == self.active);
        Feedback { others, ..active.pop().unwrap_or_default() }
    }

    /// Measured pose of the tool centre point of the arm that was commanded last.
    pub(crate) fn tcp(&self, world: &PhysicsWorld) -> Pose {
        self.limbs.get(self.active).map_or(Pose::IDENTITY, |limb| limb.wrist.tcp(world))
    }

    /// The commanded opening of the hand that was commanded last, as a share of its widest. A cup is open when its pump is
    /// off.
    pub(crate) fn commanded_opening(&self) -> f64 {
        let share = |limb: &Limb| match limb.hand {
            Hand::Fingers(_) => limb.grip.opening_m / limb.robot.max_opening_m,
            Hand::Cup(_) => f64::from(u8::from(!limb.grip.vacuum)),
        };
        self.limbs.get(self.active).map_or(1.0, share)
    }

    /// All its bodies.
    pub(crate) fn bodies(&self) -> Vec<RigidBodyHandle> {
        let of = |limb: &Limb| {
            let fingers = if let Hand::Fingers(fingers) = &limb.hand { fingers.fingers.to_vec() } else { Vec::new() };
            let links: Vec<_> = limb.links.iter().flat_map(Links::bodies).collect();
            [vec![limb.wrist.follow, limb.wrist.hand], fingers, links].concat()
        };
        self.limbs.iter().flat_map(of).collect()
    }

    /// What the physics audit looks at: where the hands are, how they grip, and what they can.
    pub(crate) fn hands<'a>(&'a self, world: &'a PhysicsWorld) -> impl Iterator<Item = audit::Hand> + 'a {
        self.limbs.iter().map(|limb| {
            let tcp = limb.wrist.tcp(world);
            audit::Hand {
                at: tcp.translation,
                grip_n: if let Hand::Fingers(fingers) = &limb.hand { fingers.grip_n(world) } else { 0.0 },
                pulled: limb.wrist.force(world),
                max_speed_m_s: limb.robot.max_speed_m_s,
                max_grip_n: limb.robot.max_grip_force_n,
            }
        })
    }

    /// What touches things on purpose, arm by arm.
    pub(crate) fn touching(&self) -> impl Iterator<Item = Touching> {
        self.limbs.iter().map(|limb| match &limb.hand {
            Hand::Fingers(fingers) => Touching::Pads(fingers.pads),
            Hand::Cup(cup) => Touching::Cup(cup.holds()),
        })
    }

    /// All that can be seen of it, where it is now: `true` for the fingers.
    pub(crate) fn seen(&self, world: &PhysicsWorld) -> Vec<(PlacedSolid, bool)> {
        self.limbs.iter().flat_map(|limb| limb.seen(world)).collect()
    }
}

/// What of a hand touches things on purpose.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Touching {
    /// The two pads, +y side first.
    Pads([ColliderHandle; 2]),
    /// What a suction cup holds.
    Cup(Option<ColliderHandle>),
}

impl Limb {
    fn build(world: &mut PhysicsWorld, model: &RobotModel, robot: RobotDescription) -> Limb {
        let wrist = Wrist::build(world, &robot);
        let hand = match robot.suction {
            Some(cup) => Hand::Cup(Cup::new(cup, model.evacuation_s, model.venting_s)),
            None => Hand::Fingers(Fingers::build(world, &robot, &wrist)),
        };
        let home = Aim { tcp: robot.home, joints: robot.arm.as_ref().map(|arm| arm.home) };
        Limb {
            links: robot.arm.as_ref().map(|arm| Links::build(world, arm)),
            grip: Grip { opening_m: robot.max_opening_m, force_n: robot.max_grip_force_n, vacuum: false },
            forces: TickForces::default(),
            from: home,
            to: home,
            at: home,
            before: home,
            wrist,
            hand,
            robot,
        }
    }

    fn drive(&mut self, world: &mut PhysicsWorld, fraction: f64, drops: bool) {
        (self.before, self.at) = (self.at, self.from.towards(&self.to, fraction, &self.robot));
        self.wrist.drive(world, &self.at.tcp, &self.robot);
        if let (Some(links), Some(arm), Some(joints)) = (&self.links, &self.robot.arm, &self.at.joints) {
            links.drive(world, &arm.frames(joints));
        }
        match &mut self.hand {
            Hand::Fingers(fingers) => {
                let open_m = if drops { fingers.opening(world, &self.wrist) + DROP_OPENING_M } else { 0.0 };
                let opening_m = self.grip.opening_m.max(open_m).min(self.robot.max_opening_m);
                fingers.drive(world, &self.wrist, opening_m, self.grip.force_n);
            }
            Hand::Cup(cup) => cup.drive(world, &self.wrist, self.grip.vacuum && !drops),
        }
    }

    fn feedback(&self, world: &PhysicsWorld, time: Time, arm: usize) -> Feedback {
        let tcp = self.wrist.tcp(world);
        let (pads, wrist) = self.forces.mean();
        let (opening_m, vacuum) = match &self.hand {
            Hand::Fingers(fingers) => (fingers.opening(world, &self.wrist), 0.0),
            Hand::Cup(cup) => (0.0, cup.vacuum),
        };
        Feedback {
            time,
            tcp,
            joints: self.at.joints.map_or_else(Vec::new, |joints| joints.to_vec()),
            opening_m,
            commanded_opening_m: self.grip.opening_m,
            pad_force_n: pads.map(|force| tcp.inverse().transform_vector(force)),
            wrist_force_n: wrist,
            vacuum,
            arm,
            others: Vec::new(),
        }
    }

    fn seen(&self, world: &PhysicsWorld) -> Vec<(PlacedSolid, bool)> {
        let place = |frame: Pose, part: &PlacedSolid| PlacedSolid { solid: part.solid, pose: frame * part.pose };
        let tcp = self.wrist.tcp(world);
        let mut seen: Vec<_> = self.robot.hand.iter().map(|part| (place(tcp, part), false)).collect();
        if let Hand::Fingers(fingers) = &self.hand {
            let mirror = Pose::from_yaw(DVec3::ZERO, PI);
            for (frame, turn) in fingers.poses(world).into_iter().zip([Pose::IDENTITY, mirror]) {
                seen.extend(self.robot.finger.iter().map(|part| (place(frame * turn, part), true)));
            }
        }
        if let (Some(arm), Some(joints)) = (&self.robot.arm, &self.at.joints) {
            seen.extend(arm.solids(joints).into_iter().map(|solid| (solid, false)));
        }
        seen
    }
}

impl Aim {
    fn towards(&self, to: &Aim, fraction: f64, robot: &RobotDescription) -> Aim {
        match (&robot.arm, &self.joints, &to.joints) {
            (Some(arm), Some(from), Some(to)) => {
                let joints = from.lerp(to, fraction);
                Aim { tcp: arm.tcp(&joints), joints: Some(joints) }
            }
            _ => Aim { tcp: self.tcp.interpolate(&to.tcp, fraction), joints: None },
        }
    }
}

#[cfg(test)]
mod tests;
