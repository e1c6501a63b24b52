//! The front end on whole instructions, with the project's template library.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that panics fails, which is what it shall do")]

use acm_concept::template::TemplateLibrary;
use acm_planner::{Destination, Goal, ParseError, Planner, Task};
use proptest::prelude::*;
use std::sync::OnceLock;

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
    static MIND: OnceLock<(Planner, TemplateLibrary)> = OnceLock::new();
    let (planner, library) = MIND.get_or_init(|| (Planner::new().unwrap(), library()));
    let task = planner.parse(text, library)?;
    comes_back(planner, library, &task);
    Ok(task)
}

/// What the rules read can be said in the form in which a language model answers, and read back from it.
fn comes_back(planner: &Planner, library: &TemplateLibrary, task: &Task) {
    static SCHEMA: OnceLock<jsonschema::Validator> = OnceLock::new();
    let text = &task.instruction;
    let schema = || jsonschema::validator_for(&planner.prompt(text, library).unwrap().schema).unwrap();
    let answer = serde_json::to_value(planner.answer(task)).unwrap();
    let faults: Vec<String> =
        SCHEMA.get_or_init(schema).iter_errors(&answer).map(|e| format!("{}: {e}", e.instance_path())).collect();
    assert_eq!(faults, Vec::<String>::new(), "{text}");
    // A model copies words as they are written: it puts none right.
    let as_written = Task { corrections: Vec::new(), ..task.clone() };
    assert_eq!(planner.understand(text, library, &answer).as_ref(), Ok(&as_written), "{text}");
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
fn all_that_a_phrase_can_say_comes_back() {
    for text in [
        "Do not touch the dark blue cube. Put the cube on the left mat between the red cube and the can.",
        "Put a cube beside the second mat from the right; put the other cube to the left of it.",
        "Put the light green cube on the free mat, then pick up the largest block.",
        "Put the cube on the mat. Take the cube on the mat and put it where it was at the start.",
    ] {
        parse(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    }
}

#[test]
fn a_task_names_its_nouns_and_its_words() {
    let task = parse(CANONICAL).unwrap();
    assert_eq!(task.nouns, ["cube", "button"]);
    let texts: Vec<&str> = task.subtasks.iter().map(|subtask| subtask.text.as_str()).collect();
    assert_eq!(texts, ["Bring the cube to the middle", "press the button", "return it to where it came from"]);
}

#[test]
fn two_things_change_places_in_two_goals_that_stay_together() {
    let swapped = ["at(#0, in place of #1)", "at(#1, in place of #0)"];
    for text in [
        "Swap the red cube and the blue cube.",
        "Exchange the cube with the can.",
        "Trade the positions of the red cube and the green one.",
        "Please swap the places of the can and the cube.",
        "The red cube should be swapped with the blue cube.",
    ] {
        assert_eq!(outline(text), swapped, "{text}");
    }
    let after = ["press(#0) x1", "at(#1, in place of #2)", "at(#2, in place of #1)"];
    assert_eq!(outline("Swap the red cube and the blue cube after pressing the button."), after);
    for text in ["Swap the cube.", "Swap the cube and the cube.", "Swap the cubes and the can."] {
        assert!(parse(text).is_err(), "{text}");
    }
}

#[test]
fn an_unknown_noun_is_named_with_its_span() {
    let text = "Bring the coffee machine to the middle.";
    let error = parse(text).unwrap_err();
    assert!(
        matches!(&error, ParseError::UnknownNoun { text, known, .. } if text == "coffee machine" && known.contains("cube"))
    );
    assert_eq!(error.span().unwrap().of(text), "coffee machine");
    assert!(parse("Bring the cubo to the middle.").unwrap_err().to_string().contains("did you mean `cube`"));
    let text = "Put the red cube on the banana, then press the button.";
    assert_eq!(parse(text).unwrap_err().span().unwrap().of(text), "banana");
}

#[test]
fn a_typing_error_is_read_as_what_it_nearly_is_and_that_is_kept() {
    let text = "Bring the cbue to the mddle, press the buton, then return it to where it came from.";
    let task = parse(text).unwrap();
    assert_eq!(task.outline(), outline(CANONICAL));
    let corrections: Vec<(&str, &str)> =
        task.corrections.iter().map(|correction| (correction.span.of(text), correction.read.as_str())).collect();
    assert_eq!(corrections, [("cbue", "cube"), ("mddle", "middle"), ("buton", "button")]);
    assert_eq!(parse(CANONICAL).unwrap().corrections, []);
}

#[test]
fn what_cannot_be_read_is_named_and_never_skipped() {
    for (text, span) in [
        ("Juggle the cube.", "Juggle"),
        ("Press the button until it sings.", "until"),
        ("Bring the cube to the middle, press the button, then sing.", "sing"),
        ("Put the cube somewhere.", "somewhere"),
    ] {
        let error = parse(text).unwrap_err();
        assert_eq!(error.span().unwrap().of(text), span, "{text}: {error}");
    }
}

#[test]
fn what_is_read_but_cannot_be_done_says_why() {
    for (text, span, why) in [
        ("Press the cube.", "the cube", "function press"),
        ("Pick up the mat.", "the mat", "picked up"),
        ("Put the cube on the button.", "the button", "carry"),
        ("Put the cube on the mats.", "on the mats", "say which one"),
        ("Put the cube on the left mat from left to right.", "from left to right", "no order"),
        ("Move the cube to the middle of the table.", "to the middle of the table", "how far it reaches"),
    ] {
        let error = parse(text).unwrap_err();
        assert!(matches!(error, ParseError::Unsupported { .. }), "{text}: {error}");
        assert_eq!(error.span().unwrap().of(text), span, "{text}");
        assert!(error.to_string().contains(why), "{error}");
    }
    assert!(matches!(parse("Put it on the left mat."), Err(ParseError::NoAntecedent { .. })));
    assert!(matches!(parse("Move the other cube to the middle."), Err(ParseError::NoAntecedent { .. })));
    assert_eq!(parse(" ,. "), Err(ParseError::Empty));
}

#[test]
fn pronouns_stand_for_what_the_verb_can_act_on() {
    let outline = outline("Put the red cube on the left mat, press the button, then pick it up and press it again.");
    assert_eq!(outline, ["at(#0, on #1)", "press(#2) x1", "holding(#0)", "press(#2) x1"]);
}

#[test]
fn the_order_of_doing_follows_after_and_before() {
    let put_back = ["at(#0, middle)", "press(#1) x1", "at(#0, BeforeMoved of #0)"];
    for text in [
        "Bring the cube to the middle; return it to where it came from after pressing the button.",
        "Before you return the cube to where it came from, bring it to the middle and press the button.",
        "Press the button after bringing the cube to the middle, then put it back.",
        "After bringing the cube to the middle and pressing the button, return it to where it came from.",
        "Bring the cube to the middle. Press the button. After pressing the button, return the cube to its mat.",
    ] {
        let lines = outline(text);
        assert_eq!(lines.len(), 3, "{text}: {lines:?}");
        let kinds: Vec<&str> = lines.iter().map(|line| line.split('(').next().unwrap()).collect();
        assert_eq!(kinds, ["at", "press", "at"], "{text}");
        assert!(lines[0].contains("middle") && lines[2].contains("BeforeMoved"), "{text}: {lines:?}");
    }
    assert_eq!(outline(CANONICAL), put_back);
}

#[test]
fn times_ordinals_and_negation_are_read() {
    assert_eq!(outline("Press the second button from the left twice, then the right button once.").len(), 2);
    assert_eq!(outline("Hit the button 3 times."), ["press(#0) x3"]);
    assert_eq!(outline("Give the button two pushes."), ["press(#0) x2"]);
    let task = parse("Put the red cube on the blue mat without touching the green cube.").unwrap();
    assert_eq!(task.untouched.len(), 1);
    assert_eq!(task.subtasks.len(), 1);
}

#[test]
fn nouns_and_colours_may_change_one_for_one() {
    let shape = outline(CANONICAL);
    for (noun, color, place) in [
        ("can", "green ", "pads"),
        ("box", "", "mats"),
        ("cylinder", "dark blue ", "mats"),
        ("disc", "purple ", "markers"),
    ] {
        let text = format!(
            "Bring the {color}{noun} to the middle of the {place}, press the switch, then return it to where it came from."
        );
        match parse(&text) {
            Ok(task) => assert_eq!(task.outline(), shape, "{text}"),
            Err(error) => panic!("{text}: {error}"),
        }
    }
}

#[test]
fn a_task_survives_being_sent_as_a_message() {
    let task = parse("Put the dark red cube on the second mat from the left, then bring it back.").unwrap();
    let text = serde_json::to_string(&task).unwrap();
    assert_eq!(serde_json::from_str::<Task>(&text).unwrap(), task);
}

/// A library with more kinds of things.
fn whole_library() -> &'static (Planner, TemplateLibrary) {
    static MIND: OnceLock<(Planner, TemplateLibrary)> = OnceLock::new();
    MIND.get_or_init(|| {
        let library = acm_memory::library_of(&acm_memory::library_groups()).unwrap();
        (Planner::new().unwrap(), library)
    })
}

fn wide(text: &str) -> Task {
    let (planner, library) = whole_library();
    let task = planner.parse(text, library).unwrap_or_else(|error| panic!("{text}\n  {error}"));
    let answer = serde_json::to_value(planner.answer(&task)).unwrap();
    assert_eq!(planner.understand(text, library, &answer).as_ref(), Ok(&task), "{text}");
    task
}

/// The wordings of a file, each with the instruction that it stands under.
fn wordings(file: &str) -> Vec<(&str, &str)> {
    let mut under = "";
    let mut wordings = Vec::new();
    for line in file.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        match line.strip_suffix(':') {
            Some(instruction) => under = instruction,
            None => wordings.push((under, line)),
        }
    }
    wordings
}

