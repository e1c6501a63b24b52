//! Move: carry what is held, watching that it stays in the hand; and lower it until it stands.

use super::{Grip, GripWatch, Outcome, Primitive, Rest, Step, check_collision};
use crate::{
    descent::{Descent, Progress},
    hand::Hand,
    motion::Path,
};
use acm_concept::{embodiment::Feedback, primitive::Primitive as Kind};

/// What is allowed beyond the path's own time, seconds: rest, and pauses where the grip is unsure.
const SLACK_S: f64 = 4.0;
/// Speed of lowering, m/s: a stiff wrist then feels a touch within about a millimetre.
const LOWERING_M_S: f64 = 0.03;
/// Upward force that tells that what is held stands on something, newtons.
const STANDING_N: f64 = 3.5;

/// Flies a path with something in the hand, then comes to rest and takes its weight as the wrist's zero.
#[derive(Debug)]
pub(crate) struct Carry {
    path: Path,
    watch: GripWatch,
    rest: Rest,
}

impl Carry {
    pub fn new(path: Path, watch: GripWatch) -> Carry {
        Carry { path, watch, rest: Rest::default() }
    }
}

impl Primitive for Carry {
    fn kind(&self) -> Kind {
        Kind::Move
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
    descent: Descent,
    watch: GripWatch,
    limit_s: f64,
}

impl Lower {
    /// Down to a TCP height of `floor_m` at most. The wrist's zero must have been taken at rest.
    pub fn new(hand: &Hand, floor_m: f64, watch: GripWatch) -> Lower {
        let descent = Descent::new(hand, floor_m, LOWERING_M_S, STANDING_N);
        Lower { limit_s: descent.duration_s(hand.command.tcp.translation.z) + SLACK_S, descent, watch }
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
        match self.descent.tick(hand) {
            Progress::Down => Step::Act,
            Progress::Touched => {
                // The spring of the wrist is let go, so that opening the fingers does not shoot the object away.
                let touch_n = Some(hand.felt_n().z);
                hand.command_height(height_m);
                Step::Done(Outcome::Lowered { touch_n, height_m })
            }
            Progress::Floor => Step::Done(Outcome::Lowered { touch_n: None, height_m }),
        }
    }
}
