//! A task as a model writes it down: flat, every field there, things by their index.

use crate::{
    lexicon::Lexicon,
    task::{Destination, Direction, Goal, ObjectReference, Quantity, Rank, Size, Span, Task},
};
use acm_memory::query::PlaceReference;
use serde::{Deserialize, Serialize};

/// An instruction as a model reads it: `prompts/parse.schema.json` describes each field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskForm {
    pub(super) things: Vec<ThingForm>,
    pub(super) steps: Vec<StepForm>,
    pub(super) untouched: Vec<usize>,
    pub(super) unclear: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ThingForm {
    pub phrase: String,
    pub occurrence: Option<usize>,
    pub quantity: Quantity,
    pub noun: Option<String>,
    pub color: Option<String>,
    pub shade: Option<String>,
    pub size: Option<Size>,
    pub rank: Option<u32>,
    pub rank_from: Option<RankFrom>,
    pub free: bool,
    pub located: Option<PlaceForm>,
    pub other_than: Vec<usize>,
    pub function: Option<String>,
    pub affordance: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StepForm {
    pub words: String,
    pub occurrence: Option<usize>,
    pub goal: GoalForm,
    pub thing: usize,
    pub to: Option<PlaceForm>,
    pub function: Option<String>,
    pub times: Option<u32>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceForm {
    pub kind: PlaceKind,
    pub thing: Option<usize>,
    pub second: Option<usize>,
    pub side: Option<Direction>,
    pub past: Option<Past>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PlaceKind {
    On,
    Middle,
    Between,
    Beside,
    InPlaceOf,
    Past,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Past {
    BeforeMoved,
    AtStart,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RankFrom {
    Left,
    Right,
    Front,
    Back,
    Middle,
}

impl RankFrom {
    /// The side; `None` for the middle.
    pub(super) fn side(self) -> Option<Direction> {
        match self {
            RankFrom::Left => Some(Direction::Left),
            RankFrom::Right => Some(Direction::Right),
            RankFrom::Front => Some(Direction::Front),
            RankFrom::Back => Some(Direction::Back),
            RankFrom::Middle => None,
        }
    }
    fn of(side: Direction) -> RankFrom {
        match side {
            Direction::Left => RankFrom::Left,
            Direction::Right => RankFrom::Right,
            Direction::Front => RankFrom::Front,
            Direction::Back => RankFrom::Back,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum GoalForm {
    At,
    Holding,
    PutDown,
    Performed,
}

impl TaskForm {
    /// The answer that stands for a task.
    pub(crate) fn new(lexicon: &Lexicon, task: &Task) -> TaskForm {
        let text = &task.instruction;
        TaskForm {
            things: task.references.iter().map(|reference| ThingForm::new(lexicon, text, reference)).collect(),
            steps: task.subtasks.iter().map(|subtask| StepForm::new(text, subtask.span, &subtask.goal)).collect(),
            untouched: task.untouched.clone(),
            unclear: None,
        }
    }
}

impl ThingForm {
    fn new(lexicon: &Lexicon, text: &str, reference: &ObjectReference) -> ThingForm {
        let shade = reference.color.as_ref().and_then(|color| {
            let fits = |lightness| lexicon.shaded(&color.name, lightness).as_ref() == Some(color);
            lexicon.shade_words().find(|(_, lightness)| !fits(0.0) && fits(*lightness))
        });
        let (rank, rank_from) = match reference.rank {
            None => (None, None),
            Some(Rank::FromSide(number, side)) => (Some(number + 1), Some(RankFrom::of(side))),
            Some(Rank::Middle) => (None, Some(RankFrom::Middle)),
        };
        ThingForm {
            phrase: reference.phrase.clone(),
            occurrence: occurrence(text, reference.span),
            quantity: reference.quantity,
            noun: reference.noun.clone(),
            color: reference.color.as_ref().map(|color| color.name.clone()),
            shade: shade.map(|(word, _)| word.to_owned()),
            size: reference.size,
            rank,
            rank_from,
            free: reference.free,
            located: reference.located.as_deref().map(PlaceForm::new),
            other_than: reference.other_than.clone(),
            function: reference.function.clone(),
            affordance: reference.affordance.clone(),
        }
    }
}

impl StepForm {
    fn new(text: &str, span: Span, goal: &Goal) -> StepForm {
        let (kind, to, function, times) = match goal {
            Goal::At { destination, .. } => (GoalForm::At, Some(PlaceForm::new(destination)), None, None),
            Goal::Holding { held: true, .. } => (GoalForm::Holding, None, None, None),
            Goal::Holding { held: false, .. } => (GoalForm::PutDown, None, None, None),
            Goal::Performed { function, times, .. } => {
                (GoalForm::Performed, None, Some(function.clone()), Some(*times))
            }
        };
        let (words, occurrence) = (span.of(text).to_owned(), occurrence(text, span));
        StepForm { words, occurrence, goal: kind, thing: goal.object(), to, function, times }
    }
}

impl PlaceForm {
    fn new(destination: &Destination) -> PlaceForm {
        let plain = |kind, thing| PlaceForm { kind, thing, second: None, side: None, past: None };
        match destination {
            Destination::On { reference } => plain(PlaceKind::On, Some(*reference)),
            Destination::Middle { of } => plain(PlaceKind::Middle, *of),
            Destination::Between { first, second } => {
                PlaceForm { second: Some(*second), ..plain(PlaceKind::Between, Some(*first)) }
            }
            Destination::Beside { reference, side } => {
                PlaceForm { side: *side, ..plain(PlaceKind::Beside, Some(*reference)) }
            }
            Destination::Exchanged { with, .. } => plain(PlaceKind::InPlaceOf, Some(*with)),
            Destination::History { object, reference } => {
                let past = match reference {
                    PlaceReference::BeforeMoved => Some(Past::BeforeMoved),
                    PlaceReference::AtStart => Some(Past::AtStart),
                    // No instruction asks for it: the place of now is no place to bring things.
                    PlaceReference::Now => None,
                };
                PlaceForm { past, ..plain(PlaceKind::Past, Some(*object)) }
            }
        }
    }
}

/// Where words stand in a text.
pub(super) fn places<'a>(text: &'a str, words: &'a str) -> impl Iterator<Item = Span> + 'a {
    let starts = text.char_indices().map(|(at, _)| at);
    let here = move |at: &usize| text.get(*at..).is_some_and(|rest| rest.starts_with(words));
    starts.filter(here).map(|start| Span { start, end: start + words.len() })
}

/// Which occurrence of its words a span is, from 1; `None` for the first.
fn occurrence(text: &str, span: Span) -> Option<usize> {
    let number = 1 + places(text, span.of(text)).take_while(|place| place.start < span.start).count();
    (number > 1).then_some(number)
}
