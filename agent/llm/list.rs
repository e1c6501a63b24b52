//! `acm llm list`: the backends of a configuration.

use super::{LlmId, STAGES, chains, chosen};
use crate::{
    cli::{Exit, LlmListArgs},
    config,
};
use serde::Serialize;
use std::io::Write;

/// A backend in a list.
#[derive(Debug, Serialize)]
struct Line<'a> {
    id: &'a str,
    wire: &'static str,
    model: &'a str,
    base_url: &'a str,
    structured: acm_llm::wire::Structured,
    images: bool,
    /// The variable with its key, and whether it is set.
    key: Option<(&'a str, bool)>,
    /// The stages at which it is asked, with its place in their chains from 1.
    stages: Vec<(String, usize)>,
}

#[derive(Debug, Serialize)]
struct List<'a> {
    schema: &'static str,
    config: Option<String>,
    backends: Vec<Line<'a>>,
}

/// Runs `acm llm list`.
///
/// # Errors
/// The configuration cannot be used.
pub fn run(args: &LlmListArgs) -> anyhow::Result<Exit> {
    let (file, config) = config::open(args.config.as_deref())?;
    let llm = &config.llm;
    let default = match chosen(None, llm) {
        LlmId::Backend(id) => Some(id),
        _ => None,
    };
    let chains = chains(default.as_deref(), llm, None);
    let stages_of = |id: &str| -> Vec<(String, usize)> {
        let at = |ids: &Vec<String>| Some(1 + ids.iter().position(|other| other == id)?);
        chains.iter().filter_map(|(stage, ids)| Some((stage.clone(), at(ids)?))).collect()
    };
    let backends = llm.backend.iter().map(|(id, backend)| {
        let profile = backend.profile();
        Line {
            id,
            wire: backend.wire.name(),
            model: &backend.model,
            base_url: backend.base_url(),
            structured: profile.structured,
            images: profile.images,
            key: backend.key_env.as_deref().map(|name| (name, std::env::var_os(name).is_some())),
            stages: stages_of(id),
        }
    });
    let list = List {
        schema: "acm.llm-list/1",
        config: file.map(|file| file.display().to_string()),
        backends: backends.collect(),
    };
    let mut out = std::io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &list)?;
        writeln!(out)?;
        return Ok(Exit::Success);
    }
    match &list.config {
        Some(file) => writeln!(out, "{file}")?,
        None => writeln!(out, "no configuration: neither --config nor ./acm.toml (acm.example.toml has an example)")?,
    }
    writeln!(out, "  {:<16} the rules; no model is asked", "rules")?;
    for line in &list.backends {
        let key = match line.key {
            None => "no key".to_owned(),
            Some((name, true)) => format!("key in {name}"),
            Some((name, false)) => format!("KEY MISSING: {name} is not set"),
        };
        let stages: Vec<String> = line.stages.iter().map(|(stage, at)| format!("{stage} {at}")).collect();
        let asked = if stages.is_empty() { String::new() } else { format!("; asked: {}", stages.join(", ")) };
        writeln!(out, "  {:<16} {} {} at {}; {key}{asked}", line.id, line.wire, line.model, line.base_url)?;
    }
    writeln!(out, "stages: {}; the number is the place in the stage's chain", STAGES.join(", "))?;
    Ok(Exit::Success)
}
