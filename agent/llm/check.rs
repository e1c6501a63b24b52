//! `acm llm check`: a tiny question to each backend, to see what it can do and what it costs.

use super::server;
use crate::{
    cli::{Exit, LlmCheckArgs},
    config,
};
use acm_llm::{
    Backend, CallError, ChatReply, ChatRequest, Dialogue, Image, LlmConfig, Next, Parameters, Part, PromptId, Speaker,
    Turn, Usage, wire::Structured,
};
use anyhow::{Context, bail};
use serde::Serialize;
use serde_json::{Value, json};
use std::{
    io::{Cursor, Write},
    time::Instant,
};

/// How often a wrong answer goes back.
const REPAIRS: u32 = 2;
/// Room for the reasoning of models that cannot leave it.
const MAX_TOKENS: u32 = 2_000;
/// Side of the picture that is asked about, pixels: some models take none that are smaller.
const SIDE: u32 = 64;

/// What one backend did.
#[derive(Debug, Serialize)]
struct Finding {
    id: String,
    /// Whether an answer of the schema came, repairs included.
    usable: bool,
    /// What became of the schema, in words.
    schema: String,
    /// What became of a picture, in words.
    images: String,
    repairs: u32,
    usage: Usage,
    cost_usd: Option<f64>,
    /// Wall time of the first call.
    latency_ms: u64,
    model: String,
    notes: Vec<String>,
    error: Option<String>,
}

