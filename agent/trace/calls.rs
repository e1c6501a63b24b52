//! What a language model was asked in a run, and what it replied.

use super::run_file::Entry;
use acm_actors::message::{LLM, PLANNER};
use acm_llm::{Answer, Cassette, ChatRequest, Speaker};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    io::{self, Write},
};

/// Kind of the message by which a model is asked.
const ASKED: &str = "ask-llm";
/// Kind of the message with what it replied.
const REPLIED: &str = "llm-replied";

/// A call.
#[derive(Debug, Clone, PartialEq)]
pub struct Call {
    /// The message that asked.
    pub asked: u64,
    /// The message with the answer, and the answer; `None` where none came.
    pub answer: Option<(u64, Answer)>,
    /// What was asked.
    pub request: ChatRequest,
}

#[derive(Deserialize)]
struct AskBody {
    request: ChatRequest,
}

/// The calls of a run, in order.
///
/// # Errors
/// A message has another form.
pub fn calls(entries: &[Entry]) -> anyhow::Result<Vec<Call>> {
    let mut calls: BTreeMap<u64, Call> = BTreeMap::new();
    for entry in entries {
        let header = &entry.header;
        let malformed = || format!("message {} (`{}`) is malformed", header.seq, header.kind);
        if header.kind == ASKED && header.to == LLM.0 {
            let AskBody { request } = serde_json::from_value(entry.record()?.body).with_context(malformed)?;
            calls.insert(header.seq, Call { asked: header.seq, answer: None, request });
        } else if header.kind == REPLIED && header.to == PLANNER.0 {
            let answer = serde_json::from_value(entry.record()?.body).with_context(malformed)?;
            if let Some(call) = header.cause.and_then(|cause| calls.get_mut(&cause)) {
                call.answer = Some((header.seq, answer));
            }
        }
    }
    Ok(calls.into_values().collect())
}

/// The answered calls of a run as a cassette of this name.
///
/// # Errors
/// As [`calls`].
pub fn cassette(entries: &[Entry], name: &str) -> anyhow::Result<Cassette> {
    let mut cassette = Cassette::new(name);
    for call in calls(entries)? {
        if let Some((_, answer)) = call.answer {
            cassette.add(call.request, answer)?;
        }
    }
    Ok(cassette)
}

/// A call as the viewer shows it.
#[derive(Debug, Serialize)]
pub struct CallRow {
    seq: u64,
    replied: Option<u64>,
    prompt: String,
    /// Speakers with what they said.
    turns: Vec<[String; 2]>,
    reasoning: Option<String>,
    reply: Option<String>,
    /// What it cost, or why there is no reply.
    note: String,
}

impl From<Call> for CallRow {
    fn from(call: Call) -> CallRow {
        let (mut reasoning, mut reply, mut note) = (None, None, "no answer is in the trace".to_owned());
        match call.answer.as_ref().map(|(_, answer)| answer) {
            Some(Answer::Reply(said)) => {
                (reasoning, reply) = (said.reasoning.clone(), Some(laid_out(&said.text)));
                note = format!("{} ({}), {}", said.model, said.backend, said.usage);
                said.notes.iter().for_each(|more| note += &format!("; {more}"));
            }
            Some(Answer::Error(error)) => note = error.to_string(),
            None => {}
        }
        CallRow {
            seq: call.asked,
            replied: call.answer.map(|(seq, _)| seq),
            prompt: call.request.prompt.to_string(),
            turns: said(&call.request),
            reasoning,
            reply,
            note,
        }
    }
}

/// Everything that was said in a request: who, and what.
fn said(request: &ChatRequest) -> Vec<[String; 2]> {
    let turns = request.turns.iter().map(|turn| {
        let who = match turn.who {
            Speaker::User => "user",
            Speaker::Assistant => "model",
        };
        [who.to_owned(), turn.text()]
    });
    [["system".to_owned(), request.system.clone()]].into_iter().chain(turns).collect()
}

/// JSON over several lines; other text as it is.
fn laid_out(text: &str) -> String {
    let json = serde_json::from_str::<serde_json::Value>(text).ok();
    json.and_then(|json| serde_json::to_string_pretty(&json).ok()).unwrap_or_else(|| text.into())
}

/// Prints prompt or reply of a message in words; false for a message of another kind.
///
/// # Errors
/// The sink takes no more, or the message is malformed.
pub fn tell(entry: &Entry, out: &mut impl Write) -> anyhow::Result<bool> {
    let body = entry.record()?.body;
    match entry.header.kind.as_str() {
        ASKED => {
            let AskBody { request } = serde_json::from_value(body)?;
            let most = request.parameters.max_output_tokens;
            writeln!(out, "prompt {}, stage {}, at most {most} tokens", request.prompt, request.stage)?;
            for [who, text] in said(&request) {
                paragraph(&who, &text, out)?;
            }
            writeln!(out, "the answer's schema: `--json` has it")?;
        }
        REPLIED => match serde_json::from_value(body)? {
            // The line of the message has told it.
            Answer::Error(_) => {}
            Answer::Reply(reply) => {
                writeln!(out, "{} ({}), {}, ended: {:?}", reply.model, reply.backend, reply.usage, reply.end)?;
                for note in &reply.notes {
                    writeln!(out, "note: {note}")?;
                }
                if let Some(reasoning) = &reply.reasoning {
                    paragraph("reasoning", reasoning, out)?;
                }
                paragraph("reply", &laid_out(&reply.text), out)?;
            }
        },
        _ => return Ok(false),
    }
    Ok(true)
}

/// A text under its name. Control characters become blanks: what a model says is not the terminal's to obey.
fn paragraph(name: &str, text: &str, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{name}")?;
    for line in text.lines() {
        let plain: String = line.chars().map(|sign| if sign.is_control() { ' ' } else { sign }).collect();
        writeln!(out, "  | {plain}")?;
    }
    Ok(())
}
