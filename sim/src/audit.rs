//! The physics audit: whatever happens in the world must have a cause.
//!
//! After every physics step each free body is compared with how it was before. It must be where its velocity has taken
//! it: a body or a joint that is *set* is somewhere else. And its energy, height included, must not rise unless
//! something touches it that moves: the robot, a third party's kinematic body, another moving body. The hand must not be
//! faster, nor grip harder, than the robot can. An episode with a violation proves nothing and is void.
//!
//! Kinematic bodies are third parties or the robot, and a body that changes its kind has just been taken or put down by
//! one. An injected mishap is excused by whoever injects it.

use crate::oracle::OracleVerdict;
use glam::{DQuat, DVec3};
use rapier3d::prelude::{PhysicsWorld, RigidBody, RigidBodyHandle, RigidBodyType};
use serde::{Deserialize, Serialize};

/// Most violations that are told in words.
const MAX_TOLD: usize = 8;
/// How far the engine may shift a body in a step to part what overlaps, metres.
const PARTED_M: f64 = 0.0015;
/// The same as a turn, radians.
const PARTED_RAD: f64 = 0.05;
/// What the robot leans on with its whole wrist, or what that is pushed against, is pushed into its neighbours or askew in its joint, and comes out again:
/// so many times more is possible of shifts and of turns.
const LEANT_ON: [f64; 2] = [3.0, 5.0];
/// What is left after a step of having been leant on.
const LEANT_ON_LATER: f64 = 0.9;
/// Shifts without a velocity may add up to this, metres, and are forgotten at the rate below.
const DRIFT_M: f64 = 0.01;
/// Energy that may appear without a cause, J/kg: a height of 2 mm, or 0.2 m/s.
const GAIN_J_KG: f64 = 0.02;
/// What is left of an unexplained shift or gain after a step.
const REMEMBERED: f64 = 0.98;
/// Slower things than this push nothing, m/s.
const MOVING_M_S: f64 = 0.002;
/// A hand that comes free springs forward by as much as what pulls it was ahead, 15 mm: 60 N down to the deflection at which
/// they are reached and ever less from there, on 1.5 kg, m/s.
const RELEASE_M_S: f64 = 0.95;
/// A hand that is pulled along with nearly all that a wrist bears, 60 N, is dragged; and no faster than what falls by a
/// metre, m/s.
const DRAGGED_N: f64 = 55.0;
const FALLING_M_S: f64 = 4.5;
/// Fingers that meet an object at their full speed press for an instant by a quarter more than they may.
const IMPACT: f64 = 1.25;

/// What the audit of an episode found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AuditReport {
    /// How often something happened without a cause, or a limit was passed.
    pub violations: u64,
    /// The first of them in words.
    pub first: Vec<String>,
}

/// One of the robot's hands, and what it can.
pub(crate) struct Hand {
    /// Its tool centre point.
    pub(crate) at: DVec3,
    /// What the drive of its fingers closed them with in this step, newtons. Not what the pads feel: a finger that is
    /// pushed into a gap feels the gap's sides many times as strongly as it is pushed.
    pub(crate) grip_n: f64,
    /// With what the outside world pulls it, newtons, as far as its wrist bears.
    pub(crate) pulled: DVec3,
    pub(crate) max_speed_m_s: f64,
    pub(crate) max_grip_n: f64,
}

/// The auditor and what it remembers of the step before.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Audit {
    seen: Vec<Seen>,
    /// Where the hands were.
    hands: Vec<DVec3>,
    report: AuditReport,
}

/// A body after the step before.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Seen {
    handle: RigidBodyHandle,
    kind: RigidBodyType,
    centre: DVec3,
    turn: DQuat,
    velocity: DVec3,
    /// Radians per second about each axis.
    spin: DVec3,
    energy: f64,
    drift: DVec3,
    gained: f64,
    /// 1 while the robot touches it, less and less afterwards.
    leant_on: f64,
}

impl Audit {
    /// What the audit has found so far.
    pub(crate) fn report(&self) -> &AuditReport {
        &self.report
    }

