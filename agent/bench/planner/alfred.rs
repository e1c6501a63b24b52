//! What people wrote of household episodes: is the goal that the planner reads the episode's own?
//!
//! A description is read with what there is in its room (types of objects and receptacles over all episodes of the
//! floor plan). Compared are types, not things: what is moved, where it ends, its states, how many, what is switched on.

use super::inventory::{Abilities, Type, slug};
use acm_concept::template::TemplateLibrary;
use acm_planner::{
    Destination, Goal, Planner, Task,
    task::{Quantity, ReferenceIndex},
};
use anyhow::Context;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// Types that people call by each other's names; such confusions are counted by themselves.
const CONFUSED: [&[&str]; 3] =
    [&["cup", "mug"], &["pot", "pan"], &["towel", "cloth", "rag", "washcloth", "hand towel"]];

/// An episode of the outside data, with the fields that are used.
#[derive(Deserialize)]
pub struct Episode {
    /// Its room.
    pub floor_plan: String,
    /// Kind of task.
    pub task_type: String,
    object_poses: Vec<(String, serde_json::Value, serde_json::Value)>,
    object_toggles: Vec<(String, bool)>,
    pddl_params: Params,
    high_pddl: Vec<(String, Vec<String>, serde_json::Value, serde_json::Value)>,
    /// What people wrote.
    pub anns: Vec<Annotation>,
}

#[derive(Deserialize)]
struct Params {
    object_target: String,
    parent_target: String,
    mrecep_target: String,
    toggle_target: String,
    object_sliced: bool,
}

/// What one person wrote.
#[derive(Deserialize)]
pub struct Annotation {
    /// The task in one sentence.
    pub task_desc: String,
}

/// What came of a description.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// The goal is the episode's.
    Right,
    /// What it asks for is a part of the episode's goal, of which the description leaves out the rest: the reading has all
    /// that the description names, or a place by what stands beside it.
    SaysLess,
    /// It is not, and nothing was said.
    SilentlyWrong,
    /// It could not be read, or what it means is not in the room.
    Unread,
    /// A word fits several types of the room: an agent would ask.
    Ambiguous,
    /// A cup for a mug, and the like.
    Confused,
}

/// `SideTable` as `side_table`.
pub fn snake(name: &str) -> String {
    let mut snake = String::new();
    for character in name.chars() {
        if character.is_uppercase() && !snake.is_empty() && !snake.ends_with('_') && name != "CD" && name != "TVStand" {
            snake.push('_');
        }
        snake.extend(character.to_lowercase());
    }
    if snake == "glassbottle" {
        "glass_bottle".into()
    } else if snake == "tvstand" {
        "tv_stand".into()
    } else {
        snake
    }
}

/// What there is, by floor plan.
pub struct Rooms {
    libraries: BTreeMap<String, TemplateLibrary>,
}

impl Rooms {
    /// Collects the rooms of all episodes.
    ///
    /// # Errors
    /// A room makes no library.
    pub fn collect(episodes: &[Episode], abilities: &Abilities, planner: &Planner) -> anyhow::Result<Rooms> {
        let mut receptacles: BTreeSet<String> = BTreeSet::new();
        let mut objects: BTreeSet<String> = BTreeSet::new();
        for episode in episodes {
            let params = &episode.pddl_params;
            receptacles.extend([&params.parent_target, &params.toggle_target].map(|name| snake(name)));
            objects.extend([&params.object_target, &params.mrecep_target].map(|name| snake(name)));
            objects
                .extend(episode.object_poses.iter().map(|(name, _, _)| snake(name.split('_').next().unwrap_or(name))));
            receptacles.extend(episode.object_toggles.iter().map(|(name, _)| snake(name)));
        }
        for names in [&mut receptacles, &mut objects] {
            names.remove("");
        }
        let fixed: BTreeMap<String, String> =
            receptacles.iter().map(|name| (name.replace('_', ""), name.clone())).collect();
        let mut rooms: BTreeMap<String, BTreeSet<Type>> = BTreeMap::new();
        for episode in episodes {
            let room = rooms.entry(episode.floor_plan.clone()).or_default();
            let poses = episode.object_poses.iter().map(|(name, _, _)| snake(name.split('_').next().unwrap_or(name)));
            room.extend(poses.map(|name| Type { fixed: !objects.contains(&name), name }));
            let gone = episode.high_pddl.iter().flat_map(|(_, arguments, _, _)| arguments);
            room.extend(
                gone.filter_map(|name| fixed.get(name))
                    .map(|name| Type { name: name.clone(), fixed: !objects.contains(name) }),
            );
            room.extend(episode.object_toggles.iter().map(|(name, _)| Type { name: snake(name), fixed: true }));
        }
        let mut libraries = BTreeMap::new();
        for (name, mut types) in rooms {
            let has = |one: &Type| types.iter().any(|known| known.name.starts_with(one.name.as_str()));
            let missing: Vec<Type> = abilities.of_any_room(plan_number(&name) / 100).filter(|one| !has(one)).collect();
            types.extend(missing);
            libraries.insert(name.clone(), abilities.library(&types, false, planner.lexicon()).with_context(|| name)?);
        }
        Ok(Rooms { libraries })
    }
}

