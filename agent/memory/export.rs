//! What is remembered, in forms that others read.

use super::picture;
use crate::cli::memory::ExportFormat;
use acm_memory::open_store;
use acm_store::{Id, Kind, State, Store, event::Sure};
use anyhow::Context;
use serde_json::{Value, json};
use std::{
    fs::File,
    io::{BufWriter, Write},
    path::Path,
};

/// Writes the file.
pub fn run(dir: &Path, format: ExportFormat, out: &Path) -> anyhow::Result<()> {
    let mut store = open_store(dir)?;
    let cannot = || format!("{} cannot be written", out.display());
    let mut file = BufWriter::new(File::create(out).with_context(cannot)?);
    match format {
        ExportFormat::Jsonl => jsonl(&mut store, &mut file)?,
        ExportFormat::Sql => sql(&store.view(), &mut file)?,
        ExportFormat::Pddl => pddl(&store.view(), &mut file)?,
        ExportFormat::SparkDsg => serde_json::to_writer(&mut file, &spark_dsg(&store.view()))?,
        ExportFormat::Svg => file.write_all(picture::svg(&store.view()).as_bytes())?,
    }
    file.flush().with_context(cannot)?;
    println!("{} objects -> {}", store.state().table.live, out.display());
    Ok(())
}

fn jsonl(store: &mut Store, out: &mut impl Write) -> anyhow::Result<()> {
    for (known, event) in store.events()? {
        let document: Value = serde_json::from_slice(&event.document).unwrap_or(Value::Null);
        writeln!(
            out,
            "{}",
            json!({"schema": "acm.memory-event/1", "known_ns": known, "event": event, "document": document})
        )?;
    }
    let state = store.view();
    for id in state.ids() {
        writeln!(out, "{}", json!({"schema": "acm.memory-object/1", "object": named(&state, id)}))?;
    }
    Ok(())
}

/// An object with words for numbers.
fn named(state: &State, id: Id) -> Value {
    let Some(object) = state.object(id) else { return Value::Null };
    let word = |symbol| state.symbols.word(symbol);
    let related =
        state.relations.of(id).map(|edge| json!([word(edge.relation), format!("O{}", edge.object), edge.holds()]));
    json!({
        "id": format!("O{id}"), "category": word(object.category), "region": word(object.region),
        "position_m": object.position, "rotation_xyz": object.rotation, "confidence": object.confidence,
        "states": object.states.iter().map(|state| word(*state)).collect::<Vec<_>>(),
        "relations": related.collect::<Vec<_>>(),
        "parts": object.parts.iter().map(|part| json!({
            "template": word(part.template), "name": word(part.name), "theta": part.theta, "position_m": part.position,
            "affordances": part.affordances.iter().filter(|word| **word > 0).map(|symbol| word(*symbol)).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
    })
}

fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}

fn sql(state: &State, out: &mut impl Write) -> anyhow::Result<()> {
    out.write_all(
        b"begin;\n\
          create table object(id integer primary key, category text, region text, x real, y real, z real, confidence real);\n\
          create table part(object integer, number integer, template text, name text, x real, y real, z real);\n\
          create table parameter(object integer, part integer, number integer, value real);\n\
          create table state(object integer, state text, holds integer);\n\
          create table relation(subject integer, relation text, object integer, holds integer);\n\
          create table fluent(object integer, fluent text, value real);\n",
    )?;
    let word = |symbol| quoted(state.symbols.word(symbol));
    for id in state.ids() {
        let Some(object) = state.object(id) else { continue };
        let [x, y, z] = object.position;
        let (category, region) = (word(object.category), word(object.region));
        writeln!(out, "insert into object values({id},{category},{region},{x},{y},{z},{});", object.confidence)?;
        for (number, part) in object.parts.iter().enumerate() {
            let ([x, y, z], template, name) = (part.position, word(part.template), word(part.name));
            writeln!(out, "insert into part values({id},{number},{template},{name},{x},{y},{z});")?;
            for (at, value) in part.theta.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                writeln!(out, "insert into parameter values({id},{number},{at},{value});")?;
            }
        }
        for (symbol, name) in state.symbols.of_kind(Kind::State) {
            match state.sure(id, symbol) {
                Sure::Unknown => {}
                sure => {
                    writeln!(out, "insert into state values({id},{},{});", quoted(name), u8::from(sure == Sure::Yes))?
                }
            }
        }
        for edge in state.relations.of(id) {
            let (relation, holds) = (word(edge.relation), u8::from(edge.holds()));
            writeln!(out, "insert into relation values({id},{relation},{},{holds});", edge.object)?;
        }
        for (symbol, name) in state.symbols.of_kind(Kind::Fluent) {
            if let Some(value) = state.number(id, symbol) {
                writeln!(out, "insert into fluent values({id},{},{value});", quoted(name))?;
            }
        }
    }
    out.write_all(b"commit;\n")?;
    Ok(())
}

/// A word as PDDL takes it.
fn name(text: &str) -> String {
    let mut name: String =
        text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert(0, 'n');
    }
    name
}