#[test]
fn instructions_of_a_published_suite_ask_for_what_they_say() {
    for (text, outline) in [
        (
            "Look at the block displayed on the bench; once it is hidden, raise its twin from the table.",
            vec!["await not visible(#0)", "holding(#1)"],
        ),
        (
            "Fill the free mat with the cube standing in the gap, hit the button once, then bring the other cube into the gap.",
            vec!["at(#0, on #1)", "press(#2) x1", "at(#3, middle)"],
        ),
        (
            "Exchange the two cubes using the spare tray, one cube at a time, never two in one tray; press when done.",
            vec!["at(#0, in place of #1)", "at(#1, in place of #0)", "press(#2) x1"],
        ),
        (
            "Let the two T pieces trade places so that each takes over the other's spot and heading.",
            vec!["at(#0, in place and heading of #1)", "at(#1, in place and heading of #0)"],
        ),
        (
            "Two cells and a holder with a dial: find the polarity that makes the dial move.",
            vec!["find Heading of #0 in #1 until moved(#2)"],
        ),
        (
            "Sort the cubes into the secret order; press after each new arrangement until it is accepted.",
            vec!["find Order of #0 by press(#1) x1 until accepted()"],
        ),
        (
            "Hide the cubes from left to right, then reveal red, green and blue in that order, parking each cover behind its cube.",
            vec![
                "each #0 from Left: covered(#0)",
                "each #0 as #1, #2, #3: not covered(#0) & at(#4, beside #0 Some(Back))",
            ],
        ),
        (
            "Read both cards; push the left key as often as the left card says and the middle key as often as the right card says, then confirm on the right.",
            vec!["press(#0) x shown by #1", "press(#2) x shown by #3", "press(#4) x1"],
        ),
    ] {
        assert_eq!(wide(text).outline(), outline, "{text}");
    }
}

