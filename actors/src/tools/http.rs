//! A tool behind an HTTP address.

use super::wire::{
    About, REPLY, REQUEST, WireFrame, WireOutcome, WirePart, WirePose, WireReply, WireRequest, templates,
};
use acm_concept::{camera::RgbdFrame, object::PixelSupport, template::TemplateLibrary};
use acm_perception::tools::{
    Detection, Detector, Gap, Identity, Mask, Outcome, ParamBelief, ParamEstimator, PartHypothesis, PartRecogniser,
    PartView, PoseBelief, PoseEstimator, Prompts, Reason, Request, Segmenter, Tool, ToolError,
};
use std::sync::{Arc, Mutex, PoisonError};
use ureq::{Agent, Error, http::Uri};

/// Most bytes of a reply that are read.
pub const MAX_REPLY_BYTES: u64 = 32 << 20;
/// Most characters of a server's own words that are kept.
const MAX_WORDS: usize = 300;

/// A tool in another process. One server may answer all questions, each at a path of its own below the address:
/// `v1/detect`, `v1/segment`, `v1/recognise`, `v1/pose`, `v1/params` (docs/perception-tools.md).
///
/// A call ends at the deadline of its request at the latest, wherever the server hangs; nothing is sent twice, no
/// redirect is followed and no proxy is used. Frames go out without encryption: the server is this machine or a near one.
pub struct HttpTool {
    address: String,
    agent: Agent,
    /// What the last reply said of the tool.
    said: Mutex<Identity>,
    /// The last frame as it is sent: a frame is asked about many times.
    frame: Mutex<Option<(RgbdFrame, Arc<WireFrame>)>>,
}

impl HttpTool {
    /// The tool at `http://HOST:PORT`, perhaps with a path. Nobody is asked yet.
    ///
    /// # Errors
    /// A text that is no such address.
    pub fn new(address: &str) -> Result<HttpTool, String> {
        let wrong = || format!("`{address}` is no address of a tool: write http://HOST:PORT");
        let uri: Uri = address.parse().map_err(|_invalid| wrong())?;
        let plain = uri.scheme_str() == Some("http") && uri.host().is_some() && uri.query().is_none();
        // What is given here is written into reports.
        if !plain || uri.authority().is_some_and(|authority| authority.as_str().contains('@')) {
            return Err(wrong());
        }
        let config = Agent::config_builder().http_status_as_error(false).max_redirects(0).proxy(None).build();
        let address = address.trim_end_matches('/').to_owned();
        let said = Identity { tool: address.clone(), version: "unknown".into(), model_digest: None };
        let agent = Agent::new_with_config(config);
        Ok(HttpTool { address, agent, said: Mutex::new(said), frame: Mutex::new(None) })
    }

    /// The frame as it is sent, encoded once.
    fn frame(&self, frame: &RgbdFrame) -> Result<Arc<WireFrame>, ToolError> {
        let mut last = self.frame.lock().unwrap_or_else(PoisonError::into_inner);
        // The kept frame keeps its planes alive, so that another one cannot lie at the same place.
        let same = |kept: &RgbdFrame| {
            kept.header == frame.header
                && std::ptr::eq(kept.color.as_ptr(), frame.color.as_ptr())
                && std::ptr::eq(kept.depth.as_ptr(), frame.depth.as_ptr())
        };
        if let Some((_, encoded)) = last.as_ref().filter(|(kept, _)| same(kept)) {
            return Ok(Arc::clone(encoded));
        }
        let encoded = Arc::new(WireFrame::of(frame)?);
        *last = Some((frame.clone(), Arc::clone(&encoded)));
        Ok(encoded)
    }

    fn ask<T>(
        &self,
        path: &str,
        request: &Request,
        about: About,
        read: impl FnOnce(WireReply) -> Result<T, ToolError>,
    ) -> Outcome<T> {
        let reply = match self.post(path, request, about) {
            Ok(reply) => reply,
            Err(error) => return Outcome::Failed(error),
        };
        let missing = reply.missing.iter().map(|gap| Gap(words(gap))).collect();
        let reason = reply.reason.as_deref().map_or_else(|| "no reason given".into(), words);
        match reply.outcome {
            WireOutcome::Abstain => Outcome::Abstain(Reason::Said(reason)),
            WireOutcome::Failed => Outcome::Failed(ToolError::Said { reason }),
            WireOutcome::Ok => read(reply).map_or_else(Outcome::Failed, Outcome::Ok),
            WireOutcome::Partial => {
                read(reply).map_or_else(Outcome::Failed, |value| Outcome::Partial { value, missing })
            }
        }
    }

