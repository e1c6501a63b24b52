//! What each method keeps, as a table.

/// Frames in a window, and key frames.
const RECENT: usize = 8;
/// Frames in the bank of `embedding`.
const BANK: usize = 16;

/// What a method keeps beside what all of them have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Keeping {
    /// The method's name.
    pub name: &'static str,
    /// Of past frames: what they showed and where.
    pub frames: Frames,
    /// Of its own deeds.
    pub deeds: Deeds,
    /// Whether things out of sight stay where they were last seen.
    pub last_places: bool,
    /// Whether what is past is kept in words.
    pub in_words: bool,
}

/// Which past frames are kept beside the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Frames {
    /// None.
    Last,
    /// The first one of the run.
    First,
    /// The last so many.
    Recent(usize),
    /// The last so many, and at most so many key frames.
    Key { recent: usize, most: usize },
    /// At most so many; read are those that look most like the last one.
    Bank { most: usize, read: usize },
    /// All.
    All,
}

/// Which own deeds are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Deeds {
    /// The last one.
    Last,
    /// The last one, and of the present subtask what was dealt with: the last deed of each kind with each thing, not where it
    /// was nor how often.
    Progress,
    /// Those since the first frame of the window.
    Window,
    /// All.
    All,
}

impl Deeds {
    /// Whether a deed is kept with the places that it tells of.
    pub fn tell_places(self) -> bool {
        matches!(self, Deeds::Window | Deeds::All)
    }
}

const fn keeping(name: &'static str, frames: Frames, deeds: Deeds) -> Keeping {
    Keeping { name, frames, deeds, last_places: false, in_words: false }
}

/// The methods that are told apart by what they keep.
pub(crate) const KEEPINGS: [Keeping; 9] = [
    keeping("reactive", Frames::Last, Deeds::Last),
    keeping("first-frame", Frames::First, Deeds::Progress),
    keeping("window", Frames::Recent(RECENT), Deeds::Window),
    keeping("window-2", Frames::Recent(2), Deeds::Window),
    keeping("action-log", Frames::Last, Deeds::All),
    keeping("keyframe", Frames::Key { recent: RECENT, most: RECENT }, Deeds::Window),
    keeping("embedding", Frames::Bank { most: BANK, read: RECENT }, Deeds::Progress),
    Keeping { in_words: true, ..keeping("text-summary", Frames::All, Deeds::All) },
    Keeping { last_places: true, ..keeping("semantic", Frames::Last, Deeds::Progress) },
];

/// What `full-history` keeps.
pub(crate) const FULL_HISTORY: Keeping = keeping("full-history", Frames::All, Deeds::All);
