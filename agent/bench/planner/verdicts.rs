//! What the verifier says of finished skills, beside what came of them in truth.
//!
//! Episodes are lived as always; a journal follows their messages and asks the simulator, when a skill begins and when it
//! is judged, how things truly are. The agent knows nothing of it.

use crate::{
    bench::{BenchResult, Row, progress},
    cli::BenchArgs,
    episode::{EpisodeConfig, Runner},
    inject::Faults,
};
use acm_actors::message::Message;
use acm_concept::{
    ids::{ObjectId, TransitionId},
    literal::{Literal, Term},
    skill::SkillInvocation,
};
use acm_memory::observation::Outcome;
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use acm_sim::{Scenario, TrueObject};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Seeds of each scenario with each fault.
const SEEDS: u64 = 8;
/// How far a remembered thing may be from the true one that it stands for, metres.
const SAME_M: f64 = 0.08;
/// A door or drawer that is open by less counts as shut, as a share of its way.
const OPEN_SHARE: f64 = 0.1;

/// Verdicts on one skill, beside the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Tally {
    /// Called verified and all of its effects hold.
    verified_true: u32,
    /// Called verified and some effect does not hold.
    verified_false: u32,
    /// Called contradicted though all effects hold.
    contradicted_true: u32,
    /// Called contradicted, and rightly so.
    contradicted_false: u32,
    /// Not decided, though all effects hold.
    open_true: u32,
    /// Not decided, and some effect does not hold.
    open_false: u32,
    /// Not judged here: what is meant cannot be matched with anything true, or nobody measures the effect.
    unjudged: u32,
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        self.verified_true += other.verified_true;
        self.verified_false += other.verified_false;
        self.contradicted_true += other.contradicted_true;
        self.contradicted_false += other.contradicted_false;
        self.open_true += other.open_true;
        self.open_false += other.open_false;
        self.unjudged += other.unjudged;
    }
    fn count(&mut self, outcome: Outcome, truth: Option<bool>) {
        *match (outcome, truth) {
            (_, None) => &mut self.unjudged,
            (Outcome::Verified, Some(true)) => &mut self.verified_true,
            (Outcome::Verified, Some(false)) => &mut self.verified_false,
            (Outcome::Contradicted, Some(true)) => &mut self.contradicted_true,
            (Outcome::Contradicted, Some(false)) => &mut self.contradicted_false,
            (Outcome::CannotTell, Some(true)) => &mut self.open_true,
            (Outcome::CannotTell, Some(false)) => &mut self.open_false,
        } += 1;
    }
    fn judged(&self) -> u32 {
        self.verified_true
            + self.verified_false
            + self.contradicted_true
            + self.contradicted_false
            + self.open_true
            + self.open_false
    }
    /// Of those called verified, the share that is so.
    fn precision(&self) -> f64 {
        share(self.verified_true, self.verified_true + self.verified_false)
    }
    /// Of those that are so, the share that is called verified.
    fn recall(&self) -> f64 {
        share(self.verified_true, self.verified_true + self.contradicted_true + self.open_true)
    }
    fn cannot_tell(&self) -> f64 {
        share(self.open_true + self.open_false, self.judged())
    }
    fn row(&self, name: &str) -> Row {
        let values = [
            ("judged", f64::from(self.judged())),
            ("precision", self.precision()),
            ("recall", self.recall()),
            ("cannot_tell", self.cannot_tell()),
            ("verified_wrongly", f64::from(self.verified_false)),
            ("contradicted_wrongly", f64::from(self.contradicted_true)),
            ("went_wrong", f64::from(self.verified_false + self.contradicted_false + self.open_false)),
            ("unjudged", f64::from(self.unjudged)),
        ];
        Row::new(name, values)
    }
}

fn share(part: u32, whole: u32) -> f64 {
    f64::from(part) / f64::from(whole.max(1))
}

/// A skill whose outcome is awaited.
struct Running {
    skill: String,
    /// The thing that it acts on, by its place in the list of true things.
    target: Option<usize>,
    /// Presses counted on it before.
    presses: u32,
}

#[derive(Default)]
struct Followed {
    running: Option<Running>,
    /// What each remembered thing was found to stand for when the hand last acted on it.
    stands_for: BTreeMap<ObjectId, usize>,
    truth: BTreeMap<TransitionId, (String, Option<bool>)>,
    tallies: BTreeMap<String, Tally>,
}

/// Follows the messages of an episode.
struct Follower<W> {
    witness: W,
    followed: Mutex<Followed>,
}

impl<W: Fn() -> Vec<TrueObject> + Send + Sync> Follower<W> {
    fn begin(&self, followed: &mut Followed, invocation: &SkillInvocation) {
        let things = (self.witness)();
        let id = invocation.part.object;
        let held = things.iter().position(|thing| thing.held).filter(|_| invocation.held.is_some());
        let at = invocation.target.pose.pose.translation;
        let away = |thing: &TrueObject| thing.pose.translation.distance(at);
        let nearest = || {
            let near = things.iter().enumerate().filter(|(_, thing)| away(thing) < SAME_M);
            near.min_by(|(_, a), (_, b)| away(a).total_cmp(&away(b))).map(|(index, _)| index)
        };
        let target = held.or_else(nearest).or_else(|| followed.stands_for.get(&id).copied());
        if let Some(target) = target {
            followed.stands_for.insert(id, target);
        }
        let presses = target.and_then(|target| things.get(target)).map_or(0, presses);
        followed.running = Some(Running { skill: invocation.skill.clone(), target, presses });
    }