    fn post(&self, path: &str, request: &Request, about: About) -> Result<WireReply, ToolError> {
        let frame = self.frame(request.frame)?;
        let limit_ms = request.limit.as_millis() as u64;
        let body = WireRequest { schema: REQUEST, id: request.id, limit_ms, frame: &frame, about };
        let body = serde_json::to_vec(&body).map_err(|e| ToolError::bad_request("request", e.to_string()))?;
        let failed = |error: Error| match error {
            Error::Timeout(_) => ToolError::TimedOut { limit_ms },
            Error::BodyExceedsLimit(most) => ToolError::invalid("reply", format!("is longer than {most} bytes")),
            Error::Protocol(error) => ToolError::invalid("reply", error.to_string()),
            Error::Io(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
                ToolError::invalid("reply", "ends too early")
            }
            error => ToolError::Unreachable { reason: error.to_string() },
        };
        let sent = self
            .agent
            .post(format!("{}/v1/{path}", self.address))
            .config()
            .timeout_global(Some(request.limit))
            .build()
            .header("content-type", "application/json")
            .send(body.as_slice());
        let mut response = sent.map_err(failed)?;
        let status = response.status();
        let text = response.body_mut().with_config().limit(MAX_REPLY_BYTES).read_to_vec().map_err(failed)?;
        if !status.is_success() {
            let reason = format!("status {}: {}", status.as_u16(), words(&String::from_utf8_lossy(&text)));
            return Err(ToolError::Said { reason });
        }
        let reply: WireReply = serde_json::from_slice(&text).map_err(|e| ToolError::invalid("reply", e.to_string()))?;
        self.note(request, &reply)?;
        Ok(reply)
    }

    /// Checks whose answer it is, and keeps what it says of itself.
    fn note(&self, request: &Request, reply: &WireReply) -> Result<(), ToolError> {
        if reply.schema != REPLY {
            return Err(ToolError::invalid("schema", format!("is `{}`, not `{REPLY}`", words(&reply.schema))));
        }
        if reply.id != request.id {
            return Err(ToolError::invalid("id", format!("is {}, but {} was asked", reply.id, request.id)));
        }
        let model_digest = match &reply.model_sha256 {
            None => None,
            Some(text) => {
                Some(digest(text).ok_or_else(|| ToolError::invalid("model_sha256", "is no 64 hexadecimal digits"))?)
            }
        };
        let tool = format!("{} at {}", words(&reply.tool), self.address);
        let said = Identity { tool, version: words(&reply.version), model_digest };
        *self.said.lock().unwrap_or_else(PoisonError::into_inner) = said;
        Ok(())
    }
}

/// A server's words on one line and not too many.
fn words(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_WORDS).collect()
}

fn digest(text: &str) -> Option<[u8; 32]> {
    let mut digest = [0; 32];
    if text.len() != 64 || !text.is_ascii() {
        return None;
    }
    for (byte, pair) in digest.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(digest)
}

impl Tool for HttpTool {
    fn identity(&self) -> Identity {
        self.said.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Detector for HttpTool {
    fn detect(&self, request: &Request, nouns: &[String]) -> Outcome<Vec<Detection>> {
        self.ask("detect", request, About::Detect { nouns }, WireReply::detections)
    }
}

impl Segmenter for HttpTool {
    fn segment(&self, request: &Request, prompts: &Prompts) -> Outcome<Vec<Mask>> {
        let boxes = prompts.boxes.iter().map(|detection| detection.bounds).collect();
        self.ask("segment", request, About::Segment { nouns: prompts.nouns, boxes }, |reply| reply.masks(request))
    }
}

impl PartRecogniser for HttpTool {
    fn recognise(
        &self,
        request: &Request,
        mask: &PixelSupport,
        library: &TemplateLibrary,
    ) -> Outcome<Vec<PartHypothesis>> {
        let about = About::Recognise { mask: &mask.runs, templates: templates(library) };
        self.ask("recognise", request, about, WireReply::hypotheses)
    }
}

impl PoseEstimator for HttpTool {
    fn pose(&self, request: &Request, part: &PartView, prior: Option<&PoseBelief>) -> Outcome<PoseBelief> {
        let camera = request.frame.header.camera_pose;
        let prior = prior.map(|belief| Box::new(WirePose::of(belief, &camera)));
        match WirePart::of(part) {
            Ok(wire) => {
                let about = About::Pose { mask: &part.mask.runs, part: wire, prior };
                self.ask("pose", request, about, |reply| reply.pose(&camera))
            }
            Err(error) => Outcome::Failed(error),
        }
    }
}

impl ParamEstimator for HttpTool {
    fn params(&self, request: &Request, part: &PartView, prior: Option<&ParamBelief>) -> Outcome<ParamBelief> {
        match WirePart::of(part) {
            Ok(wire) => {
                let about = About::Params { mask: &part.mask.runs, part: wire, prior };
                self.ask("params", request, about, WireReply::params)
            }
            Err(error) => Outcome::Failed(error),
        }
    }
}
