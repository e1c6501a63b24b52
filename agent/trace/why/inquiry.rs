//! Puts the answer together: the decision, and what it says of itself.

use super::{Kind, Link, Node, Why};
use crate::trace::{
    belief::Beliefs,
    decision::{self, StepSpan},
    run_file::{Entry, RunFile},
    sight::{self, Sight},
};
use acm_concept::{
    ids::{FrameId, ObjectId},
    literal::{Belief, Literal, Place, Term},
};
use acm_memory::query::Recall;
use acm_planner::{Decision, Explanation, Grounds, ResolvedReference, Step};
use std::collections::{BTreeMap, BTreeSet};

/// Most hits of a retrieval whose entries are followed.
const MAX_HITS: usize = 6;

/// A run, ready to be asked.
pub struct Inquiry<'a> {
    pub(super) run: &'a RunFile,
    pub(super) beliefs: Beliefs<'a>,
    pub(super) sights: BTreeMap<FrameId, Sight>,
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
pub(super) struct Answer<'a> {
    pub(super) all: &'a Inquiry<'a>,
    pub(super) why: Why,
    known: BTreeSet<String>,
}

impl<'a> Answer<'a> {
    fn new(all: &'a Inquiry<'a>, seq: u64) -> Answer<'a> {
        Answer { all, why: Why { seq, ..Why::default() }, known: BTreeSet::new() }
    }

    /// Adds a node unless it is there; says whether it was new.
    pub(super) fn node(&mut self, id: &str, kind: Kind, seq: Option<u64>, title: String, lines: Vec<String>) -> bool {
        let new = self.known.insert(id.into());
        if new {
            let t = seq.and_then(|seq| self.all.run.entry(seq)).map(Entry::seconds);
            self.why.nodes.push(Node { id: id.into(), kind, seq, t, title, lines, crops: Vec::new() });
        }
        new
    }

    pub(super) fn link(&mut self, from: &str, to: &str, role: &'static str) {
        let link = Link { from: from.into(), to: to.into(), role };
        if !self.why.links.contains(&link) {
            self.why.links.push(link);
        }
    }

    pub(super) fn lack(&mut self, what: String) {
        if !self.why.lacks.contains(&what) {
            self.why.lacks.push(what);
        }
    }

    fn decision(&mut self, decided: &'a Entry) -> anyhow::Result<()> {
        let seq = decided.header.seq;
        let id = format!("d{seq}");
        let decision = decision::read(decided)?;
        let from = format!("m{seq}");
        let step = self.all.step_of.get(&seq).copied();
        self.why.step = step.map(|index| index + 1);
        let (title, lines) = decision_words(&decision, self.why.step, self.all.steps.len());
        self.node(&id, Kind::Decision, Some(seq), title, lines);
        self.link(&from, &id, "decided");
        self.instruction(&id, decided);
        self.losses(&id, seq);
        match decision {
            Decision::Act { step, explanation } => self.act(&id, seq, &step, &explanation),
            Decision::Look { reason, grounds } | Decision::SubtaskDone { reason, grounds, .. } => {
                self.grounds(&id, seq, &reason, &grounds);
            }
            Decision::GiveUp { unknown, grounds } => self.grounds(&id, seq, &unknown.text, &grounds),
            Decision::Done { reason } => self.grounds(&id, seq, &reason, &Grounds::default()),
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
        if let Some(parsed) = before.iter().rev().find(|entry| entry.header.kind == "parsed") {
            let asked = self.causes(parsed).find(|entry| entry.header.kind == "parse");
            let title = asked.map_or_else(|| parsed.line.clone(), |asked| asked.line.clone());
            let source = format!("i{}", parsed.header.seq);
            self.node(&source, Kind::Instruction, Some(parsed.header.seq), title, vec![parsed.line.clone()]);
            self.link(id, &source, "asked for by");
            self.model(id, parsed);
        }
    }

    /// The message that caused one, the one that caused that, and so on.
    fn causes(&self, entry: &'a Entry) -> impl Iterator<Item = &'a Entry> + use<'a> {
        let run = self.all.run;
        std::iter::successors(Some(entry), move |entry| run.entry(entry.header.cause?)).skip(1)
    }

    /// What a model was asked, and replied, before an instruction was read.
    fn model(&mut self, id: &str, parsed: &'a Entry) {
        let said: Vec<&Entry> = self.causes(parsed).take_while(|entry| entry.header.kind != "parse").collect();
        for entry in said.into_iter().rev() {
            let node = format!("c{}", entry.header.seq);
            self.node(&node, Kind::Model, Some(entry.header.seq), entry.line.clone(), Vec::new());
            self.link(id, &node, "a model said");
        }
    }

    fn act(&mut self, id: &str, seq: u64, step: &Step, explanation: &Explanation) {
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
        let part = step.candidate.part.object;
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

    /// A decision that is not to act: what it rests on, what its words name beside that, and the last frame before it.
    fn grounds(&mut self, id: &str, seq: u64, words: &str, grounds: &Grounds) {
        for (index, reference) in grounds.references.iter().enumerate() {
            self.reference(id, seq, index, reference);
        }
        for (index, pair) in grounds.literals.iter().enumerate() {
            self.belief(id, seq, &format!("b{seq}.{index}"), "weighed", pair);
        }
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
}

fn decision_words(decision: &Decision, number: Option<usize>, steps: usize) -> (String, Vec<String>) {
    match decision {
        Decision::Act { step, explanation } => {
            let prediction = &step.prediction;
            let number = number.map_or_else(String::new, |number| format!("step {number} of {steps}: "));
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
            (format!("{number}{step}"), lines)
        }
        Decision::Look { reason, .. } => (format!("look again: {reason}"), Vec::new()),
        Decision::SubtaskDone { index, reason, .. } => (format!("subtask {} is done: {reason}", index + 1), Vec::new()),
        Decision::Done { reason } => (format!("all is done: {reason}"), Vec::new()),
        Decision::GiveUp { unknown, .. } => {
            (format!("give up ({}): {}", unknown.cause.word(), unknown.text), Vec::new())
        }
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
