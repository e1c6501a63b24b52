//! What an instruction asks for: goals over references that are resolved when their subtask is due.

mod words;

use acm_concept::{color::Lab, template::TemplateLibrary};
use acm_memory::query::PlaceReference;
use serde::{Deserialize, Serialize};

/// Bytes `start..end` of the instruction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// The smallest span that covers both.
    pub fn join(self, other: Span) -> Span {
        Span { start: self.start.min(other.start), end: self.end.max(other.end) }
    }
    /// The words of `text` that the span covers; empty if it does not fit the text.
    pub fn of(self, text: &str) -> &str {
        text.get(self.start..self.end).unwrap_or_default()
    }
}

/// An instruction as read: subtasks in the order in which they are to be done. It holds no knowledge of the
/// scene: the same task can be decided on against any memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The instruction as given.
    pub instruction: String,
    /// What is to be done, in order.
    pub subtasks: Vec<Subtask>,
    /// The things that the instruction speaks of; [`ReferenceIndex`] points here.
    pub references: Vec<ObjectReference>,
    /// Things that must not be acted on ("do not touch the blue cube").
    pub untouched: Vec<ReferenceIndex>,
    /// The library's nouns that the instruction uses, for the prior of perception.
    pub nouns: Vec<String>,
    /// What the instruction says of the way of doing it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub manners: Vec<Manner>,
    /// Words that were taken for typing errors, and what they were read as.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corrections: Vec<Correction>,
}

/// A word of an instruction that nobody knows, and the known word that it was read as.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Correction {
    /// As it is written.
    pub text: String,
    /// Where it stands in the instruction.
    pub span: Span,
    /// What it was read as.
    pub read: String,
}

