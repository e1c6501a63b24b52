//! One exchange over HTTP, with limits on time and size. Dropping it closes the connection.

use super::{Key, ServerConfig, TimeLimits};
use crate::{
    chat::CallError,
    wire::{self, Headers, Profile, Said, Watch, WireRequest},
};
use reqwest::{
    Client, Response, Url,
    header::{HeaderMap, HeaderName, HeaderValue},
    redirect::Policy,
};
use std::{
    error::Error,
    time::{Duration, Instant},
};

/// Most bytes of a reply that are read. An answer is far below; what is longer is a server gone wild.
pub(crate) const MAX_REPLY_BYTES: usize = 8 << 20;

/// A failed exchange, with what the server said of asking again.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Failed {
    pub error: CallError,
    /// The server's own word on whether to ask again.
    pub should_retry: Option<bool>,
    /// How long it wants to be left alone.
    pub retry_after_ms: Option<u64>,
}

impl From<CallError> for Failed {
    fn from(error: CallError) -> Failed {
        Failed { error, should_retry: None, retry_after_ms: None }
    }
}

/// Wall time: a server is outside, and its calls are effects.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stopwatch(Instant);

impl Stopwatch {
    #[expect(clippy::disallowed_methods, reason = "limits of calls to servers are wall time; nothing else sees it")]
    pub(super) fn start() -> Stopwatch {
        Stopwatch(Instant::now())
    }
    pub(super) fn elapsed(&self) -> Duration {
        self.0.elapsed()
    }
}

/// The connection's settings.
pub(super) struct Transport {
    client: Client,
    base_url: String,
    headers: HeaderMap,
    key: Option<Key>,
    limits: TimeLimits,
}

impl Transport {
    pub(super) fn new(config: &ServerConfig) -> Result<Transport, String> {
        let base_url = checked_address(&config.base_url)?;
        let mut headers = HeaderMap::new();
        for (name, value) in &config.headers {
            let wrong = || format!("`{name}` with its value is no header");
            let name = HeaderName::from_bytes(name.as_bytes()).map_err(|_invalid| wrong())?;
            headers.insert(name, HeaderValue::from_str(value).map_err(|_invalid| wrong())?);
        }
        if let Some(key) = &config.key {
            let (name, prefix) = config.profile.wire.key_header();
            let value = HeaderValue::from_str(&format!("{prefix}{}", key.reveal()));
            let mut value = value.map_err(|_invalid| "the key cannot be sent in a header".to_owned())?;
            value.set_sensitive(true);
            headers.insert(HeaderName::from_static(name), value);
        }
        // One that is there already is as good.
        drop(rustls::crypto::ring::default_provider().install_default());
        let mut client = Client::builder();
        if is_of_this_machine(&base_url) {
            client = client.no_proxy();
        }
        let client = client
            .connect_timeout(config.limits.connect)
            // A redirect would take the key elsewhere.
            .redirect(Policy::none())
            // A run may have a runtime of its own, with which its connections end.
            .pool_max_idle_per_host(0)
            .user_agent(concat!("acm/", env!("CARGO_PKG_VERSION")))
            .build()
            .map_err(|error| format!("no connection can be made: {}", words(&error)))?;
        Ok(Transport { client, base_url, headers, key: config.key.clone(), limits: config.limits })
    }