#[test]
fn other_wordings_of_a_published_suite_ask_for_the_same() {
    for (instruction, wording) in wordings(include_str!("published.txt")) {
        assert_eq!(wide(wording).outline(), wide(instruction).outline(), "{wording}");
    }
}

/// How many of the wordings that the grammar was not written to are read as their instruction; the others must be errors,
/// never another task.
#[test]
fn unseen_wordings_are_read_alike_or_refused() {
    let (planner, library) = whole_library();
    let all = wordings(include_str!("published_unseen.txt"));
    let mut alike = 0;
    for (instruction, wording) in &all {
        match planner.parse(wording, library) {
            Ok(task) if task.outline() == wide(instruction).outline() => alike += 1,
            Ok(task) => println!("other: {wording}\n   {:?}", task.outline()),
            Err(error) => println!("refused: {wording}\n   {error}"),
        }
    }
    println!("{alike} of {} alike", all.len());
    assert!(2 * alike >= all.len(), "{alike} of {}", all.len());
}

#[test]
fn manners_are_read_as_such_and_not_dropped() {
    use acm_planner::task::MannerKind;
    let text =
        "Exchange the two cubes using the spare tray, one cube at a time, never two in one tray; press when done.";
    let kinds: Vec<MannerKind> = wide(text).manners.iter().map(|manner| manner.kind).collect();
    assert!(matches!(kinds[..], [MannerKind::Aside(_), MannerKind::OneAtATime, MannerKind::OneToAPlace]), "{kinds:?}");
}

