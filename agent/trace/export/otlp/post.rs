//! Posts spans to a collector: OTLP over HTTP with JSON.

use super::wire::Request;
use anyhow::{Context, bail};
use serde::Deserialize;
use std::time::Duration;
use ureq::{Agent, http::Uri};

/// How long a collector may take.
const TIMEOUT: Duration = Duration::from_secs(30);
/// Most bytes of its answer that are read.
const MAX_ANSWER_BYTES: u64 = 64 << 10;
/// Where a collector takes spans, when the address names no path.
const TRACES: &str = "/v1/traces";

/// What a collector answers where it did not take everything; empty where it did.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Answer {
    partial_success: PartialSuccess,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct PartialSuccess {
    /// A 64-bit integer, which this encoding writes as text; some write a number.
    rejected_spans: serde_json::Value,
    error_message: String,
}

/// The address to which spans go, when `target` is one at all.
///
/// # Errors
/// It is one to which nothing is sent: a malformed one, or one that asks for encryption.
pub fn address(target: &str) -> anyhow::Result<Option<Uri>> {
    if target.starts_with("https://") {
        bail!("--otlp {target}: spans are sent without encryption; give the http:// address of a collector near by");
    }
    if !target.starts_with("http://") {
        return Ok(None);
    }
    let malformed = || format!("--otlp {target} is no address: write http://HOST:PORT");
    let uri: Uri = target.parse().with_context(malformed)?;
    if uri.path() != "/" {
        return Ok(Some(uri));
    }
    let base = target.trim_end_matches('/');
    Ok(Some(format!("{base}{TRACES}").parse().with_context(malformed)?))
}

/// Posts one request.
///
/// # Errors
/// Nobody answers, the collector refuses, or it does not take all spans.
pub fn post(address: &Uri, request: &Request) -> anyhow::Result<()> {
    let config = Agent::config_builder().timeout_global(Some(TIMEOUT)).http_status_as_error(false).build();
    let sent = Agent::new_with_config(config)
        .post(address)
        .header("content-type", "application/json")
        .send(serde_json::to_vec(request)?.as_slice());
    let mut response = sent.with_context(|| format!("the collector at {address} cannot be reached"))?;
    let status = response.status();
    let body = response.body_mut().with_config().limit(MAX_ANSWER_BYTES).read_to_string().unwrap_or_default();
    if !status.is_success() {
        let said = body.split_whitespace().collect::<Vec<_>>().join(" ");
        let said: String = said.chars().take(200).collect();
        bail!("the collector at {address} refuses the spans: {status} {said}");
    }
    // An answer that is no JSON says nothing of spans that were left out.
    let PartialSuccess { rejected_spans, error_message } =
        serde_json::from_str::<Answer>(&body).unwrap_or_default().partial_success;
    let rejected = rejected_spans.as_u64().or_else(|| rejected_spans.as_str()?.parse().ok()).unwrap_or(0);
    if rejected > 0 {
        bail!("the collector at {address} did not take {rejected} spans: {error_message}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;

    #[test]
    fn an_address_without_a_path_is_that_of_a_collector() {
        let uri = |target| address(target).unwrap().map(|uri| uri.to_string());
        assert_eq!(uri("http://127.0.0.1:4318").as_deref(), Some("http://127.0.0.1:4318/v1/traces"));
        assert_eq!(uri("http://127.0.0.1:4318/").as_deref(), Some("http://127.0.0.1:4318/v1/traces"));
        assert_eq!(uri("http://near/other/path").as_deref(), Some("http://near/other/path"));
        assert_eq!((uri("spans.json"), uri("-")), (None, None));
        assert!(address("https://far/").unwrap_err().to_string().contains("without encryption"));
        assert!(address("http://no host/").is_err());
    }
}
