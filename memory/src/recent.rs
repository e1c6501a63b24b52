//! The last events, kept for whoever writes down what changed.

use crate::event::Event;
use std::collections::VecDeque;

/// Most events that are kept.
pub const MAX_RECENT: usize = 2048;

/// What a memory took in lately.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recent {
    /// Events taken in since the memory was opened.
    pub total: u64,
    /// The last of them, oldest first: those that were asked for, as far as they are still kept.
    pub events: Vec<Event>,
}

/// A bounded list of the last events. What was dropped from it is in the log.
#[derive(Debug, Default)]
pub(crate) struct RecentEvents {
    total: u64,
    events: VecDeque<Event>,
}

impl RecentEvents {
    pub(crate) fn add(&mut self, events: impl IntoIterator<Item = Event>) {
        for event in events {
            if self.events.len() >= MAX_RECENT {
                self.events.pop_front();
            }
            self.events.push_back(event);
            self.total += 1;
        }
    }

    /// The events after the first `known`; all that are kept where more are known than there were.
    pub(crate) fn since(&self, known: u64) -> Recent {
        let new = self.total.checked_sub(known).unwrap_or(self.total);
        let skipped = self.events.len().saturating_sub(usize::try_from(new).unwrap_or(usize::MAX));
        Recent { total: self.total, events: self.events.iter().skip(skipped).cloned().collect() }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;
    use crate::{AcmMemory, Memory, event::Change, observation::Note};

    #[test]
    fn events_are_given_once_and_the_oldest_go_first() {
        let mut memory = AcmMemory::in_memory(crate::default_library().unwrap().into());
        memory.note(&Note::EpisodeBegan).unwrap();
        memory.note(&Note::SubtaskDone { time: Default::default(), index: 4 }).unwrap();
        let all = memory.events_since(0);
        assert_eq!((all.total, all.events.len()), (2, 2));
        let last = memory.events_since(1).events;
        assert!(matches!(last.as_slice(), [Event { change: Change::SubtaskDone { index: 4 }, .. }]));
        assert!(memory.events_since(2).events.is_empty());
        memory.wipe().unwrap();
        assert!(matches!(memory.events_since(2).events[0].change, Change::Wiped(_)));

        let mut recent = RecentEvents::default();
        recent.add(std::iter::repeat_n(all.events[0].clone(), MAX_RECENT + 7));
        assert_eq!(recent.since(0).events.len(), MAX_RECENT);
        assert_eq!(recent.since(MAX_RECENT as u64 + 5).events.len(), 2);
        assert_eq!(recent.since(1 << 40).events.len(), MAX_RECENT);
    }
}
