//! Pull, push and rotate: move a part along the way that its joint leaves it, or shove a thing along a line.
//!
//! One state machine for the three, because they differ only in how the hand holds on to the part: the fingers hold
//! it, or their closed tips press against it. The hand is stiff along the way and yields across it, so that a joint
//! that is not quite where it was perceived bends the way instead of breaking the grip; what the way tells of the
//! joint is fitted as it goes.

use super::{Failure, Grip, GripWatch, Outcome, Primitive, Release, Step};
use crate::{articulation::Articulation, hand::Hand};
use acm_concept::{embodiment::Feedback, pose::Pose, primitive::Primitive as Kind, skill::FailureCause};
use glam::DVec3;
use std::collections::VecDeque;

/// Most force that is used along the way, newtons: under the 60 N at which a wrist gives up.
const MOST_N: f64 = 45.0;
/// Most force at all; beyond it the hand stands still until the force falls, and gives up if it does not; newtons.
const CAP_N: f64 = 55.0;
/// How fast the hand yields across the way: m/s for a newton beyond the dead band, and at most.
const YIELDING_M_S_N: f64 = 0.003;
const YIELDING_DEAD_N: f64 = 3.0;
const YIELDING_M_S: f64 = 0.03;
/// How far across the way it yields before it gives up, metres.
const MOST_YIELDING_M: f64 = 0.06;
/// A part that has not gone on by this much (metres along the way, or radians of a turn in place) for so long, while
/// the hand urges it, is blocked.
const PROGRESS_M: f64 = 0.001;
const PROGRESS_RAD: f64 = 0.01;
const BLOCKED_S: f64 = 0.8;
/// The command may run ahead of the hand by this, metres and radians.
const LEAD_M: f64 = 0.005;
const LEAD_RAD: f64 = 0.1;
/// A part that is heavy to move is pressed harder, but slowly, from this time without progress on: by so much farther a
/// second, metres, up to this force, newtons.
const HEAVY_S: f64 = 0.2;
const HEAVY_M_S: f64 = 0.01;
const HEAVY_N: f64 = 50.0;
/// The share of the speed at which it goes then.
const HEAVY_SHARE: f64 = 0.5;
/// How far it comes back in a tick where the force is too great, as a share of that.
const BACK_SHARE: f64 = 0.3;
/// How far the hand may lag at the end, as a share of that, before it is waited for.
const LATE_SHARE: f64 = 0.4;
/// Forces below this are let be at the end, newtons.
const SLACK_N: f64 = 8.0;
/// How long the hand waits at the end for the motion to cease, and what counts as ceased, m/s.
const CEASING_S: f64 = 0.16;
const CEASED_M_S: f64 = 0.01;
/// A part that draws the hand on with more than this at the end of its way would fall if it were let go, newtons; it is led on
/// at this share of the speed.
const FALLING_N: f64 = 2.0;
const LEAD_ON_SHARE: f64 = 0.4;
/// How the force is kept with which tips press on a face that they drag along: m/s for a newton that lacks, and at most.
const PRESSING_M_S_N: f64 = 0.002;
const PRESSING_M_S: f64 = 0.03;
/// Tips that press with less than this share of it for so long have left the face; a share and seconds.
const LEFT_SHARE: f64 = 0.2;
const LEFT_S: f64 = 0.12;
/// From this share on they have met it.
const MET_SHARE: f64 = 0.8;
/// A way leads down from this share of it on.
const DOWN_SHARE: f64 = 0.1;
/// Tips behind it that feel this much against the way push it, newtons.
const PUSHED_N: f64 = 1.0;
/// How far behind a face that they have left the tips reach to push it on, metres; and how fast they go there, m/s.
const BEHIND_M: f64 = 0.025;
const BEHIND_M_S: f64 = 0.1;
/// How far the fingers open to let go, metres.
const LET_GO_M: f64 = 0.025;
/// How far the pushing tips back off, metres, and how fast, m/s.
const PART_M: f64 = 0.015;
const PART_M_S: f64 = 0.1;
/// Distance between points of the trace that the joint is fitted to, and from what length on; metres.
const TRACE_M: f64 = 0.004;
const FIT_FROM_M: f64 = 0.06;
/// Most points of the trace.
const MAX_TRACE: usize = 400;
/// The full speed is reached within this time, seconds.
const RUN_UP_S: f64 = 0.25;
/// Speed of a turn in place, rad/s; and the share of the robot's turning speed that an arc may take.
const IN_PLACE_RAD_S: f64 = 0.9;
const TURN_SHARE: f64 = 0.6;
/// The end of the way in which a pushed thing must still have been felt, metres, and no more of it than this share.
const LAST_M: f64 = 0.02;
const LAST_SHARE: f64 = 0.25;

