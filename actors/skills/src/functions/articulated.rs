//! What opening, closing, turning and dragging share: take hold of a part, or press against it, and follow its joint.

use super::{argument, ending, number};
use crate::{
    approach::{Surroundings, TILTS, choose, drawn_back, facing, openings, tilted, turned_about, way},
    articulation::Articulation,
    controller::StartError,
    hand::Hand,
    motion::{Pace, Path},
    primitives::{Follow, FollowPlan, Grasp, GraspPlan, GripWatch, Hold, Outcome, Reach},
    run::{Next, Notes, WayOut},
    sequence::{Moment, Step, Steps},
};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term},
    pose::Pose,
    primitive::Primitive as Kind,
    skill::{FailureCause, SkillInvocation},
};
use glam::DVec3;

/// The least spread a part must leave, metres.
const LEAST_SPREAD_M: f64 = 0.006;
/// Distance from the part at which the hand comes to rest before it goes to it, metres.
const STANDOFF_M: f64 = 0.06;
/// The last stretch before that, which goes straight on, metres.
const STRAIGHT_M: f64 = 0.1;
/// How far the hand backs off in the end, metres.
pub(super) const LEAVE_M: f64 = 0.1;
/// A hand that points up by more than this share stands under the part: it comes out from there by so much, metres.
const UNDER: f64 = 0.3;
const OUT_M: f64 = 0.25;
/// How much farther a hinged part is led on that would fall if it were let go, radians.
const LEAD_ON_RAD: f64 = 0.8;
/// Speed along the way, m/s: with a part in the hand, and pressing against it.
const PULL_M_S: f64 = 0.15;
const PUSH_M_S: f64 = 0.08;
/// How far beyond its end the way of a closing part is followed, until it stops: metres for a slide, radians for a hinge.
const BEYOND_M: f64 = 0.02;
const BEYOND_RAD: f64 = 0.08;
/// How much of the way may lack where a part stops by itself, as a share and at least in metres or radians.
const LACK_SHARE: f64 = 0.06;
const LACK: f64 = 0.01;
/// A part that was felt all the way surely is where the hand left it.
const FELT_CONFIDENCE: f64 = 0.92;

/// What parts on a hinge and parts on a slide differ in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Jointed {
    /// The argument that says how far the part moves.
    pub travel: &'static str,
    /// Direction of the joint's axis in the frame where no argument gives one.
    pub axis: DVec3,
}
pub(crate) const HINGED: Jointed = Jointed { travel: "angle", axis: DVec3::X };
pub(crate) const SLIDING: Jointed = Jointed { travel: "travel", axis: DVec3::Z };

/// The joint that an invocation describes in the function's frame: a line along `axis_*` if there is no `hinge_*`.
pub(crate) fn joint(invocation: &SkillInvocation, default_axis: DVec3) -> Articulation {
    let frame = invocation.frame;
    let vector = |names: [&str; 3], default: DVec3| {
        DVec3::new(
            number(invocation, names[0], default.x),
            number(invocation, names[1], default.y),
            number(invocation, names[2], default.z),
        )
    };
    let axis = vector(["axis_x", "axis_y", "axis_z"], DVec3::ZERO).try_normalize().unwrap_or(default_axis);
    let axis = frame.transform_vector(axis);
    let hinge = ["hinge_x", "hinge_y", "hinge_z"];
    if hinge.iter().any(|name| invocation.arguments.contains_key(*name)) {
        let point = frame.transform_point(vector(hinge, DVec3::ZERO));
        return Articulation::Revolute { point, axis };
    }
    Articulation::Prismatic { direction: axis }
}

/// Writes down what a joint turned out to be.
fn note_joint(notes: &mut Notes, joint: &Articulation, at: DVec3) {
    let mut vector = |name: &str, value: DVec3| {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(value.to_array()) {
            notes.measure(&format!("{name}_{axis}"), value);
        }
    };
    match *joint {
        Articulation::Prismatic { direction } => vector("slide_direction", direction),
        Articulation::Revolute { point, axis } => {
            vector("hinge_axis", axis);
            // Of all points of the axis, the one nearest to the hand.
            vector("hinge_point_m", point + (at - point).project_onto_normalized(axis));
            notes.measure("hinge_radius_m", joint.lever_m(at));
        }
    }
}

