//! The events of which memory is the sum. What is decided is written, not what was read: a log stays readable
//! when the rules that decide are improved. The format is described in docs/memory-format.md.

use crate::{
    entry::{HistoryEntry, Moment, ObjectEntry, SkillEntry, TaskProgress, Transition, TransitionResult},
    hand::HandFeeling,
};
use acm_concept::{
    ids::{FrameId, ObjectId, TransitionId},
    literal::{Evidence, Literal},
    object::{GroundedPart, SupportPlane, Visibility},
    pose::Pose,
    time::Time,
};
use serde::{Deserialize, Serialize};

/// One change of memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// When it came to be believed.
    pub moment: Moment,
    /// Where it comes from.
    pub source: Source,
    /// What it rests on.
    pub evidence: Vec<Evidence>,
    /// The change.
    pub change: Change,
}

/// Where a change comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// A camera, by name.
    Camera(String),
    /// The robot's own report of what it did and felt.
    Robot,
    /// The agent that keeps this memory: its instruction, its progress, its verifier.
    Agent,
}

/// What changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// A run began.
    EpisodeBegan,
    /// The instruction was given.
    Instructed {
        /// The instruction.
        text: String,
    },
    /// A subtask was found done.
    SubtaskDone {
        /// Its index, from 0.
        index: u32,
    },
    /// A frame was taken.
    Frame(Glance),
    /// The surface on which things stand was seen.
    Support(SupportPlane),
    /// An object as it is believed from now on: new, or in place of what was believed. Its history is left out;
    /// while it stays where it is, the last entry of its history follows its pose.
    Object(Box<Believed>),
    /// An object's place changed.
    History {
        /// The object.
        object: ObjectId,
        /// What is added to its history.
        entry: HistoryEntry,
    },
    /// A skill was executed.
    Transition(Box<Transition>),
    /// A transition was compared with what was seen.
    Settled {
        /// The transition.
        transition: TransitionId,
        /// How it ended.
        result: TransitionResult,
        /// State literals after it.
        after: Vec<Literal>,
    },
    /// A skill entry as it is from now on; one without tries is dropped.
    Skill(Box<SkillEntry>),
    /// Skills must not rest on these transitions, or may again.
    TakenBack {
        /// The transitions.
        transitions: Vec<TransitionId>,
        /// Whether they may be rested on again.
        restored: bool,
    },
    /// Identities were merged or split, or that was undone.
    Regrouped(Box<Regrouping>),
    /// Some of memory was dropped.
    Forgotten(Forget),
    /// The log was written anew: the events before this one say what is still believed of objects, transitions and
    /// skills, and this one the rest.
    Compacted(Box<Rest>),
    /// Everything dynamic was dropped; ids go on where they were, so that none is ever given twice.
    Wiped(Counters),
}

/// An object without its history, with what memory tracks beside the entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Believed {
    /// The entry; its history is empty here.
    pub entry: ObjectEntry,
    /// The rest.
    pub track: Track,
}

/// What is known of an object beside its entry: the state of the tests that it still has to pass.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// How often in a row it was seen to be absent from its place.
    pub absences: u32,
    /// A view that contradicts the entry and has to be repeated before it is believed.
    pub pending: Option<Pending>,
    /// How it sits in the hand (base frame in the TCP frame), where it is held and that is known.
    pub grip: Option<Pose>,
    /// The own action that is believed to have left it here, until it is seen here.
    pub unconfirmed: Option<TransitionId>,
    /// Whether an own action may have shifted it since it was last seen.
    pub disturbed: bool,
    /// Where it stands as its first views in this place had it, and how many views that is the mean of. A thing that
    /// creeps away in steps below the noise leaves it.
    #[serde(default)]
    pub anchor: Option<Anchor>,
    /// Set while it may be another object than it is taken for.
    #[serde(default)]
    pub doubt: Option<Box<crate::identity::doubt::Doubt>>,
    /// What was read on it of late.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shown: Vec<crate::shown::Shown>,
    /// Its colour at first and now.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colored: Option<crate::shown::Colored>,
}

/// The spot at which an object came to stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Anchor {
    /// Position of the main part's base frame in the world, metres.
    pub position: glam::DVec3,
    /// How many views it is the mean of.
    pub views: u32,
}

