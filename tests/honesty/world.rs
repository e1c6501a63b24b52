//! Scenario files rewritten: the same world under other names, or with more in it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use toml::{Table, Value};

/// Texts that are no names and hold none.
const PLAIN: [&str; 12] = [
    "scenario",
    "summary",
    "instruction",
    "paraphrases",
    "color",
    "shape",
    "kind",
    "stream",
    "sensor",
    "cover",
    "model",
    "redraw",
];

/// A scenario as a table, with the models that it uses written into it.
pub struct World(pub Table);

impl World {
    /// A scenario that ships with the simulator.
    pub fn read(name: &str) -> World {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sim/scenarios");
        let table = |path: PathBuf| std::fs::read_to_string(path).unwrap().parse::<Table>().unwrap();
        let mut world = World(table(folder.join(format!("{name}.toml"))));
        let mut used: Vec<String> = world.items("object").iter().map(|object| text(object, "model")).collect();
        used.sort();
        used.dedup();
        let models: Vec<Value> =
            used.iter().map(|model| Value::Table(table(folder.join(format!("objects/{model}.toml"))))).collect();
        world.items("model").extend(models);
        world
    }

    /// Parses tables in the form of a scenario file and appends their items.
    pub fn add(&mut self, more: &str) {
        for (kind, items) in more.parse::<Table>().unwrap() {
            self.items(&kind).extend(items.as_array().unwrap().iter().cloned());
        }
    }

    /// The items of one kind.
    pub fn items(&mut self, kind: &str) -> &mut Vec<Value> {
        self.0.entry(kind).or_insert_with(|| Value::Array(Vec::new())).as_array_mut().unwrap()
    }

    /// Gives every draw, object, place, model, surface, event and judged condition, and the scenario, another name.
    pub fn rename(&mut self) {
        self.0.insert("scenario".into(), Value::from("w0"));
        let mut names = Vec::new();
        for kind in ["object", "place"] {
            names.extend(self.items(kind).iter().map(|item| text(item, "name")));
        }
        if let Some(draws) = self.0["random"].get("draw").and_then(Value::as_array) {
            names.extend(draws.iter().map(|draw| text(draw, "name")));
        }
        // Counted down, so that the order by name changes too.
        let other = |(index, name): (usize, &String)| (name.clone(), format!("w{}", 900 - index));
        let names: BTreeMap<String, String> = names.iter().enumerate().map(other).collect();
        for (key, value) in &mut self.0 {
            if key != "camera" && key != "model" {
                rename_in(value, key, &names);
            }
        }
        for surface in self.items("surface") {
            let name = format!("surface {}", text(surface, "name").len());
            surface.as_table_mut().unwrap().insert("name".into(), Value::from(name));
        }
        let models: Vec<String> = self.items("model").iter().map(|model| text(model, "model")).collect();
        for kind in ["model", "object"] {
            for item in self.items(kind) {
                let index = models.iter().position(|model| *model == text(item, "model")).unwrap();
                item.as_table_mut().unwrap().insert("model".into(), Value::from(format!("m{}", 90 - index)));
            }
        }
    }

    /// Declares objects the other way round; what stands on something still comes after it.
    pub fn reorder(&mut self) {
        let objects = self.items("object");
        objects.reverse();
        objects.sort_by_key(|object| object.get("on").is_some());
        self.items("model").reverse();
    }

    /// Writes it as a scenario file.
    pub fn write(&self, path: &Path) {
        std::fs::write(path, toml::to_string(&self.0).unwrap()).unwrap();
    }
}

/// A text field of an item.
pub fn text(item: &Value, field: &str) -> String {
    item.get(field).and_then(Value::as_str).unwrap().to_owned()
}

fn rename_in(value: &mut Value, key: &str, names: &BTreeMap<String, String>) {
    match value {
        Value::String(_) if PLAIN.contains(&key) => {}
        Value::String(text) => *text = replaced(text, |word| renamed(word, names)),
        Value::Array(items) => items.iter_mut().for_each(|item| rename_in(item, key, names)),
        Value::Table(table) => table.iter_mut().for_each(|(key, value)| rename_in(value, key, names)),
        _ => {}
    }
}

/// `cube` and `cube_x` under the cube's other name.
fn renamed(word: &str, names: &BTreeMap<String, String>) -> Option<String> {
    if let Some(other) = names.get(word) {
        return Some(other.clone());
    }
    let prefixes = word.match_indices('_').map(|(at, _)| word.split_at(at));
    prefixes.rev().find_map(|(name, rest)| Some(format!("{}{rest}", names.get(name)?)))
}

/// A text with some of its words (letters, digits and underscores) replaced.
pub fn replaced(text: &str, other: impl Fn(&str) -> Option<String>) -> String {
    let part_of_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let (mut rest, mut done) = (text, String::new());
    while let Some(start) = rest.find(part_of_word) {
        let (before, from) = rest.split_at(start);
        let (word, after) = from.split_at(from.find(|c| !part_of_word(c)).unwrap_or(from.len()));
        done.push_str(before);
        done.push_str(&other(word).unwrap_or_else(|| word.to_owned()));
        rest = after;
    }
    done + rest
}

#[test]
fn names_are_replaced_within_expressions() {
    let names = BTreeMap::from([("cube".to_owned(), "w1".to_owned()), ("cube_home".to_owned(), "w2".to_owned())]);
    let other = replaced("abs(cube_x - cube_home_x) < 0.04 && icecube > cubes", |word| renamed(word, &names));
    assert_eq!(other, "abs(w1_x - w2_x) < 0.04 && icecube > cubes");
}
