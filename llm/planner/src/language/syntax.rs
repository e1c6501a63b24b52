//! What is read: phrases and clauses before their references are joined.

use crate::{
    lexicon::{FrameGoal, ModifierKind},
    task::{ColorTerm, Direction, Quantity, Rank, Size, Span},
};
use acm_memory::query::PlaceReference;

/// A phrase for a thing, as read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NounPhrase {
    pub span: Span,
    pub pronoun: Option<Pronoun>,
    pub quantity: Quantity,
    /// "each", "every": its clause is meant for one after the other.
    pub each: bool,
    /// "its cube": the thing that belongs to the one whose turn it is.
    pub its: bool,
    pub noun: Option<String>,
    /// The noun was left out or is "one": it is that of a thing named before.
    pub elided: bool,
    pub color: Option<ColorTerm>,
    pub size: Option<Size>,
    pub rank: Option<Rank>,
    pub free: bool,
    pub other: bool,
    /// "the same".
    pub same: bool,
    /// "from the table": somewhere that nobody knows the borders of.
    pub somewhere: bool,
    pub states: Vec<(String, bool)>,
    pub located: Option<Box<PlacePhrase>>,
    pub part_of: Option<Box<NounPhrase>>,
    pub twin_of: Option<Box<NounPhrase>>,
    pub contains: Vec<NounPhrase>,
    /// "you took first": the verb's frame and which one in time.
    pub handled: Option<(usize, i32)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pronoun {
    One,
    Several,
}

/// A phrase for a place, as read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlacePhrase {
    pub span: Span,
    pub kind: PlaceKind,
}

/// What a preposition says of a thing as a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Relation {
    On,
    In,
    Under,
    /// "to the box": on it or in it, as it is made.
    To,
}

#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a clause has one place: a box would save nothing that counts")]
pub(super) enum PlaceKind {
    At(NounPhrase, Relation),
    Middle(Option<NounPhrase>),
    /// "the middle of the table": nothing that memory knows the extent of.
    MiddleOfWhole,
    Between(NounPhrase, NounPhrase),
    Beside(NounPhrase, Option<Direction>),
    History(Option<NounPhrase>, PlaceReference),
}

/// A statement about things that may hold or not.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Statement {
    pub span: Span,
    pub predicate: String,
    pub negated: bool,
    /// What it is said of; `None` for what is said of the moment ("it is accepted").
    pub about: Option<NounPhrase>,
    /// With a place for a predicate: `on`, `in`.
    pub place: Option<PlacePhrase>,
}

/// What follows a clause and says how it is meant.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Modifier {
    pub span: Span,
    pub kind: ModifierKind,
    pub thing: Option<NounPhrase>,
    pub condition: Option<Statement>,
    pub side: Option<Direction>,
    /// Whether what takes another one's place takes over its heading.
    pub heading: bool,
    /// What it names one after the other.
    pub list: Vec<NounPhrase>,
    /// Index of its form among the lexicon's.
    pub form: usize,
}

/// A clause as read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Clause {
    pub span: Span,
    pub goal: FrameGoal,
    pub object: Option<NounPhrase>,
    /// More objects: "the red cube and the blue one".
    pub also: Vec<NounPhrase>,
    pub place: Option<PlacePhrase>,
    pub tool: Option<NounPhrase>,
    pub condition: Option<Statement>,
    pub history: Option<PlaceReference>,
    pub times: Option<u32>,
    pub modifiers: Vec<Modifier>,
    /// The verb frame, for a clause that leaves its verb out, and its form.
    pub frame: usize,
    pub form: usize,
}

/// Where a clause belongs among those read before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// After them.
    Last,
    /// Just before the last one.
    BeforeLast,
}

/// The "if" on which a clause hangs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Guard {
    pub condition: Statement,
    /// Under "otherwise".
    pub otherwise: bool,
    /// Number of the "if".
    pub number: usize,
}

/// What was read, in the order of the text.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Sentence {
    /// To be done. A background clause ("after pressing the button") adds nothing if it was said before.
    Do { clause: Box<Clause>, order: Order, background: bool, guard: Option<Box<Guard>> },
    /// Not to be touched.
    Leave { object: Box<NounPhrase> },
    /// Things that are there.
    There { things: Vec<NounPhrase> },
    /// Something that must hold before what follows ("once it is hidden").
    Once { condition: Box<Statement>, trails: bool },
    /// What is said of the clause before, in a clause of its own.
    Manner { modifier: Box<Modifier> },
}

impl NounPhrase {
    /// How many places the phrase and those within it name to tell things apart.
    pub fn places_named(&self) -> usize {
        let of = |phrase: &NounPhrase| 1 + phrase.places_named();
        self.located.as_ref().map_or(0, |place| 1 + place.places_named())
            + self.part_of.as_deref().map_or(0, of)
            + self.contains.iter().map(of).max().unwrap_or_default()
    }
    /// Whether it names several things.
    pub fn several(&self) -> bool {
        self.pronoun == Some(Pronoun::Several) || matches!(self.quantity, Quantity::Group | Quantity::Count(_))
    }
}

impl PlacePhrase {
    /// See [`NounPhrase::places_named`].
    pub fn places_named(&self) -> usize {
        match &self.kind {
            PlaceKind::At(phrase, _) | PlaceKind::Beside(phrase, _) => phrase.places_named(),
            PlaceKind::Between(first, second) => first.places_named() + second.places_named(),
            PlaceKind::Middle(group) => group.as_ref().map_or(0, NounPhrase::places_named),
            PlaceKind::History(owner, _) => owner.as_ref().map_or(0, NounPhrase::places_named),
            PlaceKind::MiddleOfWhole => 0,
        }
    }
}

impl Clause {
    /// See [`NounPhrase::places_named`].
    pub fn places_named(&self) -> usize {
        self.object.as_ref().map_or(0, NounPhrase::places_named)
            + self.also.iter().map(NounPhrase::places_named).sum::<usize>()
            + self.place.as_ref().map_or(0, PlacePhrase::places_named)
    }
    /// The side at which a group is begun, with the modifier that says so.
    pub fn order_side(&self) -> Option<(&Modifier, Direction)> {
        let orders = self.modifiers.iter().filter(|modifier| modifier.kind == ModifierKind::Order);
        orders.filter_map(|modifier| Some((modifier, modifier.side?))).next()
    }
    /// The modifier that says that things are taken as they are named.
    pub fn as_named(&self) -> Option<&Modifier> {
        self.modifiers.iter().find(|modifier| modifier.kind == ModifierKind::Order && modifier.side.is_none())
    }
    /// The modifier of a kind, if the clause has one.
    pub fn modifier(&self, kind: ModifierKind) -> Option<&Modifier> {
        self.modifiers.iter().find(|modifier| modifier.kind == kind)
    }
}