/// How the hand holds on to the part.
#[derive(Debug, Clone)]
pub(crate) enum Hold {
    /// Between the fingers, which let go at the end.
    Fingers(GripWatch),
    /// Closed finger tips press against it, and part from it at the end.
    Contact,
    /// Closed finger tips press on a face along which the way leads, and friction takes it along.
    Pressed(Pressing),
}

/// Tips on a face that they drag.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Pressing {
    /// The force that is kept along the approach direction, newtons.
    pub force_n: f64,
    /// How far along the approach direction the command is from the way, metres.
    deep_m: f64,
    /// Whether the face has been felt with most of the force.
    met: bool,
    weak_ticks: u32,
    /// The last force along the way while the face was felt, newtons; above 0 if the part drew the hand on.
    drawn_n: f64,
    /// The tips have left the face and go in behind its edge: how much farther, metres.
    behind_m: Option<f64>,
    /// Whether the part's weight took it from under them.
    fell: bool,
    /// The travel at which they last felt that they push the part from behind.
    pushed_at: f64,
}

impl Pressing {
    /// Keeps this force.
    pub fn with(force_n: f64) -> Pressing {
        Pressing { force_n, ..Pressing::default() }
    }
    /// One tick, with the forces into the face and along the way, and whether the way leads down; unsure while the face is not
    /// felt.
    fn tick(&mut self, hand: &Hand, pressed_n: f64, drawn_n: f64, falls: bool, travel: f64) -> Grip {
        let tick_s = hand.robot.tick_s;
        if let Some(left_m) = &mut self.behind_m {
            let step_m = (BEHIND_M_S * tick_s).min(*left_m);
            *left_m -= step_m;
            self.deep_m += step_m;
            if drawn_n < -PUSHED_N {
                self.pushed_at = travel;
            }
            return Grip::Firm;
        }
        let speed_m_s = (PRESSING_M_S_N * (self.force_n - pressed_n)).clamp(-PRESSING_M_S, PRESSING_M_S);
        self.deep_m += speed_m_s * tick_s;
        if pressed_n > LEFT_SHARE * self.force_n {
            self.met |= pressed_n > MET_SHARE * self.force_n;
            (self.weak_ticks, self.drawn_n) = (0, drawn_n);
            return if self.met { Grip::Firm } else { Grip::Unsure };
        }
        self.weak_ticks += 1;
        if self.weak_ticks > hand.ticks(LEFT_S) {
            self.behind_m = Some(BEHIND_M);
            self.fell = falls && self.drawn_n > FALLING_N;
        }
        Grip::Unsure
    }
    /// Whether the part is where the tips are at the end of the way, or farther; or else where it was last felt.
    fn lost_at(&self, goal: f64) -> Option<f64> {
        let lost = self.behind_m.is_some() && !self.fell && self.pushed_at < (1.0 - LAST_SHARE) * goal;
        lost.then_some(self.pushed_at)
    }
}

/// What is to be done.
#[derive(Debug, Clone)]
pub(crate) struct FollowPlan {
    /// `Pull`, `Push` or `Rotate`.
    pub kind: Kind,
    /// The way.
    pub joint: Articulation,
    /// How far the hand goes along it, metres or radians; below 0 to go the other way.
    pub travel: f64,
    /// The least of it that counts where the part stops by itself: there may be a stop before the end.
    pub least: f64,
    /// How far beyond the end a part that would fall is led on, until it rests on something; metres or radians.
    pub lead_on: f64,
    /// How fast the hand goes, metres per second.
    pub speed_m_s: f64,
    /// How it holds on.
    pub hold: Hold,
}

#[derive(Debug)]
enum Phase {
    Going,
    /// At the end of the way, or at a stop, until nothing moves.
    Ceasing {
        ticks: u32,
        still_ticks: u32,
        last: DVec3,
    },
    LettingGo(Release),
    /// The tips back off.
    Parting {
        gone_m: f64,
    },
}

