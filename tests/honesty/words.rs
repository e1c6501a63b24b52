//! The agent's vocabulary, one to one in other words: templates, parts, parameters, nouns and colours.
//!
//! A word's letters are mirrored in the alphabet, so that lengths stay, the order by name turns round, and mirroring
//! twice gives the word back.

use crate::world::replaced;
use acm_concept::template::TemplateLibrary;
use acm_planner::Lexicon;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};
use toml::{Table, Value};

/// A word in mirror letters.
pub fn mirrored(word: &str) -> String {
    let letter = |c: char| if c.is_ascii_lowercase() { (b'a' + b'z' - c as u8) as char } else { c };
    word.chars().map(letter).collect()
}

/// Library and lexicon in other words.
pub struct Vocabulary {
    pub library: TemplateLibrary,
    pub lexicon: Lexicon,
    /// Words of the instruction that are called otherwise.
    spoken: BTreeSet<String>,
    /// Everything that is called otherwise.
    all: BTreeSet<String>,
}

impl Vocabulary {
    /// The library in the repository and the embedded lexicon, all their names mirrored.
    pub fn mirrored() -> Vocabulary {
        let (mut all, mut spoken) = (BTreeSet::new(), BTreeSet::new());
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("memory/library");
        let mut texts = Vec::new();
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                continue;
            }
            let mut table: Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
            template(&mut table, &mut all, &mut spoken);
            let name = mirrored(path.file_stem().unwrap().to_str().unwrap());
            texts.push((format!("{name}.toml"), toml::to_string(&table).unwrap()));
        }
        let library = texts.iter().map(|(name, text)| (name.as_str(), text.as_str()));
        let library = TemplateLibrary::parse(library).unwrap();
        let mut files = acm_planner::embedded_lexicon();
        for (file, rename) in [("nouns.toml", nouns as fn(&mut Table, &mut BTreeSet<String>)), ("colors.toml", colors)]
        {
            let mut table: Table = files[file].parse().unwrap();
            rename(&mut table, &mut spoken);
            files.insert(file.into(), toml::to_string(&table).unwrap());
        }
        all.extend(spoken.iter().cloned());
        Vocabulary { library, lexicon: Lexicon::parse(&files).unwrap(), spoken, all }
    }

    /// An instruction in these words.
    pub fn say(&self, instruction: &str) -> String {
        replaced(instruction, |word| other(word, &self.spoken))
    }

    /// What was said in these words, in the words that they stand for.
    pub fn understand(&self, value: serde_json::Value) -> serde_json::Value {
        use serde_json::Value as Json;
        let theirs: BTreeSet<String> = self.all.iter().map(|word| mirrored(word)).collect();
        let text = |text: &str| replaced(text, |word| other(word, &theirs));
        match value {
            Json::String(told) => Json::String(text(&told)),
            Json::Array(items) => items.into_iter().map(|item| self.understand(item)).collect(),
            Json::Object(fields) => {
                fields.into_iter().map(|(key, value)| (text(&key), self.understand(value))).collect()
            }
            plain => plain,
        }
    }
}

/// A word or its plural in mirror letters, if it is one of these.
fn other(word: &str, words: &BTreeSet<String>) -> Option<String> {
    if words.contains(word) {
        return Some(mirrored(word));
    }
    let singular = word.strip_suffix('s')?;
    words.contains(singular).then(|| format!("{}s", mirrored(singular)))
}

/// Mirrors a text of plain words and remembers them.
fn mirror(value: &mut Value, words: &mut BTreeSet<String>) {
    if let Value::String(text) = value {
        words.extend(text.split(|c: char| !c.is_ascii_lowercase() && c != '_').map(str::to_owned));
        *text = mirrored(text);
    }
}

fn template(table: &mut Table, all: &mut BTreeSet<String>, spoken: &mut BTreeSet<String>) {
    mirror(&mut table["template"], all);
    for noun in table["synopsis"]["nouns"].as_array_mut().unwrap() {
        mirror(&mut noun["noun"], spoken);
    }
    let names = ["parameter", "part", "frame"];
    let mut parameters = BTreeSet::new();
    for kind in names {
        for item in table.get_mut(kind).and_then(Value::as_array_mut).into_iter().flatten() {
            mirror(&mut item["name"], if kind == "parameter" { &mut parameters } else { all });
        }
    }
    for (kind, field) in [("solid", "part"), ("function", "frame")] {
        for item in table.get_mut(kind).and_then(Value::as_array_mut).into_iter().flatten() {
            if let Some(name) = item.get_mut(field) {
                mirror(name, all);
            }
        }
    }
    for (key, value) in table.iter_mut().filter(|(key, _)| *key != "template") {
        expressions(value, key, &parameters);
    }
    all.extend(parameters);
}

/// Mirrors parameters within expressions.
fn expressions(value: &mut Value, key: &str, parameters: &BTreeSet<String>) {
    let plain = ["description", "affordance", "intended_use", "noun", "kind", "shape", "unit", "seen_by", "name"];
    let plain =
        plain.contains(&key) || ["part", "frame", "up", "affordances", "preconditions", "effects"].contains(&key);
    match value {
        Value::String(text) if !plain => {
            *text = replaced(text, |word| parameters.contains(word).then(|| mirrored(word)));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| expressions(item, key, parameters)),
        Value::Table(table) => table.iter_mut().for_each(|(key, value)| expressions(value, key, parameters)),
        _ => {}
    }
}

fn nouns(table: &mut Table, spoken: &mut BTreeSet<String>) {
    for alias in table["alias"].as_array_mut().unwrap() {
        mirror(&mut alias["noun"], spoken);
        for word in alias["words"].as_array_mut().unwrap() {
            // Of several words one may also be a verb ("push button"): an instruction uses the single ones here.
            let mut parts = BTreeSet::new();
            let single = word.as_str().is_some_and(|text| text.chars().all(|c| c.is_ascii_lowercase()));
            mirror(word, if single { spoken } else { &mut parts });
        }
    }
    let plurals: BTreeMap<String, Value> = table["plurals"].as_table().unwrap().clone().into_iter().collect();
    let mirror_pair = |(plural, noun): (String, Value)| {
        let other = mirrored(&plural);
        spoken.insert(plural);
        (other, Value::from(mirrored(noun.as_str().unwrap())))
    };
    table.insert("plurals".into(), Value::Table(plurals.into_iter().map(mirror_pair).collect()));
}

fn colors(table: &mut Table, spoken: &mut BTreeSet<String>) {
    for color in table["color"].as_array_mut().unwrap() {
        color["words"].as_array_mut().unwrap().iter_mut().for_each(|word| mirror(word, spoken));
    }
}