/// Runs `acm llm check`: 0 if all backends are usable, else 1.
///
/// # Errors
/// The configuration cannot be used, or names no such backend.
pub fn run(args: &LlmCheckArgs) -> anyhow::Result<Exit> {
    let (_, config) = config::open(args.config.as_deref())?;
    let ids: Vec<&str> = match &args.id {
        Some(id) => vec![super::known(id, &config.llm)?],
        None => config.llm.backend.keys().map(String::as_str).collect(),
    };
    if ids.is_empty() {
        bail!("there is no backend to check: name some in a configuration (--config FILE, else ./acm.toml)");
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let mut findings = Vec::new();
    for id in ids {
        let finding = runtime.block_on(examine(id, &config.llm));
        if !args.json {
            tell(&finding, &mut std::io::stdout().lock())?;
        }
        findings.push(finding);
    }
    if args.json {
        let mut out = std::io::stdout().lock();
        serde_json::to_writer_pretty(&mut out, &json!({ "schema": "acm.llm-check/1", "backends": findings }))?;
        writeln!(out)?;
    }
    Ok(if findings.iter().all(|finding| finding.usable) { Exit::Success } else { Exit::Failed })
}

fn tell(finding: &Finding, out: &mut impl Write) -> std::io::Result<()> {
    let Finding { id, schema, images, usage, latency_ms, model, notes, cost_usd, .. } = finding;
    writeln!(out, "{id}: {}", if finding.usable { "usable" } else { "NOT USABLE" })?;
    if let Some(error) = &finding.error {
        writeln!(out, "  error    {error}")?;
    }
    if !model.is_empty() {
        writeln!(out, "  model    {model}")?;
        writeln!(out, "  schema   {schema}; {} repairs", finding.repairs)?;
        writeln!(out, "  images   {images}")?;
        let cost = cost_usd.map_or_else(String::new, |usd| format!(", {usd:.6} US dollars"));
        writeln!(out, "  cost     {usage}{cost}; first answer after {latency_ms} ms")?;
    }
    notes.iter().try_for_each(|note| writeln!(out, "  note     {note}"))
}

#[expect(clippy::disallowed_methods, reason = "a check measures wall time")]
async fn examine(id: &str, config: &LlmConfig) -> Finding {
    let mut finding = Finding {
        id: id.into(),
        usable: false,
        schema: String::new(),
        images: String::new(),
        repairs: 0,
        usage: Usage::default(),
        cost_usd: None,
        latency_ms: 0,
        model: String::new(),
        notes: Vec::new(),
        error: None,
    };
    let server = match server(id, config) {
        Ok(server) => server,
        Err(error) => {
            finding.error = Some(format!("{error:#}"));
            return finding;
        }
    };
    let began = Instant::now();
    let first = server.chat(&greeting()).await;
    finding.latency_ms = began.elapsed().as_millis() as u64;
    if let Err(error) = look_at(&server, first, &mut finding).await {
        finding.error = Some(error.to_string());
    }
    finding
}

async fn look_at(
    server: &acm_llm::Server,
    first: Result<ChatReply, CallError>,
    finding: &mut Finding,
) -> anyhow::Result<()> {
    let first = first?;
    finding.model.clone_from(&first.model);
    finding.cost_usd = first.cost_usd;
    finding.notes.clone_from(&first.notes);
    let mut dialogue = Dialogue::new(greeting(), REPAIRS)?;
    let mut answer = Ok(first);
    finding.usable = loop {
        match dialogue.take(&answer.into(), |_| Ok(())) {
            Next::Accepted(()) => break true,
            Next::GaveUp(reason) => {
                finding.error = Some(reason);
                break false;
            }
            Next::Ask => answer = server.chat(dialogue.request()).await,
        }
    };
    finding.repairs = dialogue.faults().len() as u32;
    finding.usage = dialogue.usage();
    finding.schema = match (server.profile().structured, dialogue.faults().first()) {
        (Structured::PromptOnly | Structured::JsonObject, None) => "told in the prompt, and heeded".into(),
        (_, None) => "heeded, though the prompt asks for something else".into(),
        (_, Some(fault)) => format!("NOT HEEDED: {fault}"),
    };
    finding.images = picture(server).await?;
    Ok(())
}

/// A question whose words ask for what the schema forbids: who heeds the schema shows it.
fn greeting() -> ChatRequest {
    ask(
        vec![Part::Text("Greet me in one short sentence.".into())],
        json!({ "word": { "type": "string", "enum": ["hello", "goodbye"] }, "polite": { "type": "boolean" } }),
    )
}

fn ask(parts: Vec<Part>, properties: Value) -> ChatRequest {
    let required: Vec<String> = properties.as_object().into_iter().flatten().map(|(name, _)| name.clone()).collect();
    ChatRequest {
        stage: "check".into(),
        prompt: PromptId { id: "check".into(), version: 1 },
        system: "You are asked a single question.".into(),
        turns: vec![Turn { who: Speaker::User, parts }],
        schema: json!({
            "type": "object", "additionalProperties": false, "required": required, "properties": properties
        }),
        parameters: Parameters { max_output_tokens: MAX_TOKENS },
    }
}

/// Shows a red square and asks for its colour.
async fn picture(server: &acm_llm::Server) -> anyhow::Result<String> {
    if !server.profile().images {
        return Ok("none are sent (caps.images)".into());
    }
    let mut png = Cursor::new(Vec::new());
    let square = image::RgbImage::from_pixel(SIDE, SIDE, image::Rgb([200, 20, 20]));
    square.write_to(&mut png, image::ImageFormat::Png).context("the picture cannot be encoded")?;
    let words = "Which colour has this picture? Answer as {\"color\": \"...\"} with red, green or blue.";
    let parts = vec![Part::Text(words.into()), Part::Image(Image::new("image/png", png.into_inner()))];
    let colors = json!({ "color": { "type": "string", "enum": ["green", "blue", "red"] } });
    Ok(match server.chat(&ask(parts, colors)).await {
        Err(error) => format!("NOT TAKEN: {error}"),
        Ok(reply) => {
            match serde_json::from_str::<Value>(&reply.text).ok().and_then(|value| value.get("color").cloned()) {
                Some(color) if color == "red" => "taken, and a red square is called red".into(),
                Some(color) => format!("taken, but a red square is called {color}"),
                None => "taken, but not answered in the form that was asked for".into(),
            }
        }
    })
}
