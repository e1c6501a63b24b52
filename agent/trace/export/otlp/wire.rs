//! Spans as OpenTelemetry sends them: the JSON encoding of OTLP 1.x, as far as a trace fills it.
//!
//! Written out here because it is a page: the crates that hold the whole protocol bring gRPC with them. Field names,
//! hexadecimal ids, numbers of enumerations and 64-bit integers as texts are the encoding's own
//! (<https://opentelemetry.io/docs/specs/otlp/#json-protobuf-encoding>).

use serde::Serialize;

/// `ExportTraceServiceRequest`: what is posted, and the whole of a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Request {
    /// One entry: one run.
    pub resource_spans: [ResourceSpans; 1],
}

/// Spans of one process.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct ResourceSpans {
    /// What ran.
    pub resource: Resource,
    /// One entry: all are written by us.
    pub scope_spans: [ScopeSpans; 1],
}

/// What ran.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Resource {
    /// Such as `service.name`.
    pub attributes: Vec<Attribute>,
}

/// Spans of one library.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScopeSpans {
    /// Which.
    pub scope: Scope,
    /// The spans.
    pub spans: Vec<Span>,
}

/// A library that makes spans.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scope {
    /// Its name.
    pub name: &'static str,
    /// Its version.
    pub version: &'static str,
}

/// A span.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Span {
    /// Sixteen bytes.
    pub trace_id: String,
    /// Eight bytes.
    pub span_id: String,
    /// Eight bytes; empty for the root.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub parent_span_id: String,
    /// What it is of: few different ones.
    pub name: String,
    /// Which side of a call.
    pub kind: u8,
    /// Nanoseconds since 1970.
    pub start_time_unix_nano: String,
    /// Nanoseconds since 1970.
    pub end_time_unix_nano: String,
    /// More about it.
    pub attributes: Vec<Attribute>,
    /// Spans that brought it about and are not its parents.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<Link>,
    /// How it came out.
    pub status: Status,
}

/// `SPAN_KIND_INTERNAL`: within the process.
pub const INTERNAL: u8 = 1;
/// `SPAN_KIND_CLIENT`: asks another one.
pub const CLIENT: u8 = 3;

/// Another span.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Link {
    /// Its trace.
    pub trace_id: String,
    /// It.
    pub span_id: String,
}

/// How a span came out.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Status {
    /// 0 where nothing is said, 1 well, 2 failed.
    pub code: u8,
    /// Why it failed.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub message: String,
}

impl Status {
    /// Well.
    pub fn well() -> Status {
        Status { code: 1, ..Status::default() }
    }
    /// Failed, and why.
    pub fn failed(message: impl Into<String>) -> Status {
        Status { code: 2, message: message.into() }
    }
}

/// A named value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Attribute {
    /// Its name.
    pub key: String,
    /// Its value.
    pub value: AnyValue,
}

impl Attribute {
    /// A named value.
    pub fn new(key: impl Into<String>, value: impl Into<AnyValue>) -> Attribute {
        Attribute { key: key.into(), value: value.into() }
    }
}

/// A value.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub enum AnyValue {
    /// A text.
    StringValue(String),
    /// A whole number, as text.
    IntValue(String),
    /// A number.
    DoubleValue(f64),
    /// Several values.
    ArrayValue {
        /// They.
        values: Vec<AnyValue>,
    },
}

impl From<&str> for AnyValue {
    fn from(text: &str) -> Self {
        AnyValue::StringValue(text.into())
    }
}
impl From<String> for AnyValue {
    fn from(text: String) -> Self {
        AnyValue::StringValue(text)
    }
}
impl From<u64> for AnyValue {
    fn from(number: u64) -> Self {
        AnyValue::IntValue(number.to_string())
    }
}
impl From<f64> for AnyValue {
    fn from(number: f64) -> Self {
        AnyValue::DoubleValue(number)
    }
}
impl From<Vec<AnyValue>> for AnyValue {
    fn from(values: Vec<AnyValue>) -> Self {
        AnyValue::ArrayValue { values }
    }
}