/// What a function on an articulated part felt to hold in the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Felt {
    /// It stands open.
    Open,
    /// It is shut.
    Closed,
    /// Nothing that a literal says.
    Nothing,
}

/// Notes how far the part went, or says why that is not known.
pub(super) fn note_travel(moment: &mut Moment<'_>, object: ObjectId, felt: Felt) -> Option<Next> {
    let Some(Outcome::Followed { travelled, joint, resistance_n, stopped }) = moment.last else {
        return Some(Next::fail(FailureCause::Motion, "the motion ended without a result"));
    };
    let name = if matches!(joint, Articulation::Revolute { .. }) { "travel_rad" } else { "travel_m" };
    moment.notes.measure(name, travelled);
    moment.notes.measure("resistance_n", resistance_n);
    moment.notes.measure("stopped", f64::from(u8::from(stopped)));
    note_joint(moment.notes, &joint, moment.feedback.tcp.translation);
    let open = Literal::new("open", vec![Term::Object(object)]);
    match felt {
        Felt::Open => moment.notes.feel(open, FELT_CONFIDENCE),
        Felt::Closed => moment.notes.feel(open.negate(), FELT_CONFIDENCE),
        Felt::Nothing => {}
    }
    None
}

/// What is around the part: perceived solids without the part's own object, and the support.
pub(crate) fn surroundings(invocation: &SkillInvocation) -> Surroundings {
    solids_but(invocation, Some(invocation.part.object))
}

/// As [`surroundings`], with the part's own object: a hand on its way to the part must not touch that either.
pub(crate) fn all_around(invocation: &SkillInvocation) -> Surroundings {
    solids_but(invocation, None)
}

fn solids_but(invocation: &SkillInvocation, own: Option<ObjectId>) -> Surroundings {
    let held = invocation.held.as_ref().map(|(object, _, _)| *object);
    let counts = |id: &ObjectId| Some(*id) != own && Some(*id) != held;
    let obstacles = invocation.obstacles.iter().filter(|(id, _)| counts(id)).map(|(_, solid)| *solid).collect();
    Surroundings { obstacles, floor_m: invocation.support_height_m }
}

/// Takes hold of a part between the fingers and moves it along its joint, then lets go.
pub(crate) struct Draw {
    object: ObjectId,
    felt: Felt,
    grasp_at: Pose,
    around: Surroundings,
    opening_m: f64,
    grasp: GraspPlan,
    follow: FollowPlan,
    must_stop: bool,
}

/// What tells the kinds of drawing apart.
pub(crate) struct DrawKind {
    pub what: &'static str,
    pub primitive: Kind,
    pub joint: Articulation,
    /// Metres or radians, signed.
    pub travel: f64,
    /// Whether the part hangs on something.
    pub attached: bool,
    /// Whether the way ends at a stop.
    pub to_stop: bool,
    pub felt: Felt,
}

impl DrawKind {
    /// The least travel that counts where the part stops by itself, metres or radians.
    pub fn least(&self) -> f64 {
        self.travel.abs() - LACK.max(LACK_SHARE * self.travel.abs())
    }
    /// How much farther it is led on if it would fall.
    fn lead_on(&self) -> f64 {
        match (self.felt, self.joint) {
            (Felt::Open, Articulation::Revolute { .. }) => LEAD_ON_RAD,
            _ => 0.0,
        }
    }
}

