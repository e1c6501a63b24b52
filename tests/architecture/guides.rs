//! The guides in docs/ are true: their examples are accepted and their tables are complete.

use super::{files, read, root};
use acm_concept::{literal::Literal, template::Template};
use anyhow::{Context, Result};
use std::collections::BTreeSet;

/// The fenced blocks of a language, without their fences.
fn blocks<'a>(document: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("\n```{language}\n");
    document.split(fence.as_str()).skip(1).filter_map(|rest| rest.split("\n```").next()).collect()
}

/// The first cells, in back ticks, of the table rows between a heading and the next one.
fn table_names<'a>(document: &'a str, heading: &str) -> Result<BTreeSet<&'a str>> {
    let (_, rest) = document.split_once(heading).with_context(|| format!("the guide has no heading `{heading}`"))?;
    let section = rest.split("\n## ").next().unwrap_or(rest);
    Ok(section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next()).collect())
}

/// The predicate of a table row such as `on(object, support)`.
fn predicate(row: &str) -> &str {
    row.split('(').next().unwrap_or(row)
}

#[test]
fn the_worked_template_is_accepted() -> Result<()> {
    let guide = read(&root().join("docs/templates.md"))?;
    let example = blocks(&guide, "toml").first().copied().context("docs/templates.md has no example")?;
    let template = Template::parse("docs/templates.md", example)?;
    // A ruler of 30 cm as a segment of that size would be measured.
    let values = template.initial_values([0.3, 0.03, 0.009, 0.15])?;
    let named = template.named(&values);
    assert!(template.admits(&named));
    assert_eq!(template.nouns(&named), ["ruler", "bar"]);
    assert_eq!(template.solids(&named)?.len(), 1);
    for function in &template.functions {
        assert!(acm_skills::kinds().contains(&function.kind.as_str()), "no controller runs `{}`", function.kind);
        assert!(template.frame(&function.frame, &named)?.is_some());
        let required = acm_skills::required_arguments(&function.kind).context("a kind that nothing runs")?;
        let unbound: Vec<_> = required.iter().filter(|name| !function.arguments.contains_key(**name)).collect();
        assert_eq!(unbound, Vec::<&&str>::new(), "`{}` of the worked template", function.name);
    }
    Ok(())
}

#[test]
fn the_tools_guide_shows_settings_that_are_read_and_names_every_field() -> Result<()> {
    let guide = read(&root().join("docs/perception-tools.md"))?;
    let example = blocks(&guide, "toml").first().copied().context("docs/perception-tools.md has no example")?;
    let settings: acm_actors::settings::Settings = toml::from_str(example)?;
    settings.tools.check().map_err(anyhow::Error::msg)?;
    assert_eq!(settings.tools.named().count(), 2);
    let named = table_names(&guide, "## Switching one on")?;
    let text: Vec<String> = named.iter().filter(|name| **name != "deadline_ms").map(|n| format!("{n} = 'x'")).collect();
    let all: acm_actors::tools::ToolSettings = toml::from_str(&text.join("\n"))?;
    let fields: BTreeSet<&str> = all.named().map(|(field, _)| field).chain(["deadline_ms"]).collect();
    assert_eq!((named, fields.len()), (fields.clone(), 6));
    Ok(())
}

#[test]
fn every_function_kind_is_described() -> Result<()> {
    let guide = read(&root().join("docs/templates.md"))?;
    let known: BTreeSet<&str> = acm_skills::kinds().iter().copied().collect();
    assert_eq!(table_names(&guide, "## Function kinds")?, known);
    Ok(())
}

#[test]
fn every_argument_of_a_function_kind_is_described() -> Result<()> {
    let guide = read(&root().join("docs/templates.md"))?;
    for kind in acm_skills::kinds() {
        let row = guide.lines().find(|line| line.starts_with(&format!("| `{kind}` |"))).context("a kind has no row")?;
        for argument in acm_skills::required_arguments(kind).context("a kind without a controller")? {
            assert!(row.contains(&format!("`{argument}`")), "docs/templates.md: `{kind}` needs `{argument}` too");
        }
    }
    Ok(())
}

#[test]
fn every_predicate_of_the_library_is_described() -> Result<()> {
    let guide = read(&root().join("docs/literals.md"))?;
    let described: BTreeSet<&str> = table_names(&guide, "## Predicates")?.into_iter().map(predicate).collect();
    let mut used = BTreeSet::new();
    for path in files(&root().join("memory/library"), "toml")? {
        let template = Template::parse(&path.display().to_string(), &read(&path)?)?;
        let literals = template.functions.iter().flat_map(|f| f.preconditions.iter().chain(&f.effects));
        used.extend(literals.map(|literal| literal.predicate.clone()));
    }
    assert!(used.len() > 3, "the library uses {used:?} only: correct the path here");
    let missing: Vec<&String> = used.iter().filter(|name| !described.contains(name.as_str())).collect();
    assert_eq!(missing, Vec::<&String>::new(), "describe them in docs/literals.md");
    Ok(())
}

#[test]
fn the_examples_of_literals_are_accepted() -> Result<()> {
    let guide = read(&root().join("docs/literals.md"))?;
    let example = blocks(&guide, "text").first().copied().context("docs/literals.md has no example")?;
    for line in example.lines() {
        assert_eq!(Literal::parse(line)?.to_string(), line);
    }
    Ok(())
}

#[test]
fn the_worked_scenario_is_accepted_and_laid_out() -> Result<()> {
    let guide = read(&root().join("docs/scenarios.md"))?;
    let example = blocks(&guide, "toml").first().copied().context("docs/scenarios.md has no example")?;
    let scenario = acm_sim::Scenario::parse("docs/scenarios.md", example)?;
    for seed in 0..5 {
        let world =
            acm_sim::Simulation::without_renderer(&scenario, &acm_sim::SimOptions { seed, ..Default::default() })?;
        assert_eq!(world.truth().len(), 2, "seed {seed}");
        assert!(!world.verdict().strict, "seed {seed} is solved before it begins");
    }
    Ok(())
}

#[test]
fn blocks_and_tables_are_found() -> Result<()> {
    let document =
        "# T\n\n```toml\na = 1\n```\n\n```toml\nb = 2\n```\n## One\n| `x(a)` | y |\n| z |\n## Two\n| `w` |\n";
    assert_eq!(blocks(document, "toml"), ["a = 1", "b = 2"]);
    assert_eq!(blocks(document, "text"), [""; 0]);
    assert_eq!(table_names(document, "## One")?, BTreeSet::from(["x(a)"]));
    assert_eq!(predicate("x(a)"), "x");
    assert!(table_names(document, "## Three").is_err());
    Ok(())
}
