//! The front end on whole instructions, with the project's template library.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

use acm_concept::template::TemplateLibrary;
use acm_planner::{ParseError, Planner, Task};
use proptest::prelude::*;

const CANONICAL: &str = "Bring the cube to the middle, press the button, then return it to where it came from.";

fn library() -> TemplateLibrary {
    TemplateLibrary::parse([
        ("box.toml", include_str!("../../../memory/library/box.toml")),
        ("button.toml", include_str!("../../../memory/library/button.toml")),
        ("cylinder.toml", include_str!("../../../memory/library/cylinder.toml")),
        ("mat.toml", include_str!("../../../memory/library/mat.toml")),
    ])
    .unwrap()
}

fn parse(text: &str) -> Result<Task, ParseError> {
    Planner::new().unwrap().parse(text, &library())
}

fn outline(text: &str) -> Vec<String> {
    parse(text).unwrap_or_else(|error| panic!("{text}\n  {error}")).outline()
}

fn check_paraphrases(file: &str) {
    let canonical = ["at(#0, middle)", "press(#1) x1", "at(#0, BeforeMoved of #0)"];
    for line in file.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        assert_eq!(outline(line), canonical, "{line}");
    }
}

#[test]
fn the_paraphrases_in_use_ask_for_the_same() {
    check_paraphrases(include_str!("paraphrases.txt"));
}

#[test]
fn unseen_paraphrases_ask_for_the_same() {
    check_paraphrases(include_str!("paraphrases_unseen.txt"));
}

#[test]
fn a_task_names_its_nouns_and_its_words() {
    let task = parse(CANONICAL).unwrap();
    assert_eq!(task.nouns, ["cube", "button"]);
    let texts: Vec<&str> = task.subtasks.iter().map(|subtask| subtask.text.as_str()).collect();
    assert_eq!(texts, ["Bring the cube to the middle", "press the button", "return it to where it came from"]);
}