    /// Looks at the world after a physics step. The first look finds nothing.
    pub(crate) fn step(&mut self, physics: &PhysicsWorld, robot: &[RigidBodyHandle], hands: &[Hand], now_s: f64) {
        let step_s = f64::from(physics.integration_parameters.dt);
        self.watch_hands(hands, step_s, now_s);
        let before = std::mem::take(&mut self.seen);
        let touched_by_robot = touched_by(physics, robot);
        for (handle, body) in physics.bodies.iter() {
            if body.is_fixed() || robot.contains(&handle) {
                continue;
            }
            let mut seen = Seen::of(physics, handle, body);
            // The engine hands its bodies out in the order of their handles, so a look at the same place mostly finds.
            let place = self.seen.len();
            let known = before.get(place).filter(|known| known.handle == handle);
            let known = known.or_else(|| before.iter().find(|known| known.handle == handle));
            seen.leant_on = match known {
                _ if touched_by_robot.contains(&handle) => 1.0,
                known => known.map_or(0.0, |known| known.leant_on * LEANT_ON_LATER),
            };
            if let Some(known) = known.filter(|known| known.kind == seen.kind && body.is_dynamic()) {
                let touched = || is_touched(physics, handle, robot, &before);
                let found = seen.compare(known, step_s, touched).or_else(|| {
                    let jointed = is_jointed(physics, handle);
                    seen.weigh(known, || jointed || touched())
                });
                if let Some(what) = found {
                    self.tell(now_s, &what);
                }
            }
            self.seen.push(seen);
        }
    }

    fn watch_hands(&mut self, hands: &[Hand], step_s: f64, now_s: f64) {
        let before = std::mem::replace(&mut self.hands, hands.iter().map(|hand| hand.at).collect());
        for (hand, before) in hands.iter().zip(before) {
            let (speed, way) = (before.distance(hand.at) / step_s, (hand.at - before).normalize_or_zero());
            // What pulls it harder than it can hold takes it along.
            let dragged = hand.pulled.dot(way) > DRAGGED_N;
            if speed > if dragged { FALLING_M_S } else { hand.max_speed_m_s + RELEASE_M_S } {
                self.tell(now_s, &format!("a hand moved at {speed:.2} m/s, it can {} m/s", hand.max_speed_m_s));
            }
            if hand.grip_n > hand.max_grip_n * IMPACT {
                self.tell(now_s, &format!("a hand gripped with {:.1} N, it can {} N", hand.grip_n, hand.max_grip_n));
            }
        }
    }

    /// Forgets how a body was: it is moved on purpose by something outside of the world.
    pub(crate) fn excuse(&mut self, handle: RigidBodyHandle) {
        self.seen.retain(|seen| seen.handle != handle);
    }

    /// A verdict as it stands after the audit: an episode with a violation proves nothing.
    pub(crate) fn void(&self, verdict: OracleVerdict) -> OracleVerdict {
        let Some(first) = self.report.first.first() else { return verdict };
        let count = self.report.violations;
        let mut violations = verdict.violations;
        violations.push(format!("void: the physics audit found {count} violations, the first {first}"));
        let explanation = format!("Void by the physics audit: {first}. {}", verdict.explanation);
        OracleVerdict { strict: false, faithful: verdict.faithful.map(|_| false), violations, explanation, ..verdict }
    }

    fn tell(&mut self, now_s: f64, what: &str) {
        self.report.violations += 1;
        if self.report.first.len() < MAX_TOLD {
            self.report.first.push(format!("at {now_s:.3} s {what}"));
        }
    }
}

impl Seen {
    fn of(physics: &PhysicsWorld, handle: RigidBodyHandle, body: &RigidBody) -> Seen {
        let mass = f64::from(body.mass()).max(1e-9);
        let centre = body.center_of_mass().as_dvec3();
        let height = -centre.dot(physics.gravity.as_dvec3());
        Seen {
            handle,
            kind: body.body_type(),
            centre,
            turn: body.rotation().as_dquat(),
            velocity: body.linvel().as_dvec3(),
            spin: body.angvel().as_dvec3(),
            energy: f64::from(body.kinetic_energy()) / mass + height,
            drift: DVec3::ZERO,
            gained: 0.0,
            leant_on: 0.0,
        }
    }

