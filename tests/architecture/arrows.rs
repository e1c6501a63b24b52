//! Which crate may know which other, over every feature, platform and kind of dependency.

use super::metadata;
use anyhow::{Context, Result};
use cargo_metadata::{DependencyKind, Metadata};
use std::collections::{BTreeMap, BTreeSet};

/// Each of our crates with those of ours that it may name. A crate that is missing here may not exist.
const MAY_NAME: [(&str, &[&str]); 15] = [
    ("acm-concept", &[]),
    ("acm-llm", &[]),
    ("acm-runtime", &[]),
    ("acm-store", &[]),
    ("acm-memory", &["acm-concept", "acm-store"]),
    ("acm-perception", &["acm-concept"]),
    ("acm-learned", &["acm-concept", "acm-perception"]),
    ("acm-onnx", &["acm-concept", "acm-perception"]),
    ("acm-skills", &["acm-concept"]),
    ("acm-render", &["acm-concept"]),
    ("acm-baselines", &["acm-concept", "acm-memory"]),
    ("acm-planner", &["acm-concept", "acm-memory"]),
    ("acm-sim", &["acm-concept", "acm-render"]),
    (
        "acm-actors",
        &["acm-concept", "acm-llm", "acm-memory", "acm-perception", "acm-planner", "acm-runtime", "acm-skills"],
    ),
    (
        "acm",
        &[
            "acm-actors",
            "acm-baselines",
            "acm-concept",
            "acm-learned",
            "acm-llm",
            "acm-memory",
            "acm-onnx",
            "acm-perception",
            "acm-planner",
            "acm-render",
            "acm-runtime",
            "acm-sim",
            "acm-skills",
            "acm-store",
        ],
    ),
];

/// Outside crates that belong to one of ours alone.
const RESERVED: [(&str, &str); 5] = [
    ("candle-core", "acm-learned"),
    ("candle-nn", "acm-learned"),
    ("ort", "acm-onnx"),
    ("rapier3d", "acm-sim"),
    ("wgpu", "acm-render"),
];

/// The agent's side: it sees frames and what an arm reports, and cannot name a simulator type.
const AGENT_SIDE: [&str; 12] = [
    "acm-actors",
    "acm-baselines",
    "acm-concept",
    "acm-learned",
    "acm-llm",
    "acm-memory",
    "acm-onnx",
    "acm-perception",
    "acm-planner",
    "acm-runtime",
    "acm-skills",
    "acm-store",
];

/// What the agent's side may not reach, over any number of steps.
const WORLD_SIDE: [&str; 4] = ["acm-sim", "acm-render", "rapier3d", "wgpu"];

/// A dependency as a manifest declares it.
#[derive(Debug)]
struct Arrow {
    from: String,
    to: String,
    kind: DependencyKind,
}

/// The dependencies of our crates as declared: optional ones and those of other platforms too.
fn declared(metadata: &Metadata) -> Vec<Arrow> {
    let arrows = |package: &cargo_metadata::Package| -> Vec<Arrow> {
        let from = package.name.to_string();
        package
            .dependencies
            .iter()
            .map(|dependency| Arrow { from: from.clone(), to: dependency.name.clone(), kind: dependency.kind })
            .collect()
    };
    metadata.workspace_packages().into_iter().flat_map(arrows).collect()
}

/// One sentence for each crate that the table does not know and each arrow that it does not have.
fn forbidden(crates: &[String], arrows: &[Arrow]) -> Vec<String> {
    let table: BTreeMap<&str, &[&str]> = MAY_NAME.into_iter().collect();
    let unknown = crates
        .iter()
        .filter(|name| !table.contains_key(name.as_str()))
        .map(|name| format!("{name} is a new crate: say in MAY_NAME which crates it may name"));
    let wrong = arrows.iter().filter_map(|Arrow { from, to, kind }| {
        let ours = table.contains_key(to.as_str());
        if ours && !table.get(from.as_str()).is_some_and(|allowed| allowed.contains(&to.as_str())) {
            return Some(format!("{from} may not depend on {to}, but does ({kind:?})"));
        }
        let (library, owner) = RESERVED.iter().find(|(library, _)| library == to)?;
        (from != owner).then(|| format!("{library} belongs to {owner} alone, but {from} depends on it ({kind:?})"))
    });
    unknown.chain(wrong).collect()
}

/// Crate names with the names that each depends on directly, as resolved.
type Graph = BTreeMap<String, BTreeSet<String>>;

fn resolved(metadata: &Metadata) -> Result<Graph> {
    let resolve = metadata.resolve.as_ref().context("cargo metadata gave no resolved graph")?;
    let mut graph = Graph::new();
    for node in &resolve.nodes {
        let names = node.deps.iter().map(|dependency| metadata[&dependency.pkg].name.to_string());
        graph.entry(metadata[&node.id].name.to_string()).or_default().extend(names);
    }
    Ok(graph)
}