impl Draw {
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, kind: DrawKind) -> Result<Draw, StartError> {
        let width_m = argument(invocation, "grip_width")?;
        let openings_m = openings(hand, width_m, LEAST_SPREAD_M)?;
        let around = surroundings(invocation);
        let straight = facing(&invocation.frame);
        let straight = nearer_turn(hand, straight);
        let candidates = TILTS.map(|angle| tilted(&straight, angle));
        let (grasp_at, opening_m) = choose(hand, kind.what, &candidates, &openings_m, STANDOFF_M, &around)?;
        Ok(Draw {
            object: invocation.part.object,
            felt: kind.felt,
            grasp_at,
            around,
            opening_m,
            // Tips that touch near the end of the way have met what the part stands out from.
            grasp: GraspPlan {
                travel_m: STANDOFF_M,
                width_m,
                landed_before_m: STANDOFF_M - 2.0 * hand.tip_reach_m,
                attached: kind.attached,
            },
            follow: FollowPlan {
                kind: kind.primitive,
                joint: kind.joint,
                travel: kind.travel + kind.travel.signum() * beyond(&kind.joint, kind.to_stop),
                least: kind.least(),
                lead_on: kind.lead_on(),
                speed_m_s: PULL_M_S,
                // Replaced by a watch of the gap that the grasp finds.
                hold: Hold::Contact,
            },
            must_stop: kind.to_stop,
        })
    }

    fn reach(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let before = drawn_back(&self.grasp_at, STANDOFF_M + STRAIGHT_M);
        let path = way(moment.hand, before, &self.around, Pace::free(&moment.hand.robot));
        Some(Next::begin(Reach::passing(path, self.opening_m)))
    }

    /// Straight on towards the part: what stands out from it may not be passed sideways.
    fn close_in(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let (hand, before) = (moment.hand, drawn_back(&self.grasp_at, STANDOFF_M));
        let path = Path::through(hand.command.tcp, &[before], Pace::free(&hand.robot), hand.robot.tick_s);
        Some(Next::begin(Reach::new(path, self.opening_m)))
    }

    fn grasp(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        Some(Next::begin(Grasp::new(moment.hand, self.grasp)))
    }

    fn follow(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let Some(Outcome::Grasped { width_m, gap_m, .. }) = moment.last else {
            return Some(Next::fail(FailureCause::Grasp, "the grasp ended without a grip"));
        };
        moment.notes.measure("grip_width_m", width_m);
        let plan = FollowPlan { hold: Hold::Fingers(GripWatch::new(gap_m)), ..self.follow.clone() };
        Some(Next::begin(Follow::new(moment.hand, plan)))
    }

    /// Out from under the part, away from its hinge or on along its slide, so that the way up is free.
    fn come_out(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let (robot, from) = (&moment.hand.robot, moment.hand.command.tcp);
        if from.transform_vector(DVec3::Z).z < UNDER {
            return None;
        }
        let out = match self.follow.joint {
            Articulation::Prismatic { direction } => self.follow.travel.signum() * direction,
            Articulation::Revolute { point, axis } => (from.translation - point).reject_from_normalized(axis),
        };
        let out = out.with_z(0.0).normalize_or_zero();
        let at = (from.translation + OUT_M * out).max(robot.workspace_min).min(robot.workspace_max);
        let path = Path::through(from, &[Pose::new(at, from.rotation)], Pace::free(robot), robot.tick_s);
        Some(Next::begin(Reach::passing(path, moment.hand.command.opening_m)))
    }
}

impl Steps for Draw {
    const STEPS: &'static [Step<Draw>] = &[
        Draw::reach,
        Draw::close_in,
        Draw::grasp,
        Draw::follow,
        |draw, moment| judge_stop(moment, draw.must_stop),
        |draw, moment| note_travel(moment, draw.object, draw.felt),
        |_, moment| Some(ending::back_off_by(moment.hand, LEAVE_M)),
        Draw::come_out,
        |draw, moment| ending::felt_free(moment, draw.object),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Back(LEAVE_M)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}

/// Presses closed finger tips against a part and moves it along its joint until it stops, or a way is behind.
pub(crate) struct Drive {
    object: ObjectId,
    felt: Felt,
    /// TCP pose at which the tips touch.
    contact: Pose,
    /// The side on which the hand comes to it and leaves it: a unit vector, world frame.
    back: DVec3,
    around: Surroundings,
    follow: FollowPlan,
    must_stop: bool,
}

/// What tells the kinds of driving apart.
pub(crate) struct DriveKind {
    pub what: &'static str,
    pub joint: Articulation,
    /// Metres or radians, signed.
    pub travel: f64,
    /// Whether the way ends at a stop.
    pub to_stop: bool,
    pub felt: Felt,
}

/// Room between the tips and the part from which the hand begins to press, metres: a run-up in which it learns what a
/// free hand feels.
const RUN_UP_M: f64 = 0.03;

impl Drive {
    /// With the tips of the hand that looks against the frame.
    pub fn plan(invocation: &SkillInvocation, hand: &Hand, kind: DriveKind) -> Result<Drive, StartError> {
        let tips = facing(&invocation.frame) * Pose::from_translation(-hand.tip_reach_m * DVec3::Z);
        let straight = nearer_turn(hand, tips);
        let quarter = straight * Pose::from_yaw(DVec3::ZERO, std::f64::consts::FRAC_PI_2);
        let back = invocation.frame.transform_vector(DVec3::Z);
        Drive::at(invocation, hand, kind, &[straight, quarter], back)
    }