impl Track {
    /// What is known of a thing that stands somewhere else now: what it shows goes with it.
    pub(crate) fn moved(&mut self) -> Track {
        Track { shown: std::mem::take(&mut self.shown), colored: self.colored, ..Track::default() }
    }
}

impl Anchor {
    /// From so many views on it stays where it is.
    const SETTLED: u32 = 8;

    /// The anchor with one more view.
    pub fn seen_at(anchor: Option<Anchor>, position: glam::DVec3) -> Anchor {
        match anchor {
            Some(anchor) if anchor.views >= Anchor::SETTLED => anchor,
            Some(Anchor { position: mean, views }) => {
                Anchor { position: mean + (position - mean) / f64::from(views + 1), views: views + 1 }
            }
            None => Anchor { position, views: 1 },
        }
    }
    /// Whether it is the mean of enough views to be held against another.
    pub fn is_settled(&self) -> bool {
        self.views >= Anchor::SETTLED / 2
    }
}

/// A view that contradicts what is believed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pending {
    /// The parts as that view has them.
    pub parts: Vec<GroundedPart>,
    /// How many views in a row agreed on it.
    pub views: u32,
}

/// A frame and what of it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Glance {
    /// The frame.
    pub frame: FrameId,
    /// Whether it showed anything.
    pub showed: bool,
    /// Pose of the hand when it was taken.
    pub tcp: Pose,
    /// What the fingers felt.
    pub hand: HandFeeling,
    /// What it said of the objects that were expected.
    pub visibility: Vec<(ObjectId, Visibility)>,
    /// How all that it showed was displaced, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displaced: Option<crate::observation::Displaced>,
}

/// Identities that were merged or split.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Regrouping {
    /// Its number in this memory, from 1.
    pub number: u32,
    /// What was done.
    pub what: Regrouped,
    /// All that it touched, as it was.
    pub before: Slice,
    /// The same, as it is from now on.
    pub after: Slice,
}

/// What was done to identities.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Regrouped {
    /// Two were one thing.
    Merged {
        /// The identity that stays.
        kept: ObjectId,
        /// The one that goes.
        gone: ObjectId,
    },
    /// One was two things.
    Split {
        /// The identity that keeps what was before.
        from: ObjectId,
        /// The one that has what was since.
        new: ObjectId,
        /// Since when.
        since: Moment,
    },
    /// An earlier merge or split was undone.
    Undone {
        /// Its number.
        number: u32,
    },
}

/// Some objects and transitions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slice {
    /// Objects whole.
    pub objects: Vec<Whole>,
    /// Objects that are not there.
    pub gone: Vec<ObjectId>,
    /// Transitions.
    pub transitions: Vec<Transition>,
}

/// An object with its history and what is tracked of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Whole {
    /// The entry.
    pub entry: ObjectEntry,
    /// The rest.
    pub track: Track,
}

/// What to drop from memory.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Forget {
    /// Objects to drop.
    pub objects: Vec<ObjectId>,
    /// Whether to drop all of every history but the present place.
    pub histories: bool,
    /// Drop the transitions before this one.
    pub transitions_before: Option<TransitionId>,
    /// Whether to drop skill memory.
    pub skills: bool,
}

/// What is believed beside objects, transitions and skills.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rest {
    /// Where the agent is in its instruction.
    pub progress: TaskProgress,
    /// The surface on which things stand.
    pub support: Option<SupportPlane>,
    /// Frames of the run that showed something.
    pub frames_seen: u32,
    /// The last frame.
    pub glance: Option<Glance>,
    /// What the fingers felt last.
    pub hand: HandFeeling,
    /// The ids that come next.
    pub next: Counters,
    /// Virtual time within the run.
    pub now: Time,
    /// Whether memory goes back to the beginning of the run.
    pub from_start: bool,
    /// Merges and splits that can be undone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regrouped: Vec<Regrouping>,
    /// How many there were.
    #[serde(default)]
    pub regroupings: u32,
}

/// The ids that come next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Number of the episode; 0 before the first.
    pub episode: u32,
    /// Next object.
    pub object: u64,
    /// Next transition.
    pub transition: u64,
    /// Next skill entry.
    pub skill: u64,
}

impl Default for Counters {
    fn default() -> Self {
        Counters { episode: 0, object: 1, transition: 1, skill: 1 }
    }
}
