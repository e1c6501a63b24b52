//! Tabletop tasks with an instruction and a hidden goal: is the goal that the planner reads the task's own?
//!
//! The scene is known (types, and in which region of which surface each thing stands); the goal is not. The
//! instruction is read with the scene's inventory and grounded in the scene; its goals are compared with the task's.
//! Which region *of* a thing is meant is compared only where the regions are parts (drawers, compartments).

use super::{
    inventory::{Abilities, Type, slug},
    scene::{Scene, Thing},
};
use acm_concept::{color::Lab, ids::ObjectId, template::TemplateLibrary};
use acm_memory::MemoryView;
use acm_planner::{Destination, Goal, PlanOptions, Planner, Task, classical::sexpr::Expression, task::Direction};
use anyhow::{Context, bail};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// What a fact of a goal says: a relation, its subject, and the place by thing and part.
pub type Fact = (String, String, String);

/// A task of the outside data.
pub struct Published {
    /// The instruction.
    pub instruction: String,
    fixtures: Vec<(String, String)>,
    objects: Vec<(String, String)>,
    /// Middle of each region of a surface, metres, as the data has it.
    regions: BTreeMap<String, (f64, f64)>,
    stands: Vec<(String, String)>,
    goal: Vec<(String, Vec<String>)>,
}

impl Published {
    /// Reads a task from the sections of its file.
    ///
    /// # Errors
    /// A section is not as the data's format has it.
    pub fn read(section: &dyn Fn(&str) -> Vec<Expression>) -> anyhow::Result<Published> {
        let words =
            |section: &[Expression]| section.iter().filter_map(|e| e.word().map(str::to_owned)).collect::<Vec<_>>();
        let mut regions = BTreeMap::new();
        for region in section("regions") {
            let (name, rest) = region.expect_headed("a region")?;
            let field = |wanted: &str| {
                rest.iter().filter_map(Expression::headed).find(|(head, _)| *head == wanted).map(|(_, r)| r)
            };
            let target = field(":target").and_then(|r| r.first()?.word()).context("a region without target")?;
            if let Some(range) = field(":ranges").and_then(|ranges| ranges.first()?.list()?.first()?.list()) {
                let numbers: Vec<f64> = range.iter().filter_map(|e| e.word()?.parse().ok()).collect();
                let [x0, y0, x1, y1] = numbers[..] else { bail!("the region {name} has no four numbers") };
                regions.insert(format!("{target}_{name}"), (0.5 * (x0 + x1), 0.5 * (y0 + y1)));
            }
        }
        let facts = |expressions: &[Expression]| -> Vec<(String, Vec<String>)> {
            expressions
                .iter()
                .filter_map(Expression::headed)
                .map(|(head, rest)| (head.to_owned(), words(rest)))
                .collect()
        };
        let stands = facts(&section("init")).into_iter().filter(|(head, _)| head == "On" || head == "In");
        let stands = stands.filter_map(|(_, a)| Some((a.first()?.clone(), a.get(1)?.clone()))).collect();
        let goals = section("goal");
        let (_, goal) = goals.first().and_then(Expression::headed).context("a task without goal")?;
        Ok(Published {
            instruction: words(&section("language")).join(" "),
            fixtures: typed(&words(&section("fixtures"))),
            objects: typed(&words(&section("objects"))),
            regions,
            stands,
            goal: facts(goal),
        })
    }

    fn types(&self) -> BTreeSet<Type> {
        let fixed = self.fixtures.iter().filter(|(name, _)| !self.is_surface(name)).map(|(_, name)| (name, true));
        let moved = self.objects.iter().map(|(_, name)| (name, false));
        fixed.chain(moved).map(|(name, fixed)| Type { name: name.clone(), fixed }).collect()
    }
    /// Whether a fixture is what everything stands on.
    fn is_surface(&self, name: &str) -> bool {
        !self.stands.iter().any(|(thing, _)| thing == name)
    }
}

/// "a_1 a_2 - a b_1 - b" as pairs of name and type.
fn typed(words: &[String]) -> Vec<(String, String)> {
    let mut pairs = Vec::new();
    let mut names: Vec<&String> = Vec::new();
    let mut words = words.iter();
    while let Some(word) = words.next() {
        if word == "-" {
            let kind = words.next().map_or("", String::as_str);
            pairs.extend(names.drain(..).map(|name| (name.clone(), kind.to_owned())));
        } else {
            names.push(word);
        }
    }
    pairs
}

/// What there is in a task's scene, as the library that its instruction is read with.
///
/// # Errors
/// A type makes no template.
pub fn library(planner: &Planner, abilities: &Abilities, task: &Published) -> anyhow::Result<TemplateLibrary> {
    abilities.library(&task.types(), true, planner.lexicon())
}

/// The scene with the names of its things.
struct Laid {
    scene: Scene,
    names: BTreeMap<ObjectId, String>,
}

