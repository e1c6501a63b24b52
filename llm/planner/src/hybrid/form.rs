//! A task as a model writes it down: flat, every field there, things by their index.

use crate::{
    lexicon::Lexicon,
    task::{
        Condition, Destination, Direction, Goal, Manner, MannerKind, ObjectReference, Ordering, Quantity, Rank, Size,
        Span, Task, Times, Variation,
    },
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
    pub(super) manners: Vec<MannerForm>,
    pub(super) unclear: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ThingForm {
    pub phrase: String,
    pub occurrence: Option<usize>,
    pub quantity: QuantityForm,
    pub count: Option<u32>,
    pub noun: Option<String>,
    pub color: Option<String>,
    pub shade: Option<String>,
    pub size: Option<Size>,
    pub rank: Option<u32>,
    pub rank_from: Option<RankFrom>,
    pub free: bool,
    pub located: Option<PlaceForm>,
    pub other_than: Vec<usize>,
    pub part_of: Option<usize>,
    pub twin_of: Option<usize>,
    pub contains: Vec<usize>,
    pub states: Vec<StateForm>,
    pub handled: Option<HandledForm>,
    pub function: Option<String>,
    pub affordance: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StepForm {
    pub words: String,
    pub occurrence: Option<usize>,
    /// The step that this one is a part of: what is done with each of a group, or to try.
    pub part_of: Option<usize>,
    pub goal: GoalForm,
    pub thing: Option<usize>,
    pub to: Option<PlaceForm>,
    pub function: Option<String>,
    pub times: Option<u32>,
    pub times_shown_by: Option<usize>,
    pub state: Option<StateForm>,
    pub by: Option<usize>,
    pub order_from: Option<Direction>,
    pub order_named: Vec<usize>,
    pub vary: Option<Variation>,
    pub until: Option<ConditionForm>,
    pub only_if: Option<ConditionForm>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StateForm {
    pub predicate: String,
    pub holds: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConditionForm {
    pub predicate: String,
    pub things: Vec<usize>,
    pub holds: bool,
    pub judged_at: Option<u32>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HandledForm {
    pub effect: String,
    pub rank: i32,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MannerForm {
    pub words: String,
    pub occurrence: Option<usize>,
    pub kind: MannerWord,
    pub thing: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum MannerWord {
    OneAtATime,
    OneToAPlace,
    Aside,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum QuantityForm {
    TheOne,
    AnyOne,
    Group,
    Count,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceForm {
    pub kind: PlaceKind,
    pub thing: Option<usize>,
    pub second: Option<usize>,
    pub side: Option<Direction>,
    pub past: Option<Past>,
    pub heading: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PlaceKind {
    On,
    In,
    Under,
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
    Up,
    Down,
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
            RankFrom::Up => Some(Direction::Up),
            RankFrom::Down => Some(Direction::Down),
            RankFrom::Middle => None,
        }
    }
    fn of(side: Direction) -> RankFrom {
        match side {
            Direction::Left => RankFrom::Left,
            Direction::Right => RankFrom::Right,
            Direction::Front => RankFrom::Front,
            Direction::Back => RankFrom::Back,
            Direction::Up => RankFrom::Up,
            Direction::Down => RankFrom::Down,
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
    State,
    Each,
    Find,
    Await,
}

impl TaskForm {
    /// The answer that stands for a task.
    pub(crate) fn new(lexicon: &Lexicon, task: &Task) -> TaskForm {
        let text = &task.instruction;
        let mut steps = Vec::new();
        for subtask in &task.subtasks {
            StepForm::push(&mut steps, text, subtask.span, &subtask.goal, None);
            // The step that stands for the whole is the first one pushed: its parts have none of their own.
            let whole = steps.iter_mut().rev().find(|step| step.part_of.is_none());
            if let (Some(whole), Some(condition)) = (whole, &subtask.when) {
                whole.only_if = Some(ConditionForm::new(condition));
            }
        }
        TaskForm {
            things: task.references.iter().map(|reference| ThingForm::new(lexicon, text, reference)).collect(),
            steps,
            untouched: task.untouched.clone(),
            manners: task.manners.iter().map(|manner| MannerForm::new(text, manner)).collect(),
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
        let (quantity, count) = match reference.quantity {
            Quantity::TheOne => (QuantityForm::TheOne, None),
            Quantity::AnyOne => (QuantityForm::AnyOne, None),
            Quantity::Group => (QuantityForm::Group, None),
            Quantity::Count(count) => (QuantityForm::Count, Some(count)),
        };
        ThingForm {
            phrase: reference.phrase.clone(),
            occurrence: occurrence(text, reference.span),
            quantity,
            count,
            noun: reference.noun.clone(),
            color: reference.color.as_ref().map(|color| color.name.clone()),
            shade: shade.map(|(word, _)| word.to_owned()),
            size: reference.size,
            rank,
            rank_from,
            free: reference.free,
            located: reference.located.as_deref().map(PlaceForm::new),
            other_than: reference.other_than.clone(),
            part_of: reference.part_of,
            twin_of: reference.twin_of,
            contains: reference.contains.clone(),
            states: reference.states.iter().map(|(predicate, holds)| StateForm::new(predicate, *holds)).collect(),
            handled: reference
                .handled
                .as_ref()
                .map(|handled| HandledForm { effect: handled.effect.clone(), rank: handled.rank }),
            function: reference.function.clone(),
            affordance: reference.affordance.clone(),
        }
    }
}

impl StepForm {
    /// The step of a goal, and behind it those of the goals within it.
    fn push(steps: &mut Vec<StepForm>, text: &str, span: Span, goal: &Goal, part_of: Option<usize>) {
        let index = steps.len();
        let mut step = StepForm {
            words: span.of(text).to_owned(),
            occurrence: occurrence(text, span),
            part_of,
            goal: GoalForm::At,
            thing: goal.object(),
            to: None,
            function: None,
            times: None,
            times_shown_by: None,
            state: None,
            by: None,
            order_from: None,
            order_named: Vec::new(),
            vary: None,
            until: None,
            only_if: None,
        };
        let mut within: Vec<&Goal> = Vec::new();
        match goal {
            Goal::At { destination, .. } => step.to = Some(PlaceForm::new(destination)),
            Goal::Holding { held, .. } => step.goal = if *held { GoalForm::Holding } else { GoalForm::PutDown },
            Goal::Performed { function, times, .. } => {
                step.goal = GoalForm::Performed;
                step.function = Some(function.clone());
                match times {
                    Times::Count(count) => step.times = Some(*count),
                    Times::Shown(by) => step.times_shown_by = Some(*by),
                    Times::Until(condition) => step.until = Some(ConditionForm::new(condition)),
                }
            }
            Goal::State { predicate, holds, by, .. } => {
                step.goal = GoalForm::State;
                step.by = *by;
                step.state = Some(StateForm::new(predicate, *holds));
            }
            Goal::Each { order, body, .. } => {
                step.goal = GoalForm::Each;
                match order {
                    Ordering::Any => {}
                    Ordering::From(side) => step.order_from = Some(*side),
                    Ordering::Named(named) => step.order_named.clone_from(named),
                }
                within.extend(body);
            }
            Goal::Find { vary, within: place, probe, sign, .. } => {
                step.goal = GoalForm::Find;
                step.vary = Some(*vary);
                step.to = place.as_ref().map(PlaceForm::new);
                step.until = sign.as_ref().map(ConditionForm::new);
                within.extend(probe.as_deref());
            }
            Goal::Await { condition } => {
                step.goal = GoalForm::Await;
                step.until = Some(ConditionForm::new(condition));
            }
        }
        steps.push(step);
        for goal in within {
            StepForm::push(steps, text, span, goal, Some(index));
        }
    }
}

impl StateForm {
    fn new(predicate: &str, holds: bool) -> StateForm {
        StateForm { predicate: predicate.to_owned(), holds }
    }
}

impl ConditionForm {
    fn new(condition: &Condition) -> ConditionForm {
        ConditionForm {
            predicate: condition.predicate.clone(),
            things: condition.arguments.clone(),
            holds: !condition.negated,
            judged_at: condition.judged_at,
        }
    }
}

impl MannerForm {
    fn new(text: &str, manner: &Manner) -> MannerForm {
        let (kind, thing) = match manner.kind {
            MannerKind::OneAtATime => (MannerWord::OneAtATime, None),
            MannerKind::OneToAPlace => (MannerWord::OneToAPlace, None),
            MannerKind::Aside(place) => (MannerWord::Aside, Some(place)),
        };
        MannerForm { words: manner.span.of(text).to_owned(), occurrence: occurrence(text, manner.span), kind, thing }
    }
}

impl PlaceForm {
    fn new(destination: &Destination) -> PlaceForm {
        let plain = |kind, thing| PlaceForm { kind, thing, second: None, side: None, past: None, heading: false };
        match destination {
            Destination::On { reference } => plain(PlaceKind::On, Some(*reference)),
            Destination::In { reference } => plain(PlaceKind::In, Some(*reference)),
            Destination::Under { reference } => plain(PlaceKind::Under, Some(*reference)),
            Destination::Middle { of } => plain(PlaceKind::Middle, *of),
            Destination::Between { first, second } => {
                PlaceForm { second: Some(*second), ..plain(PlaceKind::Between, Some(*first)) }
            }
            Destination::Beside { reference, side } => {
                PlaceForm { side: *side, ..plain(PlaceKind::Beside, Some(*reference)) }
            }
            Destination::Exchanged { with, heading, .. } => {
                PlaceForm { heading: *heading, ..plain(PlaceKind::InPlaceOf, Some(*with)) }
            }
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
