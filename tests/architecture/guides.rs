//! The guides in docs/ are true: their examples are accepted and their tables are complete.

use super::{files, read, root};
use acm_concept::{
    camera::{FrameHeader, Intrinsics, RgbdFrame},
    ids::FrameId,
    literal::Literal,
    pose::Pose,
    solid::PlacedSolid,
    template::{Template, TemplateLibrary},
    time::Time,
};
use anyhow::{Context, Result};
use glam::{DMat3, DQuat, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
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
    // A pot of 12 cm as a segment of that size would be measured.
    let values = template.initial_values([0.12, 0.12, 0.1, 0.06])?;
    let named = template.named(&values);
    assert!(template.admits(&named));
    assert_eq!(template.nouns(&named), ["pot"]);
    assert_eq!(template.solids(&named)?.len(), 1);
    assert_eq!(unbound(&template)?, Vec::<String>::new());
    Ok(())
}

/// Functions of a template that no controller runs, or that lack an argument which theirs needs.
fn unbound(template: &Template) -> Result<Vec<String>> {
    let mut wrong = Vec::new();
    for function in &template.functions {
        let Some(required) = acm_skills::required_arguments(&function.kind) else {
            wrong.push(format!("{}: no controller runs `{}`", template.name, function.kind));
            continue;
        };
        let missing = required.iter().filter(|name| !function.arguments.contains_key(**name));
        wrong.extend(missing.map(|name| format!("{}: `{}` lacks `{name}`", template.name, function.name)));
    }
    Ok(wrong)
}

#[test]
fn a_view_of_the_worked_template_is_grounded() -> Result<()> {
    let guide = read(&root().join("docs/templates.md"))?;
    let example = blocks(&guide, "toml").first().copied().context("docs/templates.md has no example")?;
    // Beside what is tried anyway.
    let mut texts = vec![("docs/templates.md".to_owned(), example.to_owned())];
    for entry in std::fs::read_dir(root().join("memory/library"))? {
        let path = entry?.path();
        if path.is_file() {
            texts.push((path.display().to_string(), read(&path)?));
        }
    }
    let library = TemplateLibrary::parse(texts.iter().map(|(file, text)| (file.as_str(), text.as_str())))?;
    let template = library.get("plant-pot").context("the example has another name")?;
    let truth = [0.04, 0.055, 0.09];
    let frame = view(&template.solids(&template.named(&truth))?)?;
    let grounder = acm_perception::Grounder::new(library.clone().into(), acm_perception::GrounderConfig::default());
    let percepts = grounder.ground(&frame, &acm_concept::expectation::Expectation::default());
    let part = percepts.objects.first().and_then(|object| object.parts.first()).context("nothing is seen")?;
    assert_eq!(part.template, template.name);
    let height = part.parameters.iter().find(|parameter| parameter.name == "height").context("it has no height")?;
    assert!((height.value - truth[2]).abs() < 0.006, "{}", height.value);
    let rim = part.parameters.iter().find(|parameter| parameter.name == "radius_top").context("it has no rim")?;
    assert!((rim.value - truth[1]).abs() < 0.006, "{}", rim.value);
    assert!(part.pose.pose.translation.length() < 0.01, "{}", part.pose.pose.translation);
    Ok(())
}

/// What a camera sees of some solids on the plane z = 0 from 0.7 m, with a depth noise of a millimetre.
fn view(solids: &[PlacedSolid]) -> Result<RgbdFrame> {
    let (width, height) = (320, 240);
    let intrinsics = Intrinsics::from_vertical_fov(width, height, 0.8);
    let ahead = DVec3::new(0.0, 0.55, -0.83).normalize();
    let axes = DMat3::from_cols(DVec3::X, ahead.cross(DVec3::X), ahead);
    let camera = Pose::new(-ahead * 0.7, DQuat::from_mat3(&axes).normalize());
    let mut noise = ChaCha8Rng::seed_from_u64(5);
    let (mut color, mut depth) = (Vec::new(), Vec::new());
    for index in 0..intrinsics.pixels() {
        let pixel = (index % width as usize, index / width as usize);
        let ray = camera.transform_vector(intrinsics.ray(pixel.0 as f64, pixel.1 as f64));
        let thing = solids.iter().filter_map(|s| s.intersect_ray(camera.translation, ray)).map(|(enter, _)| enter);
        let (thing, table) = (thing.fold(f64::INFINITY, f64::min), -camera.translation.z / ray.z);
        color.extend(if thing < table { [190, 90, 60] } else { [215, 215, 210] });
        depth.push((thing.min(table) + noise.random_range(-0.0017..0.0017)) as f32);
    }
    let header =
        FrameHeader { id: FrameId(0), camera: "head".into(), time: Time::ZERO, intrinsics, camera_pose: camera };
    Ok(RgbdFrame::new(header, color.into(), depth.into())?)
}

#[test]
fn controllers_run_every_function_of_the_library() -> Result<()> {
    let mut wrong = Vec::new();
    let library = acm_memory::library_of(&acm_memory::library_groups())?;
    for template in library.iter() {
        wrong.extend(unbound(template)?);
    }
    assert_eq!(wrong, Vec::<String>::new());
    Ok(())
}

#[test]
fn the_gallery_shows_the_library_as_it_is() -> Result<()> {
    let redo = "draw it anew: acm library --gallery docs";
    assert!(read(&root().join("docs/library.md"))? == acm::library::gallery()?, "docs/library.md differs; {redo}");
    let folder = root().join("docs/library");
    let library = acm_memory::library_of(&acm_memory::library_groups())?;
    assert_eq!(files(&folder, "png")?.len(), library.iter().count(), "docs/library; {redo}");
    for template in library.iter() {
        let path = folder.join(format!("{}.png", template.name));
        let drawn = acm::library::picture(template)?;
        let kept = image::open(&path).with_context(|| path.display().to_string())?.to_rgb8();
        assert_eq!(kept.dimensions(), drawn.dimensions(), "{}; {redo}", path.display());
        assert!(std::fs::metadata(&path)?.len() < 6 * 1024, "{} is larger than 6 kB", path.display());
        // Another processor may round an edge otherwise.
        let far = |(a, b): (&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 12);
        let differ = kept.pixels().zip(drawn.pixels()).filter(|pair| far(*pair)).count();
        assert!(differ < 100, "{}: {differ} pixels differ; {redo}", path.display());
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
