//! Reads a trace from its beginning as far as it goes.

use super::writer::{MAX_CHANNELS, MAX_RECORD_BYTES, PROFILE, Schema};
use mcap::{
    McapError,
    records::Record as McapRecord,
    sans_io::{LinearReader, LinearReaderOptions, linear_reader::LinearReadEvent},
};
use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufReader, Read},
    path::{Path, PathBuf},
    sync::Arc,
};
use thiserror::Error;

/// Largest file that is read, bytes.
pub const MAX_FILE_BYTES: u64 = 16 << 30;
/// Most messages that are read of one file.
pub const MAX_MESSAGES: u64 = 20_000_000;

/// Why a file cannot be read at all.
#[derive(Debug, Error)]
pub enum TraceReadError {
    /// It cannot be opened.
    #[error("the trace {path} cannot be read: {reason}")]
    Open {
        /// The file.
        path: PathBuf,
        /// The operating system's complaint.
        reason: String,
    },
    /// It is something else.
    #[error("{path} is no trace: {reason}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        reason: String,
    },
    /// It is larger than anything that a run writes.
    #[error("the trace {path} has {bytes} bytes, at most {MAX_FILE_BYTES} are read")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
}

/// A channel of a trace.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelInfo {
    /// The topic.
    pub topic: String,
    /// Name of the message type.
    pub schema: String,
    /// Language of the type's description: `jsonschema` or `protobuf`.
    pub language: String,
    /// The type's description.
    pub description: Arc<[u8]>,
    /// Encoding of the messages: `json` or `protobuf`.
    pub encoding: String,
}

impl ChannelInfo {
    /// How its messages are described, as a writer takes it.
    pub fn schema(&self) -> Schema<'_> {
        Schema { name: &self.schema, encoding: &self.language, data: &self.description, messages: &self.encoding }
    }
}

/// A message of a trace.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceMessage {
    /// Where it was written.
    pub channel: Arc<ChannelInfo>,
    /// The number that its writer gave it, cut to 32 bits.
    pub sequence: u32,
    /// Virtual time, nanoseconds.
    pub time_ns: u64,
    /// The bytes.
    pub data: Vec<u8>,
}

impl TraceMessage {
    /// The topic.
    pub fn topic(&self) -> &str {
        &self.channel.topic
    }
}

/// What stands in a trace.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A message of any channel.
    Message(TraceMessage),
    /// Named texts that concern the whole run.
    Metadata {
        /// Their name.
        name: String,
        /// The texts.
        values: BTreeMap<String, String>,
    },
    /// A file within the file.
    Attachment {
        /// Its name.
        name: String,
        /// Its media type.
        media_type: String,
        /// Its bytes.
        data: Vec<u8>,
    },
}

/// Reads a trace from its beginning. A file that was cut or damaged gives what stands before the damage.
pub struct TraceReader {
    source: BufReader<File>,
    linear: LinearReader,
    schemas: BTreeMap<u16, (String, String, Arc<[u8]>)>,
    channels: BTreeMap<u16, Arc<ChannelInfo>>,
    bytes: u64,
    messages: u64,
    cut: Option<String>,
    done: bool,
}

impl TraceReader {
    /// Opens a file and reads its header.
    pub fn open(path: &Path) -> Result<TraceReader, TraceReadError> {
        let failed = |e: std::io::Error| TraceReadError::Open { path: path.into(), reason: e.to_string() };
        let foreign = |reason: String| TraceReadError::Foreign { path: path.into(), reason };
        let file = File::open(path).map_err(failed)?;
        let about = file.metadata().map_err(failed)?;
        if about.is_dir() {
            return Err(foreign("it is a folder".into()));
        }
        if about.len() > MAX_FILE_BYTES {
            return Err(TraceReadError::TooLarge { path: path.into(), bytes: about.len() });
        }
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(2 * MAX_RECORD_BYTES);
        let mut reader = TraceReader {
            source: BufReader::new(file),
            linear: LinearReader::new_with_options(options),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            bytes: about.len(),
            messages: 0,
            cut: None,
            done: false,
        };
        match reader.next_record() {
            Ok(Some(McapRecord::Header(header))) if header.profile == PROFILE => Ok(reader),
            Ok(Some(McapRecord::Header(header))) => {
                Err(foreign(format!("it is an MCAP file of another program (`{}`)", short(&header.library))))
            }
            Ok(_) => Err(foreign("it does not begin with a header".into())),
            Err(McapError::BadMagic) => Err(foreign("it is no MCAP file".into())),
            Err(McapError::UnexpectedEof) => {
                Err(foreign(format!("it ends within its header, after {} bytes", about.len())))
            }
            Err(error) => Err(foreign(error.to_string())),
        }
    }

