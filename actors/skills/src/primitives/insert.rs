//! Insert: bring what is held into an opening, searching for it by touch.
//!
//! From the rim the hand lifts what is held a little, sets it down beside, and so on in a growing spiral: dragged over
//! the rim it would tilt in the grip. Where it goes deeper than before, the hand yields sideways to what it feels, and so
//! follows a rounded edge into the opening and then the walls. At the end what is held must be held sideways by the
//! opening as well: else it went in nowhere.

use super::{Failure, Grip, GripWatch, Outcome, Primitive, Step, check_collision};
use crate::{
    advance::{Advance, Progress},
    hand::Hand,
};
use acm_concept::{embodiment::Feedback, pose::Pose, primitive::Primitive as Kind, skill::FailureCause};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

/// Speed towards the opening, m/s.
const APPROACH_M_S: f64 = 0.02;
/// Force that tells of the rim or the ground, newtons.
const TOUCH_N: f64 = 3.0;
/// Force with which it is set down during the search, newtons.
const SEARCH_N: f64 = 2.0;
/// Gain of the force control, metres for a newton and tick; and the most that the command moves in a tick, metres.
const FORCE_GAIN_M_N: f64 = 2e-5;
const FORCE_STEP_M: f64 = 1e-4;
/// Radius of the search, metres: what a pose may be off.
const SEARCH_M: f64 = 0.0045;
/// Distance of neighbouring places of the search, as a share of the clearance, and within what; metres.
const PITCH_SHARE: f64 = 0.85;
const PITCH_M: [f64; 2] = [3.5e-4, 1e-3];
/// How far it is lifted between two places, metres; speeds of lifting and shifting, and of setting down, m/s.
const LIFTED_M: f64 = 1e-3;
const SHIFT_M_S: f64 = 0.025;
const SET_DOWN_M_S: f64 = 0.012;
/// Time that one place takes, seconds: for the time limit.
const PLACE_S: f64 = 0.35;
/// A place lower than the rim by so much is looked into, metres; one lower by so much is the opening.
const DROP_M: f64 = 3e-4;
const ENTRY_M: f64 = 1.6e-3;
/// How long a drop may take to become an entry, seconds; and how the hand yields meanwhile, m/s for a newton.
const LOOK_S: f64 = 0.3;
const LOOK_YIELDING_M_S_N: f64 = 2e-3;
/// Speed within the opening, m/s, and the force that is used there, newtons.
const SINK_M_S: f64 = 0.02;
const SINK_N: f64 = 12.0;
/// Sideways yielding within the opening, m/s for a newton.
const YIELDING_M_S_N: f64 = 6e-4;
/// Shaking when it jams: amplitude in metres, turns in a second.
const SHAKE_M: f64 = 3e-4;
const SHAKE_HZ: f64 = 4.0;
/// With it the hand rocks about the direction in which its fingers close, in which what is held may have tilted: largest
/// angle in radians, and turns in a second. It stays as it is as long as it goes deeper.
const ROCK_RAD: f64 = 0.09;
const ROCK_HZ: f64 = 0.8;
/// It jams for good when it has not gone deeper by this, metres, for so long, seconds.
const JAM_M: f64 = 3e-4;
const JAM_S: f64 = 2.6;
/// So often a jam ends in another try: from the next place if it is shallow, that is within so many entries of the rim,
/// else a little higher.
const MAX_RETRIES: u32 = 6;
const SHALLOW: f64 = 3.0;
const RETRY_M: f64 = 4e-3;
/// A ground is believed in when the force has stood for so long, seconds, and is no more than this before its time.
const GROUND_S: f64 = 0.1;
const EARLY_M: f64 = 1e-3;
/// How far beyond the expected depth the ground is looked for, metres: what is held may have slid up between the fingers.
const BEYOND_M: f64 = 8e-3;
/// The share of the depth that counts as inserted.
const DEEP_SHARE: f64 = 0.8;
/// The test at the end: how far beyond the clearance the hand goes sideways, metres; how fast, m/s; what it must feel, newtons.
const PROBE_M: f64 = 0.0015;
const PROBE_M_S: f64 = 0.02;
const PROBE_N: f64 = 2.5;
/// How far it is drawn back for that test, so that the ground's friction does not count, metres.
const LIFT_M: f64 = 5e-4;

