//! What a status beside 200 means.

use super::{Headers, text_at};
use crate::chat::{CallError, shortened};
use serde_json::Value;

/// Most characters of a server's own words that are kept.
const MAX_WORDS: usize = 300;

/// The failure that a status, headers and body tell of. All formats have an `error`, as an object or as words.
pub(crate) fn failure(status: u16, headers: &Headers, body: &[u8]) -> CallError {
    let value: Value = serde_json::from_slice(body).unwrap_or_default();
    let error = value.get("error").unwrap_or(&value);
    let said = text_at(error, "/message").or(error.as_str()).or(text_at(&value, "/message"));
    let raw = String::from_utf8_lossy(body.get(..4 * MAX_WORDS).unwrap_or(body)).into_owned();
    let reason = shortened(said.unwrap_or(&raw), MAX_WORDS);
    let reason = if reason.is_empty() { "it does not say why".to_owned() } else { reason };
    let code = text_at(error, "/code").or(text_at(error, "/type")).unwrap_or_default();
    let lower = reason.to_lowercase();
    let too_long = code == "context_length_exceeded"
        || [
            "context length",
            "context window",
            "prompt is too long",
            "maximum context",
            "exceeds the available context",
        ]
        .iter()
        .any(|words| lower.contains(words));
    match status {
        401 | 403 => CallError::Auth { reason },
        402 => CallError::Quota { reason },
        429 if code == "insufficient_quota" => CallError::Quota { reason },
        429 => CallError::RateLimited { retry_after_ms: retry_after_ms(headers, &value) },
        503 | 529 => CallError::Overloaded,
        400 | 404 | 413 | 422 if too_long => CallError::ContextTooLong { reason },
        // What has timed out on the way or collided may be asked again like a failure of the server's own.
        408 | 409 | 500.. => CallError::Server { status, reason },
        _ => CallError::BadRequest { status, parameter: parameter(error, &reason), reason },
    }
}

/// A reply without a reason why it ended was cut off; one with a reason that nobody knows is no reply.
pub(super) fn no_end(reason: Option<&str>) -> CallError {
    match reason {
        None | Some("") => CallError::BrokenOff { reason: "it does not say that it is at its end".into() },
        Some(other) => CallError::Unreadable {
            reason: format!("it ended for the unknown reason `{}`", shortened(other, MAX_WORDS)),
        },
    }
}

/// The parameter that a server refuses: by a field of its own, or in its words.
fn parameter(error: &Value, words: &str) -> Option<String> {
    let named = |text: &str| {
        let fits = |c: char| c.is_ascii_alphanumeric() || "_.[]".contains(c);
        (!text.is_empty() && text.len() <= 80 && text.chars().all(fits)).then(|| text.to_owned())
    };
    if let Some(name) = text_at(error, "/param").and_then(named) {
        return Some(name);
    }
    let lower = words.to_lowercase();
    let about = ["parameter", "argument", "field", "unknown name", "extra inputs", "not permitted", "not supported"];
    if !about.iter().any(|phrase| lower.contains(phrase)) {
        return None;
    }
    // "Unsupported parameter: 'x'", "Invalid JSON payload received. Unknown name \"x\" at ...", "x: Extra inputs are not
    // permitted".
    let quoted = words.split(['\'', '"', '`']).nth(1).and_then(named);
    quoted.or_else(|| words.split_once(": Extra inputs").and_then(|(name, _)| named(name)))
}

/// How long a server wants to be left alone, milliseconds. A date counts from the server's own clock.
pub(crate) fn retry_after_ms(headers: &Headers, body: &Value) -> Option<u64> {
    let header = |name: &str| headers.get(name).map(|value| value.trim());
    if let Some(ms) = header("retry-after-ms").and_then(|text| millis(text, 1.0)) {
        return Some(ms);
    }
    if let Some(text) = header("retry-after") {
        let waited = || Some(http_date_s(text)?.saturating_sub(http_date_s(header("date")?)?).saturating_mul(1000));
        return millis(text, 1000.0).or_else(waited);
    }
    let details = super::list_at(body, "/error/details");
    let mut delays = details.filter_map(|detail| text_at(detail, "/retryDelay"));
    delays.find_map(|delay| millis(delay.strip_suffix('s')?, 1000.0))
}