    /// Is it where its velocity has taken it?
    fn compare(&mut self, before: &Seen, step_s: f64, touched: impl Fn() -> bool) -> Option<String> {
        // What is touched by what moves is asked last, because it takes longest.
        let beyond = |much: f64, parted: f64, leant_on: f64| {
            let most = |leaning: f64| parted * (1.0 + (leant_on - 1.0) * leaning);
            much > most(self.leant_on) && (much > most(1.0) || !touched())
        };
        let shift = self.centre - before.centre;
        let off = shift - self.velocity * step_s;
        // Within a step the velocity changes from the old to the new one.
        let fast = (self.velocity - before.velocity).length() * step_s;
        let turned = DQuat::from_scaled_axis(self.spin * step_s) * before.turn;
        let askew = turned.normalize().angle_between(self.turn.normalize());
        let spun = (self.spin - before.spin).length() * step_s;
        if beyond(askew - spun, PARTED_RAD, LEANT_ON[1]) {
            return Some(format!("a body was turned by {askew:.3} rad without a spin{}", self.at()));
        }
        // A hard push alone must not add up to a drift.
        let unexplained = if off.length() > fast { off * (1.0 - fast / off.length()) } else { DVec3::ZERO };
        if beyond(off.length() - fast, PARTED_M, LEANT_ON[0]) {
            return Some(format!("a body was moved by {:.1} mm without a velocity{}", off.length() * 1e3, self.at()));
        }
        self.drift = (before.drift + unexplained) * REMEMBERED;
        if self.drift.length() > DRIFT_M {
            let drift = std::mem::take(&mut self.drift);
            return Some(format!("a body drifted by {:.1} mm without a velocity{}", drift.length() * 1e3, self.at()));
        }
        None
    }

    /// Did its energy rise without a cause?
    fn weigh(&mut self, before: &Seen, pushed: impl Fn() -> bool) -> Option<String> {
        let rise = self.energy - before.energy;
        self.gained = before.gained * REMEMBERED + rise.max(0.0);
        if self.gained <= GAIN_J_KG {
            return None;
        }
        let gained = std::mem::take(&mut self.gained);
        let what = || format!("a body gained {gained:.3} J/kg and nothing touched it that moves{}", self.at());
        (!pushed()).then(what)
    }

    fn at(&self) -> String {
        format!(", at {:.3}", self.centre)
    }
}

/// Whether a joint holds a body, whose spring may push it.
fn is_jointed(physics: &PhysicsWorld, handle: RigidBodyHandle) -> bool {
    physics.impulse_joints.attached_joints(handle).next().is_some()
        || physics.multibody_joints.rigid_body_link(handle).is_some()
}

/// The bodies that the robot's touch, and what hangs on them.
fn touched_by(physics: &PhysicsWorld, robot: &[RigidBodyHandle]) -> Vec<RigidBodyHandle> {
    let colliders = robot.iter().filter_map(|part| physics.bodies.get(*part)).flat_map(|part| part.colliders());
    let pairs = colliders.flat_map(|collider| physics.contact_pairs_with(*collider));
    let touching = pairs.filter(|pair| pair.has_any_active_contact());
    let parents = touching.flat_map(|pair| [pair.collider1, pair.collider2]).filter_map(|at| physics.colliders.get(at));
    let mut touched: Vec<RigidBodyHandle> =
        parents.filter_map(|collider| collider.parent()).filter(|body| !robot.contains(body)).collect();
    let joints =
        |body: &RigidBodyHandle| physics.impulse_joints.attached_joints(*body).map(|(one, other, ..)| [one, other]);
    let hanging: Vec<RigidBodyHandle> = touched.iter().flat_map(joints).flatten().collect();
    touched.extend(hanging);
    touched
}

