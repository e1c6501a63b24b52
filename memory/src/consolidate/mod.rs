//! Consolidation (paper, section "Memory Update and Consolidation"): settled executions of one skill on parts of one
//! template become one entry of skill memory. Statistics follow every verdict; what executions have in common is read
//! out of them once their subtask is done. An entry is always computed anew from its transitions, so that a verdict
//! that is revised is never counted twice, and taking transitions back leaves what there would be without them.

mod conditions;
mod law;

use crate::{
    draft::Draft,
    entry::{General, SkillEntry, TargetSchema, Transition, TransitionResult},
    event::Change,
    skill::find,
    state::State,
};
use acm_concept::{
    ids::{SkillId, TransitionId},
    literal::Evidence,
    template::TemplateLibrary,
};
use std::collections::BTreeMap;

/// Brings the statistics of a settled transition's skill up to date.
pub(crate) fn count(draft: &mut Draft<'_>, transition: &Transition) {
    if let Some(entry) = counted(&draft.state, draft.library, transition) {
        draft.emit(vec![Evidence::Transition(transition.id)], Change::Skill(Box::new(entry)));
    }
}

/// Generalises the skills that were executed for a subtask of the present run.
pub(crate) fn after_subtask(draft: &mut Draft<'_>, index: u32) {
    let episode = draft.state.next.episode;
    let served = |t: &&Transition| t.moment.episode == episode && t.subtask == Some(index);
    let transitions: Vec<Transition> = draft.state.transitions.iter().filter(served).cloned().collect();
    generalise(draft, &transitions);
}

/// Takes transitions back, or in again, and brings the skills that they belong to up to date.
pub(crate) fn take_back(draft: &mut Draft<'_>, transitions: &[TransitionId], restored: bool) {
    let taken = Change::TakenBack { transitions: transitions.to_vec(), restored };
    draft.emit(Vec::new(), taken);
    let of = |id: &TransitionId| draft.state.transition(*id).cloned();
    let transitions: Vec<Transition> = transitions.iter().filter_map(of).collect();
    generalise(draft, &transitions);
}

/// The transitions of an entry that its latest subtask brought.
pub(crate) fn latest(state: &State, skill: SkillId) -> Vec<TransitionId> {
    let Some(entry) = state.skills.iter().find(|entry| entry.id == skill) else { return Vec::new() };
    let ids = entry.transitions.iter().chain(&entry.failures);
    let all: Vec<&Transition> = ids.filter_map(|id| state.transition(*id)).collect();
    let subtask = |t: &Transition| (t.moment.episode, t.subtask);
    let Some(last) = all.iter().max_by_key(|t| t.id).map(|t| subtask(t)) else { return Vec::new() };
    let mut ids: Vec<TransitionId> = all.iter().filter(|t| subtask(t) == last).map(|t| t.id).collect();
    ids.sort();
    ids
}

fn generalise(draft: &mut Draft<'_>, transitions: &[Transition]) {
    let mut kinds: BTreeMap<(&str, &str), Vec<&Transition>> = BTreeMap::new();
    for transition in transitions {
        kinds.entry((transition.skill(), &transition.report.invocation.target.template)).or_default().push(transition);
    }
    for ((skill, template), of_kind) in kinds {
        let Some(first) = of_kind.first() else { continue };
        let Some(mut entry) = counted(&draft.state, draft.library, first) else { continue };
        entry.general = Some(Box::new(general(&draft.state, &entry))).filter(|_| entry.successes > 0);
        if find(&draft.state, skill, template) == Some(&entry) {
            continue;
        }
        let evidence = of_kind.iter().map(|transition| Evidence::Transition(transition.id)).collect();
        draft.emit(evidence, Change::Skill(Box::new(entry)));
    }
}

/// The entry that a transition belongs to with the statistics of all settled transitions of its skill and template;
/// without tries where it was there and nothing is left of it. `None` while nothing is decided.
fn counted(state: &State, library: &TemplateLibrary, transition: &Transition) -> Option<SkillEntry> {
    let (skill, template) = (transition.skill(), &transition.report.invocation.target.template);
    let same = |other: &&Transition| {
        other.skill() == skill
            && other.report.invocation.target.template == *template
            && !state.taken_back.contains(&other.id)
    };
    let (mut links, mut failures) = (Vec::new(), Vec::new());
    let mut sums: BTreeMap<&str, (f64, u32)> = BTreeMap::new();
    for other in state.transitions.iter().filter(same) {
        match other.result {
            TransitionResult::Verified => {
                for (name, value) in bound(other) {
                    let (sum, count) = sums.entry(name).or_insert((0.0, 0));
                    (*sum, *count) = (*sum + value, *count + 1);
                }
                links.push(other.id);
            }
            TransitionResult::Failed { .. } => failures.push(other.id),
            TransitionResult::Pending | TransitionResult::CannotTell => {}
        }
    }
    let known = find(state, skill, template);
    let tries = links.len() + failures.len();
    if tries == 0 && known.is_none() {
        return None;
    }
    let function = library.get(template).and_then(|template| template.function(skill));
    let narrow = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    Some(SkillEntry {
        id: known.map_or(SkillId(state.next.skill), |entry| entry.id),
        skill: skill.into(),
        template: template.clone(),
        kind: transition.report.invocation.kind.clone(),
        preconditions: function.map(|function| function.preconditions.clone()).unwrap_or_default(),
        parameters: sums.into_iter().map(|(name, (sum, count))| (name.into(), sum / f64::from(count))).collect(),
        tries: narrow(tries),
        successes: narrow(links.len()),
        transitions: links,
        failures,
        general: known.and_then(|entry| entry.general.clone()),
    })
}

/// Numbers that an execution was bound to or measured.
fn bound(transition: &Transition) -> impl Iterator<Item = (&str, f64)> {
    let report = &transition.report;
    report.invocation.arguments.iter().chain(&report.measured).map(|(name, value)| (name.as_str(), *value))
}

fn general(state: &State, entry: &SkillEntry) -> General {
    let of = |ids: &[TransitionId]| -> Vec<&Transition> { ids.iter().filter_map(|id| state.transition(*id)).collect() };
    let (successes, failures) = (of(&entry.transitions), of(&entry.failures));
    let learned = conditions::learned(&successes, &failures, &entry.preconditions);
    let sound = conditions::sound(&learned, &successes, &failures);
    General { target: target(state, &successes), learned, sound, laws: law::laws(&successes) }
}

fn target(state: &State, successes: &[&Transition]) -> TargetSchema {
    let mut schema = TargetSchema::default();
    let mut ranges: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for (number, transition) in successes.iter().enumerate() {
        let part = &transition.report.invocation.target;
        schema.categories.extend(state.object(transition.object()).map(|object| object.category.clone()));
        match number {
            0 => schema.affordances.clone_from(&part.affordances),
            _ => schema.affordances.retain(|word| part.affordances.contains(word)),
        }
        for parameter in &part.parameters {
            let (low, high) = ranges.entry(&parameter.name).or_insert((parameter.value, parameter.value));
            (*low, *high) = (low.min(parameter.value), high.max(parameter.value));
        }
    }
    schema.categories.sort();
    schema.categories.dedup();
    schema.affordances.sort();
    schema.parameters = ranges.into_iter().map(|(name, (low, high))| (name.into(), low, high)).collect();
    schema
}
