//! The judge: predicates over the world's true state, evaluated after every physics step.

use crate::{
    model::{ObjectModel, variables},
    scenario::{JudgeSpec, PredicateSpec},
};
use acm_concept::expression::Expression;
use serde::{Deserialize, Serialize};

const WORLD_VARIABLES: [&str; 8] =
    ["others_moved", "commanded_opening", "pad_contact", "tcp_x", "tcp_y", "tcp_z", "hands_moved", "time"];

/// How an episode is judged. `strict` decides.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OracleVerdict {
    /// Whether every stage of the strict predicate was reached and nothing was violated.
    pub strict: bool,
    /// The same for the predicate as published elsewhere; `None` where there is none.
    pub faithful: Option<bool>,
    /// The strict predicate's stages in their order, and whether each was reached.
    pub stages: Vec<(String, bool)>,
    /// What the strict predicate forbids and happened.
    pub violations: Vec<String>,
    /// One or two sentences: what is missing, with the values that decide it.
    pub explanation: String,
}

/// Names of all variables of the judge: of objects (the name if it has no copies, and its model), of the world, and of
/// constants.
pub(crate) fn names<'a>(
    objects: impl Iterator<Item = (Option<&'a str>, &'a ObjectModel)>,
    others: &[String],
) -> Vec<String> {
    let mut names: Vec<String> = WORLD_VARIABLES.iter().map(|name| name.to_string()).collect();
    names.extend(others.iter().cloned());
    for (name, model) in objects {
        let Some(name) = name else { continue };
        names.extend(variables::own(model).iter().map(|variable| format!("{name}_{variable}")));
    }
    names
}

/// An expression with its variables' places in the state, looked up once.
#[derive(Debug, Clone)]
pub(crate) struct Watch {
    expression: Expression,
    slots: Vec<(String, usize)>,
}

impl Watch {
    pub(crate) fn new(expression: &Expression, names: &[String]) -> Watch {
        let slot = |name: &str| Some((name.to_string(), names.iter().position(|known| known == name)?));
        Watch { expression: expression.clone(), slots: expression.names().into_iter().filter_map(slot).collect() }
    }
    /// An expression over an object's own variables, which are named here without the object's name.
    pub(crate) fn of_object(text: &str, object: &str, model: &ObjectModel, names: &[String]) -> Option<Watch> {
        let own = variables::own(model);
        let expression = Expression::parse(text, &own.iter().map(String::as_str).collect::<Vec<_>>()).ok()?;
        let slot = |name: &str| {
            let full = format!("{object}_{name}");
            Some((name.to_string(), names.iter().position(|known| *known == full)?))
        };
        let slots = expression.names().into_iter().filter_map(slot).collect();
        Some(Watch { expression, slots })
    }
    /// Whether it holds. The parser has checked the names, so a failed evaluation is a number out of its domain,
    /// and does not hold.
    pub(crate) fn holds(&self, state: &[f64]) -> bool {
        self.value(state).is_some_and(|value| value != 0.0)
    }
    /// Its value, if it is a finite number.
    pub(crate) fn value(&self, state: &[f64]) -> Option<f64> {
        let values: Vec<(&str, f64)> = self.values(state).collect();
        self.expression.evaluate(&values).ok().filter(|value| value.is_finite())
    }
    fn values<'a>(&'a self, state: &'a [f64]) -> impl Iterator<Item = (&'a str, f64)> {
        self.slots.iter().map(|(name, slot)| (name.as_str(), state.get(*slot).copied().unwrap_or(f64::NAN)))
    }
    fn describe(&self, state: &[f64]) -> String {
        let values: Vec<String> = self.values(state).map(|(name, value)| format!("{name} = {value:.4}")).collect();
        format!("`{}` with {}", self.expression.text(), values.join(", "))
    }
}

#[derive(Debug, Clone)]
struct Stage {
    name: String,
    watch: Watch,
    hold_s: f64,
    at_end: bool,
    held_s: f64,
    reached: bool,
}

#[derive(Debug, Clone)]
struct Violation {
    name: String,
    watch: Watch,
    before: Option<usize>,
    happened_at_s: Option<f64>,
}

/// One predicate on its way through the episode.
#[derive(Debug, Clone)]
struct Predicate {
    stages: Vec<Stage>,
    violations: Vec<Violation>,
}