/// Whether something touches a body that moves: the robot, a third party, another body.
fn is_touched(physics: &PhysicsWorld, handle: RigidBodyHandle, robot: &[RigidBodyHandle], before: &[Seen]) -> bool {
    let moves = |other: RigidBodyHandle| {
        let Some(body) = physics.bodies.get(other) else { return false };
        let was = before.iter().find(|seen| seen.handle == other);
        robot.contains(&other)
            || body.is_kinematic()
            || was.is_some_and(|seen| seen.velocity.length() > MOVING_M_S)
            || f64::from(body.linvel().length()) > MOVING_M_S
    };
    let Some(body) = physics.bodies.get(handle) else { return true };
    body.colliders().iter().any(|collider| {
        physics.contact_pairs_with(*collider).filter(|pair| pair.has_any_active_contact()).any(|pair| {
            let other = if pair.collider1 == *collider { pair.collider2 } else { pair.collider1 };
            physics.colliders.get(other).and_then(|other| other.parent()).is_some_and(moves)
        })
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::{Scenario, SimOptions, world::World};
    use acm_concept::time::Time;
    use rapier3d::prelude::Vector;

    fn world() -> World {
        World::new(&Scenario::open("put-back-block").unwrap(), &SimOptions::default()).unwrap()
    }
    fn wait(world: &mut World, seconds: f64) -> u64 {
        world.wait_until(Time::from_seconds(world.seconds() + seconds)).unwrap();
        world.audit().violations
    }
    fn cube(world: &World) -> RigidBodyHandle {
        world.bodies.iter().find(|body| body.placed.name == "cube").unwrap().handle
    }

    #[test]
    fn a_world_left_alone_has_no_violation() {
        let mut world = world();
        assert_eq!(wait(&mut world, 2.0), 0, "{:?}", world.audit());
    }

    #[test]
    fn a_body_that_is_set_elsewhere_is_caught() {
        for shift in [0.003, 0.05] {
            let mut world = world();
            wait(&mut world, 0.1);
            let handle = cube(&world);
            let body = world.physics.bodies.get_mut(handle).unwrap();
            body.set_translation(body.translation() + Vector::new(shift, 0.0, 0.0), true);
            assert!(wait(&mut world, 0.1) > 0, "{shift} m");
            assert!(world.audit().first[0].contains("without a velocity"), "{:?}", world.audit());
        }
    }

    #[test]
    fn a_body_that_is_nudged_step_by_step_is_caught() {
        let mut world = world();
        let handle = cube(&world);
        for _ in 0..100 {
            let body = world.physics.bodies.get_mut(handle).unwrap();
            body.set_translation(body.translation() + Vector::new(0.001, 0.0, 0.0), true);
            wait(&mut world, 0.004);
        }
        assert!(world.audit().violations > 0);
    }

    #[test]
    fn a_body_that_is_flung_is_caught() {
        let mut world = world();
        wait(&mut world, 0.1);
        let handle = cube(&world);
        world.physics.bodies.get_mut(handle).unwrap().set_linvel(Vector::new(0.0, 0.0, 0.5), true);
        assert!(wait(&mut world, 0.1) > 0);
        assert!(world.audit().first[0].contains("nothing touched it"), "{:?}", world.audit());
        let verdict = world.verdict();
        assert!(!verdict.strict && verdict.explanation.starts_with("Void"), "{verdict:?}");
    }

    #[test]
    fn a_joint_that_is_set_is_caught() {
        let mut world = world();
        wait(&mut world, 0.1);
        let button = world.bodies.iter().find(|body| !body.joints.is_empty()).unwrap();
        let cap = button.handles().last().unwrap();
        let body = world.physics.bodies.get_mut(cap).unwrap();
        body.set_translation(body.translation() - Vector::new(0.0, 0.0, 0.004), true);
        assert!(wait(&mut world, 0.1) > 0);
    }

    #[test]
    fn a_body_that_is_turned_on_the_spot_is_caught() {
        let mut world = world();
        wait(&mut world, 0.1);
        let handle = cube(&world);
        let body = world.physics.bodies.get_mut(handle).unwrap();
        body.set_rotation(rapier3d::math::Rotation::from_rotation_z(0.2) * *body.rotation(), true);
        assert!(wait(&mut world, 0.1) > 0);
        assert!(world.audit().first[0].contains("without a spin"), "{:?}", world.audit());
    }

    #[test]
    fn a_hand_that_jumps_or_crushes_is_caught() {
        let world = world();
        let mut audit = Audit::default();
        let hand = |x: f64, grip_n: f64, pulled_n: f64| {
            let pulled = DVec3::X * pulled_n;
            [Hand { at: DVec3::X * x, grip_n, pulled, max_speed_m_s: 0.5, max_grip_n: 40.0 }]
        };
        // Moved, gripped, jumped, crushed; dragged along, as nothing drags, and against what pulls it.
        let steps = [
            (0.0, 0.0, 0.0, 0),
            (0.002, 45.0, 0.0, 0),
            (0.02, 0.0, 0.0, 1),
            (0.02, 55.0, 0.0, 2),
            (0.03, 0.0, 60.0, 2),
            (0.06, 0.0, 60.0, 3),
            (0.07, 0.0, -60.0, 4),
        ];
        for (x, grip_n, pulled_n, violations) in steps {
            audit.step(&world.physics, &[], &hand(x, grip_n, pulled_n), x);
            assert_eq!(audit.report().violations, violations, "{x} {:?}", audit.report());
        }
    }
}