/// The numbers of an insertion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InsertPlan {
    /// Unit direction into the opening, world frame.
    pub direction: DVec3,
    /// How far the TCP goes until the tip of what is held is level with the rim, metres.
    pub rim_m: f64,
    /// How deep the tip goes beyond the rim, metres.
    pub depth_m: f64,
    /// Width of the opening less that of what goes in, metres.
    pub clearance_m: f64,
    /// Whether the ground is met at that depth; else it is enough to be that deep.
    pub grounded: bool,
    /// How far the tip is from the TCP along the direction, metres.
    pub tip_m: f64,
}

#[derive(Debug)]
enum Phase {
    Approach(Advance),
    /// Lifted off the rim and on the way to the next place.
    Shift(Place),
    /// On the way down to it.
    SetDown(Place),
    /// Lower than the rim by a little: the edge of the opening, or a dent.
    Look {
        place: Place,
        ticks: u32,
    },
    Sink {
        rim_m: f64,
        best_m: f64,
        stuck_ticks: u32,
        ground_ticks: u32,
    },
    /// Drawn back a little, then pushed one way and the other.
    Probe {
        depth_m: f64,
        leg: usize,
        gone_m: f64,
        most_n: f64,
    },
}

/// Where the search is.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// The level of the rim as last felt, metres along the direction.
    rim_m: f64,
    /// Angle along the spiral.
    angle: f64,
}

/// From above the opening, at rest and with the wrist's zero taken, to inserted.
#[derive(Debug)]
pub(crate) struct Insert {
    plan: InsertPlan,
    watch: GripWatch,
    start: Pose,
    /// Phase of the rocking, radians.
    rock: f64,
    /// Where the commanded TCP is sideways of the start, in the plane across the direction, without spiral and shaking.
    centre: DVec2,
    /// How far it is commanded along the direction.
    along_m: f64,
    across: [DVec3; 2],
    phase: Phase,
    ticks: u32,
    most_n: f64,
    searched_m: f64,
    /// Where the search went on last.
    place: Option<Place>,
    retries: u32,
    limit_s: f64,
}

impl Insert {
    pub fn new(hand: &Hand, plan: InsertPlan, watch: GripWatch) -> Insert {
        let travel_m = plan.rim_m + ENTRY_M + 0.5 * plan.depth_m;
        let advance = Advance::new(hand, plan.direction, travel_m, APPROACH_M_S, TOUCH_N);
        let (u, v) = plan.direction.any_orthonormal_pair();
        let pitch_m = pitch(&plan);
        let places = std::f64::consts::PI * (SEARCH_M / pitch_m).powi(2);
        let limit_s = advance.duration_s() + 2.0 * PLACE_S * places + plan.depth_m / SINK_M_S + 15.0;
        Insert {
            plan,
            watch,
            start: hand.command.tcp,
            rock: 0.0,
            centre: DVec2::ZERO,
            along_m: 0.0,
            across: [u, v],
            phase: Phase::Approach(advance),
            ticks: 0,
            most_n: 0.0,
            searched_m: 0.0,
            place: None,
            retries: 0,
            limit_s,
        }
    }

    fn command(&self, hand: &mut Hand, aside: DVec2) {
        let at = self.centre + aside;
        let [u, v] = self.across;
        let InsertPlan { direction, tip_m, .. } = self.plan;
        let turn =
            self.start.rotation * DQuat::from_rotation_y(ROCK_RAD * self.rock.sin()) * self.start.rotation.inverse();
        // Rocking leaves the tip where it is.
        let tip = self.start.translation + (self.along_m + tip_m) * direction + at.x * u + at.y * v;
        hand.command.tcp = Pose::new(tip - tip_m * (turn * direction), (turn * self.start.rotation).normalize());
    }