impl Predicate {
    fn new(spec: &PredicateSpec, names: &[String]) -> Predicate {
        let stages = spec.stages.iter().map(|stage| Stage {
            name: stage.name.clone(),
            watch: Watch::new(&stage.when, names),
            hold_s: stage.hold_s,
            at_end: stage.at_end,
            held_s: 0.0,
            reached: false,
        });
        let violations = spec.violations.iter().map(|violation| Violation {
            name: violation.name.clone(),
            watch: Watch::new(&violation.when, names),
            before: violation.before,
            happened_at_s: None,
        });
        Predicate { stages: stages.collect(), violations: violations.collect() }
    }

    fn step(&mut self, state: &[f64], now_s: f64, step_s: f64) {
        for violation in &mut self.violations {
            let counts = violation.before.is_none_or(|stage| !self.stages[stage].reached);
            if violation.happened_at_s.is_none() && counts && violation.watch.holds(state) {
                violation.happened_at_s = Some(now_s);
            }
        }
        // Stages come in their order: only the first one that is not reached is watched, and the last one that
        // must hold at the end.
        let current = self.stages.iter_mut().find(|stage| !stage.reached || stage.at_end);
        if let Some(stage) = current {
            // The first step of a hold is its beginning and lasts no time.
            stage.held_s = if !stage.watch.holds(state) { -1.0 } else { (stage.held_s + step_s).max(0.0) };
            let held = stage.held_s >= stage.hold_s - 1e-9;
            stage.reached = held || (stage.reached && !stage.at_end);
        }
    }

    fn holds(&self) -> bool {
        self.stages.iter().all(|stage| stage.reached) && self.violations.iter().all(|v| v.happened_at_s.is_none())
    }

    fn explain(&self, state: &[f64]) -> String {
        let mut sentences = Vec::new();
        for violation in &self.violations {
            if let Some(at) = violation.happened_at_s {
                sentences.push(format!("At {at:.2} s: {}.", violation.name));
            }
        }
        match self.stages.iter().find(|stage| !stage.reached) {
            Some(stage) => {
                sentences.push(format!("Not reached: {}; at the end {}.", stage.name, stage.watch.describe(state)));
            }
            None if sentences.is_empty() => sentences.push("Every stage was reached.".into()),
            None => {}
        }
        sentences.join(" ")
    }
}

/// All that a predicate changes while the world runs: of each stage how long it has held and whether it was reached,
/// of each violation when it happened.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct PredicateState {
    stages: Vec<(f64, bool)>,
    violations: Vec<Option<f64>>,
}

impl Predicate {
    fn state(&self) -> PredicateState {
        PredicateState {
            stages: self.stages.iter().map(|stage| (stage.held_s, stage.reached)).collect(),
            violations: self.violations.iter().map(|violation| violation.happened_at_s).collect(),
        }
    }
    fn set_state(&mut self, state: PredicateState) {
        for (stage, saved) in self.stages.iter_mut().zip(state.stages) {
            (stage.held_s, stage.reached) = saved;
        }
        for (violation, saved) in self.violations.iter_mut().zip(state.violations) {
            violation.happened_at_s = saved;
        }
    }
}

impl PredicateState {
    fn fits(&self, predicate: &Predicate) -> bool {
        self.stages.len() == predicate.stages.len() && self.violations.len() == predicate.violations.len()
    }
}

/// All that the judge changes while the world runs.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct JudgeState {
    strict: PredicateState,
    faithful: Option<PredicateState>,
}

impl JudgeState {
    /// Whether it can be the state of this judge.
    pub(crate) fn fits(&self, judge: &Judge) -> bool {
        let faithful = match (&self.faithful, &judge.faithful) {
            (Some(state), Some(predicate)) => state.fits(predicate),
            (state, predicate) => state.is_none() && predicate.is_none(),
        };
        faithful && self.strict.fits(&judge.strict)
    }
}

impl Judge {
    pub(crate) fn state(&self) -> JudgeState {
        JudgeState { strict: self.strict.state(), faithful: self.faithful.as_ref().map(Predicate::state) }
    }
    pub(crate) fn set_state(&mut self, state: JudgeState) {
        self.strict.set_state(state.strict);
        if let (Some(faithful), Some(saved)) = (&mut self.faithful, state.faithful) {
            faithful.set_state(saved);
        }
    }
}