/// Predicates have names of their own beside those of actions: each ends with the kind it comes from.
fn pddl(state: &State, out: &mut impl Write) -> anyhow::Result<()> {
    let word = |symbol| name(state.symbols.word(symbol));
    writeln!(out, "(define (problem memory)\n  (:domain acm)\n  (:objects")?;
    let mut facts = Vec::new();
    for id in state.ids() {
        let Some(object) = state.object(id) else { continue };
        let category = if object.category == 0 { "object".into() } else { word(object.category) };
        writeln!(out, "    o{id} - {category}")?;
        facts.extend(object.states.iter().map(|symbol| format!("({}-state o{id})", word(*symbol))));
        facts.extend(
            state
                .relations
                .of(id)
                .filter(|edge| edge.holds())
                .map(|edge| format!("({}-relation o{id} o{})", word(edge.relation), edge.object)),
        );
        let affordances =
            object.parts.iter().flat_map(|part| part.affordances).chain(object.affordances.iter().copied());
        let mut affordances: Vec<u16> = affordances.filter(|symbol| *symbol > 0).collect();
        affordances.sort_unstable();
        affordances.dedup();
        facts.extend(affordances.into_iter().map(|symbol| format!("({}-affordance o{id})", word(symbol))));
        for (symbol, fluent) in state.symbols.of_kind(Kind::Fluent) {
            facts.extend(state.number(id, symbol).map(|value| format!("(= ({}-fluent o{id}) {value})", name(fluent))));
        }
    }
    writeln!(out, "  )\n  (:init")?;
    for fact in facts {
        writeln!(out, "    {fact}")?;
    }
    writeln!(out, "  )\n  (:goal (and))\n)")?;
    Ok(())
}

/// The object layer of a scene graph as spark_dsg writes it.
fn spark_dsg(state: &State) -> Value {
    let symbol = |id: Id| u64::from(b'O') << 56 | u64::from(id);
    let mut nodes = Vec::new();
    let mut edges = Vec::new();
    for id in state.ids() {
        let Some(object) = state.object(id) else { continue };
        let [x, y, z] = object.rotation;
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        nodes.push(json!({
            "id": symbol(id), "layer": 2, "partition": 0,
            "attributes": {
                "type": "ObjectNodeAttributes", "position": object.position, "last_update_time_ns": state.now,
                "is_active": false, "is_predicted": false, "metadata": {"confidence": object.confidence},
                "name": state.symbols.word(object.category), "color": {"r": 128, "g": 128, "b": 128, "a": 255},
                "bounding_box": {"type": 0}, "semantic_label": object.category, "semantic_feature": [],
                "registered": false, "world_R_object": {"w": w, "x": x, "y": y, "z": z}, "mesh_connections": [],
            },
        }));
        for edge in state.relations.of(id).filter(|edge| edge.holds()) {
            edges.push(json!({
                "source": symbol(id), "target": symbol(edge.object),
                "info": {"weight": f32::from(edge.confidence) / 255.0, "weighted": true,
                         "metadata": {"relation": state.symbols.word(edge.relation)}},
            }));
        }
    }
    json!({
        "header": {"project_name": "main", "version": {"major": 1, "minor": 1, "patch": 3}},
        "directed": false, "multigraph": false, "nodes": nodes, "edges": edges,
        "layer_ids": [2, 3, 4, 5], "layer_keys": [], "layer_names": {}, "metadata": {},
    })
}
