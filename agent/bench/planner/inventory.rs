//! A list of what there is, as the library of templates that the planner reads with: nouns from the names of types,
//! everyday words for them from the lexicon, functions from a table of what kinds of things do.

use acm_concept::template::TemplateLibrary;
use acm_planner::Lexicon;
use anyhow::Context;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

const KINDS: &str = include_str!("kinds.toml");

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Kinds {
    carry_nothing: BTreeSet<String>,
    contain: BTreeSet<String>,
    open: BTreeSet<String>,
    switch: BTreeSet<String>,
    parts: BTreeMap<String, BTreeSet<String>>,
    rooms: BTreeMap<String, BTreeSet<String>>,
}

/// A type of things.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Type {
    /// Its name, words joined by underscores: `wooden_cabinet`.
    pub name: String,
    /// Whether its things stay where they are.
    pub fixed: bool,
}

/// What kinds of things do.
pub struct Abilities {
    kinds: Kinds,
}

impl Abilities {
    /// Reads the table.
    ///
    /// # Errors
    /// The table is not well formed.
    pub fn read() -> anyhow::Result<Abilities> {
        Ok(Abilities { kinds: toml::from_str(KINDS).context("kinds.toml")? })
    }
    /// What a part of a type is called that is named by its place: the drawer of a cabinet.
    pub fn part_of(&self, name: &str) -> Option<&str> {
        let head = head(name);
        self.kinds.parts.iter().find(|(_, wholes)| wholes.contains(head)).map(|(part, _)| part.as_str())
    }
    /// What any room of a kind has, by the hundred in the number of its floor plan.
    pub fn of_any_room(&self, hundred: u32) -> impl Iterator<Item = Type> + '_ {
        let names = self.kinds.rooms.get(&hundred.to_string()).into_iter().flatten();
        names.map(|name| Type { name: name.clone(), fixed: true })
    }
    /// The library of the types, with or without the parts that the table gives them.
    ///
    /// # Errors
    /// A name makes no template.
    pub fn library(&self, types: &BTreeSet<Type>, parts: bool, lexicon: &Lexicon) -> anyhow::Result<TemplateLibrary> {
        let part_of = |one: &Type| if parts { self.part_of(&one.name) } else { None };
        let mut texts: BTreeMap<String, String> = BTreeMap::new();
        // What is a name of one type is no everyday word for others.
        let mut best: BTreeMap<String, usize> = BTreeMap::new();
        for one in types {
            for (noun, tier) in nouns(&one.name, lexicon) {
                best.entry(noun).and_modify(|known| *known = tier.min(*known)).or_insert(tier);
            }
        }
        for one in types {
            let part = part_of(one);
            let called = nouns(&one.name, lexicon).into_iter().filter(|(noun, tier)| best.get(noun) == Some(tier));
            let mut nouns: Vec<String> = called.map(|(noun, _)| noun).collect();
            // A thing is called by what it is made of: a drawer for a chest of drawers.
            nouns.extend(part.map(str::to_owned));
            texts.insert(format!("{}.toml", slug(&one.name)), self.template(one, true, &nouns));
            if let Some(part) = part {
                let part_nouns: Vec<String> = self::nouns(part, lexicon).into_iter().map(|(noun, _)| noun).collect();
                let one = Type { name: part.to_owned(), fixed: true };
                texts.insert(format!("{part}.toml"), self.template(&one, false, &part_nouns));
            }
        }
        let texts = texts.iter().map(|(file, text)| (file.as_str(), text.as_str()));
        TemplateLibrary::parse(texts).context("the library of an inventory")
    }

    fn template(&self, one: &Type, carries: bool, nouns: &[String]) -> String {
        let head = head(&one.name);
        let carries = carries && !self.kinds.carry_nothing.contains(head);
        let mut affordances: Vec<&str> = carries.then_some("supportive").into_iter().collect();
        let mut functions = String::new();
        let mut function = |name: &str, kind: &str, effects: &str| {
            functions += &format!(
                "\n[[function]]\nname = \"{name}\"\nkind = \"{kind}\"\nframe = \"base\"\narguments = {{}}\npreconditions = []\neffects = [{effects}]\n"
            );
        };
        if !one.fixed {
            affordances.push("graspable");
            function("pick", "grasp-from-above", "\"holding(?self)\"");
            function("place", "place-upright", "\"at(?self, ?destination)\"");
        }
        if self.kinds.contain.contains(head) {
            affordances.push("contains");
        }
        if self.kinds.open.contains(head) {
            function("open", "hinge-open", "\"open(?self)\"");
            function("close", "hinge-close", "\"not open(?self)\"");
        }
        if self.kinds.switch.contains(head) {
            function("switch-on", "press-down", "\"switched-on(?self)\"");
        }
        let nouns: Vec<String> = nouns.iter().map(|noun| format!("{{ noun = \"{noun}\" }}")).collect();
        let mut text = format!(
            "template = \"{}\"\nseen_by = \"depth\"\naffordances = {affordances:?}\nconstraints = []\n\n[synopsis]\ndescription = \"a thing\"\naffordance = \"as its kind\"\nintended_use = \"as its kind\"\nnouns = [{}]\n",
            slug(&one.name),
            nouns.join(", ")
        );
        for (parameter, initial) in [("length", "extent_x"), ("width", "extent_y"), ("height", "extent_z")] {
            text += &format!(
                "\n[[parameter]]\nname = \"{parameter}\"\nunit = \"m\"\nmin = 0.001\nmax = 3.0\ninitial = \"{initial}\"\n"
            );
        }
        text += "\n[[solid]]\nshape = \"box\"\nsize = [\"length\", \"width\", \"height\"]\nposition = [\"0\", \"0\", \"height / 2\"]\n";
        text += "\n[[frame]]\nname = \"base\"\nposition = [\"0\", \"0\", \"0\"]\n";
        text + &functions
    }
}

/// A name as template files are called.
pub fn slug(name: &str) -> String {
    name.replace('_', "-")
}

fn head(name: &str) -> &str {
    name.rsplit('_').find(|word| word.parse::<u32>().is_err()).unwrap_or(name)
}

/// What a thing of this type may be called, and how well: by its name or the end of it (0), or by an everyday word for
/// either (1).
pub fn nouns(name: &str, lexicon: &Lexicon) -> Vec<(String, usize)> {
    let words: Vec<&str> = name.split('_').filter(|word| word.parse::<u32>().is_err()).collect();
    let ends = (0..words.len()).filter_map(|from| Some((words.get(from..)?.join(" "), 0)));
    let mut nouns: Vec<(String, usize)> = ends.collect();
    for (end, _) in nouns.clone() {
        nouns.extend(lexicon.words_for(&end).into_iter().map(|word| (word.to_owned(), 1)));
    }
    let mut seen = BTreeSet::new();
    nouns.retain(|(noun, _)| seen.insert(noun.clone()));
    nouns
}