impl Rooms {
    /// What there is in the room of an episode.
    pub fn library(&self, episode: &Episode) -> Option<&TemplateLibrary> {
        self.libraries.get(&episode.floor_plan)
    }
}

impl Outcome {
    /// All of them.
    pub const ALL: [Outcome; 6] = [
        Outcome::Right,
        Outcome::SaysLess,
        Outcome::SilentlyWrong,
        Outcome::Unread,
        Outcome::Ambiguous,
        Outcome::Confused,
    ];
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Right => "right",
            Outcome::SaysLess => "says_less",
            Outcome::SilentlyWrong => "contradicts",
            Outcome::Unread => "unread",
            Outcome::Ambiguous => "ambiguous",
            Outcome::Confused => "confused",
        }
    }
}

/// The number of a floor plan.
pub fn plan_number(name: &str) -> u32 {
    name.trim_start_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or_default()
}

/// What a reading asks for, by types.
#[derive(Debug, Default)]
struct Asked {
    place: BTreeMap<ReferenceIndex, Destination>,
    states: BTreeMap<ReferenceIndex, BTreeSet<String>>,
    /// Where what carries things is said to be.
    described: BTreeMap<ReferenceIndex, Destination>,
    several: BTreeSet<ReferenceIndex>,
    held: BTreeSet<ReferenceIndex>,
    on: BTreeSet<ReferenceIndex>,
    other: bool,
}

impl Asked {
    fn of(task: &Task) -> Asked {
        let mut asked = Asked::default();
        for subtask in &task.subtasks {
            asked.add(&subtask.goal);
            asked.other |= subtask.when.is_some();
        }
        for (index, reference) in task.references.iter().enumerate() {
            let states = asked.states.entry(index).or_default();
            states.extend(reference.states.iter().filter(|(_, holds)| *holds).map(|(state, _)| state.clone()));
            if matches!(reference.quantity, Quantity::Count(_) | Quantity::Group) {
                asked.several.insert(index);
            }
            for &content in &reference.contains {
                asked.place.insert(content, Destination::In { reference: index });
            }
        }
        // What a thing is put in is where the description has it: "in the cup on the counter".
        let carriers: Vec<ReferenceIndex> = asked.place.values().flat_map(Destination::references).collect();
        for carrier in carriers {
            let located = task.references.get(carrier).and_then(|reference| reference.located.as_deref());
            if let Some(located @ (Destination::On { .. } | Destination::In { .. })) = located
                && !asked.place.contains_key(&carrier)
            {
                asked.described.insert(carrier, located.clone());
            }
        }
        asked
    }
    fn add(&mut self, goal: &Goal) {
        match goal {
            Goal::At { object, destination } => {
                self.place.insert(*object, destination.clone());
                self.held.remove(object);
            }
            Goal::Holding { object, held: true } => {
                self.held.insert(*object);
            }
            Goal::State { predicate, object, holds: true, .. } if predicate == "switched-on" => {
                self.on.insert(*object);
            }
            Goal::State { predicate, holds: false, .. } if predicate == "switched-on" => self.other = true,
            Goal::State { predicate, object, holds: true, .. } if predicate != "open" => {
                self.states.entry(*object).or_default().insert(predicate.clone());
            }
            Goal::Each { members, body, .. } => {
                self.several.insert(*members);
                body.iter().for_each(|goal| self.add(goal));
            }
            Goal::State { .. } | Goal::Holding { .. } => {}
            Goal::Performed { .. } | Goal::Find { .. } | Goal::Await { .. } => self.other = true,
        }
    }
}

