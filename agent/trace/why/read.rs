//! What was read of memory, what had written it, and the frames behind that.

use super::{Crop, How, Kind, inquiry::Answer};
use crate::trace::{
    belief::{self, Change},
    decision,
    run_file::Delta,
    sight::{self, Odds, Sight},
};
use acm_concept::{
    ids::{FrameId, ObjectId},
    literal::Evidence,
};
use std::collections::BTreeSet;

/// Most changes of an object that are told beside those that something rests on.
const MAX_CHANGES: usize = 6;
/// Most frames that are named against another.
const MAX_FRAMES: usize = 6;

impl Answer<'_> {
    /// What something rests on: frames and own moves are followed, conclusions stand in the words already.
    pub(super) fn evidence(&mut self, id: &str, seq: u64, objects: &[ObjectId], evidence: &[Evidence]) {
        let all = self.all;
        for one in evidence {
            match one {
                Evidence::Frame(frame) => {
                    self.frame(id, seq, *frame, objects);
                    for &object in objects {
                        self.written_from(id, seq, object, *frame);
                    }
                }
                Evidence::Transition(transition) => match all.beliefs.transition(*transition, seq) {
                    Some((object, change)) => self.change(id, object, change),
                    None => {
                        self.lack(format!("own move {transition} is not in this trace: it was made in an earlier run"))
                    }
                },
                Evidence::Inferred(_) => {}
            }
        }
    }

    /// The changes of an object that a frame brought about.
    pub(super) fn written_from(&mut self, id: &str, seq: u64, object: ObjectId, frame: FrameId) {
        let all = self.all;
        for change in all.beliefs.before(object, seq) {
            if change.words.is_some() && change.frames().any(|of| of == frame) {
                self.change(id, object, change);
            }
        }
    }

    /// An entry of memory as it was just before a message, with what made it so.
    pub(super) fn entry(&mut self, id: &str, seq: u64, object: ObjectId, role: &'static str) {
        let name = object.to_string();
        let believed = self.all.beliefs.at(object, seq);
        let words = believed.map(belief::entry_words).or_else(|| self.in_view(object, seq));
        let title = format!("{name} {}", words.as_deref().unwrap_or("(not in the trace)"));
        let new = self.node(&name, Kind::Entry, Some(seq), title, Vec::new());
        self.link(id, &name, role);
        if !new {
            return;
        }
        if self.all.beliefs.inherited(object) {
            self.lack(format!(
                "{name} was in memory before this trace began: what wrote it first, and frames of then, are not in it"
            ));
        }
        let changes = self.all.beliefs.before(object, seq);
        // Its history repeats what the entry says; it is told where something rests on it.
        let told = changes.iter().filter(|change| change.words.is_some() && change.delta.change != "history");
        let told: Vec<&Change<'_>> = told.collect();
        let left_out = told.len().saturating_sub(MAX_CHANGES);
        // The first one says where it came from, the last ones why it is as it is.
        let kept = told.iter().enumerate().filter(|(index, _)| *index == 0 || *index > left_out);
        let kept: Vec<Change<'_>> = kept.map(|(_, change)| (*change).clone()).collect();
        for change in &kept {
            self.change(&name, object, change);
        }
        if left_out > 0 {
            let node = self.why.nodes.iter_mut().find(|node| node.id == name);
            node.into_iter().for_each(|node| node.lines.push(format!("{left_out} changes between are left out")));
        }
    }

    /// An object in the view that the planner was given, for one that no change of this trace concerns.
    pub(super) fn in_view(&self, object: ObjectId, seq: u64) -> Option<String> {
        let cause = self.all.run.entry(seq)?.header.cause?;
        let body = self.all.run.entry(cause)?.record().ok()?.body;
        let objects = body.get("view")?.get("objects")?.as_array()?;
        let name = object.to_string();
        let entry = objects.iter().find(|entry| entry.get("id").and_then(|id| id.as_str()) == Some(&*name))?;
        Some(belief::entry_words(entry))
    }

    pub(super) fn change(&mut self, id: &str, object: ObjectId, change: &Change<'_>) {
        let delta = change.delta;
        let name = format!("e{}", delta.event);
        let words = change.words.clone().unwrap_or_else(|| format!("{object} was seen again where it was"));
        let evidence: Vec<String> = delta.evidence.iter().map(decision::evidence_words).collect();
        let lines = if evidence.is_empty() { Vec::new() } else { vec![format!("by {}", evidence.join(" and "))] };
        self.node(&name, Kind::Change, Some(delta.seq), words, lines);
        self.link(id, &name, "written by");
        for frame in change.frames() {
            self.frame(&name, delta.seq + 1, frame, &[object]);
        }
    }

    /// A frame, with the pixels of the objects for which it is evidence.
    pub(super) fn frame(&mut self, id: &str, seq: u64, frame: FrameId, objects: &[ObjectId]) {
        let name = frame.to_string();
        // Numbers of frames begin anew with each run: one from after the message is a namesake.
        let Some(sight) = self.all.sights.get(&frame).filter(|sight| sight.seq < seq) else {
            return self
                .lack(format!("frame {name} is not in this trace before message {seq}: it is of an earlier run"));
        };
        let header = &sight.header;
        let (width, height) = (header.intrinsics.width, header.intrinsics.height);
        let title = format!("{name} of {}, {width}x{height}", header.camera);
        let mut lines: Vec<String> = sight.blindness.iter().map(|why| format!("shows nothing: {why}")).collect();
        lines.extend(sight.same_as.map(|first| format!("bit for bit the picture of {first}")));
        lines.extend(sight::odds(&self.all.sights, frame).as_ref().map(odds_words));
        self.node(&name, Kind::Frame, Some(sight.seq), title, lines);
        self.link(id, &name, "seen in");
        let crops: Vec<Crop> = objects.iter().map(|object| self.crop(sight, *object)).collect();
        if let Some(node) = self.why.nodes.iter_mut().find(|node| node.id == name) {
            for crop in crops {
                if !node.crops.contains(&crop) {
                    node.crops.push(crop);
                }
            }
        }
    }

    pub(super) fn crop(&self, sight: &Sight, object: ObjectId) -> Crop {
        let crop = |bounds, how, label| Crop { frame: sight.header.id, object, bounds, how, label, file: None };
        if let Some(seen) = sight.of(object) {
            let label = format!("{} {:.2}", seen.category, seen.confidence);
            return crop(Some(seen.bounds), How::Seen, label);
        }
        let believed = self.all.beliefs.at(object, sight.seq).and_then(belief::place);
        let label = sight.visibility(object).map_or("not seen, and not expected", sight::visibility_word);
        crop(believed.and_then(|place| sight.around(place)), How::Projected, label.into())
    }

    /// What memory lost before a decision.
    pub(super) fn losses(&mut self, id: &str, seq: u64) {
        let lost = |delta: &&Delta| delta.seq < seq && ["wiped", "forgotten"].contains(&delta.change.as_str());
        for delta in self.all.run.deltas.iter().filter(lost) {
            let name = format!("e{}", delta.event);
            let title = format!("memory was {}, it held {}", delta.change, decision::shortened(&delta.before));
            self.node(&name, Kind::Change, Some(delta.seq), title, Vec::new());
            self.link(id, &name, "memory lost");
        }
    }

    /// What the handling of the message itself changed in memory.
    pub(super) fn written_by(&mut self, seq: u64) {
        let id = format!("m{seq}");
        let objects: BTreeSet<ObjectId> = self
            .all
            .run
            .deltas
            .iter()
            .filter(|delta| delta.seq == seq)
            .filter_map(|delta| delta.object.as_deref()?.parse().ok())
            .collect();
        for object in objects {
            let changes =
                self.all.beliefs.before(object, seq + 1).iter().filter(|c| c.delta.seq == seq && c.words.is_some());
            let changes: Vec<Change<'_>> = changes.cloned().collect();
            for change in &changes {
                self.change(&id, object, change);
                let written = self.why.links.iter_mut().rev().find(|link| link.from == id && link.role == "written by");
                written.into_iter().for_each(|link| link.role = "changed");
            }
        }
    }
}

/// What speaks against a frame.
fn odds_words(odds: &Odds) -> String {
    let frames: Vec<String> = odds.frames.iter().take(MAX_FRAMES).map(FrameId::to_string).collect();
    let more = odds.frames.len().saturating_sub(MAX_FRAMES);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let [x, y, z] = odds.by.to_array().map(|metres| 1e3 * metres);
    let (things, of) = odds.things;
    let agree = match odds.agree {
        0 => "no frame agrees with it".to_owned(),
        agree => format!("{agree} agree with it"),
    };
    format!(
        "AT ODDS with {}{more}: there {things} of {of} things lie ({x:.0}, {y:.0}, {z:.0}) mm from where it shows them; {agree}",
        frames.join(", ")
    )
}
