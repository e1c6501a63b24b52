//! Skill memory: which manipulation functions fit an object, what came of them, what they are expected to do.

use crate::{
    belief,
    entry::SkillEntry,
    query::{Prediction, SkillCandidate},
    state::State,
};
use acm_concept::{
    ids::{ObjectId, PartId},
    literal::{Literal, Place, Term, Truth},
    template::{FunctionBinding, TemplateLibrary},
};

/// The functions that the object's templates bind, instantiated on its parts; best expected success first. Those
/// that need a destination are left out where none is given.
pub(crate) fn candidates(
    state: &State,
    library: &TemplateLibrary,
    object: ObjectId,
    destination: Option<Place>,
) -> Vec<SkillCandidate> {
    let Some(entry) = state.object(object) else { return Vec::new() };
    let mut candidates = Vec::new();
    for (index, part) in (0u32..).zip(&entry.parts) {
        let Some(template) = library.get(&part.template) else { continue };
        // Frames and arguments of functions are written for an upright part.
        if template.rests.iter().any(|rest| rest.holds(part.up())) {
            continue;
        }
        let part_id = PartId { object, index };
        let bind = |name: &str| match name {
            "self" if index == 0 => Some(Term::Object(object)),
            "self" => Some(Term::Part(part_id)),
            "object" => Some(Term::Object(object)),
            "support" => entry.support.map(Term::Object),
            "destination" => destination.map(Term::Place),
            _ => None,
        };
        for function in template.functions.iter().filter(|function| part.functions.contains(&function.name)) {
            let ground = |literals: &[Literal]| -> Vec<Literal> {
                literals.iter().map(|literal| literal.substitute(&bind)).collect()
            };
            let (preconditions, effects) = (ground(&function.preconditions), ground(&function.effects));
            if !preconditions.iter().chain(&effects).all(Literal::is_ground) {
                continue;
            }
            let known = find(state, &function.name, &template.name);
            let (tries, successes) = known.map_or((0, 0), |entry| statistics(state, library, entry, &bind));
            candidates.push(SkillCandidate {
                skill: function.name.clone(),
                template: template.name.clone(),
                kind: function.kind.clone(),
                part: part_id,
                destination: destination.filter(|_| needs_destination(function)),
                entry: known.map(|entry| entry.id),
                preconditions,
                effects,
                success: smoothed(tries, successes),
            });
        }
    }
    // Stable: equal ones stay in the order of parts and of the template file.
    candidates.sort_by(|a, b| b.success.total_cmp(&a.success));
    candidates
}

fn needs_destination(function: &FunctionBinding) -> bool {
    let is_destination = |term: &Term| matches!(term, Term::Variable(name) if name == "destination");
    function.preconditions.iter().chain(&function.effects).any(|literal| literal.arguments.iter().any(is_destination))
}

/// Declared effects with the probability that this skill on this template has had so far, under the conditions that
/// were learned for it.
pub(crate) fn predict(state: &State, library: &TemplateLibrary, candidate: &SkillCandidate) -> Prediction {
    let part = candidate.part;
    let bind = |name: &str| match name {
        "self" if part.index == 0 => Some(Term::Object(part.object)),
        "self" => Some(Term::Part(part)),
        "object" => Some(Term::Object(part.object)),
        "support" => state.object(part.object).and_then(|entry| entry.support).map(Term::Object),
        _ => None,
    };
    let known = find(state, &candidate.skill, &candidate.template);
    let (tries, successes) = known.map_or((0, 0), |entry| statistics(state, library, entry, &bind));
    let success = smoothed(tries, successes);
    let effects = candidate.effects.iter().map(|effect| (effect.clone(), success)).collect();
    Prediction { effects, success, tries, successes }
}

/// Mean of the Beta(1, 1) posterior.
fn smoothed(tries: u32, successes: u32) -> f64 {
    (f64::from(successes) + 1.0) / (f64::from(tries) + 2.0)
}

pub(crate) fn find<'s>(state: &'s State, skill: &str, template: &str) -> Option<&'s SkillEntry> {
    state.skills.iter().find(|entry| entry.skill == skill && entry.template == template)
}

/// Tries and successes that are like what is asked: where a learned condition is believed not to hold, the tries without
/// it; where all are believed to hold, the tries that violated none; else all.
fn statistics(
    state: &State,
    library: &TemplateLibrary,
    entry: &SkillEntry,
    bind: &dyn Fn(&str) -> Option<Term>,
) -> (u32, u32) {
    let Some(general) = entry.general.as_ref().filter(|general| !general.learned.is_empty()) else {
        return (entry.tries, entry.successes);
    };
    let mut all_hold = true;
    for condition in &general.learned {
        let literal = condition.literal.substitute(bind);
        let truth = if literal.is_ground() { belief::belief(state, library, &literal).truth } else { Truth::Unknown };
        match truth {
            Truth::No => return (condition.failures_without, 0),
            Truth::Unknown => all_hold = false,
            Truth::Yes => {}
        }
    }
    if all_hold { general.sound } else { (entry.tries, entry.successes) }
}
