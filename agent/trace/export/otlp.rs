//! A trace as spans of OpenTelemetry, with the names of its conventions for generative AI.
//!
//! | module | holds |
//! |---|---|
//! | [`spans`] | the spans of a run: which messages each is made of, and within which other it lies |
//! | [`attributes`] | what is said of each |
//! | [`wire`] | their JSON encoding |
//! | [`post`] | sending them to a collector |
//!
//! Virtual time is what the spans measure, counted from the wall time at which the run began. Ids are hashes of the run and
//! of the message that begins the span: a trace that is exported twice gives the same spans.

pub mod attributes;
pub mod post;
pub mod spans;
pub mod wire;

use super::{chrome, write_to};
use crate::trace::run_file::RunFile;
use anyhow::Context;
use spans::Interval;
use std::path::Path;
use wire::{Attribute, Link, Request, Resource, ResourceSpans, Scope, ScopeSpans, Span};

/// Most spans in one post: some hundred kilobytes, which every collector takes.
const BATCH: usize = 1000;

/// The variable of OpenTelemetry that says whether spans may hold prompts, replies and arguments: `true`.
const CONTENT: &str = "OTEL_INSTRUMENTATION_GENAI_CAPTURE_MESSAGE_CONTENT";

/// Sends the spans of a run to a collector, when `target` is its address, else writes them to the file that it names.
/// Gives why the trace ends too early, if it does.
///
/// # Errors
/// The trace cannot be read, or nobody takes the spans.
pub fn export(trace: &Path, target: &str) -> anyhow::Result<Option<String>> {
    let address = post::address(target)?;
    let run = RunFile::read(trace)?;
    let content = std::env::var(CONTENT).is_ok_and(|value| value.eq_ignore_ascii_case("true"));
    let all = Spans::of(trace, &run, content)?;
    match address {
        Some(address) => {
            for batch in all.spans.chunks(BATCH) {
                post::post(&address, &all.request(batch))?;
            }
            eprintln!("acm: {} spans sent to {address}", all.spans.len());
        }
        None => {
            let request = serde_json::to_vec(&all.request(&all.spans))?;
            write_to(Path::new(target), |out| Ok(out.write_all(&request)?))?;
        }
    }
    Ok(run.cut)
}

/// All spans of a run.
struct Spans {
    resource: Vec<Attribute>,
    spans: Vec<Span>,
}

impl Spans {
    fn of(trace: &Path, run: &RunFile, content: bool) -> anyhow::Result<Spans> {
        let took = chrome::wall(trace)?;
        let begun_ns = chrome::begun(&took)
            .with_context(|| format!("{} has no wall-clock times: when its spans were is unknown", trace.display()))?;
        let ids = Ids::new(run, begun_ns);
        let intervals = spans::intervals(run);
        let mut spans = Vec::with_capacity(intervals.len());
        for interval in &intervals {
            let id = |place: usize| intervals.get(place).map(|interval| ids.span(interval));
            let time = |seq: u64| (begun_ns + run.entry(seq).map_or(0, |entry| entry.header.t)).to_string();
            let wall_ns: u64 = (interval.first..interval.last).filter_map(|seq| chrome::took_ns(&took, seq)).sum();
            let said = attributes::of(run, interval, content);
            let mut attributes = said.attributes;
            attributes.push(Attribute::new("acm.seq", interval.first));
            attributes.push(Attribute::new("acm.wall_s", wall_ns as f64 * 1e-9));
            attributes.push(Attribute::new("gen_ai.conversation.id", ids.trace.as_str()));
            let link = interval.cause.and_then(id).map(|span_id| Link { trace_id: ids.trace.clone(), span_id });
            spans.push(Span {
                trace_id: ids.trace.clone(),
                span_id: ids.span(interval),
                parent_span_id: interval.parent.and_then(id).unwrap_or_default(),
                name: said.name,
                kind: said.kind,
                start_time_unix_nano: time(interval.first),
                end_time_unix_nano: time(interval.last),
                attributes,
                links: link.into_iter().collect(),
                status: said.status,
            });
        }
        Ok(Spans { resource: attributes::resource(run), spans })
    }

    fn request(&self, spans: &[Span]) -> Request {
        let scope = Scope { name: "acm", version: env!("CARGO_PKG_VERSION") };
        let resource = Resource { attributes: self.resource.clone() };
        Request {
            resource_spans: [ResourceSpans { resource, scope_spans: [ScopeSpans { scope, spans: spans.to_vec() }] }],
        }
    }
}

/// Ids that come out of the run and its messages alone.
struct Ids {
    trace: String,
}

impl Ids {
    /// `begun_ns` tells two runs of one seed from each other.
    fn new(run: &RunFile, begun_ns: u64) -> Ids {
        let known = serde_json::to_vec(&(&run.about, begun_ns)).unwrap_or_default();
        Ids { trace: digits(&known, 32) }
    }
    fn span(&self, interval: &Interval) -> String {
        digits(format!("{} {} {}", self.trace, interval.marked.word(), interval.first).as_bytes(), 16)
    }
}

/// The first digits of a hash, hexadecimal.
fn digits(bytes: &[u8], count: usize) -> String {
    acm_runtime::trace::hash(bytes).chars().take(count).collect()
}
