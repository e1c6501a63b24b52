//! `place-upright`: put what is held down at a destination, base down, and let go.
//!
//! The invocation says how what is held sits in the hand and where its base shall be. The height is found by
//! feeling: perceived heights may be off, the wrist knows when something stands.
//!
//! Argument: `height`, of what is held over its base, which the hand clears when it leaves; metres.

use super::{argument, ending, within_ceiling};
use crate::{
    approach::Surroundings,
    clearance::{
        GUARD_M, PERCEPTION_ERROR_M, SAFETY_M, approach_clearance, obstacles, safe_height, within_guarded_reach,
        within_reach,
    },
    controller::StartError,
    geometry::{downward, points_down},
    hand::{Hand, holds_something, pads_in_contact},
    motion::{Pace, Path},
    primitives::{Carry, Failure, GripWatch, Lower, Outcome, Reach, Release},
    run::{Function, Next, Notes, WayOut},
};
use acm_concept::{
    embodiment::Feedback,
    ids::ObjectId,
    pose::Pose,
    skill::{FailureCause, SkillInvocation},
    solid::PlacedSolid,
};
use glam::DVec3;

/// How far below the expected contact it is still looked for, metres.
const SEARCH_M: f64 = 0.018;
/// An approach direction with more than this along the world's z comes from below, where the support is.
const UPWARD: f64 = 0.2;
/// How much the fingers first open, the widest first; metres.
const SPREADS_M: [f64; 3] = [0.025, 0.018, 0.012];
/// Room that opening should leave to neighbours, metres.
const OPENING_ROOM_M: f64 = 0.003;
/// How far a hand that holds from the side backs off, metres.
const BACK_M: f64 = 0.1;
/// Height of the slow rise off what was placed, metres.
const RISE_M: f64 = 0.03;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Begin,
    Carrying,
    Lowering,
    Releasing,
    Rising,
    Leaving,
    Opening,
}

/// The running function.
pub(crate) struct PlaceUpright {
    object: ObjectId,
    base_in_tcp: Pose,
    /// TCP pose at which the base should touch.
    contact: Pose,
    obstacles: Vec<PlacedSolid>,
    travel_height_m: f64,
    leave_height_m: f64,
    gap_m: f64,
    /// The opening kept until the hand is above its neighbours.
    opening_m: f64,
    /// Whether the hand points down; else it leaves against its approach direction before it rises.
    down: bool,
    around: Surroundings,
    stage: Stage,
}