#[test]
fn states_parts_containers_and_tools_are_read() {
    for (text, outline) in [
        (
            "Open the top drawer of the cabinet, put the bowl in it and close it.",
            vec!["open(#0)", "at(#1, in #0)", "not open(#0)"],
        ),
        ("Close the bottom drawer and open the top drawer.", vec!["not open(#0)", "open(#1)"]),
        ("Slice the loaf with the kitchen knife.", vec!["sliced(#0) by #1"]),
        (
            "Put the red cube, the blue cube and the mug in the tray.",
            vec!["at(#0, in #1)", "at(#2, in #1)", "at(#3, in #1)"],
        ),
        ("Put both cubes in the basket.", vec!["each #0: at(#0, in #1)"]),
        ("Put two cubes in the tray, one after the other.", vec!["each #0: at(#0, in #1)"]),
        ("Hide every cube from right to left.", vec!["each #0 from Right: covered(#0)"]),
        ("Put the bowl with the spoon in it on the tray.", vec!["at(#0, on #1)"]),
        ("Put the mug under the bench.", vec!["at(#0, under #1)"]),
    ] {
        let outline: Vec<String> = outline.into_iter().map(String::from).collect();
        let read = wide(text).outline();
        assert_eq!(read, outline, "{text}");
    }
    assert!(
        wide("Put two cubes in the tray.")
            .references
            .iter()
            .any(|r| r.quantity == acm_planner::task::Quantity::Count(2))
    );
    assert_eq!(wide("Put the bowl with the spoon in it on the tray.").references[0].phrase, "the spoon");
}

#[test]
fn what_a_moved_thing_holds_is_read_wherever_it_is_said() {
    for (text, held) in [
        ("Put a pot with a spatula and a ladle in the box.", 2),
        ("Put the pot with a spatula in it, on the mat.", 1),
        ("Put the pot on the mat with a spatula in it.", 1),
        ("Put a pot of eggs on the mat.", 1),
    ] {
        let task = wide(text);
        assert_eq!(task.outline().len(), 1, "{text}: {:?}", task.outline());
        let pot = task.references.iter().find(|known| known.noun.as_deref() == Some("pot")).unwrap();
        assert_eq!(pot.contains.len(), held, "{text}");
    }
    let (planner, library) = whole_library();
    let error = planner.parse("Put the pot with a drawer in it on the mat.", library).unwrap_err();
    assert!(error.to_string().contains("no kind of drawer that I know can be moved"), "{error}");
}

#[test]
fn what_is_said_of_several_things_is_said_of_each() {
    for text in [
        "Put the spatula plus the ladle in the box.",
        "Put the spatula along with the ladle in the box.",
        "Pick up the spatula and the ladle, put in the box.",
        "Pick up the spatula and the ladle and put them in the box.",
    ] {
        let task = wide(text);
        let noun = |index: usize| task.references[index].noun.clone().unwrap_or_default();
        let moved = |goal: &Goal| match goal {
            Goal::At { object, destination: Destination::In { reference } } => (noun(*object), noun(*reference)),
            other => panic!("{text}: {other:?}"),
        };
        let moves: Vec<(String, String)> = task.subtasks.iter().map(|subtask| moved(&subtask.goal)).collect();
        let expected = ["spatula", "ladle"].map(|noun| (noun.to_owned(), "box".to_owned()));
        assert_eq!(moves, expected, "{text}");
    }
}