    pub(super) async fn exchange(&self, profile: &Profile, made: &WireRequest) -> Result<Said, Failed> {
        let body = serde_json::to_vec(&made.body)
            .map_err(|error| CallError::Unable { reason: format!("the request has no JSON: {error}") })?;
        let mut call = self.client.post(format!("{}{}", self.base_url, made.path)).headers(self.headers.clone());
        for (name, value) in &made.headers {
            call = call.header(*name, value);
        }
        let sent = call.header("content-type", "application/json").body(body).send();
        let response = match profile.stream {
            true => self.in_time(sent).await?,
            false => sent.await,
        };
        let response = response.map_err(failed)?;
        let (status, headers) = (response.status().as_u16(), headers_of(&response));
        let watch = (profile.stream && (200..300).contains(&status)).then(|| Watch::new(profile.wire));
        let body = self.read(response, watch).await?;
        let body = match &self.key {
            Some(key) => key.removed_from(body),
            None => body,
        };
        wire::reply(profile, status, &headers, &body).map_err(|error| {
            let value = serde_json::from_slice(&body).unwrap_or_default();
            let should_retry = match headers.get("x-should-retry").map(String::as_str) {
                Some("true") => Some(true),
                Some("false") => Some(false),
                _ => None,
            };
            Failed { error, should_retry, retry_after_ms: wire::retry_after_ms(&headers, &value) }
        })
    }

    async fn read(&self, mut response: Response, mut watch: Option<Watch>) -> Result<Vec<u8>, CallError> {
        let too_long = || CallError::Unreadable { reason: format!("it has more than {MAX_REPLY_BYTES} bytes") };
        if response.content_length().is_some_and(|length| length > MAX_REPLY_BYTES as u64) {
            return Err(too_long());
        }
        let mut body = Vec::new();
        while let Some(piece) = self.in_time(response.chunk()).await?.map_err(failed)? {
            if body.len() + piece.len() > MAX_REPLY_BYTES {
                return Err(too_long());
            }
            body.extend_from_slice(&piece);
            // What is damaged needs no rest; it is told of below, once the key is out of it.
            if watch.as_mut().is_some_and(|watch| watch.look(&body).is_err()) {
                break;
            }
        }
        Ok(body)
    }

    async fn in_time<T>(&self, what: impl Future<Output = T>) -> Result<T, CallError> {
        let idle = self.limits.idle;
        let stalled = |_elapsed| CallError::Stalled { idle_ms: idle.as_millis() as u64 };
        tokio::time::timeout(idle, what).await.map_err(stalled)
    }
}

/// An address that holds no key and needs no guess.
fn checked_address(address: &str) -> Result<String, String> {
    // What is wrong with it is not told with it: a key may stand in it.
    let wrong = |why: &str| Err(format!("`base_url` {why}: write https://HOST/PATH"));
    let Ok(url) = Url::parse(address) else { return wrong("is no address") };
    if !matches!(url.scheme(), "http" | "https") || url.host_str().is_none() {
        return wrong("is no address of HTTP");
    }
    if !url.username().is_empty() || url.password().is_some() {
        return wrong("has a name or a password in it; keys are named by `key_env`");
    }
    if url.query().is_some() || url.fragment().is_some() {
        return wrong("has a `?` or a `#` in it");
    }
    Ok(address.trim_end_matches('/').to_owned())
}

/// Whether an address is this machine's own: then no proxy stands between.
fn is_of_this_machine(address: &str) -> bool {
    let host = Url::parse(address).ok().and_then(|url| url.host_str().map(str::to_owned)).unwrap_or_default();
    let numbers = host.trim_matches(['[', ']']).parse::<std::net::IpAddr>();
    host == "localhost" || numbers.is_ok_and(|address| address.is_loopback())
}

fn headers_of(response: &Response) -> Headers {
    let text =
        |(name, value): (&HeaderName, &HeaderValue)| Some((name.as_str().to_owned(), value.to_str().ok()?.to_owned()));
    response.headers().iter().filter_map(text).collect()
}

fn failed(error: reqwest::Error) -> CallError {
    let reason = words(&error);
    match error.is_body() || error.is_decode() {
        true => CallError::BrokenOff { reason },
        false => CallError::Unreachable { reason },
    }
}

/// An error with its causes, but not the address.
fn words(error: &reqwest::Error) -> String {
    let mut told: Vec<String> = Vec::new();
    let mut cause: Option<&dyn Error> = error.source();
    while let Some(error) = cause {
        told.push(error.to_string());
        cause = error.source();
    }
    told.dedup();
    if told.is_empty() { "the connection failed".into() } else { told.join(": ") }
}
