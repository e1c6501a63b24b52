//! Puts the answer together.

use super::{Crop, How, Kind, Link, Node, Why};
use crate::trace::{
    belief::{self, Beliefs, Change},
    decision::{self, Act, Decided, StepSpan},
    run_file::{Delta, Entry, RunFile},
    show,
    sight::{self, Sight},
};
use acm_concept::{
    ids::{FrameId, ObjectId},
    literal::{Belief, Evidence, Literal, Place, Term},
};
use acm_memory::query::Recall;
use acm_planner::ResolvedReference;
use std::collections::{BTreeMap, BTreeSet};

/// Most lines of the chain of causes.
const MAX_CHAIN: usize = 12;
/// Most changes of an object that are told beside those that something rests on.
const MAX_CHANGES: usize = 6;
/// Most hits of a retrieval whose entries are followed.
const MAX_HITS: usize = 6;

/// A run, ready to be asked.
pub struct Inquiry<'a> {
    run: &'a RunFile,
    beliefs: Beliefs<'a>,
    sights: BTreeMap<FrameId, Sight>,
    steps: Vec<StepSpan>,
    /// The step of each decision to act, from 0.
    step_of: BTreeMap<u64, usize>,
}

impl<'a> Inquiry<'a> {
    /// Reads what every answer needs.
    pub fn new(run: &'a RunFile) -> Inquiry<'a> {
        let steps = decision::steps(run);
        let firsts = steps.iter().map(|span| span.decision(run).map_or(0, |entry| entry.header.seq));
        let step_of = firsts.zip(0..).collect();
        Inquiry { run, beliefs: Beliefs::new(run), sights: sight::sights(run), steps, step_of }
    }

    /// The steps of the run.
    pub fn steps(&self) -> &[StepSpan] {
        &self.steps
    }
    /// The frames of the run.
    pub fn sights(&self) -> &BTreeMap<FrameId, Sight> {
        &self.sights
    }
    /// What memory believed.
    pub fn beliefs(&self) -> &Beliefs<'a> {
        &self.beliefs
    }

    /// Why a message was sent.
    ///
    /// # Errors
    /// The trace has no such message, or a decision in a form that cannot be read.
    pub fn why(&self, seq: u64) -> anyhow::Result<Why> {
        self.run.asked(seq)?;
        let mut answer = Answer::new(self, seq);
        match answer.chain(seq) {
            Some(decided) => answer.decision(decided)?,
            None => {
                answer.lack(format!("no decision stands among the causes of message {seq}: nothing was decided yet"))
            }
        }
        answer.written_by(seq);
        Ok(answer.why)
    }
}

/// An answer while it is put together.
struct Answer<'a> {
    all: &'a Inquiry<'a>,
    why: Why,
    known: BTreeSet<String>,
}

