//! Dynamics of loaded objects. Files of articulated objects often hold what no real door has: dry friction of
//! 10,000 N m, damping of 1,900, 2 kg of wood in a dial. One rule is applied to every loaded object:
//!
//! - A joint's dry friction is what 2 to 15 N overcome at the link's reach, drawn evenly, once per episode and joint.
//!   For a slider that is the friction; for a hinge it is times the reach, kept within 0.2 to 2 N m.
//! - Damping stays as it is up to 5 N s/m at the reach: at most 5 N s/m for a slider, at most 5 times the reach
//!   squared, and never more than 5 N m s/rad, for a hinge.
//! - A mass is believed if it makes the link's density 20 to 8000 kg/m3 and, of what moves, is at most 25 kg; otherwise
//!   it is the volume times 500 kg/m3, kept within 5 g and 25 kg, or 60 kg of what does not move. Inertia comes from
//!   the shapes.
//! - A door that its own weight would swing off its closed position has a catch, as ovens and microwaves do: it holds the
//!   door shut with 1.2 times the moment of that weight.
//!
//! The *reach* is how far the link extends from its hinge's axis.

use super::{
    Link, Weight,
    joint::{Follows, Joint, JointKind, Latch},
};
use acm_concept::pose::Pose;
use glam::{DQuat, DVec3};
use rand::Rng;

/// Force at the reach, newtons.
const FORCE_N: [f64; 2] = [2.0, 15.0];
const HINGE_N_M: [f64; 2] = [0.2, 2.0];
const MAX_DAMPING: f64 = 5.0;
const BELIEVED_KG_M3: [f64; 2] = [20.0, 8000.0];
/// A catch holds within this of the closed position, radians, with the weight's moment times this.
const CATCH_RAD: f64 = 0.03;
const CATCH_SHARE: f64 = 1.2;
/// A moment above this share of the friction is not surely held by it.
const HELD_SHARE: f64 = 0.8;
const GRAVITY_M_S2: f64 = 9.81;
const USUAL_KG_M3: f64 = 500.0;
const LEAST_KG: f64 = 0.005;
const MOST_KG: f64 = 60.0;
const MOST_MOVING_KG: f64 = 25.0;

/// What a file says of a joint, before the rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Original {
    pub(crate) friction: f64,
    pub(crate) damping: f64,
}

/// The weight of a link of which a file says a mass, or nothing.
pub(super) fn weight(mass_kg: Option<f64>, volume_m3: f64, moves: bool) -> Weight {
    let believed = |mass: &f64| {
        let density = mass / volume_m3.max(1e-9);
        (BELIEVED_KG_M3[0]..=BELIEVED_KG_M3[1]).contains(&density) && (!moves || *mass <= MOST_MOVING_KG)
    };
    let most = if moves { MOST_MOVING_KG } else { MOST_KG };
    Weight::Mass(mass_kg.filter(believed).unwrap_or((USUAL_KG_M3 * volume_m3).clamp(LEAST_KG, most)))
}

/// Gives the joint of a link the dynamics that the rule allows it.
pub(crate) fn joint(link: &Link, joint: &mut Joint, original: &Original, rng: &mut impl Rng) {
    // Drawn whether it is used or not, so that one joint's kind does not shift the next one's draw.
    let force = rng.random_range(FORCE_N[0]..FORCE_N[1]);
    let damping = if original.damping.is_finite() { original.damping.max(0.0) } else { 0.0 };
    let (friction, most) = match joint.kind {
        JointKind::Slider => (force, MAX_DAMPING),
        JointKind::Hinge => {
            let reach = reach(link, joint);
            ((force * reach).clamp(HINGE_N_M[0], HINGE_N_M[1]), (MAX_DAMPING * reach * reach).min(MAX_DAMPING))
        }
    };
    // A mechanism that follows another joint is moved with little force and has none of its own.
    joint.friction = if matches!(joint.follows, Some(Follows::Joint { .. })) { 0.0 } else { friction };
    joint.damping = damping.min(most);
    if joint.latch.is_none() && joint.follows.is_none() {
        joint.latch = catch(link, joint);
    }
}

/// The catch of a door whose weight would open it in spite of its friction, in an object that stands upright.
fn catch(link: &Link, joint: &Joint) -> Option<Latch> {
    let [low, high] = joint.range.filter(|_| joint.kind == JointKind::Hinge)?;
    let opening = if high - joint.closed >= joint.closed - low { 1.0 } else { -1.0 };
    let volume_m3 = link.volume();
    let middle = |(low, high): (DVec3, DVec3)| 0.5 * (low + high);
    let solid = link.pieces.iter().filter(|piece| piece.solid);
    let moments = solid.map(|piece| piece.shape.volume() * middle(piece.bounds(&Pose::IDENTITY)));
    let arm = moments.sum::<DVec3>() / volume_m3.max(1e-9) - joint.origin;
    let arm = DQuat::from_axis_angle(joint.axis, joint.closed) * arm;
    let weight = link.mass_kg() * GRAVITY_M_S2 * DVec3::NEG_Z;
    let moment = opening * arm.cross(weight).dot(joint.axis);
    // Friction that barely holds it would let go at a knock.
    (moment > HELD_SHARE * joint.friction).then_some(Latch { force: CATCH_SHARE * moment, within: CATCH_RAD })
}

