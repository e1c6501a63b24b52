//! Skill memory, each entry with the executions that it rests on.

use acm_concept::ids::SkillId;
use acm_memory::{
    Memory, MemoryView,
    entry::{General, Law, SkillEntry, Transition, TransitionResult},
};
use anyhow::ensure;
use serde_json::json;
use std::path::Path;

/// Prints the entries, or one.
pub fn print(dir: &Path, wanted: Option<&str>, as_json: bool) -> anyhow::Result<()> {
    let wanted: Option<SkillId> = wanted.map(str::parse).transpose()?;
    let memory = super::opened(dir)?;
    let view = memory.view();
    let entries: Vec<&SkillEntry> =
        view.skills().iter().filter(|entry| wanted.is_none_or(|wanted| wanted == entry.id)).collect();
    if let Some(wanted) = wanted {
        ensure!(!entries.is_empty(), "there is no skill {wanted} in this memory");
    }
    for entry in &entries {
        if as_json {
            println!("{}", json!({"schema": "acm.memory-skill/1", "skill": entry}));
        } else {
            text(entry, &*view);
        }
    }
    if entries.is_empty() && !as_json {
        println!("no skill was learned yet");
    }
    Ok(())
}

fn text(entry: &SkillEntry, view: &dyn MemoryView) {
    let SkillEntry { id, skill, template, kind, tries, successes, .. } = entry;
    println!("{id}  {skill} of {template} by {kind}: {successes} of {tries} went well");
    for literal in &entry.preconditions {
        println!("  needs {literal}, as declared");
    }
    if let Some(general) = &entry.general {
        learned(general);
    }
    for (name, mean) in &entry.parameters {
        let law = entry.general.iter().flat_map(|general| &general.laws).find(|law| law.name == *name);
        println!("  {name} = {}", law.map_or_else(|| format!("{mean:.4} on the average"), formula));
    }
    let links = entry.transitions.iter().chain(&entry.failures);
    for transition in links.filter_map(|id| view.transitions().iter().find(|known| known.id == *id)) {
        println!("  {}", execution(transition));
    }
}

fn learned(general: &General) {
    for condition in &general.learned {
        println!(
            "  needs {}, as learned: so before {} successes; {} failures with it, {} without",
            condition.literal, condition.successes, condition.failures_with, condition.failures_without
        );
    }
    let target = &general.target;
    println!("  on parts of {} that are {}", target.categories.join(", "), target.affordances.join(", "));
    for (name, low, high) in &target.parameters {
        println!("    {name} {low:.4} to {high:.4}");
    }
}

fn formula(law: &Law) -> String {
    let terms: Vec<String> = law.terms.iter().map(|term| format!("{:.3} {}", term.slope, term.parameter)).collect();
    format!("{} + {:.4}, give or take {:.4}", terms.join(" + "), law.constant, law.residual)
}

fn execution(transition: &Transition) -> String {
    let result = match &transition.result {
        TransitionResult::Verified => "verified".to_owned(),
        TransitionResult::Failed { cause, reason } => format!("failed ({}): {reason}", cause.word()),
        TransitionResult::Pending | TransitionResult::CannotTell => "not decided".to_owned(),
    };
    format!("{} on {}, run {}, {result}", transition.id, transition.report.invocation.part, transition.moment.episode)
}