/// Reads a description and compares it with its episode; with what it was read as, or why it was not.
pub fn score(planner: &Planner, rooms: &Rooms, episode: &Episode, text: &str) -> (Outcome, String) {
    let Some(library) = rooms.libraries.get(&episode.floor_plan) else {
        return (Outcome::Unread, "the room is not known".into());
    };
    match planner.parse(text.trim(), library) {
        Err(error) => {
            let outcome = if confused(episode, text) { Outcome::Confused } else { Outcome::Unread };
            (outcome, error.to_string())
        }
        Ok(task) => {
            let outcome = match compare(&task, library, episode) {
                Outcome::SaysLess if passes_over(&task, library, episode, text) => Outcome::SilentlyWrong,
                Outcome::SilentlyWrong if confused(episode, text) => Outcome::Confused,
                outcome => outcome,
            };
            (outcome, task.outline().join("; "))
        }
    }
}

/// Whether the text names a thing of the goal that the reading has not: then it is the reading that says less.
fn passes_over(task: &Task, library: &TemplateLibrary, episode: &Episode, text: &str) -> bool {
    let said = text.to_lowercase().replace(|c: char| !c.is_alphabetic(), " ");
    let mut said = format!(" {} ", said.split_whitespace().collect::<Vec<_>>().join(" "));
    // The coffee mug is no coffee machine.
    for noun in task.references.iter().filter_map(|known| known.noun.as_deref()) {
        said = said.replace(noun, "");
    }
    let params = &episode.pddl_params;
    [&params.object_target, &params.mrecep_target, &params.parent_target, &params.toggle_target].into_iter().any(
        |target| {
            let Some(template) = library.get(&slug(&snake(target))) else { return false };
            let nouns: Vec<&str> = template.synopsis.nouns.iter().map(|noun| noun.noun.as_str()).collect();
            let named =
                nouns.iter().any(|noun| [format!(" {noun} "), format!(" {noun}s ")].iter().any(|n| said.contains(n)));
            named
                && !task.references.iter().any(|known| known.noun.as_deref().is_some_and(|noun| nouns.contains(&noun)))
        },
    )
}

/// Whether the text has the name of a type that is confused with one of the goal's, and not that one's own.
fn confused(episode: &Episode, text: &str) -> bool {
    let text = text.to_lowercase();
    let says =
        |word: &str| text.split(|c: char| !c.is_alphabetic()).any(|w| w == word || w.strip_suffix('s') == Some(word));
    let params = &episode.pddl_params;
    [&params.object_target, &params.mrecep_target, &params.parent_target].into_iter().any(|target| {
        let target = snake(target);
        let own = target.rsplit('_').next().unwrap_or_default().to_owned();
        CONFUSED
            .iter()
            .filter(|group| group.contains(&own.as_str()))
            .any(|group| !says(&own) && group.iter().any(|other| *other != own && says(other)))
    })
}

