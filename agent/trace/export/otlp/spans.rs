//! Which spans a run has: the episode, its subtasks, their steps, and each call of one actor by another.
//!
//! A span is a stretch of messages. The order of messages is total and one request is in flight at a time, so the stretches
//! lie within each other as the work did.

use crate::trace::{
    decision,
    run_file::{Entry, RunFile},
};
use acm_planner::Decision;
use std::{cmp::Reverse, collections::BTreeMap};

/// A question of one actor to another, by the kinds of its messages.
#[derive(Debug, PartialEq, Eq)]
pub struct Call {
    /// What asks.
    pub asks: &'static str,
    /// What answers.
    pub answers: &'static str,
    /// The name of its spans, where its operation is none of the conventions'.
    pub name: &'static str,
    /// `gen_ai.operation.name`, where the conventions have one.
    pub operation: Option<&'static str>,
    /// `gen_ai.memory.store.id`: which of the linked memories it is about.
    pub store: Option<&'static str>,
}

const fn call(asks: &'static str, answers: &'static str, name: &'static str) -> Call {
    Call { asks, answers, name, operation: None, store: None }
}
const fn operation(asks: &'static str, answers: &'static str, operation: &'static str) -> Call {
    Call { asks, answers, name: operation, operation: Some(operation), store: None }
}
const fn memory(asks: &'static str, answers: &'static str, operation: &'static str, store: &'static str) -> Call {
    Call { asks, answers, name: operation, operation: Some(operation), store: Some(store) }
}

/// The calls that are spans. Control ticks are not: they are in the span of their skill.
const CALLS: [Call; 15] = [
    operation("parse", "parsed", "plan"),
    operation("decide", "decided", "plan"),
    operation("ask-llm", "llm-replied", "chat"),
    operation("execute", "skill-ended", "execute_tool"),
    operation("retreat", "retreated", "execute_tool"),
    memory("look", "expected", "search_memory", "object"),
    memory("percepts", "updated", "update_memory", "object"),
    memory("note", "kept", "update_memory", "temporal"),
    memory("record", "kept", "update_memory", "transition"),
    memory("settle", "kept", "update_memory", "transition"),
    operation("wipe", "kept", "delete_memory"),
    call("capture", "frame", "capture"),
    call("frame", "percepts", "perceive"),
    call("verify", "verdict", "verify"),
    call("wait", "waited", "wait"),
];

/// What a span is of.
#[derive(Debug, Clone, PartialEq)]
pub enum Marked {
    /// The whole run.
    Episode,
    /// A part of the task.
    Subtask {
        /// From 1.
        number: usize,
        /// The words that ask for it.
        text: String,
        /// Whether it was done.
        done: bool,
    },
    /// A decision to act with all that came of it.
    Step {
        /// From 1.
        number: usize,
        /// Why it failed, if it did.
        failure: Option<String>,
    },
    /// A question and its answer.
    Call {
        /// Of which kind.
        call: &'static Call,
        /// Whether the answer came.
        answered: bool,
    },
}

impl Marked {
    /// One word for what it is of. With the message that begins it, it tells a span from all others of a run.
    pub fn word(&self) -> &'static str {
        match self {
            Marked::Episode => "episode",
            Marked::Subtask { .. } => "subtask",
            Marked::Step { .. } => "step",
            Marked::Call { .. } => "call",
        }
    }
    /// Of two of the same messages, the lower holds the other.
    fn rank(&self) -> u8 {
        match self {
            Marked::Episode => 0,
            Marked::Subtask { .. } => 1,
            Marked::Step { .. } => 2,
            Marked::Call { .. } => 3,
        }
    }
}

/// The messages of a span, both ends included.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// The message that begins it.
    pub first: u64,
    /// The message that ends it.
    pub last: u64,
    /// What it is of.
    pub marked: Marked,
    /// The place of the span within which it lies.
    pub parent: Option<usize>,
    /// The place of the call whose answer brought it about.
    pub cause: Option<usize>,
}

/// The spans of a run, each after the one within which it lies.
pub fn intervals(run: &RunFile) -> Vec<Interval> {
    let (Some(first), Some(last)) = (run.entries.first(), run.entries.last()) else { return Vec::new() };
    let (first, last) = (first.header.seq, last.header.seq);
    let mut all = vec![interval(first, last, Marked::Episode)];
    all.extend(subtasks(run, last));
    all.extend(steps(run));
    all.extend(calls(run, last));
    all.sort_by_key(|interval| (interval.first, Reverse(interval.last), interval.marked.rank()));
    nest(&mut all);
    link(run, &mut all);
    all
}