    /// How far the tip has gone along the direction, as the measured TCP tells, metres.
    fn along(&self, feedback: &Feedback) -> f64 {
        let InsertPlan { direction, tip_m, .. } = self.plan;
        let turn = feedback.tcp.rotation * self.start.rotation.inverse();
        let tip = feedback.tcp.translation + tip_m * (turn * direction);
        (tip - self.start.translation).dot(direction) - tip_m
    }

    /// Sideways force, in the plane across the direction.
    fn sideways_n(&self, hand: &Hand) -> DVec2 {
        let force = hand.felt_n();
        DVec2::new(force.dot(self.across[0]), force.dot(self.across[1]))
    }

    /// Moves the command along the direction so that the force along it comes to be `wanted_n`.
    fn press(&mut self, hand: &Hand, wanted_n: f64, fastest_m: f64) {
        let lacking_n = wanted_n - self.resistance_n(hand);
        self.along_m += (FORCE_GAIN_M_N * lacking_n).clamp(-FORCE_STEP_M, fastest_m);
    }

    fn resistance_n(&self, hand: &Hand) -> f64 {
        -hand.felt_n().dot(self.plan.direction)
    }

    fn approach(&mut self, hand: &mut Hand, at_m: f64) -> Step {
        let Phase::Approach(advance) = &mut self.phase else { return Step::Act };
        let progress = advance.tick(hand);
        self.along_m = advance.gone_m();
        match progress {
            Progress::Onward => {}
            Progress::End => self.phase = sink(self.plan.rim_m, at_m),
            Progress::Touched if at_m > self.plan.rim_m + 2.0 * ENTRY_M => {
                self.phase = sink(self.plan.rim_m, at_m);
            }
            Progress::Touched => {
                self.phase = Phase::Shift(Place { rim_m: at_m, angle: 0.0 }.next(&self.plan));
            }
        }
        Step::Act
    }

    fn shift(&mut self, hand: &mut Hand) -> Step {
        let Phase::Shift(place) = self.phase else { return Step::Act };
        self.place = Some(place);
        let aside = place.aside(&self.plan);
        self.searched_m = self.searched_m.max(aside.length());
        if aside.length() > SEARCH_M {
            return failed(format!("no opening was found within {:.1} mm: the rim is closed", 1e3 * SEARCH_M));
        }
        let step_m = SHIFT_M_S * hand.robot.tick_s;
        let lifted_m = place.rim_m - LIFTED_M;
        self.along_m = (self.along_m - step_m).max(lifted_m.min(self.along_m));
        // Sideways once it is clear of the rim.
        if self.along_m < place.rim_m - 0.5 * LIFTED_M {
            let way = aside - self.centre;
            self.centre += way.clamp_length_max(step_m);
        }
        if self.along_m <= lifted_m + 1e-6 && self.centre.distance(aside) < 1e-6 {
            self.phase = Phase::SetDown(place);
        }
        self.command(hand, DVec2::ZERO);
        Step::Act
    }

    fn set_down(&mut self, hand: &mut Hand, at_m: f64) -> Step {
        let Phase::SetDown(place) = self.phase else { return Step::Act };
        if at_m > place.rim_m + ENTRY_M {
            self.phase = sink(place.rim_m, at_m);
        } else if self.resistance_n(hand) > SEARCH_N {
            self.phase = if at_m > place.rim_m + DROP_M {
                Phase::Look { place, ticks: 0 }
            } else {
                Phase::Shift(Place { rim_m: 0.5 * (place.rim_m + at_m), ..place }.next(&self.plan))
            };
        } else {
            self.along_m += SET_DOWN_M_S * hand.robot.tick_s;
            self.command(hand, DVec2::ZERO);
        }
        Step::Act
    }