    fn judge(&self, followed: &mut Followed, transition: TransitionId, predicted: &[Literal]) {
        let Some(running) = &followed.running else { return };
        let things = (self.witness)();
        let truth = running.target.and_then(|target| {
            let mut all = true;
            for literal in predicted {
                all &= holds(literal, &things, target, running.presses)?;
            }
            Some(all)
        });
        followed.truth.insert(transition, (running.skill.clone(), truth));
    }
}

impl<W: Fn() -> Vec<TrueObject> + Send + Sync> Journal<Message> for Follower<W> {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut followed = self.followed.lock().unwrap_or_else(PoisonError::into_inner);
        match &message.body {
            Message::Execute(invocation) => self.begin(&mut followed, invocation),
            Message::Verify { transition, predicted, .. } => self.judge(&mut followed, *transition, predicted),
            Message::Settle { transition, verdict } => {
                if let Some((skill, truth)) = followed.truth.remove(transition) {
                    followed.tallies.entry(skill).or_default().count(verdict.outcome, truth);
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Whether a literal about the thing that a skill acted on truly holds; `None` where nobody measures it.
fn holds(literal: &Literal, things: &[TrueObject], target: usize, presses_before: u32) -> Option<bool> {
    let thing = things.get(target)?;
    let positive = match (literal.predicate.as_str(), literal.arguments.get(1)) {
        ("holding", _) => thing.held,
        ("hand-empty", _) => things.iter().all(|thing| !thing.held),
        ("at", Some(Term::Place(place))) => {
            let offset = thing.pose.translation - place.pose.translation;
            !thing.held && offset.truncate().length() <= place.tolerance_m
        }
        ("pressed", _) => presses(thing) > presses_before,
        ("open", _) => {
            let joints: Vec<f64> = thing.links.iter().filter_map(|link| Some(link.joint.as_ref()?.opened)).collect();
            let widest = joints.into_iter().reduce(f64::max)?;
            widest > OPEN_SHARE
        }
        _ => return None,
    };
    Some(positive != literal.negated)
}

fn presses(thing: &TrueObject) -> u32 {
    thing.links.iter().filter_map(|link| link.joint.as_ref()?.presses).sum()
}

/// Measures.
///
/// # Errors
/// A scenario cannot be opened, or an episode cannot be run at all.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let seeds = args.episodes.map_or(if args.quick { SEEDS.div_ceil(10) } else { SEEDS }, |n| n as u64);
    let plain = Faults::default;
    let faults = [
        ("no fault", plain()),
        ("slip in the first carry", Faults { slip_at: Some(1), ..plain() }),
        ("slip in the second carry", Faults { slip_at: Some(2), ..plain() }),
        ("drop in the first carry", Faults { drop_at: Some(1), ..plain() }),
    ];
    let names = Scenario::names();
    let runner = Runner::new()?;
    let bar = progress("episodes", names.len() as u64 * faults.len() as u64 * seeds);
    let mut skills: BTreeMap<String, Tally> = BTreeMap::new();
    let mut broken = 0;
    for name in &names {
        let scenario = Scenario::open(name)?;
        let mut of_scenario = Tally::default();
        for (_, faults) in &faults {
            for seed in 1..=seeds {
                let config = EpisodeConfig { method: "acm".into(), faults: faults.clone(), ..EpisodeConfig::default() };
                match follow(&runner, &scenario, seed, &config) {
                    Ok(tallies) => {
                        for (skill, tally) in tallies {
                            skills.entry(skill).or_default().add(&tally);
                            of_scenario.add(&tally);
                        }
                    }
                    Err(error) => {
                        broken += 1;
                        result.errors.push(format!("{name}, seed {seed}: {error:#}"));
                    }
                }
                bar.inc(1);
            }
        }
        result.rows.push(Row { group: Some("scenario".into()), ..of_scenario.row(name) });
    }
    bar.finish_and_clear();
    let mut all = Tally::default();
    for (skill, tally) in &skills {
        all.add(tally);
        result.rows.push(Row { group: Some("skill".into()), ..tally.row(skill) });
    }
    result.rows.push(all.row("all verdicts"));
    let kinds: Vec<&str> = faults.iter().map(|(name, _)| *name).collect();
    result.notes.push(format!(
        "verdicts: seeds 1 to {seeds} of {} scenarios with {}; {broken} episodes could not be run",
        names.len(),
        kinds.join(", ")
    ));
    result.figure("verifier_precision", all.precision());
    result.figure("verifier_recall", all.recall());
    result.figure("verifier_cannot_tell", all.cannot_tell());
    Ok(())
}

fn follow(
    runner: &Runner,
    scenario: &Scenario,
    seed: u64,
    config: &EpisodeConfig,
) -> anyhow::Result<BTreeMap<String, Tally>> {
    let world = runner.world(scenario, seed, config)?;
    let follower =
        Arc::new(Follower { witness: world.simulation().witness(), followed: Mutex::new(Followed::default()) });
    runner.run_in(&world, config, Arc::clone(&follower) as Arc<dyn Journal<Message>>)?;
    let followed = follower.followed.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(followed.tallies.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_are_counted_by_what_is_true() {
        let mut tally = Tally::default();
        let counts = [
            (Outcome::Verified, Some(true), 6),
            (Outcome::Verified, Some(false), 2),
            (Outcome::Contradicted, Some(true), 1),
        ];
        for (outcome, truth, times) in counts {
            (0..times).for_each(|_| tally.count(outcome, truth));
        }
        tally.count(Outcome::CannotTell, Some(true));
        tally.count(Outcome::Verified, None);
        assert_eq!((tally.judged(), tally.unjudged), (10, 1));
        assert_eq!((tally.precision(), tally.recall(), tally.cannot_tell()), (0.75, 0.75, 0.1));
    }
}