fn interval(first: u64, last: u64, marked: Marked) -> Interval {
    Interval { first, last, marked, parent: None, cause: None }
}

/// From where the task was read, or the subtask before was done, to where the planner holds it to be done.
fn subtasks(run: &RunFile, last: u64) -> Vec<Interval> {
    let mut found = Vec::new();
    let mut texts: Vec<String> = Vec::new();
    let mut open: Option<(u64, usize)> = None;
    let subtask = |texts: &[String], (from, index): (u64, usize), to: u64, done: bool| {
        let text = texts.get(index)?.clone();
        Some(interval(from, to, Marked::Subtask { number: index + 1, text, done }))
    };
    for entry in &run.entries {
        let seq = entry.header.seq;
        if let Some(read) = task(entry) {
            found.extend(open.and_then(|open| subtask(&texts, open, seq, false)));
            (texts, open) = (read, Some((seq, 0)));
        } else if entry.header.kind == "decided"
            && let Ok(Decision::SubtaskDone { index, .. }) = decision::read(entry)
        {
            found.extend(open.and_then(|open| subtask(&texts, open, seq, true)));
            open = Some((seq, index as usize + 1));
        }
    }
    found.extend(open.and_then(|open| subtask(&texts, open, last, false)));
    found
}

/// The words of each subtask, in a message that says them.
fn task(entry: &Entry) -> Option<Vec<String>> {
    if entry.header.kind != "parsed" {
        return None;
    }
    let body = entry.record().ok()?.body;
    let subtasks = body.pointer("/Ok/subtasks")?.as_array()?;
    Some(subtasks.iter().map(|subtask| subtask["text"].as_str().unwrap_or_default().to_owned()).collect())
}

/// From a decision to act to the last message before the planner is asked again.
fn steps(run: &RunFile) -> impl Iterator<Item = Interval> + '_ {
    let asked: Vec<u64> =
        run.entries.iter().filter(|entry| entry.header.kind == "decide").map(|entry| entry.header.seq).collect();
    decision::steps(run).into_iter().zip(1..).filter_map(move |(step, number)| {
        let first = step.decision(run)?.header.seq;
        let next = asked.get(asked.partition_point(|seq| *seq <= first));
        let last = next.map_or_else(|| step.last_seq(run), |seq| seq - 1);
        Some(interval(first, last, Marked::Step { number, failure: step.failure(run) }))
    })
}

/// Each question with its answer, which is the next message of that kind from the actor that was asked. One without an
/// answer ends where that actor failed or was asked again.
fn calls(run: &RunFile, last: u64) -> impl Iterator<Item = Interval> + '_ {
    run.entries.iter().enumerate().filter_map(move |(at, asked)| {
        let call = CALLS.iter().find(|call| call.asks == asked.header.kind)?;
        let asked = &asked.header;
        let ends = run.entries.iter().skip(at + 1).map(|entry| &entry.header).find(|header| {
            let answers =
                header.from == asked.to && [call.answers, "broken", "refused"].contains(&header.kind.as_str());
            let again = header.to == asked.to && header.kind == asked.kind;
            answers || again || header.kind == "actor-failed"
        });
        let answered = ends.is_some_and(|header| header.kind == call.answers);
        let ended = ends.map_or(last, |header| header.seq);
        Some(interval(asked.seq, ended, Marked::Call { call, answered }))
    })
}

/// Finds for each span the smallest one that holds it. They are in the order of their beginnings, larger ones first.
fn nest(all: &mut [Interval]) {
    let mut open: Vec<(usize, u64)> = Vec::new();
    for (at, interval) in all.iter_mut().enumerate() {
        open.retain(|(_, last)| *last >= interval.first);
        interval.parent = open.iter().rev().find(|(_, last)| *last >= interval.last).map(|(at, _)| *at);
        open.push((at, interval.last));
    }
}

/// Finds for each span the call whose answer began or caused it.
fn link(run: &RunFile, all: &mut [Interval]) {
    let is_call = |interval: &Interval| matches!(interval.marked, Marked::Call { .. });
    let answers: BTreeMap<u64, usize> =
        (0..).zip(all.iter()).filter(|(_, interval)| is_call(interval)).map(|(at, call)| (call.last, at)).collect();
    for interval in all {
        let cause = run.entry(interval.first).and_then(|entry| entry.header.cause);
        interval.cause = answers.get(&interval.first).or_else(|| answers.get(&cause?)).copied();
    }
}