    fn look(&mut self, hand: &mut Hand, at_m: f64) -> Step {
        let Phase::Look { place, ticks } = self.phase else { return Step::Act };
        if at_m > place.rim_m + ENTRY_M {
            self.phase = sink(place.rim_m, at_m);
            return Step::Act;
        }
        if ticks > hand.ticks(LOOK_S) {
            self.phase = Phase::Shift(place.next(&self.plan));
            return Step::Act;
        }
        self.phase = Phase::Look { place, ticks: ticks + 1 };
        self.centre += LOOK_YIELDING_M_S_N * hand.robot.tick_s * self.sideways_n(hand);
        self.press(hand, 1.5 * SEARCH_N, 2.0 * FORCE_STEP_M);
        self.command(hand, DVec2::ZERO);
        Step::Act
    }

    fn sink(&mut self, hand: &mut Hand, at_m: f64) -> Step {
        let resistance_n = self.resistance_n(hand);
        let side_n = self.sideways_n(hand);
        let tick_s = hand.robot.tick_s;
        let Phase::Sink { rim_m, best_m, stuck_ticks, ground_ticks } = &mut self.phase else { return Step::Act };
        let depth_m = at_m - *rim_m;
        if at_m > *best_m + JAM_M {
            (*best_m, *stuck_ticks) = (at_m, 0);
        } else {
            *stuck_ticks += 1;
        }
        let deep = depth_m >= DEEP_SHARE * self.plan.depth_m;
        *ground_ticks = if deep && resistance_n > 0.6 * SINK_N { *ground_ticks + 1 } else { 0 };
        // A ground that comes too early may be a jam: it is believed in when rocking has not helped.
        let near = depth_m > self.plan.depth_m - EARLY_M;
        let ground_s = if near { GROUND_S } else { 0.7 * JAM_S };
        let whole = !self.plan.grounded && depth_m >= self.plan.depth_m - 1e-4;
        if depth_m > self.plan.depth_m + BEYOND_M {
            return failed(format!("{:.1} mm beyond the expected depth there is no ground", 1e3 * BEYOND_M));
        }
        // What no rocking brings deeper is in, if it is deep enough.
        let settled = deep && *stuck_ticks > hand.ticks(JAM_S);
        if *ground_ticks > hand.ticks(ground_s) || whole || settled {
            self.along_m = at_m - LIFT_M;
            self.phase = Phase::Probe { depth_m, leg: 0, gone_m: 0.0, most_n: 0.0 };
            self.command(hand, DVec2::ZERO);
            return Step::Act;
        }
        if *stuck_ticks > hand.ticks(JAM_S) && self.retries < MAX_RETRIES {
            let rim_m = *rim_m;
            self.retries += 1;
            if depth_m < SHALLOW * ENTRY_M {
                let place = self.place.unwrap_or(Place { rim_m, angle: 0.0 });
                self.phase = Phase::Shift(Place { rim_m, ..place }.next(&self.plan));
            } else {
                self.along_m -= RETRY_M;
                self.phase = sink(rim_m, at_m - RETRY_M);
                self.command(hand, DVec2::ZERO);
            }
            return Step::Act;
        }
        if *stuck_ticks > hand.ticks(JAM_S) {
            let (depth_mm, wanted_mm) = (1e3 * depth_m.max(0.0), 1e3 * self.plan.depth_m);
            return failed(format!("it jams at {depth_mm:.1} of {wanted_mm:.1} mm with {resistance_n:.0} N"));
        }
        // Beyond a few ticks without progress it is shaken.
        let shaking = *stuck_ticks > hand.ticks(0.12);
        self.centre += YIELDING_M_S_N * tick_s * side_n;
        self.press(hand, SINK_N, SINK_M_S * tick_s);
        if shaking {
            self.rock += TAU * ROCK_HZ * tick_s;
        }
        let phase = TAU * SHAKE_HZ * f64::from(self.ticks) * tick_s;
        let aside = if shaking { SHAKE_M * DVec2::from_angle(phase) } else { DVec2::ZERO };
        self.command(hand, aside);
        Step::Act
    }