fn millis(text: &str, unit_ms: f64) -> Option<u64> {
    let value: f64 = text.parse().ok()?;
    (value.is_finite() && value >= 0.0).then(|| (value * unit_ms).ceil() as u64)
}

/// Seconds from some day long ago: `Sun, 06 Nov 1994 08:49:37 GMT`.
fn http_date_s(text: &str) -> Option<u64> {
    const MONTHS: [&str; 12] = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
    let words: Vec<&str> = text.split_whitespace().collect();
    let [_, day, month, year, time, "GMT"] = words[..] else { return None };
    let month = 1 + MONTHS.iter().position(|name| *name == month)? as u64;
    let (day, year): (u64, u64) = (day.parse().ok()?, year.parse().ok()?);
    let clock: Vec<u64> = time.split(':').map(str::parse).collect::<Result<_, _>>().ok()?;
    let [hour, minute, second] = clock[..] else { return None };
    if !(1601..=9999).contains(&year) || day > 31 || hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    // Days of the proleptic Gregorian calendar, the year beginning in March.
    let (year, month) = if month <= 2 { (year - 1, month + 9) } else { (year, month - 3) };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day;
    Some(86_400 * days + 3600 * hour + 60 * minute + second)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&str, &str)]) -> Headers {
        pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
    }

    #[test]
    fn a_wait_is_read_from_headers_or_body() {
        let none = Value::Null;
        let of = |pairs: &[(&str, &str)]| retry_after_ms(&headers(pairs), &none);
        assert_eq!(of(&[("retry-after-ms", "250"), ("retry-after", "9")]), Some(250));
        assert_eq!(of(&[("retry-after", "1.5")]), Some(1500));
        assert_eq!(of(&[("retry-after", "-1")]), None);
        let date = ("date", "Sun, 28 Feb 2027 23:59:58 GMT");
        assert_eq!(of(&[("retry-after", "Mon, 01 Mar 2027 00:00:03 GMT"), date]), Some(5000));
        assert_eq!(of(&[("retry-after", "Mon, 23 Nov 2026 00:00:00 GMT"), date]), Some(0));
        assert_eq!(of(&[("retry-after", "soon"), date]), None);
        let body = serde_json::json!({ "error": { "details": [{ "@type": "x" }, { "retryDelay": "12.5s" }] } });
        assert_eq!(retry_after_ms(&Headers::new(), &body), Some(12_500));
    }

    #[test]
    fn every_status_has_its_error() {
        let of = |status, body: &str| failure(status, &Headers::new(), body.as_bytes());
        let parameter = |body: &str| match of(400, body) {
            CallError::BadRequest { parameter, .. } => parameter,
            other => panic!("{other:?}"),
        };
        let openai = r#"{"error":{"message":"Unsupported value","param":"temperature","code":"unsupported_value"}}"#;
        assert_eq!(parameter(openai).as_deref(), Some("temperature"));
        let words = r#"{"error":{"message":"Unsupported parameter: 'max_tokens' is not supported with this model."}}"#;
        assert_eq!(parameter(words).as_deref(), Some("max_tokens"));
        let anthropic = r#"{"type":"error","error":{"type":"invalid_request_error","message":"top_k: Extra inputs are not permitted"}}"#;
        assert_eq!(parameter(anthropic).as_deref(), Some("top_k"));
        assert_eq!(parameter(r#"{"error":"model 'x' not found"}"#), None);
        assert!(matches!(of(401, "{}"), CallError::Auth { reason } if reason == "{}"));
        assert!(matches!(of(429, r#"{"error":{"code":"insufficient_quota"}}"#), CallError::Quota { .. }));
        assert_eq!(of(429, ""), CallError::RateLimited { retry_after_ms: None });
        assert_eq!(of(529, ""), CallError::Overloaded);
        assert!(
            matches!(of(404, r#"{"error":"model 'x' not found"}"#), CallError::BadRequest { status: 404, reason, .. } if reason.contains("'x'"))
        );
        assert!(
            matches!(of(500, "<html>oops</html>"), CallError::Server { status: 500, reason } if reason.contains("oops"))
        );
        let long = r#"{"error":{"message":"maximum context length is 8 tokens","code":"context_length_exceeded"}}"#;
        assert!(matches!(of(400, long), CallError::ContextTooLong { .. }));
    }
}