/// From holding on to the part to having moved it.
#[derive(Debug)]
pub(crate) struct Follow {
    plan: FollowPlan,
    /// The joint as fitted so far.
    joint: Articulation,
    in_place: bool,
    /// Metres that the TCP goes for one unit of travel; 1 for a turn in place, whose unit is the radian.
    lever: f64,
    sign: f64,
    goal: f64,
    /// Travel in a second at full speed.
    full_speed: f64,
    from: Pose,
    measured_from: Option<Pose>,
    speed: f64,
    commanded: f64,
    reached: f64,
    best: f64,
    stuck_ticks: u32,
    over_ticks: u32,
    yielded: DVec3,
    /// How much farther the command may run ahead of a part that is heavy to move, in units of travel.
    heavy: f64,
    touch: Touch,
    trace: Vec<DVec3>,
    resistance_n: f64,
    stopped: bool,
    phase: Phase,
    limit_s: f64,
}

impl Follow {
    pub fn new(hand: &Hand, plan: FollowPlan) -> Follow {
        let (from, joint) = (hand.command.tcp, plan.joint);
        let in_place = joint.turns_in_place(from.translation);
        let lever = if in_place { 1.0 } else { joint.lever_m(from.translation) };
        let fastest_turn = TURN_SHARE * hand.robot.max_turn_rad_s;
        let full_speed = match joint {
            Articulation::Prismatic { .. } => plan.speed_m_s,
            Articulation::Revolute { .. } if in_place => IN_PLACE_RAD_S.min(fastest_turn),
            Articulation::Revolute { .. } => (plan.speed_m_s / lever).min(fastest_turn),
        };
        let (sign, goal) = (plan.travel.signum(), plan.travel.abs());
        Follow {
            joint,
            in_place,
            lever,
            sign,
            goal,
            full_speed,
            from,
            measured_from: None,
            speed: 0.0,
            commanded: 0.0,
            reached: 0.0,
            best: 0.0,
            stuck_ticks: 0,
            over_ticks: 0,
            yielded: DVec3::ZERO,
            heavy: 0.0,
            touch: Touch::default(),
            trace: Vec::new(),
            resistance_n: 0.0,
            stopped: false,
            phase: Phase::Going,
            limit_s: 2.5 * goal / full_speed + plan.lead_on / (LEAD_ON_SHARE * full_speed) + 8.0,
            plan,
        }
    }

    /// Unit direction in which the hand goes now; zero where it turns in place.
    fn heading(&self, at: DVec3) -> DVec3 {
        if self.in_place { DVec3::ZERO } else { self.sign * self.joint.tangent(at) }
    }

    /// The commanded TCP: on the way, and beside it by what the hand has yielded.
    fn target(&self) -> Pose {
        let on_way = self.joint.carried(&self.from, self.sign * self.commanded);
        let deep_m = if let Hold::Pressed(pressing) = &self.plan.hold { pressing.deep_m } else { 0.0 };
        Pose::new(on_way.translation + self.yielded, on_way.rotation) * Pose::from_translation(deep_m * DVec3::Z)
    }