/// Both predicates of an episode.
#[derive(Debug, Clone)]
pub(crate) struct Judge {
    strict: Predicate,
    faithful: Option<Predicate>,
}

impl Judge {
    pub(crate) fn new(spec: &JudgeSpec, names: &[String]) -> Judge {
        Judge {
            strict: Predicate::new(&spec.strict, names),
            faithful: spec.faithful.as_ref().map(|predicate| Predicate::new(predicate, names)),
        }
    }
    /// Takes in the state after one physics step; values in the order of the names.
    pub(crate) fn step(&mut self, state: &[f64], now_s: f64, step_s: f64) {
        self.strict.step(state, now_s, step_s);
        if let Some(faithful) = &mut self.faithful {
            faithful.step(state, now_s, step_s);
        }
    }
    /// How long the last stages want to hold: so long the world goes on before the outcome is read, seconds.
    pub(crate) fn settle_s(&self) -> f64 {
        let hold = |predicate: &Predicate| predicate.stages.last().map_or(0.0, |stage| stage.hold_s);
        hold(&self.strict).max(self.faithful.as_ref().map_or(0.0, hold)) + 0.25
    }
    pub(crate) fn verdict(&self, state: &[f64]) -> OracleVerdict {
        let strict = &self.strict;
        let happened = strict.violations.iter().filter(|violation| violation.happened_at_s.is_some());
        OracleVerdict {
            strict: strict.holds(),
            faithful: self.faithful.as_ref().map(Predicate::holds),
            stages: strict.stages.iter().map(|stage| (stage.name.clone(), stage.reached)).collect(),
            violations: happened.map(|violation| violation.name.clone()).collect(),
            explanation: strict.explain(state),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use crate::scenario::{StageSpec, ViolationSpec};

    fn judge(hold_s: f64, at_end: bool) -> Judge {
        let names = ["a".to_string(), "b".to_string()];
        let expression = |text: &str| Expression::parse(text, &["a", "b"]).unwrap();
        let stage = |name: &str, when: &str, hold_s, at_end| StageSpec {
            name: name.into(),
            when: expression(when),
            hold_s,
            at_end,
        };
        let early = ViolationSpec { name: "early".into(), when: expression("b > 0"), before: Some(0) };
        let strict = PredicateSpec {
            stages: vec![stage("first", "a > 0", 0.0, false), stage("second", "b > 0", hold_s, at_end)],
            violations: vec![early],
        };
        Judge::new(&JudgeSpec { moves: vec![], strict, faithful: None }, &names)
    }

    fn run(judge: &mut Judge, steps: &[(f64, f64)]) -> OracleVerdict {
        for (at, (a, b)) in steps.iter().enumerate() {
            judge.step(&[*a, *b], at as f64 * 0.1, 0.1);
        }
        judge.verdict(&[0.0, 0.0])
    }

    #[test]
    fn stages_come_in_order_and_hold() {
        assert!(run(&mut judge(0.2, false), &[(1.0, 0.0), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0)]).strict);
        let broken = run(&mut judge(0.2, false), &[(1.0, 0.0), (0.0, 1.0), (0.0, 0.0), (0.0, 1.0), (0.0, 1.0)]);
        assert!(!broken.strict && broken.stages == [("first".into(), true), ("second".into(), false)]);
        assert!(broken.explanation.contains("second") && broken.explanation.contains("b = 0.0000"));
    }

    #[test]
    fn what_must_hold_at_the_end_can_be_lost() {
        let steps = [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)];
        assert!(run(&mut judge(0.0, false), &steps).strict);
        assert!(!run(&mut judge(0.0, true), &steps).strict);
        assert!(run(&mut judge(0.0, true), &[(1.0, 0.0), (0.0, 1.0), (0.0, 0.0), (0.0, 1.0)]).strict);
    }

    #[test]
    fn a_violation_is_for_good_and_can_end_with_a_stage() {
        let verdict = run(&mut judge(0.0, false), &[(0.0, 1.0), (1.0, 0.0), (0.0, 1.0)]);
        assert!(!verdict.strict && verdict.violations == ["early"]);
        assert!(verdict.explanation.contains("At 0.00 s: early."));
        assert!(run(&mut judge(0.0, false), &[(1.0, 0.0), (0.0, 1.0)]).violations.is_empty());
    }
}