fn compare(task: &Task, library: &TemplateLibrary, episode: &Episode) -> Outcome {
    let asked = Asked::of(task);
    let params = &episode.pddl_params;
    let mut ambiguous = false;
    // Whether a reference means a type; where it may mean others too, that is kept.
    let mut is = |index: ReferenceIndex, target: &str| -> bool {
        let name = snake(target).replace('_', "-");
        // The shelf of the fridge is in the fridge; the drawer of the desk is a drawer.
        let whole = task.references.get(index).and_then(|reference| reference.part_of);
        [Some(index), whole].into_iter().flatten().any(|index| {
            let noun = task.references.get(index).and_then(|reference| reference.noun.as_deref());
            let types: BTreeSet<&str> =
                noun.map(|noun| library.with_noun(noun).map(|t| t.name.as_str()).collect()).unwrap_or_default();
            let fits = types.contains(name.as_str());
            ambiguous |= fits && types.len() > 1;
            fits
        })
    };
    let on_or_in = |destination: &Destination| match destination {
        Destination::On { reference } | Destination::In { reference } | Destination::Under { reference } => {
            Some(*reference)
        }
        Destination::Beside { reference, .. } => Some(*reference),
        _ => None,
    };
    if asked.other {
        return Outcome::SilentlyWrong;
    }
    let mut states: BTreeSet<String> = BTreeSet::new();
    match episode.task_type.as_str() {
        "pick_heat_then_place_in_recep" => _ = states.insert("hot".into()),
        "pick_cool_then_place_in_recep" => _ = states.insert("cold".into()),
        "pick_clean_then_place_in_recep" => _ = states.insert("clean".into()),
        _ => {}
    }
    if params.object_sliced {
        states.insert("sliced".into());
    }
    let two = episode.task_type == "pick_two_obj_and_place";
    let right = if episode.task_type == "look_at_obj_in_light" {
        let held = asked.held.iter().any(|held| is(*held, &params.object_target));
        let lit = asked.on.iter().any(|lamp| is(*lamp, &params.toggle_target));
        held && lit && asked.place.is_empty() && asked.held.len() == 1
    } else {
        let movable = if params.mrecep_target.is_empty() { None } else { Some(params.mrecep_target.as_str()) };
        let mut good = 0;
        let mut bad = 0;
        let mut carried = movable.is_none();
        for (carrier, destination) in &asked.described {
            if movable.is_some_and(|movable| is(*carrier, movable)) {
                carried |= on_or_in(destination).is_some_and(|place| is(place, &params.parent_target));
            }
        }
        for (object, destination) in &asked.place {
            let place = on_or_in(destination);
            let knife = ["Knife", "ButterKnife"].iter().any(|knife| is(*object, knife));
            let told = asked.states.get(object).cloned().unwrap_or_default();
            if is(*object, &params.object_target) && told == states {
                let wanted = movable.unwrap_or(&params.parent_target);
                let many = if asked.several.contains(object) { 2 } else { 1 };
                if place.is_some_and(|place| is(place, wanted)) { good += many } else { bad += 1 }
            } else if movable.is_some_and(|movable| is(*object, movable)) {
                let there = place.is_some_and(|place| is(place, &params.parent_target));
                carried |= there;
                bad += u32::from(!there);
            } else if !(knife && params.object_sliced) {
                bad += 1;
            }
        }
        let counted = if two { good == 2 } else { good == 1 };
        counted && carried && bad == 0 && asked.on.is_empty()
    };
    if !right && says_less(&asked, &mut is, &on_or_in, params, &states) {
        return Outcome::SaysLess;
    }
    match (right, ambiguous) {
        (true, false) => Outcome::Right,
        (true, true) => Outcome::Ambiguous,
        (false, _) => Outcome::SilentlyWrong,
    }
}

/// Whether all that is asked for belongs to the goal: no other thing, place or state.
fn says_less(
    asked: &Asked,
    is: &mut impl FnMut(ReferenceIndex, &str) -> bool,
    place_of: &impl Fn(&Destination) -> Option<ReferenceIndex>,
    params: &Params,
    states: &BTreeSet<String>,
) -> bool {
    let lamp = |is: &mut dyn FnMut(ReferenceIndex, &str) -> bool, on: &ReferenceIndex| is(*on, &params.toggle_target);
    let placed = asked.place.iter().all(|(object, destination)| {
        let Some(place) = place_of(destination) else { return false };
        // What stands beside a thing stands on something that is not said.
        if matches!(destination, Destination::Beside { .. }) && is(*object, &params.object_target) {
            return true;
        }
        let knife = ["Knife", "ButterKnife"].iter().any(|knife| is(*object, knife)) && params.object_sliced;
        let object_goes = is(*object, &params.object_target)
            && (is(place, &params.parent_target) || is(place, &params.mrecep_target));
        let carrier_goes = is(*object, &params.mrecep_target) && is(place, &params.parent_target);
        knife || object_goes || carrier_goes
    });
    let told = asked.states.iter().filter(|(_, told)| !told.is_empty());
    let stated = told.into_iter().all(|(object, told)| told.is_subset(states) && is(*object, &params.object_target));
    let lit = asked.on.iter().all(|on| !params.toggle_target.is_empty() && lamp(is, on));
    placed && stated && lit && asked.held.iter().all(|held| is(*held, &params.object_target))
}