    fn go(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let measured_from = *self.measured_from.get_or_insert(feedback.tcp);
        let (at, force) = (feedback.tcp.translation, hand.felt_n());
        let heading = self.heading(at);
        let resisting_n = -force.dot(heading);
        self.resistance_n = self.resistance_n.max(resisting_n);
        self.over_ticks = if force.length() > CAP_N { self.over_ticks + 1 } else { 0 };
        self.reached = self.sign * self.joint.travel(&measured_from, &feedback.tcp, self.sign * self.commanded);
        let grip = match &mut self.plan.hold {
            Hold::Fingers(watch) => {
                // What is drawn must not turn between the fingers.
                hand.command.grip_force_n = hand.robot.max_grip_force_n;
                match watch.check(hand, feedback) {
                    Ok(grip) => grip,
                    Err(failure) => return Step::Failed(failure),
                }
            }
            Hold::Contact => {
                let steady = self.speed > 0.99 * self.full_speed;
                self.touch.take(-feedback.wrist_force_n.dot(heading), steady, self.reached);
                Grip::Firm
            }
            Hold::Pressed(pressing) => {
                let into = hand.command.tcp.transform_vector(DVec3::Z);
                pressing.tick(hand, -force.dot(into), -resisting_n, heading.z < -DOWN_SHARE, self.reached)
            }
        };
        self.yield_across(hand, force, heading);
        if self.yielded.length() > MOST_YIELDING_M {
            let off_mm = 1e3 * self.yielded.length();
            return self
                .failed(format!("the part led the hand {off_mm:.0} mm off the way that its joint should leave it"));
        }
        self.remember(at);
        let lead = if self.in_place { LEAD_RAD } else { LEAD_M / self.lever + self.heavy };
        if let Some(step) = self.check_progress(hand, at, resisting_n, lead) {
            return step;
        }
        let left = self.goal - self.commanded;
        if left <= 1e-6 {
            return self.arrive(hand, at, resisting_n);
        }
        // The newest reading, not the filtered one: a stop is met within a tick or two.
        let newest_n = (feedback.wrist_force_n - hand.baseline_n()).length();
        let most_n = if self.heavy > 0.0 { HEAVY_N } else { MOST_N };
        let laden = self.stuck_ticks > hand.ticks(HEAVY_S) && self.reached < self.plan.least;
        if laden && newest_n < HEAVY_N && !self.in_place {
            self.heavy = (self.heavy + HEAVY_M_S * hand.robot.tick_s / self.lever).min(LEAD_M / self.lever);
        }
        if newest_n > most_n && !self.in_place {
            self.commanded = self.commanded.min(self.reached.max(self.commanded - BACK_SHARE * lead));
        }
        let held_back = newest_n > most_n || self.over_ticks > 0 || self.commanded - self.reached > lead;
        self.speed = if held_back || grip == Grip::Unsure {
            0.5 * self.speed
        } else {
            let change = self.full_speed / RUN_UP_S;
            let braking = (2.0 * change * left).sqrt().max(0.05 * self.full_speed);
            let fastest = if self.heavy > 0.0 { HEAVY_SHARE * self.full_speed } else { self.full_speed };
            (self.speed + change * hand.robot.tick_s).min(fastest).min(braking)
        };
        self.commanded += (self.speed * hand.robot.tick_s).min(left);
        hand.command.tcp = limited(hand, self.target());
        Step::Act
    }

    /// Whether the part has stopped although the hand urges it.
    fn check_progress(&mut self, hand: &Hand, at: DVec3, resisting_n: f64, lead: f64) -> Option<Step> {
        let progress = if self.in_place { PROGRESS_RAD } else { PROGRESS_M / self.lever };
        if self.reached > self.best + progress {
            (self.best, self.stuck_ticks) = (self.reached, 0);
            return None;
        }
        self.stuck_ticks += 1;
        let urged = self.over_ticks > 0 || resisting_n > MOST_N / 3.0 || self.commanded - self.reached > 0.5 * lead;
        if self.stuck_ticks < hand.ticks(BLOCKED_S) || !urged {
            return None;
        }
        if self.reached < self.plan.least {
            let (reached, wanted, most_n) = (self.words(self.reached), self.words(self.goal), self.resistance_n);
            return Some(
                self.failed(format!("blocked after {reached} of {wanted}: it resisted with up to {most_n:.0} N")),
            );
        }
        self.stopped = true;
        self.phase = Phase::Ceasing { ticks: 0, still_ticks: 0, last: at };
        Some(Step::Act)
    }

    /// The whole way is behind, as far as the command goes.
    fn arrive(&mut self, hand: &Hand, at: DVec3, resisting_n: f64) -> Step {
        let last = (LAST_M / self.lever).min(LAST_SHARE * self.goal);
        if matches!(self.plan.hold, Hold::Contact) && !self.touch.felt_since(self.goal - last) {
            let reason = match self.touch.felt_at {
                None => "the hand went the whole way and felt nothing that it could push".into(),
                Some(last) => format!("what was pushed was lost on the way: last felt at {}", self.words(last)),
            };
            return self.failed(reason);
        }
        if let Hold::Pressed(pressing) = &self.plan.hold
            && let Some(last) = pressing.lost_at(self.goal)
        {
            let last = self.words(last);
            return self.failed(format!("the tips slipped off what they dragged along: last felt at {last}"));
        }
        // A damped joint lags behind: it is waited for, and the check above says when that is in vain.
        let lag = if self.in_place { LEAD_RAD } else { LEAD_M / self.lever };
        if self.reached > self.goal - LATE_SHARE * lag || self.stuck_ticks > hand.ticks(0.5 * BLOCKED_S) {
            // Fingers that yield may come to the end of the way although the part stands at its stop.
            self.stopped |= resisting_n > MOST_N / 3.0;
            self.phase = Phase::Ceasing { ticks: 0, still_ticks: 0, last: at };
        }
        Step::Act
    }

