//! Skill memory: which manipulation functions fit an object, what came of them, what they are expected to do.

use crate::{
    entry::{SkillEntry, Transition, TransitionResult},
    query::{Prediction, SkillCandidate},
    state::State,
};
use acm_concept::{
    ids::{ObjectId, PartId, SkillId},
    literal::{Literal, Place, Term},
    template::{FunctionBinding, TemplateLibrary},
};
use std::collections::BTreeMap;

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
            let (tries, successes) = statistics(state, &function.name, &template.name);
            candidates.push(SkillCandidate {
                skill: function.name.clone(),
                template: template.name.clone(),
                kind: function.kind.clone(),
                part: part_id,
                destination: destination.filter(|_| needs_destination(function)),
                entry: find(state, &function.name, &template.name).map(|entry| entry.id),
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

/// Declared effects with the probability that this skill on this template has had so far.
pub(crate) fn predict(state: &State, candidate: &SkillCandidate) -> Prediction {
    let (tries, successes) = statistics(state, &candidate.skill, &candidate.template);
    let success = smoothed(tries, successes);
    let effects = candidate.effects.iter().map(|effect| (effect.clone(), success)).collect();
    Prediction { effects, success, tries, successes }
}

/// Mean of the Beta(1, 1) posterior.
fn smoothed(tries: u32, successes: u32) -> f64 {
    (f64::from(successes) + 1.0) / (f64::from(tries) + 2.0)
}

fn find<'s>(state: &'s State, skill: &str, template: &str) -> Option<&'s SkillEntry> {
    state.skills.iter().find(|entry| entry.skill == skill && entry.template == template)
}

fn statistics(state: &State, skill: &str, template: &str) -> (u32, u32) {
    find(state, skill, template).map_or((0, 0), |entry| (entry.tries, entry.successes))
}

/// The skill entry that a settled transition belongs to, computed anew from all settled transitions of its skill
/// and template, so that a verdict that is revised is never counted twice. `None` while nothing is decided.
pub(crate) fn consolidated(state: &State, library: &TemplateLibrary, transition: &Transition) -> Option<SkillEntry> {
    let (skill, template) = (transition.skill(), &transition.report.invocation.target.template);
    let same = |other: &&Transition| other.skill() == skill && other.report.invocation.target.template == *template;
    let (mut tries, mut links) = (0u32, Vec::new());
    let mut sums: BTreeMap<&str, (f64, u32)> = BTreeMap::new();
    for other in state.transitions.iter().filter(same) {
        match other.result {
            TransitionResult::Verified => {
                let report = &other.report;
                for (name, value) in report.invocation.arguments.iter().chain(&report.measured) {
                    let (sum, count) = sums.entry(name).or_insert((0.0, 0));
                    (*sum, *count) = (*sum + value, *count + 1);
                }
                links.push(other.id);
            }
            TransitionResult::Failed { .. } => {}
            TransitionResult::Pending | TransitionResult::CannotTell => continue,
        }
        tries += 1;
    }
    let known = find(state, skill, template);
    if tries == 0 && known.is_none() {
        return None;
    }
    let function = library.get(template).and_then(|template| template.function(skill));
    Some(SkillEntry {
        id: known.map_or(SkillId(state.next.skill), |entry| entry.id),
        skill: skill.into(),
        template: template.clone(),
        kind: transition.report.invocation.kind.clone(),
        preconditions: function.map(|function| function.preconditions.clone()).unwrap_or_default(),
        parameters: sums.into_iter().map(|(name, (sum, count))| (name.into(), sum / f64::from(count))).collect(),
        tries,
        successes: u32::try_from(links.len()).unwrap_or(u32::MAX),
        transitions: links,
    })
}