    /// With the hand in one of some poses in which it touches the part.
    pub fn at(
        invocation: &SkillInvocation,
        hand: &Hand,
        kind: DriveKind,
        contacts: &[Pose],
        back: DVec3,
    ) -> Result<Drive, StartError> {
        let around = surroundings(invocation);
        let (contact, _) = choose(hand, kind.what, contacts, &[0.0], RUN_UP_M, &around)?;
        let lever = match kind.joint {
            Articulation::Prismatic { .. } => 1.0,
            Articulation::Revolute { .. } => kind.joint.lever_m(contact.translation).max(0.02),
        };
        let beyond = beyond(&kind.joint, kind.to_stop);
        let whole = kind.travel.abs() + RUN_UP_M / lever;
        let least = whole - LACK.max(LACK_SHARE * kind.travel.abs());
        Ok(Drive {
            object: invocation.part.object,
            felt: kind.felt,
            contact,
            back,
            around,
            follow: FollowPlan {
                kind: Kind::Push,
                joint: kind.joint,
                travel: kind.travel.signum() * (whole + beyond),
                least,
                lead_on: 0.0,
                speed_m_s: PUSH_M_S,
                hold: Hold::Contact,
            },
            must_stop: kind.to_stop,
        })
    }

    /// The pose in which the run-up begins: back along the joint's own way.
    fn start(&self) -> Pose {
        let lever = match self.follow.joint {
            Articulation::Prismatic { .. } => 1.0,
            Articulation::Revolute { .. } => self.follow.joint.lever_m(self.contact.translation).max(0.02),
        };
        self.follow.joint.carried(&self.contact, -self.follow.travel.signum() * RUN_UP_M / lever)
    }

    fn reach(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let before = Pose::new(self.start().translation + STRAIGHT_M * self.back, self.start().rotation);
        let path = way(moment.hand, before, &self.around, Pace::free(&moment.hand.robot));
        Some(Next::begin(Reach::new(path, 0.0)))
    }

    fn close_in(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        let path = Path::through(
            moment.hand.command.tcp,
            &[self.start()],
            Pace::gentle(&moment.hand.robot),
            moment.hand.robot.tick_s,
        );
        Some(Next::begin(Reach::new(path, 0.0)))
    }

    fn follow(&mut self, moment: &mut Moment<'_>) -> Option<Next> {
        Some(Next::begin(Follow::new(moment.hand, self.follow.clone())))
    }
}

impl Steps for Drive {
    const STEPS: &'static [Step<Drive>] = &[
        Drive::reach,
        Drive::close_in,
        Drive::follow,
        |drive, moment| judge_stop(moment, drive.must_stop),
        |drive, moment| note_travel(moment, drive.object, drive.felt),
        |_, moment| Some(ending::back_off_by(moment.hand, LEAVE_M)),
    ];
    fn way_out(&self) -> WayOut {
        WayOut::Back(LEAVE_M)
    }
    fn object(&self) -> ObjectId {
        self.object
    }
}

/// How far beyond its believed end a way is followed that ends at a stop.
fn beyond(joint: &Articulation, to_stop: bool) -> f64 {
    match (to_stop, joint) {
        (false, _) => 0.0,
        (true, Articulation::Prismatic { .. }) => BEYOND_M,
        (true, Articulation::Revolute { .. }) => BEYOND_RAD,
    }
}

/// What should have been stopped and was not is not shut.
fn judge_stop(moment: &Moment<'_>, must_stop: bool) -> Option<Next> {
    let free = matches!(moment.last, Some(Outcome::Followed { stopped: false, .. }));
    let reason = "moved beyond where it should shut, but nothing stopped it";
    (must_stop && free).then(|| Next::fail(FailureCause::Press, reason))
}

/// Of a pose and the same with the fingers exchanged, the one that needs the smaller turn of the hand.
fn nearer_turn(hand: &Hand, pose: Pose) -> Pose {
    let other = turned_about(&pose);
    if hand.command.tcp.angle_to(&other) < hand.command.tcp.angle_to(&pose) { other } else { pose }
}