impl<'a> Answer<'a> {
    fn new(all: &'a Inquiry<'a>, seq: u64) -> Answer<'a> {
        Answer { all, why: Why { seq, ..Why::default() }, known: BTreeSet::new() }
    }

    /// Adds a node unless it is there; says whether it was new.
    fn node(&mut self, id: &str, kind: Kind, seq: Option<u64>, title: String, lines: Vec<String>) -> bool {
        let new = self.known.insert(id.into());
        if new {
            let t = seq.and_then(|seq| self.all.run.entry(seq)).map(Entry::seconds);
            self.why.nodes.push(Node { id: id.into(), kind, seq, t, title, lines, crops: Vec::new() });
        }
        new
    }

    fn link(&mut self, from: &str, to: &str, role: &'static str) {
        let link = Link { from: from.into(), to: to.into(), role };
        if !self.why.links.contains(&link) {
            self.why.links.push(link);
        }
    }

    fn lack(&mut self, what: String) {
        if !self.why.lacks.contains(&what) {
            self.why.lacks.push(what);
        }
    }

    /// The causes back to the decision, or to the beginning where there is none. Gives the decision's message.
    fn chain(&mut self, seq: u64) -> Option<&'a Entry> {
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

    fn decision(&mut self, decided: &'a Entry) -> anyhow::Result<()> {
        let seq = decided.header.seq;
        let id = format!("d{seq}");
        let decision = Decided::read(decided)?;
        let from = format!("m{seq}");
        let step = self.all.step_of.get(&seq).copied();
        self.why.step = step.map(|index| index + 1);
        let (title, lines) = decision_words(&decision, self.why.step, self.all.steps.len());
        self.node(&id, Kind::Decision, Some(seq), title, lines);
        self.link(&from, &id, "decided");
        self.instruction(&id, decided);
        self.losses(&id, seq);
        match decision {
            Decided::Act(act) => self.act(&id, seq, &act),
            Decided::Look { reason } | Decided::SubtaskDone { reason, .. } | Decided::Done { reason } => {
                self.named(&id, seq, &reason);
            }
            Decided::GiveUp { unknown } => self.named(&id, seq, &unknown.text),
        }
        if let Some(span) = step.and_then(|index| self.all.steps.get(index)) {
            self.outcome(&id, span);
        }
        Ok(())
    }

    /// The instruction, and what a model had to do with it or with the decision.
    fn instruction(&mut self, id: &str, decided: &Entry) {
        let seq = decided.header.seq;
        let end = self.all.run.entries.partition_point(|entry| entry.header.seq < seq);
        let before = self.all.run.entries.get(..end).unwrap_or_default();
        let mut sources = vec![Some(seq), decided.header.cause];
        if let Some(parsed) = before.iter().rev().find(|entry| entry.header.kind == "parsed") {
            let asked = parsed.header.cause.and_then(|cause| self.all.run.entry(cause));
            let title = asked.map_or_else(|| parsed.line.clone(), |asked| asked.line.clone());
            let source = format!("i{}", parsed.header.seq);
            self.node(&source, Kind::Instruction, Some(parsed.header.seq), title, vec![parsed.line.clone()]);
            self.link(id, &source, "asked for by");
            sources.extend([Some(parsed.header.seq), parsed.header.cause]);
        }
        let calls = self.all.run.effects.iter().filter(|e| e.kind == "llm" && sources.contains(&Some(e.seq)));
        for (number, call) in calls.enumerate() {
            let model = format!("c{}.{number}", call.seq);
            let usage = call.record.get("usage").map_or_else(String::new, decision::shortened);
            self.node(&model, Kind::Model, Some(call.seq), format!("a model was asked   {usage}"), Vec::new());
            self.link(id, &model, "a model said");
        }
    }

    fn act(&mut self, id: &str, seq: u64, act: &Act) {
        let explanation = &act.explanation;
        for (index, reference) in explanation.references.iter().enumerate() {
            self.reference(id, seq, index, reference);
        }
        let goals = explanation.literals.iter().map(|pair| ("goal state", pair));
        let conditions = explanation.applicability.conditions.iter().map(|pair| ("precondition", pair));
        for (index, (role, pair)) in goals.chain(conditions).enumerate() {
            self.belief(id, seq, &format!("b{seq}.{index}"), role, pair);
        }
        for (index, rejected) in explanation.rejected.iter().enumerate() {
            let name = format!("x{seq}.{index}");
            let title = format!("{}: {}", rejected.candidate, rejected.reason);
            self.node(&name, Kind::Rejected, Some(seq), title, Vec::new());
            self.link(id, &name, "not chosen");
            if let Some(failed) = &rejected.failed {
                self.belief(&name, seq, &format!("b{seq}.x{index}"), "failed precondition", failed);
            }
        }
        let part = act.step.candidate.part.object;
        self.entry(id, seq, part, "acts on");
    }

    fn reference(&mut self, id: &str, seq: u64, index: usize, reference: &ResolvedReference) {
        let name = format!("r{seq}.{index}");
        let drawn = if reference.guessed { " (DRAWN: memory did not decide)" } else { "" };
        let title = match (&reference.object, &reference.place) {
            (_, Some(place)) => format!("\"{}\" is {}: {}{drawn}", reference.phrase, place_words(place), reference.how),
            _ => format!("\"{}\" is {}{drawn}", reference.phrase, reference.how),
        };
        let mut lines = Vec::new();
        for hit in reference.retrieval.iter().flat_map(|retrieval| &retrieval.hits).take(MAX_HITS) {
            let terms: Vec<String> = hit.terms.iter().map(|(name, value)| format!("{name} {value:.2}")).collect();
            lines.push(format!("retrieved {} {:.3} ({})", hit.object, hit.score, terms.join(", ")));
        }
        let dropped = reference.retrieval.iter().flat_map(|retrieval| &retrieval.dropped);
        let dropped: Vec<String> = dropped.map(|(object, filter)| format!("{object} by {filter}")).collect();
        if !dropped.is_empty() {
            lines.push(format!("dropped {}", dropped.join(", ")));
        }
        lines.extend(reference.recall.as_ref().map(|recall| match recall {
            Recall::Known { confidence, evidence, .. } => {
                let evidence: Vec<String> = evidence.iter().map(decision::evidence_words).collect();
                format!("recalled with {confidence:.2}, by {}", evidence.join(" and "))
            }
            Recall::Unknown { reason, candidates } => {
                let candidates = candidates.iter().map(|(place, p)| format!("{} {p:.2}", place_words(place)));
                format!("NOT KNOWN: {reason}; {}", candidates.collect::<Vec<_>>().join(", "))
            }
        }));
        self.node(&name, Kind::Reference, Some(seq), title, lines);
        self.link(id, &name, "refers to");
        let evidence = match &reference.recall {
            Some(Recall::Known { evidence, .. }) => &evidence[..],
            _ => &[],
        };
        if let Some(object) = reference.object {
            self.entry(&name, seq, object, "resolved to");
            self.evidence(&name, seq, &[object], evidence);
        }
        for hit in reference.retrieval.iter().flat_map(|retrieval| &retrieval.hits).take(MAX_HITS) {
            self.entry(&name, seq, hit.object, "retrieved");
        }
    }

    fn belief(&mut self, id: &str, seq: u64, name: &str, role: &'static str, pair: &(Literal, Belief)) {
        let (literal, belief) = pair;
        self.node(name, Kind::Belief, Some(seq), decision::belief_words(pair), vec![role.into()]);
        self.link(id, name, role);
        let objects = objects_of(literal);
        for &object in &objects {
            self.entry(name, seq, object, "about");
        }
        self.evidence(name, seq, &objects, &belief.evidence);
    }

    /// What something rests on: frames and own moves are followed, conclusions stand in the words already.
    fn evidence(&mut self, id: &str, seq: u64, objects: &[ObjectId], evidence: &[Evidence]) {
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
    fn written_from(&mut self, id: &str, seq: u64, object: ObjectId, frame: FrameId) {
        let all = self.all;
        for change in all.beliefs.before(object, seq) {
            if change.words.is_some() && change.frames().any(|of| of == frame) {
                self.change(id, object, change);
            }
        }
    }

    /// An entry of memory as it was just before a message, with what made it so.
    fn entry(&mut self, id: &str, seq: u64, object: ObjectId, role: &'static str) {
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
    fn in_view(&self, object: ObjectId, seq: u64) -> Option<String> {
        let cause = self.all.run.entry(seq)?.header.cause?;
        let body = self.all.run.entry(cause)?.record().ok()?.body;
        let objects = body.get("view")?.get("objects")?.as_array()?;
        let name = object.to_string();
        let entry = objects.iter().find(|entry| entry.get("id").and_then(|id| id.as_str()) == Some(&*name))?;
        Some(belief::entry_words(entry))
    }

    fn change(&mut self, id: &str, object: ObjectId, change: &Change<'_>) {
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
    fn frame(&mut self, id: &str, seq: u64, frame: FrameId, objects: &[ObjectId]) {
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

    fn crop(&self, sight: &Sight, object: ObjectId) -> Crop {
        let crop = |bounds, how, label| Crop { frame: sight.header.id, object, bounds, how, label, file: None };
        if let Some(seen) = sight.of(object) {
            let label = format!("{} {:.2}", seen.category, seen.confidence);
            return crop(Some(seen.bounds), How::Seen, label);
        }
        let believed = self.all.beliefs.at(object, sight.seq).and_then(belief::place);
        let label = sight.visibility(object).map_or("not seen, and not expected", sight::visibility_word);
        crop(believed.and_then(|place| sight.around(place)), How::Projected, label.into())
    }

    /// A decision that explains itself in words alone: what the words name.
    fn named(&mut self, id: &str, seq: u64, words: &str) {
        let names = words.split(|sign: char| !sign.is_ascii_alphanumeric());
        let objects: BTreeSet<ObjectId> = names.filter_map(|name| name.parse().ok()).collect();
        for object in objects {
            self.entry(id, seq, object, "names");
        }
        let last = self.all.sights.values().filter(|sight| sight.seq < seq).max_by_key(|sight| sight.seq);
        if let Some(last) = last {
            self.frame(id, seq, last.header.id, &[]);
        }
    }

    /// What memory lost before a decision.
    fn losses(&mut self, id: &str, seq: u64) {
        let lost = |delta: &&Delta| delta.seq < seq && ["wiped", "forgotten"].contains(&delta.change.as_str());
        for delta in self.all.run.deltas.iter().filter(lost) {
            let name = format!("e{}", delta.event);
            let title = format!("memory was {}, it held {}", delta.change, decision::shortened(&delta.before));
            self.node(&name, Kind::Change, Some(delta.seq), title, Vec::new());
            self.link(id, &name, "memory lost");
        }
    }

    fn outcome(&mut self, id: &str, span: &StepSpan) {
        let name = format!("{id}.outcome");
        let (run, verdict) = (self.all.run, span.verdict(self.all.run));
        let Some(verdict) = verdict else {
            return self.lack("the trace does not have a verdict on this step".into());
        };
        let mut lines: Vec<String> = verdict
            .literals
            .iter()
            .map(|l| {
                format!("{}  {}: {}", l.literal, decision::outcome_word(l.outcome).to_lowercase(), l.observed.reason)
            })
            .collect();
        let failure = span.report(run).and_then(|report| report.failure);
        lines.extend(failure.map(|(cause, reason)| format!("the skill FAILED ({}): {reason}", cause.word())));
        let title = format!("{}: {}", decision::outcome_word(verdict.outcome), verdict.reason);
        self.node(&name, Kind::Outcome, None, title, lines);
        self.link(id, &name, "came out");
        for literal in &verdict.literals {
            let objects = objects_of(&literal.literal);
            self.evidence(&name, span.last_seq(run) + 1, &objects, &literal.observed.evidence);
        }
    }

    /// What the handling of the message itself changed in memory.
    fn written_by(&mut self, seq: u64) {
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

fn decision_words(decision: &Decided, step: Option<usize>, steps: usize) -> (String, Vec<String>) {
    match decision {
        Decided::Act(act) => {
            let prediction = &act.step.prediction;
            let number = step.map_or_else(String::new, |step| format!("step {step} of {steps}: "));
            let explanation = &act.explanation;
            let mut lines = vec![
                format!("goal: {}", explanation.goal),
                format!("asked for by \"{}\"", explanation.subtask),
                format!("plan: {}", explanation.plan.join(" > ")),
                format!(
                    "success expected with {:.2} ({} of {} tries of this skill on this template)",
                    prediction.success, prediction.successes, prediction.tries
                ),
            ];
            lines.extend(explanation.notes.iter().map(|note| format!("note: {note}")));
            (format!("{number}{}", act.step), lines)
        }
        Decided::Look { reason } => (format!("look again: {reason}"), Vec::new()),
        Decided::SubtaskDone { index, reason } => (format!("subtask {} is done: {reason}", index + 1), Vec::new()),
        Decided::Done { reason } => (format!("all is done: {reason}"), Vec::new()),
        Decided::GiveUp { unknown } => (format!("give up ({}): {}", unknown.cause.word(), unknown.text), Vec::new()),
    }
}

fn objects_of(literal: &Literal) -> Vec<ObjectId> {
    let mut objects = Vec::new();
    for term in &literal.arguments {
        let object = match term {
            Term::Object(object) => Some(*object),
            Term::Part(part) => Some(part.object),
            Term::Place(place) => place.support,
            _ => None,
        };
        objects.extend(object.filter(|object| !objects.contains(object)));
    }
    objects
}

fn place_words(place: &Place) -> String {
    Term::Place(*place).to_string()
}