    fn probe(&mut self, hand: &mut Hand) -> Step {
        const WAYS: [DVec2; 4] = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y];
        let felt = self.sideways_n(hand);
        let Phase::Probe { depth_m, leg, gone_m, most_n } = &mut self.phase else { return Step::Act };
        let Some(way) = WAYS.get(*leg) else {
            let outcome = Outcome::Inserted { depth_m: *depth_m, searched_m: self.searched_m, force_n: self.most_n };
            self.command(hand, DVec2::ZERO);
            return Step::Done(outcome);
        };
        *most_n = most_n.max(-felt.dot(*way));
        let reach_m = self.plan.clearance_m + PROBE_M;
        *gone_m += PROBE_M_S * hand.robot.tick_s;
        if *gone_m > 2.0 * reach_m {
            if *most_n < PROBE_N {
                let (depth_mm, side_mm) = (1e3 * *depth_m, 1e3 * reach_m);
                let reason =
                    format!("at a depth of {depth_mm:.1} mm it moves {side_mm:.1} mm sideways: nothing encloses it");
                return failed(reason);
            }
            (*leg, *gone_m, *most_n) = (*leg + 1, 0.0, 0.0);
        }
        // Out and back.
        let out_m = reach_m - (*gone_m - reach_m).abs();
        let aside = out_m * *way;
        self.command(hand, aside);
        Step::Act
    }
}

impl Primitive for Insert {
    fn kind(&self) -> Kind {
        Kind::Insert
    }
    fn limit_s(&self) -> f64 {
        self.limit_s
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let grip = self.watch.check(hand, feedback);
        match grip.and_then(|grip| check_collision(hand, "while inserting").map(|()| grip)) {
            Err(failure) => return Step::Failed(failure),
            Ok(Grip::Unsure) => return Step::Act,
            Ok(Grip::Firm | Grip::Shifted) => {}
        }
        // Pushed in, it must not be pushed up between the fingers.
        hand.command.grip_force_n = hand.robot.max_grip_force_n;
        self.ticks += 1;
        self.most_n = self.most_n.max(self.resistance_n(hand));
        let at_m = self.along(feedback);
        match self.phase {
            Phase::Approach(_) => self.approach(hand, at_m),
            Phase::Shift(_) => self.shift(hand),
            Phase::SetDown(_) => self.set_down(hand, at_m),
            Phase::Look { .. } => self.look(hand, at_m),
            Phase::Sink { .. } => self.sink(hand, at_m),
            Phase::Probe { .. } => self.probe(hand),
        }
    }
}

fn sink(rim_m: f64, at_m: f64) -> Phase {
    Phase::Sink { rim_m, best_m: at_m, stuck_ticks: 0, ground_ticks: 0 }
}

fn pitch(plan: &InsertPlan) -> f64 {
    (PITCH_SHARE * plan.clearance_m).clamp(PITCH_M[0], PITCH_M[1])
}

impl Place {
    /// The next place: about a pitch farther along Archimedes' spiral.
    fn next(self, plan: &InsertPlan) -> Place {
        let pitch_m = pitch(plan);
        let radius_m = pitch_m * self.angle / TAU;
        Place { angle: self.angle + pitch_m / radius_m.max(0.6 * pitch_m), ..self }
    }
    /// Where it is sideways of the start, metres.
    fn aside(self, plan: &InsertPlan) -> DVec2 {
        pitch(plan) * self.angle / TAU * DVec2::from_angle(self.angle)
    }
}

fn failed(reason: String) -> Step {
    Step::Failed(Failure::new(FailureCause::Place, reason))
}