/// Length, width and height by what a thing is; coarse, for grounding only.
fn size(name: &str, fixed: bool) -> DVec3 {
    match name.rsplit('_').next().unwrap_or(name) {
        "cabinet" | "shelf" => DVec3::new(0.2, 0.2, 0.3),
        "stove" | "microwave" => DVec3::new(0.25, 0.25, 0.1),
        "plate" => DVec3::new(0.14, 0.14, 0.02),
        _ if fixed => DVec3::new(0.2, 0.2, 0.1),
        _ => DVec3::splat(0.06),
    }
}

fn lay(task: &Published, abilities: &Abilities, planner: &Planner) -> anyhow::Result<Laid> {
    let library = library(planner, abilities, task)?;
    let mut laid = Laid { scene: Scene::new(library), names: BTreeMap::new() };
    let kind_of: BTreeMap<&String, (&String, bool)> = task
        .fixtures
        .iter()
        .map(|(name, kind)| (name, (kind, true)))
        .chain(task.objects.iter().map(|(name, kind)| (name, (kind, false))))
        .collect();
    // What stands on a surface first, then what stands on that.
    let mut open: Vec<&(String, String)> = task.stands.iter().collect();
    let mut spots: BTreeMap<String, (ObjectId, DVec3)> = BTreeMap::new();
    while !open.is_empty() {
        let before = open.len();
        let mut later = Vec::new();
        for stand in open {
            let (name, place) = stand;
            let Some((kind, fixed)) = kind_of.get(name) else { continue };
            let (at, on) = if let Some((x, y)) = task.regions.get(place) {
                // The robot looks along the data's x towards the camera: right is its y, near is its x.
                (DVec3::new(*y, -x, 0.0), None)
            } else if let Some((owner, (id, at))) = spots.iter().find(|(owner, _)| place.starts_with(owner.as_str())) {
                let kind = kind_of.get(owner).map_or("", |(kind, _)| kind.as_str());
                let region = place.strip_prefix(owner.as_str()).unwrap_or_default().trim_matches('_');
                let within = part_offset(region, kind, abilities);
                let top = DVec3::Z * size(kind, true).z;
                (*at + within.unwrap_or(top), Some(*id))
            } else {
                later.push(stand);
                continue;
            };
            let template = slug(kind);
            let thing = Thing { template: &template, size_m: size(kind, *fixed), at, color: color(kind), on };
            let id = laid.scene.put(&thing).with_context(|| format!("{name} cannot be put there"))?;
            add_parts(&mut laid.scene, id, kind, at, abilities);
            spots.insert(name.clone(), (id, at));
            laid.names.insert(id, name.clone());
        }
        if later.len() == before {
            bail!("{} stands nowhere", later.first().map_or("", |(name, _)| name.as_str()));
        }
        open = later;
    }
    Ok(laid)
}

/// The places of a thing's parts, by their names in the data.
const PARTS: [(&str, DVec3); 7] = [
    ("top", DVec3::new(0.0, 0.0, 0.2)),
    ("middle", DVec3::new(0.0, 0.0, 0.12)),
    ("bottom", DVec3::new(0.0, 0.0, 0.04)),
    ("left", DVec3::new(-0.06, 0.0, 0.02)),
    ("right", DVec3::new(0.06, 0.0, 0.02)),
    ("front", DVec3::new(0.0, -0.06, 0.02)),
    ("back", DVec3::new(0.0, 0.06, 0.02)),
];

fn named_parts(part: &str) -> &'static [(&'static str, DVec3)] {
    if part == "drawer" { &PARTS[..3] } else { &PARTS[3..] }
}

fn part_offset(region: &str, kind: &str, abilities: &Abilities) -> Option<DVec3> {
    let part = abilities.part_of(kind)?;
    let name = region.strip_suffix("_region")?;
    named_parts(part).iter().find(|(known, _)| name.split('_').next() == Some(known)).map(|(_, at)| *at)
}

fn add_parts(scene: &mut Scene, id: ObjectId, kind: &str, at: DVec3, abilities: &Abilities) {
    let Some(part) = abilities.part_of(kind) else { return };
    for (name, offset) in named_parts(part) {
        let thing =
            Thing { template: part, size_m: DVec3::splat(0.05), at: at + *offset, color: color(kind), on: None };
        // The library has the part's template: it was made from the same table.
        if scene.add_part(id, name, &thing).is_none() {
            return;
        }
    }
}

/// The colour that a type's name says; of two the last.
fn color(name: &str) -> Lab {
    let word = |word: &str| match word {
        "red" => Some([200, 35, 35]),
        "white" | "porcelain" => Some([235, 235, 235]),
        "yellow" => Some([230, 210, 50]),
        "black" => Some([30, 30, 30]),
        "wooden" => Some([150, 110, 70]),
        _ => None,
    };
    Lab::from_srgb(name.split('_').filter_map(word).next_back().unwrap_or([135, 135, 135]))
}

/// What was made of an instruction.
pub enum Made {
    /// Its goals as facts.
    Read(BTreeSet<Fact>),
    /// Why there are none.
    Unread(String),
}

