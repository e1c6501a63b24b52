//! Move: carry what is held, watching that it stays in the hand; and lower it until it stands.

use super::{Failure, Grip, GripWatch, Outcome, Primitive, Rest, Step, check_collision};
use crate::{
    advance::{Advance, Progress},
    hand::{Hand, pads_in_contact},
    motion::Path,
};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind, skill::FailureCause};
use glam::DVec3;

/// What is allowed beyond the path's own time, seconds: rest, and pauses where the grip is unsure.
const SLACK_S: f64 = 4.0;
/// Speed of lowering, m/s: a stiff wrist then feels a touch within about a millimetre.
const LOWERING_M_S: f64 = 0.03;
/// Upward force that tells that what is held stands on something, newtons.
const STANDING_N: f64 = 3.5;
/// How long the hand stands still on a touch before it is believed, seconds: what is knocked out of the hand is felt too.
const BELIEVED_S: f64 = 0.04;

/// Flies a path with something in the hand, then comes to rest and takes its weight as the wrist's zero.
#[derive(Debug)]
pub(crate) struct Carry {
    kind: Kind,
    path: Path,
    watch: GripWatch,
    rest: Rest,
}

impl Carry {
    /// A move: from place to place.
    pub fn new(path: Path, watch: GripWatch) -> Carry {
        Carry { kind: Kind::Move, path, watch, rest: Rest::default() }
    }
    /// A rotation in free air, or a flip: what is held turns with the hand.
    pub fn turning(kind: Kind, path: Path, watch: GripWatch) -> Carry {
        Carry { kind, ..Carry::new(path, watch) }
    }
}

impl Primitive for Carry {
    fn kind(&self) -> Kind {
        self.kind
    }
    fn limit_s(&self) -> f64 {
        self.path.longest_s() + SLACK_S
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let grip = self.watch.check(hand, feedback);
        match grip.and_then(|grip| check_collision(hand, "while carrying").map(|()| grip)) {
            Err(failure) => return Step::Failed(failure),
            Ok(Grip::Firm) => {}
            Ok(Grip::Unsure) => return Step::Act,
            Ok(Grip::Shifted) => self.path.restart(hand.command.tcp),
        }
        if hand.follow(&mut self.path) {
            return Step::Act;
        }
        if self.rest.tick(hand, feedback) { Step::Done(Outcome::Arrived) } else { Step::Act }
    }
}

/// Lowers what is held until it stands on something, or a floor is reached. Ends with the wrist relaxed.
#[derive(Debug)]
pub(crate) struct Lower {
    advance: Advance,
    watch: GripWatch,
    /// The force of the touch and for how many ticks it is known.
    touched: Option<(f64, u32)>,
    limit_s: f64,
}

impl Lower {
    /// Straight down to a TCP height of `floor_m` at most. The wrist's zero must have been taken at rest.
    pub fn new(hand: &Hand, floor_m: f64, watch: GripWatch) -> Lower {
        let travel_m = hand.command.tcp.translation.z - floor_m;
        let advance = Advance::new(hand, -DVec3::Z, travel_m, LOWERING_M_S, STANDING_N);
        Lower { limit_s: advance.duration_s() + SLACK_S, advance, watch, touched: None }
    }
}

impl Primitive for Lower {
    fn kind(&self) -> Kind {
        Kind::Move
    }
    fn limit_s(&self) -> f64 {
        self.limit_s
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let grip = self.watch.check(hand, feedback);
        match grip.and_then(|grip| check_collision(hand, "while lowering").map(|()| grip)) {
            Err(failure) => return Step::Failed(failure),
            Ok(Grip::Unsure) => return Step::Act,
            Ok(Grip::Firm | Grip::Shifted) => {}
        }
        let height_m = feedback.tcp.translation.z;
        if self.touched.is_none() {
            match self.advance.tick(hand) {
                Progress::Onward => {}
                Progress::Touched => self.touched = Some((hand.felt_n().z, 0)),
                Progress::End => return Step::Done(Outcome::Lowered { touch_n: None, height_m }),
            }
        }
        let Some((touch_n, ticks)) = &mut self.touched else { return Step::Act };
        if *ticks < hand.ticks(BELIEVED_S) {
            *ticks += 1;
            return Step::Act;
        }
        if hand.robot.suction.is_none() && pads_in_contact(feedback) == [false, false] {
            let reason =
                format!("it was lost as it was set down: felt {touch_n:.0} N, and then neither pad felt anything");
            return Step::Failed(Failure::empty_handed(FailureCause::Grasp, reason));
        }
        // The spring of the wrist is let go, so that opening the fingers does not shoot the object away.
        let touch_n = Some(*touch_n);
        hand.command_height(height_m);
        Step::Done(Outcome::Lowered { touch_n, height_m })
    }
}