    /// Moves the way aside where the part presses across it, and never along it.
    fn yield_across(&mut self, hand: &Hand, force: DVec3, heading: DVec3) {
        if matches!(self.plan.hold, Hold::Pressed(_)) {
            // The pressing has a rule of its own, and a face has no hold on the tips.
            return;
        }
        let across = force - force.dot(heading) * heading;
        let beyond_n = across.length() - YIELDING_DEAD_N;
        if beyond_n > 0.0 {
            let speed_m_s = (YIELDING_M_S_N * beyond_n).min(YIELDING_M_S);
            self.yielded += speed_m_s * hand.robot.tick_s * across.normalize_or_zero();
        }
    }

    /// Takes a place of the hand into the trace, and fits the joint to it. Tips that only touch may slip, and tell nothing.
    fn remember(&mut self, at: DVec3) {
        let far = self.trace.last().is_none_or(|last| last.distance(at) > TRACE_M);
        if self.in_place || !far || self.trace.len() >= MAX_TRACE || !matches!(self.plan.hold, Hold::Fingers(_)) {
            return;
        }
        self.trace.push(at);
        let length_m = self.trace.first().map_or(0.0, |first| first.distance(at));
        if length_m > FIT_FROM_M {
            let before = self.target().translation;
            self.joint = self.plan.joint.refined(&self.trace);
            // The command goes on from where it is.
            self.yielded += before - self.target().translation;
        }
    }

    fn cease(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let Phase::Ceasing { ticks, still_ticks, last } = &mut self.phase else { return Step::Act };
        let at = feedback.tcp.translation;
        let still = at.distance(*last) < CEASED_M_S * hand.robot.tick_s;
        *last = at;
        *ticks += 1;
        *still_ticks = if still { *still_ticks + 1 } else { 0 };
        if *ticks == 1 && hand.felt_n().length() > SLACK_N {
            // The wrist's spring is let go, so that opening the fingers does not shoot the hand away.
            hand.command.tcp = limited(hand, Pose::new(at, hand.command.tcp.rotation));
        }
        if *still_ticks < hand.ticks(CEASING_S) && *ticks < hand.ticks(4.0 * CEASING_S) {
            return Step::Act;
        }
        let drawn_n = hand.felt_n().dot(self.heading(at));
        let held = matches!(self.plan.hold, Hold::Fingers(_));
        if held && !self.stopped && self.plan.lead_on > 0.0 && drawn_n > FALLING_N {
            // It would fall if it were let go here.
            self.goal = self.reached + std::mem::take(&mut self.plan.lead_on);
            (self.commanded, self.best, self.stuck_ticks) = (self.reached, self.reached, 0);
            (self.speed, self.full_speed) = (0.0, LEAD_ON_SHARE * self.full_speed);
            self.phase = Phase::Going;
            return Step::Act;
        }
        if let Some(measured_from) = self.measured_from {
            let near = self.sign * self.reached;
            self.reached = self.sign * self.joint.travel(&measured_from, &feedback.tcp, near);
        }
        match &self.plan.hold {
            Hold::Fingers(_) => {
                let open_m = (feedback.opening_m + LET_GO_M).min(hand.robot.max_opening_m);
                self.phase = Phase::LettingGo(Release::new(feedback.opening_m, open_m));
            }
            Hold::Contact => self.phase = Phase::Parting { gone_m: 0.0 },
            Hold::Pressed(_) => return Step::Done(self.outcome()),
        }
        Step::Act
    }

    fn let_go(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        let outcome = self.outcome();
        let Phase::LettingGo(release) = &mut self.phase else { return Step::Act };
        match release.tick(hand, feedback) {
            Step::Act => Step::Act,
            Step::Failed(failure) => Step::Failed(failure),
            // A pad may still lean on the part: then backing off decides.
            Step::Done(_) => Step::Done(outcome),
        }
    }

