//! Conditions that nobody declared, read out of what was believed before successes and before failures.

use crate::entry::{LearnedCondition, Transition};
use acm_concept::{
    ids::PartId,
    literal::{Literal, Term},
};

/// Chance at which failures without a condition are still taken for an accident, over all literals that were tried.
const ACCIDENT: f64 = 0.05;
/// Fewer successes teach nothing.
const LEAST_SUCCESSES: u32 = 2;

/// Literals common to all successes whose absence goes with failure: more often than would happen by chance in one of
/// twenty such memories (Fisher's exact test, one-sided, with Bonferroni's correction for the literals that were tried).
pub(super) fn learned(
    successes: &[&Transition],
    failures: &[&Transition],
    declared: &[Literal],
) -> Vec<LearnedCondition> {
    let mut counts: Vec<LearnedCondition> = Vec::new();
    let mut denied: Vec<u32> = Vec::new();
    let mut count = |literal: Literal, add: &dyn Fn(&mut LearnedCondition, &mut u32)| {
        let at = counts.iter().position(|known| known.literal == literal).unwrap_or_else(|| {
            counts.push(LearnedCondition { literal, successes: 0, failures_with: 0, failures_without: 0 });
            denied.push(0);
            counts.len() - 1
        });
        if let (Some(known), Some(denied)) = (counts.get_mut(at), denied.get_mut(at)) {
            add(known, denied);
        }
    };
    for literal in successes.iter().flat_map(|transition| before(transition)) {
        count(literal.clone(), &|known, _| known.successes += 1);
        count(literal.negate(), &|_, denied| *denied += 1);
    }
    for literal in failures.iter().flat_map(|transition| before(transition)) {
        count(literal.clone(), &|known, _| known.failures_with += 1);
        count(literal.negate(), &|known, _| known.failures_without += 1);
    }
    // A literal and its negation are one question.
    let questions = counts.iter().filter(|known| !known.literal.negated).count().max(1);
    let teaches = |known: &LearnedCondition, denied: u32| {
        denied == 0
            && known.successes >= LEAST_SUCCESSES
            && known.failures_without > 0
            && !declared.contains(&known.literal)
            && chance(known) * questions as f64 <= ACCIDENT
    };
    let mut found: Vec<LearnedCondition> = counts
        .into_iter()
        .zip(denied)
        .filter(|(known, denied)| teaches(known, *denied))
        .map(|(known, _)| known)
        .collect();
    found.sort_by_cached_key(|known| (u32::MAX - known.failures_without, known.literal.to_string()));
    found
}

/// Tries that were not known to violate a learned condition, and the successes among them.
pub(super) fn sound(learned: &[LearnedCondition], successes: &[&Transition], failures: &[&Transition]) -> (u32, u32) {
    let violates = |transition: &&&Transition| {
        let before = before(transition);
        learned.iter().any(|known| before.contains(&known.literal.clone().negate()))
    };
    let narrow = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    let succeeded = narrow(successes.len());
    (succeeded.saturating_add(narrow(failures.iter().filter(|t| !violates(t)).count())), succeeded)
}

/// Probability that of all tries of which the condition's truth is known, those without it are failures only by chance:
/// the product of (failures - i) / (tries - i) over them.
fn chance(known: &LearnedCondition) -> f64 {
    let failures = known.failures_with + known.failures_without;
    let tries = failures + known.successes;
    (0..known.failures_without).map(|i| f64::from(failures - i) / f64::from(tries - i)).product()
}

/// What was believed before, said of variables. Literals that name other things stay behind: they do not carry over.
fn before(transition: &Transition) -> Vec<Literal> {
    let part = transition.report.invocation.part;
    let support = transition.before.iter().find(|l| l.predicate == "on" && l.subject() == Some(part.object));
    let support = support.filter(|l| !l.negated).and_then(|literal| literal.arguments.get(1).cloned());
    let mut lifted: Vec<Literal> = Vec::new();
    for literal in transition.before.iter().filter_map(|literal| lift(literal, part, support.as_ref())) {
        if !lifted.contains(&literal) {
            lifted.push(literal);
        }
    }
    lifted
}

fn lift(literal: &Literal, part: PartId, support: Option<&Term>) -> Option<Literal> {
    let variable = |name: &str| Some(Term::Variable(name.into()));
    let arguments = literal.arguments.iter().map(|term| match term {
        Term::Object(object) if *object == part.object => variable(if part.index == 0 { "self" } else { "object" }),
        Term::Part(other) if *other == part => variable("self"),
        other if Some(other) == support => variable("support"),
        Term::Number(_) | Term::Symbol(_) => Some(term.clone()),
        Term::Object(_) | Term::Part(_) | Term::Place(_) | Term::Variable(_) => None,
    });
    Some(Literal { arguments: arguments.collect::<Option<_>>()?, ..literal.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chance_is_that_of_the_hypergeometric_distribution() {
        // 5 of 20 tries failed; the 3 without the condition are among them by chance in C(5,3) / C(20,3) cases.
        let literal = Literal::new("latched", Vec::new());
        let known = LearnedCondition { literal, successes: 15, failures_with: 2, failures_without: 3 };
        assert!((chance(&known) - 10.0 / 1140.0).abs() < 1e-12);
    }
}