    /// Size of the file in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
    /// Once there is no further item: why the file ended too early, if it did.
    pub fn cut(&self) -> Option<&str> {
        self.cut.as_deref()
    }

    /// The next item; `None` at the end, or where the file is cut or damaged.
    pub fn next_item(&mut self) -> Option<Item> {
        while !self.done {
            let taken = match self.next_record() {
                Ok(Some(record)) => self.take(record),
                Ok(None) => {
                    self.done = true;
                    Ok(None)
                }
                Err(McapError::UnexpectedEof) => Err(format!("it ends within a record, after {} bytes", self.bytes)),
                Err(error) => Err(format!("it is damaged: {error}")),
            };
            match taken {
                Ok(Some(item)) => return Some(item),
                Ok(None) => {}
                Err(reason) => (self.cut, self.done) = (Some(reason), true),
            }
        }
        None
    }

    /// Takes over what describes other records, and gives what a caller wants to see.
    fn take(&mut self, record: McapRecord<'static>) -> Result<Option<Item>, String> {
        match record {
            McapRecord::Schema { header, data } => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.as_ref().into()));
            }
            McapRecord::Channel(channel) => {
                let (schema, language, description) = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let (topic, encoding) = (channel.topic, channel.message_encoding);
                let info = ChannelInfo { topic, schema, language, description, encoding };
                self.channels.insert(channel.id, Arc::new(info));
                if self.channels.len() > MAX_CHANNELS {
                    return Err(format!("it has more than {MAX_CHANNELS} channels"));
                }
            }
            McapRecord::Message { header, data } => {
                self.messages += 1;
                if self.messages > MAX_MESSAGES {
                    return Err(format!("it has more than {MAX_MESSAGES} messages; the others are left out"));
                }
                let channel = self.channels.get(&header.channel_id).cloned();
                let channel = channel
                    .ok_or_else(|| format!("a message is on channel {}, which it has not", header.channel_id))?;
                let (sequence, time_ns) = (header.sequence, header.log_time);
                let message = TraceMessage { channel, sequence, time_ns, data: data.into_owned() };
                return Ok(Some(Item::Message(message)));
            }
            McapRecord::Metadata(metadata) => {
                return Ok(Some(Item::Metadata { name: metadata.name, values: metadata.metadata }));
            }
            McapRecord::Attachment { header, data, .. } => {
                let (name, media_type) = (header.name, header.media_type);
                return Ok(Some(Item::Attachment { name, media_type, data: data.into_owned() }));
            }
            // The summary says once more what was read already.
            _ => {}
        }
        Ok(None)
    }

    fn next_record(&mut self) -> Result<Option<McapRecord<'static>>, McapError> {
        loop {
            match self.linear.next_event() {
                None => return Ok(None),
                Some(Ok(LinearReadEvent::ReadRequest(need))) => {
                    let read = self.source.read(self.linear.insert(need))?;
                    self.linear.notify_read(read);
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    return mcap::parse_record(opcode, data).map(|record| Some(record.into_owned()));
                }
                Some(Err(error)) => return Err(error),
            }
        }
    }
}

/// The beginning of a text from a file that nobody vouches for.
fn short(text: &str) -> String {
    text.chars().filter(|sign| !sign.is_control()).take(40).collect()
}