    fn part(&mut self, hand: &mut Hand) -> Step {
        let heading = self.heading(hand.command.tcp.translation);
        let outcome = self.outcome();
        let Phase::Parting { gone_m } = &mut self.phase else { return Step::Act };
        if *gone_m >= PART_M {
            return Step::Done(outcome);
        }
        let step_m = PART_M_S * hand.robot.tick_s;
        *gone_m += step_m;
        hand.command.tcp.translation -= step_m * heading;
        Step::Act
    }

    fn outcome(&self) -> Outcome {
        Outcome::Followed {
            travelled: self.reached,
            joint: self.joint,
            resistance_n: self.resistance_n,
            stopped: self.stopped,
        }
    }

    fn failed(&self, reason: String) -> Step {
        let cause = if self.plan.kind == Kind::Push { FailureCause::Press } else { FailureCause::Motion };
        Step::Failed(Failure::new(cause, reason))
    }

    fn words(&self, travel: f64) -> String {
        match self.joint {
            Articulation::Prismatic { .. } => format!("{:.0} mm", 1e3 * travel),
            Articulation::Revolute { .. } => format!("{:.0} degrees", travel.to_degrees()),
        }
    }
}

impl Primitive for Follow {
    fn kind(&self) -> Kind {
        self.plan.kind
    }
    fn limit_s(&self) -> f64 {
        self.limit_s
    }
    fn tick(&mut self, hand: &mut Hand, feedback: &Feedback) -> Step {
        match self.phase {
            Phase::Going => self.go(hand, feedback),
            Phase::Ceasing { .. } => self.cease(hand, feedback),
            Phase::LettingGo(_) => self.let_go(hand, feedback),
            Phase::Parting { .. } => self.part(hand),
        }
    }
}

/// A commanded pose no farther from the last one than the robot goes in a tick.
fn limited(hand: &Hand, wanted: Pose) -> Pose {
    let from = hand.command.tcp;
    let (step_m, turn_rad) = (from.translation.distance(wanted.translation), from.angle_to(&wanted));
    let (most_m, most_rad) = (0.95 * hand.robot.max_speed_m_s, 0.95 * hand.robot.max_turn_rad_s);
    let share =
        (most_m * hand.robot.tick_s / step_m.max(1e-12)).min(most_rad * hand.robot.tick_s / turn_rad.max(1e-12));
    if share >= 1.0 { wanted } else { from.interpolate(&wanted, share) }
}

/// Whether the pressing tips feel what they push: against what they felt on the way to it. Light things resist with
/// less than a tenth of a newton, so what counts as felt follows from the readings of the free hand.
#[derive(Debug, Default)]
struct Touch {
    free: Vec<f64>,
    window: VecDeque<f64>,
    /// The travel at which it was last felt.
    felt_at: Option<f64>,
}

impl Touch {
    /// Readings that make the free hand's mean and scatter; and as many that are compared with it.
    const READINGS: usize = 8;
    /// The least that counts, newtons; and how many standard errors it must be.
    const LEAST_N: f64 = 0.03;
    const SIGMAS: f64 = 5.0;

    /// Takes a reading of the force against the motion; `steady` once the hand goes at full speed.
    fn take(&mut self, resisting_n: f64, steady: bool, travel: f64) {
        if self.free.len() < Self::READINGS {
            if steady {
                self.free.push(resisting_n);
            }
            return;
        }
        self.window.push_back(resisting_n);
        if self.window.len() > Self::READINGS {
            self.window.pop_front();
        }
        let count = Self::READINGS as f64;
        let mean = self.free.iter().sum::<f64>() / count;
        let variance = self.free.iter().map(|n| (n - mean) * (n - mean)).sum::<f64>() / (count - 1.0);
        let now = self.window.iter().sum::<f64>() / self.window.len() as f64;
        let least_n = Self::LEAST_N.max(Self::SIGMAS * (2.0 * variance / count).sqrt());
        if self.window.len() == Self::READINGS && now - mean > least_n {
            self.felt_at = Some(travel);
        }
    }
    fn felt_since(&self, travel: f64) -> bool {
        self.felt_at.is_some_and(|felt| felt >= travel)
    }
}