impl std::fmt::Display for Correction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}` is no word that I know and was read as `{}`", self.text, self.read)
    }
}

/// What an instruction says of the way of doing it: it asks for no goal of its own.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manner {
    /// Where the words stand in the instruction.
    pub span: Span,
    /// What they say.
    pub kind: MannerKind,
}

/// Kinds of [`Manner`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MannerKind {
    /// One thing after the other ("one cube at a time"): a hand that holds one thing does so anyway.
    OneAtATime,
    /// Never two things in one place: no plan puts a thing where another one stands.
    OneToAPlace,
    /// A place for what has to be put aside ("using the spare tray").
    Aside(ReferenceIndex),
}

/// Index into [`Task::references`]. Two phrases that mean the same thing have the same index.
pub type ReferenceIndex = usize;

/// One thing to bring about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Subtask {
    /// The words that ask for it.
    pub text: String,
    /// Where they stand in the instruction.
    pub span: Span,
    /// What shall be so.
    pub goal: Goal,
    /// What must hold for the subtask to be done; where it does not, nothing is done ("if the drawer is open, close it").
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub when: Option<Condition>,
}

/// A statement about things that is so or is not: `predicate(arguments)`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Condition {
    /// A predicate of [literals](https://docs.rs/acm-concept): `open`, `on`, `visible`.
    pub predicate: String,
    /// What it is said of.
    pub arguments: Vec<ReferenceIndex>,
    /// Whether it must not hold.
    pub negated: bool,
    /// The subtask at whose beginning it is judged, where that is not the moment at which it is asked: what depends on
    /// one "if" is judged once, and so is its "otherwise".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged_at: Option<u32>,
}

/// How often something is done.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Times {
    /// A number that the instruction names.
    Count(u32),
    /// The number that a thing shows ("as often as the card says").
    Shown(ReferenceIndex),
    /// Again and again until something holds ("until the lid is open").
    Until(Condition),
}

/// In which order the members of a group are taken.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ordering {
    /// Any.
    Any,
    /// Beginning at a side ("from left to right").
    From(Direction),
    /// One after the other as named: each is a description of one member ("red, green and blue in that order").
    Named(Vec<ReferenceIndex>),
}

/// What is varied from try to try, where the instruction does not say which one is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variation {
    /// Which member of the group stands where: the places are those on which they stand at the start.
    Order,
    /// Which way round each member lies, by half a turn about the vertical.
    Heading,
    /// Which member it is.
    Choice,
}

/// What a subtask brings about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Goal {
    /// The object stands at a destination.
    At {
        /// What is moved.
        object: ReferenceIndex,
        /// Where to.
        destination: Destination,
    },
    /// The object is in the hand, or no longer is.
    Holding {
        /// What is held.
        object: ReferenceIndex,
        /// Whether it shall be so.
        held: bool,
    },
    /// A function has been performed on the object a number of times since the subtask began.
    Performed {
        /// Name of the function: `press`.
        function: String,
        /// What it is performed on.
        object: ReferenceIndex,
        /// How often.
        times: Times,
    },
    /// A predicate holds of the object, or does not: `open`, `switched-on`, `sliced`.
    State {
        /// The predicate.
        predicate: String,
        /// What it is said of.
        object: ReferenceIndex,
        /// Whether it shall be so.
        holds: bool,
        /// What it is done with ("with the knife", "in the microwave"), if that is said.
        by: Option<ReferenceIndex>,
    },
    /// The goals of the body, one after the other, for each member of a group, one member at a time. In the body the
    /// group's index means the member whose turn it is.
    Each {
        /// The group.
        members: ReferenceIndex,
        /// Who comes first.
        order: Ordering,
        /// What is done with each.
        body: Vec<Goal>,
    },
    /// Something about a group is varied until a sign shows, or, where no sign can be seen, until all has been tried.
    Find {
        /// What is varied.
        members: ReferenceIndex,
        /// How.
        vary: Variation,
        /// Where the members must be for a try to count ("in the holder"), if anywhere.
        within: Option<Destination>,
        /// What is done to try what stands there ("press after each new arrangement"), if anything.
        probe: Option<Box<Goal>>,
        /// What shows that it is right, if anything does.
        sign: Option<Condition>,
    },
    /// Nothing is done before the condition holds.
    Await {
        /// The condition.
        condition: Condition,
    },
}

impl Goal {
    /// The object that the goal is about; `None` where it is about nothing that is acted on.
    pub fn object(&self) -> Option<ReferenceIndex> {
        match self {
            Goal::At { object, .. }
            | Goal::Holding { object, .. }
            | Goal::Performed { object, .. }
            | Goal::State { object, .. } => Some(*object),
            Goal::Each { members, .. } | Goal::Find { members, .. } => Some(*members),
            Goal::Await { .. } => None,
        }
    }
    /// All things that the goal names, without those that only describe them.
    pub fn references(&self) -> Vec<ReferenceIndex> {
        let mut named: Vec<ReferenceIndex> = self.object().into_iter().collect();
        let condition = |condition: &Option<Condition>| condition.iter().flat_map(|c| c.arguments.clone()).collect();
        let more: Vec<ReferenceIndex> = match self {
            Goal::At { destination, .. } => destination.references(),
            Goal::Performed { times: Times::Shown(by), .. } => vec![*by],
            Goal::Performed { times: Times::Until(until), .. } => until.arguments.clone(),
            Goal::State { by, .. } => by.iter().copied().collect(),
            Goal::Holding { .. } | Goal::Performed { .. } => Vec::new(),
            Goal::Each { order, body, .. } => {
                let named = if let Ordering::Named(named) = order { named.clone() } else { Vec::new() };
                named.into_iter().chain(body.iter().flat_map(Goal::references)).collect()
            }
            Goal::Find { within, probe, sign, .. } => {
                let mut more: Vec<ReferenceIndex> = condition(sign);
                more.extend(within.iter().flat_map(Destination::references));
                more.extend(probe.iter().flat_map(|probe| probe.references()));
                more
            }
            Goal::Await { condition } => condition.arguments.clone(),
        };
        named.extend(more);
        named
    }
    /// Whether reaching the goal may move its object.
    pub fn moves(&self) -> bool {
        match self {
            Goal::At { .. } | Goal::Holding { .. } => true,
            Goal::Each { body, .. } => body.iter().any(Goal::moves),
            Goal::Find { vary, .. } => matches!(vary, Variation::Order | Variation::Heading),
            Goal::Performed { .. } | Goal::State { .. } | Goal::Await { .. } => false,
        }
    }
}

/// Where something shall come to stand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Destination {
    /// On top of a thing, at its centre.
    On {
        /// The thing.
        reference: ReferenceIndex,
    },
    /// Inside a thing that contains: a box, a drawer, a basket.
    In {
        /// The thing.
        reference: ReferenceIndex,
    },
    /// Below a thing, covered by it or under its top.
    Under {
        /// The thing.
        reference: ReferenceIndex,
    },
    /// In the middle of a group of things; without a group, of the largest group of like places.
    Middle {
        /// The group.
        of: Option<ReferenceIndex>,
    },
    /// Half way between two things.
    Between {
        /// One of them.
        first: ReferenceIndex,
        /// The other.
        second: ReferenceIndex,
    },
    /// Beside a thing.
    Beside {
        /// The thing.
        reference: ReferenceIndex,
        /// On which side; `None` for any.
        side: Option<Direction>,
    },
    /// Where a thing stood before the two changed places. An exchange is two goals in a row, one for each.
    Exchanged {
        /// The thing.
        with: ReferenceIndex,
        /// Whether this is the first of the two.
        first: bool,
        /// Whether it also takes over the other's heading.
        heading: bool,
    },
    /// Where an object was.
    History {
        /// The object.
        object: ReferenceIndex,
        /// Which of its places.
        reference: PlaceReference,
    },
}

impl Destination {
    /// The things that it names.
    pub fn references(&self) -> Vec<ReferenceIndex> {
        match self {
            Destination::On { reference }
            | Destination::In { reference }
            | Destination::Under { reference }
            | Destination::Beside { reference, .. } => vec![*reference],
            Destination::Middle { of } => of.iter().copied().collect(),
            Destination::Between { first, second } => vec![*first, *second],
            Destination::Exchanged { with, .. } => vec![*with],
            Destination::History { object, .. } => vec![*object],
        }
    }
}

/// A direction as seen by somebody who stands behind the robot's base: world x points right, world y away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Towards negative x.
    Left,
    /// Towards positive x.
    Right,
    /// Near, towards negative y.
    Front,
    /// Far, towards positive y.
    Back,
    /// High: towards positive z.
    Up,
    /// Low: towards negative z.
    Down,
}

impl Direction {
    /// The unit vector in the world.
    pub fn vector(self) -> glam::DVec3 {
        match self {
            Direction::Left => glam::DVec3::NEG_X,
            Direction::Right => glam::DVec3::X,
            Direction::Front => glam::DVec3::NEG_Y,
            Direction::Back => glam::DVec3::Y,
            Direction::Up => glam::DVec3::Z,
            Direction::Down => glam::DVec3::NEG_Z,
        }
    }
}

/// How many things a phrase means.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// The one that fits: more than one is ambiguous.
    #[default]
    TheOne,
    /// Any one that fits.
    AnyOne,
    /// All that fit, as a group.
    Group,
    /// So many of those that fit, whichever.
    Count(u32),
}

/// A choice by size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    /// The largest by volume.
    Large,
    /// The smallest by volume.
    Small,
}

/// A colour word with its meaning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ColorTerm {
    /// The word's main form.
    pub name: String,
    /// Prototype.
    pub lab: Lab,
    /// How far from the prototype a surface may look, CIE76 delta E.
    pub delta_e: f64,
}

/// A choice by rank along a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rank {
    /// The n-th, counted from 0, starting at the given side.
    FromSide(u32, Direction),
    /// The one nearest to the middle of its kind.
    Middle,
}

/// A description of a thing. Positions in it ("left", "on the mat") are meant as they were when the subtask
/// `subtask` began, so that a description stays true of what was moved because of it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectReference {
    /// The words.
    pub phrase: String,
    /// Where they stand in the instruction.
    pub span: Span,
    /// The subtask that introduced the thing.
    pub subtask: u32,
    /// How many are meant.
    pub quantity: Quantity,
    /// The library's noun; `None` for words like "thing".
    pub noun: Option<String>,
    /// Function that it must offer.
    pub function: Option<String>,
    /// Affordance that it must have.
    pub affordance: Option<String>,
    /// Colour.
    pub color: Option<ColorTerm>,
    /// Choice by size.
    pub size: Option<Size>,
    /// Choice by place among those that fit.
    pub rank: Option<Rank>,
    /// Nothing stands on it.
    pub free: bool,
    /// Where it stood.
    pub located: Option<Box<Destination>>,
    /// Not these ("the other cube").
    pub other_than: Vec<ReferenceIndex>,
    /// What it is a part of ("the top drawer of the cabinet"): it is described among the parts of this thing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part_of: Option<ReferenceIndex>,
    /// What it looks like in shape and colour ("its twin"), without being it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twin_of: Option<ReferenceIndex>,
    /// What stands on it or lies in it ("the mat with the cube on it").
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contains: Vec<ReferenceIndex>,
    /// States that it must be in when it is due, and whether they must hold ("the open drawer", "a sliced apple").
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<(String, bool)>,
    /// Which one by what was done with it in this episode ("the one you took first").
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handled: Option<Handled>,
}

impl ObjectReference {
    /// The things that describe it.
    pub fn references(&self) -> Vec<ReferenceIndex> {
        let located = self.located.as_deref().map(Destination::references).unwrap_or_default();
        let wholes = self.part_of.into_iter().chain(self.twin_of);
        located.into_iter().chain(self.other_than.iter().copied()).chain(wholes).chain(self.contains.clone()).collect()
    }
}

/// A choice by what the agent did, from its own transitions.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Handled {
    /// The predicate that the deed brought about: `holding`, `at`, `open`, `pressed`.
    pub effect: String,
    /// Which one in time, counted from 0; from the last one if negative (-1).
    pub rank: i32,
}

/// "where X came from" and its like.
pub(crate) fn history_phrase(reference: PlaceReference, name: &str) -> String {
    match reference {
        PlaceReference::Now => format!("where {name} is now"),
        PlaceReference::BeforeMoved => format!("where {name} came from"),
        PlaceReference::AtStart => format!("where {name} was at the start"),
    }
}

/// Names of the library's functions that declare an effect with this predicate, without doubles.
pub(crate) fn functions_with_effect<'a>(library: &'a TemplateLibrary, predicate: &str) -> Vec<&'a str> {
    let mut names: Vec<&str> = library
        .iter()
        .flat_map(|template| &template.functions)
        .filter(|f| f.effects.iter().any(|effect| effect.predicate == predicate && !effect.negated))
        .map(|f| f.name.as_str())
        .collect();
    names.sort_unstable();
    names.dedup();
    names
}
