//! How functions end that leave a part where it is: fingers open, back off, and nothing is felt any more.

use crate::hand::{Hand, pads_in_contact};
use crate::{
    approach::drawn_back,
    motion::{Pace, Path},
    primitives::{Reach, Release},
    run::Next,
    sequence::Moment,
};
use acm_concept::{ids::ObjectId, pose::Pose, skill::FailureCause};

/// How far the fingers open beyond what they held, metres.
const SPREAD_M: f64 = 0.02;
/// How far the hand backs off at least, metres: fingers and a little more.
const BACK_M: f64 = 0.07;

/// Opens the fingers round what they hold at a gap.
pub(crate) fn open(moment: &mut Moment<'_>, gap_m: f64) -> Option<Next> {
    let open_m = (gap_m + SPREAD_M).min(moment.hand.robot.max_opening_m);
    Some(Next::begin(Release::new(gap_m, open_m)))
}

/// Draws the hand back against its approach direction.
pub(crate) fn back_off(moment: &mut Moment<'_>) -> Option<Next> {
    Some(back_off_by(moment.hand, BACK_M))
}

/// As [`back_off`], by a distance in metres.
pub(crate) fn back_off_by(hand: &Hand, distance_m: f64) -> Next {
    let back = drawn_back(&hand.command.tcp, distance_m);
    let inside = back.translation.max(hand.robot.workspace_min).min(hand.robot.workspace_max);
    let to = [Pose::new(inside, back.rotation)];
    let path = Path::through(hand.command.tcp, &to, Pace::gentle(&hand.robot), hand.robot.tick_s);
    Next::begin(Reach::passing(path, hand.command.opening_m))
}

/// Notes that the hand is empty; fails if a pad still feels something.
pub(crate) fn felt_free(moment: &mut Moment<'_>, object: ObjectId) -> Option<Next> {
    if pads_in_contact(moment.feedback) != [false, false] {
        let gap_mm = 1e3 * moment.feedback.opening_m;
        let reason = format!(
            "the fingers are open and the hand has backed off, but a pad still feels something: gap {gap_mm:.1} mm"
        );
        return Some(Next::fail(FailureCause::Place, reason));
    }
    moment.notes.feel_empty(object);
    None
}
