//! The causes of a message.

use super::{Kind, inquiry::Answer};
use crate::trace::{run_file::Entry, show};

/// Most lines of the chain of causes.
const MAX_CHAIN: usize = 12;

impl<'a> Answer<'a> {
    /// The causes back to the decision, or to the beginning where there is none. Gives the decision's message.
    pub(super) fn chain(&mut self, seq: u64) -> Option<&'a Entry> {
        let mut chain: Vec<&'a Entry> = Vec::new();
        let mut next = Some(seq);
        while let Some(seq) = next {
            let Some(entry) = self.all.run.entry(seq) else {
                self.lack(format!("message {seq}, a cause, is not in the trace"));
                break;
            };
            chain.push(entry);
            if entry.header.kind == "decided" {
                break;
            }
            // A cause comes before what it causes: a damaged trace must not send us round in circles.
            next = entry.header.cause.filter(|&cause| cause < seq);
        }
        let decided = chain.last().copied().filter(|entry| entry.header.kind == "decided");
        chain.reverse();
        self.rows(&chain);
        decided
    }

    /// The chain as nodes, the latest first; long series are one node.
    fn rows(&mut self, chain: &[&'a Entry]) {
        let (mut groups, mut at) = (Vec::new(), 0);
        while at < chain.len() {
            let length = show::series(chain.get(at..).unwrap_or_default());
            let length = if length < show::FOLD_FROM { 1 } else { length };
            groups.extend(chain.get(at..at + length));
            at += length;
        }
        let older = groups.len().saturating_sub(MAX_CHAIN);
        let mut before: Option<String> = None;
        let mut add = |answer: &mut Self, group: &[&Entry], words: Option<String>| {
            let (Some(first), Some(last)) = (group.first(), group.last()) else { return };
            let header = &last.header;
            let id = format!("m{}", header.seq);
            let title =
                words.unwrap_or_else(|| format!("{} > {}  {}  {}", header.from, header.to, header.kind, last.line));
            let (kind, seq) = match first.header.seq == header.seq {
                true => (Kind::Message, header.seq),
                false => (Kind::Messages, first.header.seq),
            };
            answer.node(&id, kind, Some(seq), title, Vec::new());
            if let Some(before) = before.replace(id.clone()) {
                answer.link(&before, &id, "caused by");
            }
        };
        for group in groups.iter().skip(older).rev() {
            let words = group.get(1).zip(group.last()).map(|(second, last)| {
                let kinds = format!("{}, {}", last.header.kind, second.header.kind);
                format!("{} messages up to {} ({kinds}); {}", group.len(), last.header.seq, last.line)
            });
            add(self, group, words);
        }
        if let (Some([first, ..]), true) = (groups.first(), older > 0) {
            let count: usize = groups.iter().take(older).map(|group| group.len()).sum();
            let words = format!("{count} messages before that, back to message {}", first.header.seq);
            let both = [*first, groups.get(older - 1).and_then(|group| group.last()).unwrap_or(first)];
            add(self, &both, Some(words));
        }
    }
}