/// A chain of crates from one to another, both included.
fn path(graph: &Graph, from: &str, to: &str) -> Option<Vec<String>> {
    let mut paths = vec![vec![from.to_owned()]];
    let mut visited = BTreeSet::from([from]);
    while let Some(path) = paths.pop() {
        let last = path.last()?;
        if last == to {
            return Some(path);
        }
        for next in graph.get(last).into_iter().flatten() {
            if visited.insert(next) {
                paths.push([path.as_slice(), std::slice::from_ref(next)].concat());
            }
        }
    }
    None
}

/// One sentence for each way on which the agent's side reaches the world's.
fn leaks(graph: &Graph) -> Vec<String> {
    let pairs = AGENT_SIDE.iter().flat_map(|agent| WORLD_SIDE.iter().map(move |world| (agent, world)));
    pairs
        .filter_map(|(agent, world)| {
            Some(format!("{agent} reaches {world}: {}", path(graph, agent, world)?.join(" -> ")))
        })
        .collect()
}

#[test]
fn crates_depend_only_as_drawn() -> Result<()> {
    let metadata = metadata()?;
    let crates: Vec<String> = metadata.workspace_packages().iter().map(|package| package.name.to_string()).collect();
    let arrows = declared(&metadata);
    assert!(arrows.len() > crates.len(), "cargo metadata told of {} dependencies only", arrows.len());
    assert_eq!(forbidden(&crates, &arrows), Vec::<String>::new());
    Ok(())
}

#[test]
fn agent_side_reaches_no_simulator() -> Result<()> {
    let graph = resolved(&metadata()?)?;
    for name in AGENT_SIDE.iter().chain(&WORLD_SIDE) {
        assert!(graph.contains_key(*name), "{name} is not in the workspace's graph: correct the lists here");
    }
    assert_eq!(leaks(&graph), Vec::<String>::new());
    Ok(())
}

#[test]
fn the_table_has_no_circle_and_no_stale_row() -> Result<()> {
    let metadata = metadata()?;
    let crates: BTreeSet<String> = metadata.workspace_packages().iter().map(|p| p.name.to_string()).collect();
    for (name, allowed) in MAY_NAME {
        assert!(crates.contains(name), "MAY_NAME has {name}, which is no crate of this workspace");
        // Rows stand below the rows they name, so there is no circle.
        let earlier: BTreeSet<&str> = MAY_NAME.iter().map(|(row, _)| *row).take_while(|row| *row != name).collect();
        assert!(allowed.iter().all(|other| earlier.contains(other)), "{name} names a crate of a later row");
    }
    Ok(())
}

#[test]
fn a_wrong_arrow_is_told_in_a_sentence() {
    let arrow = |from: &str, to: &str, kind| Arrow { from: from.into(), to: to.into(), kind };
    let arrows = [
        arrow("acm-perception", "acm-concept", DependencyKind::Normal),
        arrow("acm-perception", "acm-memory", DependencyKind::Development),
        arrow("acm-skills", "acm-sim", DependencyKind::Build),
        arrow("acm-skills", "rapier3d", DependencyKind::Normal),
        arrow("acm-sim", "rapier3d", DependencyKind::Normal),
        arrow("acm", "wgpu", DependencyKind::Development),
    ];
    let told = forbidden(&["acm-sim".into(), "acm-cellar".into()], &arrows);
    assert_eq!(
        told,
        [
            "acm-cellar is a new crate: say in MAY_NAME which crates it may name",
            "acm-perception may not depend on acm-memory, but does (Development)",
            "acm-skills may not depend on acm-sim, but does (Build)",
            "rapier3d belongs to acm-sim alone, but acm-skills depends on it (Normal)",
            "wgpu belongs to acm-render alone, but acm depends on it (Development)",
        ]
    );
}

#[test]
fn a_leak_over_several_steps_is_found() {
    let graph = |arrows: &[(&str, &str)]| {
        let mut graph = Graph::new();
        for (from, to) in arrows {
            graph.entry((*from).into()).or_default().insert((*to).into());
        }
        graph
    };
    let clean = [("acm-skills", "acm-concept"), ("acm-sim", "acm-concept"), ("acm-concept", "acm-skills")];
    assert_eq!(leaks(&graph(&clean)), Vec::<String>::new());
    let leaking = [("acm-skills", "helper"), ("helper", "wgpu"), ("helper", "acm-skills")];
    assert_eq!(leaks(&graph(&leaking)), ["acm-skills reaches wgpu: acm-skills -> helper -> wgpu"]);
}