/// Reads the instruction of a task and grounds it in its scene.
///
/// # Errors
/// The scene cannot be laid.
pub fn read(planner: &Planner, abilities: &Abilities, task: &Published) -> anyhow::Result<Made> {
    let laid = lay(task, abilities, planner)?;
    let library = laid.scene.library();
    let read = match planner.parse(&task.instruction, library) {
        Ok(read) => read,
        Err(error) => return Ok(Made::Unread(error.to_string())),
    };
    let mut facts = BTreeSet::new();
    for subtask in &read.subtasks {
        match fact(planner, &laid, &read, &subtask.goal) {
            Ok(Some(fact)) => {
                // A thing that is moved again is where it was moved last.
                let again = |known: &Fact| known.0 == "at" && fact.0 == "at" && known.1 == fact.1;
                facts.retain(|known| !again(known));
                facts.insert(fact);
            }
            Ok(None) => {}
            Err(reason) => return Ok(Made::Unread(reason)),
        }
    }
    Ok(Made::Read(facts))
}

fn fact(planner: &Planner, laid: &Laid, task: &Task, goal: &Goal) -> Result<Option<Fact>, String> {
    let meant = |index: usize| -> Result<String, String> {
        let options = PlanOptions::default();
        let (object, part) =
            planner.meant(task, &laid.scene, &options, index).map_err(|unknown| unknown.to_string())?;
        let name = laid.names.get(&object).cloned().unwrap_or_default();
        let entry = laid.scene.object(object);
        let part = part.and_then(|part| Some(entry?.parts.get(part.index as usize)?.name.clone()));
        Ok(part.map_or(name.clone(), |part| format!("{name}/{part}")))
    };
    Ok(match goal {
        Goal::At { object, destination } => {
            let place = match destination {
                Destination::On { reference } | Destination::In { reference } => meant(*reference)?,
                Destination::Under { reference } => format!("under {}", meant(*reference)?),
                Destination::Beside { reference, side } => match side {
                    Some(side) => format!("{} of {}", side_name(*side), meant(*reference)?),
                    None => format!("beside {}", meant(*reference)?),
                },
                other => return Err(format!("the place {other:?} is none of the data's")),
            };
            Some(("at".into(), meant(*object)?, place))
        }
        Goal::State { predicate, object, holds, .. } => {
            Some((format!("{}{predicate}", if *holds { "" } else { "not " }), meant(*object)?, String::new()))
        }
        Goal::Holding { .. } => None,
        other => return Err(format!("the goal {} is none of the data's", task.describe(other))),
    })
}

fn side_name(side: Direction) -> String {
    format!("{side:?}").to_lowercase()
}

/// Whether what was read is what is asked for: each fact of the goal, and nothing else but the opening of what something
/// is put in, which the goals leave out where the instruction says it.
pub fn agrees(read: &BTreeSet<Fact>, goal: &BTreeSet<Fact>) -> bool {
    let means = |fact: &Fact| fact.0 == "open" && goal.iter().any(|known| known.0 == "at" && known.2 == fact.1);
    goal.is_subset(read) && read.difference(goal).all(means)
}

/// The goal of a task as facts of the same form.
///
/// # Errors
/// It has a predicate that the data's other tasks do not.
pub fn expected(task: &Published, abilities: &Abilities) -> anyhow::Result<BTreeSet<Fact>> {
    let place = |name: &String| -> String {
        let of = |(owner, kind): &(String, String)| {
            let region = name.strip_prefix(owner.as_str())?.trim_start_matches('_').to_owned();
            Some((owner.clone(), kind.clone(), region))
        };
        let owned = task.fixtures.iter().chain(&task.objects).filter(|(owner, _)| !task.is_surface(owner)).find_map(of);
        if let Some((owner, kind, region)) = owned {
            let part = abilities.part_of(&kind).and_then(|_| region.strip_suffix("_region"));
            let part = part.and_then(|part| part.split('_').next());
            return match part {
                Some(part) => format!("{owner}/{part}"),
                None if region == "bottom_region" => format!("under {owner}"),
                None => owner,
            };
        }
        // A region of the table beside a thing: "living_room_table_plate_left_region".
        for (owner, kind) in task.objects.iter().chain(&task.fixtures) {
            let short = kind.rsplit('_').next().unwrap_or(kind);
            for side in ["left", "right", "front", "back"] {
                if name.ends_with(&format!("_{short}_{side}_region")) {
                    return format!("{side} of {owner}");
                }
            }
        }
        name.clone()
    };
    let mut facts = BTreeSet::new();
    for (predicate, arguments) in &task.goal {
        let first = arguments.first().context("a goal without arguments")?;
        facts.insert(match (predicate.as_str(), arguments.get(1)) {
            ("On" | "In", Some(second)) => ("at".to_owned(), first.clone(), place(second)),
            ("Open", None) => ("open".into(), place(first), String::new()),
            ("Close", None) => ("not open".into(), place(first), String::new()),
            ("Turnon", None) => ("switched-on".into(), place(first), String::new()),
            ("Turnoff", None) => ("not switched-on".into(), place(first), String::new()),
            (other, _) => bail!("the goal has the unknown predicate {other}"),
        });
    }
    Ok(facts)
}