#[test]
fn conditions_waits_and_loops_are_read() {
    for (text, outline) in [
        (
            "If the drawer is open, close it, otherwise open it and press the button.",
            vec!["if open(#0): not open(#0)", "if not open(#0): open(#0)", "if not open(#0): press(#1) x1"],
        ),
        ("Press the button unless the drawer is open.", vec!["if not open(#0): press(#1) x1"]),
        ("Press the button until the drawer is open.", vec!["press(#0) until open(#1)"]),
        ("Wait until the cube is not visible, then press the button.", vec!["await not visible(#0)", "press(#1) x1"]),
        ("Open the drawer. Once it is open, put the mug in it.", vec!["open(#0)", "at(#1, in #0)"]),
    ] {
        assert_eq!(wide(text).outline(), outline, "{text}");
    }
    // What hangs on one "if" is judged when the first of it is due.
    let task = wide("If the drawer is open, close it, otherwise open it and press the button.");
    let judged: Vec<Option<u32>> = task.subtasks.iter().map(|s| s.when.as_ref().unwrap().judged_at).collect();
    assert_eq!(judged, [None, Some(0), Some(0)]);
}

#[test]
fn what_was_done_with_a_thing_tells_it_from_others() {
    let task = wide("Put the cube you moved first back where it was, then press the button you pressed last.");
    let handled: Vec<(String, i32)> =
        task.references.iter().filter_map(|r| r.handled.as_ref()).map(|h| (h.effect.clone(), h.rank)).collect();
    assert_eq!(handled, [("at".to_owned(), 0), ("pressed".to_owned(), -1)]);
}

/// Words that the lexicon knows, so that the generated sentences get deep into the grammar.
const WORDS: [&str; 46] = [
    "if",
    "open",
    "until",
    "each",
    "two",
    "hide",
    "otherwise",
    "is",
    "left to right",
    "using",
    "both",
    "with",
    "bring",
    "put",
    "press",
    "return",
    "the",
    "a",
    "red",
    "left",
    "second",
    "cube",
    "mats",
    "button",
    "it",
    "its",
    "to",
    "on",
    "in",
    "of",
    "middle",
    "between",
    "and",
    "then",
    "where",
    "came",
    "from",
    "was",
    "back",
    "once",
    "after",
    ",",
    "before",
    "cube's",
    "place",
    "that is",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn reading_never_panics_on_arbitrary_text(text in "\\PC{0,300}") {
        if let Err(error) = parse(&text) {
            prop_assert!(!error.to_string().is_empty());
            let span = error.span();
            prop_assert!(span.is_none_or(|span| text.get(span.start..span.end).is_some()), "{error:?}");
        }
    }

    #[test]
    fn reading_never_panics_on_known_words_in_any_order(words in prop::collection::vec(0..WORDS.len(), 0..40)) {
        let text = words.iter().map(|&word| WORDS[word]).collect::<Vec<_>>().join(" ");
        if let Ok(task) = parse(&text) {
            let known = |index: usize| index < task.references.len();
            prop_assert!(task.subtasks.iter().all(|subtask| subtask.goal.references().into_iter().all(known)));
            prop_assert!(task.subtasks.len() <= acm_planner::language::MAX_CLAUSES);
        }
    }
}

#[test]
fn very_long_and_very_ambiguous_texts_are_refused() {
    assert!(matches!(parse(&"press the button ".repeat(1000)), Err(ParseError::TooLong { .. })));
    assert!(matches!(parse(&"press the button, ".repeat(40)), Err(ParseError::TooLong { .. })));
    let nested = format!("put the cube {} in the middle", "on the mat between the cube and the cube ".repeat(20));
    assert!(parse(&nested).is_err());
}