/// How far a link extends from its joint's axis, metres.
fn reach(link: &Link, joint: &Joint) -> f64 {
    let away = |point: DVec3| (point - joint.origin).reject_from_normalized(joint.axis).length();
    let corners = link.pieces.iter().flat_map(|piece| {
        let (low, high) = piece.bounds(&Pose::IDENTITY);
        (0..8).map(move |at| {
            let pick = |axis: usize| if at >> axis & 1 == 1 { high[axis] } else { low[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    });
    corners.map(away).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Piece, shape::Shape};
    use acm_concept::solid::Solid;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn normalised(kind: JointKind, size: DVec3, original: Original, seed: u64) -> Joint {
        let shape = Shape::Solid(Solid::Box { size });
        let pieces = vec![Piece::new(shape, Pose::from_translation(DVec3::X * 0.5 * size.x), [0; 3])];
        let mut made = Joint::new(kind, DVec3::ZERO, DVec3::Z, Some([0.0, 0.3]));
        let link = Link { name: "a".into(), parent: 0, weight: Weight::Mass(1.0), friction: 0.5, pieces, joint: None };
        joint(&link, &mut made, &original, &mut ChaCha8Rng::seed_from_u64(seed));
        made
    }

    #[test]
    fn whatever_a_file_says_stays_within_the_rule() {
        for seed in 0..50 {
            for friction in [0.0, 10_000.0, f64::NAN] {
                let wild = Original { friction, damping: 1900.0 };
                let door = normalised(JointKind::Hinge, DVec3::new(0.5, 0.02, 0.8), wild, seed);
                assert!((0.2..=2.0).contains(&door.friction) && door.damping <= 5.0, "{door:?}");
                let dial = normalised(JointKind::Hinge, DVec3::new(0.02, 0.02, 0.02), wild, seed);
                assert!((0.2..=0.4).contains(&dial.friction) && dial.damping < 0.01, "{dial:?}");
                let drawer = normalised(JointKind::Slider, DVec3::ONE, wild, seed);
                assert!((2.0..=15.0).contains(&drawer.friction) && drawer.damping == 5.0, "{drawer:?}");
            }
        }
        let calm = Original { friction: 0.0, damping: 0.5 };
        assert_eq!(normalised(JointKind::Slider, DVec3::ONE, calm, 0).damping, 0.5);
    }

    #[test]
    fn what_would_fall_open_has_a_catch() {
        // A plate of 10 kg that stands up from its hinge and leans by 3 cm to the side on which it opens, or away from it.
        let catch_of = |lean: f64, axis: DVec3| {
            let shape = Shape::Solid(Solid::Box { size: DVec3::new(0.02, 0.4, 0.4) });
            let pieces = vec![Piece::new(shape, Pose::from_translation(DVec3::new(lean, 0.0, 0.2)), [0; 3])];
            let mut made = Joint::new(JointKind::Hinge, DVec3::ZERO, axis, Some([0.0, 1.5]));
            let link =
                Link { name: "a".into(), parent: 0, weight: Weight::Mass(10.0), friction: 0.5, pieces, joint: None };
            let calm = Original { friction: 0.0, damping: 0.0 };
            joint(&link, &mut made, &calm, &mut ChaCha8Rng::seed_from_u64(1));
            made.latch.map(|latch| latch.force)
        };
        let held = catch_of(0.03, DVec3::Y).unwrap_or_default();
        assert!((held - 1.2 * 10.0 * 9.81 * 0.03).abs() < 1e-6, "{held}");
        assert_eq!(catch_of(-0.03, DVec3::Y), None, "it leans on what it closes");
        assert_eq!(catch_of(0.03, DVec3::Z), None, "its weight does not turn it");
    }

    #[test]
    fn absurd_masses_are_replaced() {
        assert_eq!(weight(Some(2.0), 0.004, true), Weight::Mass(2.0));
        assert_eq!(weight(Some(2000.0), 0.004, false), Weight::Mass(2.0));
        assert_eq!(weight(Some(50.0), 0.01, true), Weight::Mass(5.0));
        assert_eq!(weight(Some(50.0), 0.01, false), Weight::Mass(50.0));
        assert_eq!(weight(None, 0.004, true), Weight::Mass(2.0));
        assert_eq!(weight(Some(0.0), 1e-9, true), Weight::Mass(0.005));
    }
}