impl PlaceUpright {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, feedback: &Feedback) -> Result<PlaceUpright, StartError> {
        let kind = || invocation.kind.clone();
        let (object, base_in_tcp, _) =
            invocation.held.as_ref().ok_or_else(|| StartError::NothingHeld { kind: kind() })?;
        let place = invocation.destination.ok_or_else(|| StartError::NoDestination { kind: kind() })?;
        let height_m = argument(invocation, "height")?;
        let wanted = place.pose * base_in_tcp.inverse();
        let down = points_down(&wanted);
        let approach = wanted.transform_vector(DVec3::Z);
        if approach.z > UPWARD {
            return Err(StartError::Tilted { tilt_rad: approach.angle_between(-DVec3::Z) });
        }
        // A hand that holds it from the side stays as it is, and leaves to that side.
        let rotation = if down { downward(DVec3::ZERO, wanted.yaw()).rotation } else { wanted.rotation };
        let contact = Pose::new(place.pose.translation - rotation * base_in_tcp.translation, rotation);
        within_guarded_reach(&hand.robot, "the place", contact.translation)?;
        let above = contact.translation + GUARD_M * DVec3::Z;
        within_reach(&hand.robot, "the pose above the place", above)?;
        let obstacles = obstacles(invocation, place.pose.translation.z);
        let around = Surroundings { obstacles: obstacles.clone(), floor_m: place.pose.translation.z };
        let clearance_m = if down {
            approach_clearance(&hand.robot, &contact, feedback.opening_m, &obstacles)
        } else {
            around.room_between_m(&hand.robot, &Pose::new(above, rotation), &contact, feedback.opening_m)
        };
        if clearance_m < -PERCEPTION_ERROR_M {
            return Err(StartError::Blocked { what: "put it there", overlap_m: -clearance_m });
        }
        let floor_m = place.pose.translation.z.max(invocation.support_height_m);
        let start = hand.command.tcp.translation;
        // How far what is held hangs under the TCP.
        let below_m = contact.translation.z - place.pose.translation.z;
        let travel_height_m = safe_height(hand, start, contact.translation, &obstacles, floor_m, below_m)?;
        let above_top_m = place.pose.translation.z + height_m + hand.tip_reach_m + SAFETY_M;
        Ok(PlaceUpright {
            object: *object,
            base_in_tcp: *base_in_tcp,
            contact,
            obstacles,
            travel_height_m,
            leave_height_m: within_ceiling(hand, travel_height_m.max(above_top_m)),
            gap_m: feedback.opening_m,
            opening_m: hand.robot.max_opening_m,
            down,
            around,
            stage: Stage::Begin,
        })
    }

    fn carry(&mut self, hand: &Hand, feedback: &Feedback) -> Next {
        if !holds_something(feedback) {
            let reason = format!("the hand is empty: its gap is {:.1} mm before the carry", 1e3 * feedback.opening_m);
            return Next::Failed(Failure::empty_handed(FailureCause::Grasp, reason));
        }
        self.gap_m = feedback.opening_m;
        self.stage = Stage::Carrying;
        let above = Pose::new(self.contact.translation + GUARD_M * DVec3::Z, self.contact.rotation);
        let pace = Pace::carrying(&hand.robot);
        let path = Path::over(hand.command.tcp, above, self.travel_height_m, pace, hand.robot.tick_s);
        Next::Begin(Box::new(Carry::new(path, GripWatch::new(self.gap_m))))
    }

    fn release(&mut self, hand: &Hand, last: Option<Outcome>, notes: &mut Notes) -> Next {
        if let Some(Outcome::Lowered { touch_n, height_m }) = last {
            notes.measure("standing_force_n", touch_n.unwrap_or(0.0));
            notes.measure("standing_offset_m", height_m - self.contact.translation.z);
        }
        self.stage = Stage::Releasing;
        let spreads = SPREADS_M.map(|spread| (self.gap_m + spread).min(hand.robot.max_opening_m));
        let roomy = |opening: &f64| self.room(hand, *opening) >= OPENING_ROOM_M;
        self.opening_m = spreads.into_iter().find(roomy).unwrap_or(spreads[2]);
        Next::Begin(Box::new(Release::new(self.gap_m, self.opening_m)))
    }

    /// Room to the neighbours with the fingers this wide where the hand is, metres.
    fn room(&self, hand: &Hand, opening_m: f64) -> f64 {
        if self.down {
            return approach_clearance(&hand.robot, &hand.command.tcp, opening_m, &self.obstacles);
        }
        self.around.room_m(&hand.robot, &hand.command.tcp, opening_m)
    }

    fn rise(&mut self, hand: &Hand, feedback: &Feedback, notes: &mut Notes) -> Next {
        notes.left_at = Some(feedback.tcp * self.base_in_tcp);
        notes.measure("release_height_m", feedback.tcp.translation.z);
        if self.room(hand, hand.robot.max_opening_m) >= OPENING_ROOM_M {
            self.opening_m = hand.robot.max_opening_m;
        }
        self.stage = Stage::Rising;
        if !self.down {
            return ending::back_off_by(hand, BACK_M);
        }
        let height_m = within_ceiling(hand, hand.command.tcp.translation.z + RISE_M);
        let path = Path::vertical(hand.command.tcp, height_m, Pace::gentle(&hand.robot), hand.robot.tick_s);
        Next::Begin(Box::new(Reach::passing(path, self.opening_m)))
    }

    fn leave(&mut self, hand: &Hand, feedback: &Feedback, notes: &mut Notes) -> Next {
        if pads_in_contact(feedback) != [false, false] {
            let what = "the fingers are open and the hand has risen, but a pad still feels something: gap";
            let reason = format!("{what} {:.1} mm", 1e3 * feedback.opening_m);
            return Next::Failed(Failure::new(FailureCause::Place, reason));
        }
        notes.feel_empty(self.object);
        self.stage = Stage::Leaving;
        let height_m = self.leave_height_m.max(hand.command.tcp.translation.z);
        let path = Path::vertical(hand.command.tcp, height_m, Pace::free(&hand.robot), hand.robot.tick_s);
        Next::Begin(Box::new(Reach::new(path, self.opening_m)))
    }

    fn open(&mut self, hand: &Hand) -> Next {
        self.stage = Stage::Opening;
        let stay = Path::through(hand.command.tcp, &[], Pace::free(&hand.robot), hand.robot.tick_s);
        Next::Begin(Box::new(Reach::new(stay, hand.robot.max_opening_m)))
    }
}

impl Function for PlaceUpright {
    fn next(&mut self, hand: &Hand, feedback: &Feedback, last: Option<Outcome>, notes: &mut Notes) -> Next {
        match self.stage {
            Stage::Begin => self.carry(hand, feedback),
            Stage::Carrying => {
                self.stage = Stage::Lowering;
                let floor_m = self.contact.translation.z - SEARCH_M;
                Next::Begin(Box::new(Lower::new(hand, floor_m, GripWatch::new(self.gap_m))))
            }
            Stage::Lowering => self.release(hand, last, notes),
            Stage::Releasing => {
                if let Some(Outcome::Released { free }) = last {
                    notes.measure("pads_free", f64::from(u8::from(free)));
                }
                self.rise(hand, feedback, notes)
            }
            Stage::Rising => self.leave(hand, feedback, notes),
            Stage::Leaving if self.opening_m < hand.robot.max_opening_m => self.open(hand),
            Stage::Leaving | Stage::Opening => Next::Done,
        }
    }
    fn way_out(&self) -> WayOut {
        WayOut::Up(self.leave_height_m)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}
