//! A trace as lines of JSON: each message, effect and change of memory as it was written, with its topic.
//!
//! Wall-clock times are left out, so that equal runs give equal lines.

use acm_runtime::trace::{Item, TraceReader, record};
use serde_json::Value;
use std::{io::Write, path::Path};

/// Writes the lines. Gives why the trace ends too early, if it does.
///
/// # Errors
/// The trace cannot be read, or the lines cannot be written.
pub fn write(trace: &Path, out: &mut dyn Write) -> anyhow::Result<Option<String>> {
    let mut reader = TraceReader::open(trace)?;
    while let Some(item) = reader.next_item() {
        let Item::Message(message) = item else { continue };
        if ![record::NAME, "acm.Effect", "acm.MemoryDelta"].contains(&message.channel.schema.as_str()) {
            continue;
        }
        let Ok(Value::Object(mut record)) = serde_json::from_slice(&message.data) else { continue };
        record.insert("topic".into(), message.topic().into());
        serde_json::to_writer(&mut *out, &record).map_err(std::io::Error::from)?;
        out.write_all(b"\n")?;
    }
    Ok(reader.cut().map(str::to_owned))
}
