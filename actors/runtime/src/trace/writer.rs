//! A trace file being written.

use mcap::{
    Attachment, Compression, McapError, WriteOptions,
    records::{MessageHeader, Metadata},
    write::NoSeek,
};
use std::{
    borrow::Cow,
    collections::BTreeMap,
    fs::OpenOptions,
    io::{self, BufWriter, Read, Write},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};
use thiserror::Error;

/// The profile in the file's header, by which a trace is known from other MCAP files.
pub const PROFILE: &str = "acm";
/// Largest message or attachment, bytes: a raw 4K depth image fits.
pub const MAX_RECORD_BYTES: usize = 64 << 20;
/// Most channels in one file.
pub const MAX_CHANNELS: usize = 4096;
/// Uncompressed bytes after which a chunk is closed though nobody asked for it.
const CHUNK_BYTES: u64 = 1 << 20;
const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// How a trace is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceOptions {
    /// Largest file, bytes. A run that reaches it ends with an error.
    pub max_bytes: u64,
    /// Whether wall-clock times go to the channel `/wall`. Without them equal runs give equal files, byte by byte.
    pub wall: bool,
}

impl Default for TraceOptions {
    fn default() -> Self {
        TraceOptions { max_bytes: 4 << 30, wall: true }
    }
}

/// Why a trace could not be begun or carried on. After the first error of a write every later one gives it again.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum TraceError {
    /// The file could not be made.
    #[error("the trace {path} cannot be created: {reason}")]
    Create {
        /// The file.
        path: PathBuf,
        /// The operating system's complaint.
        reason: String,
    },
    /// Something else lies there.
    #[error("{path} exists and is no trace: choose another file, or remove it")]
    Taken {
        /// The file.
        path: PathBuf,
    },
    /// A write failed.
    #[error("the trace {path} cannot be written: {reason}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        reason: String,
    },
    /// The file has reached its limit.
    #[error("the trace {path} has reached its limit of {limit} bytes: raise the limit or keep less of each frame")]
    Full {
        /// The file.
        path: PathBuf,
        /// The limit.
        limit: u64,
    },
    /// A record or the list of channels is larger than any reader accepts.
    #[error("the trace {path} cannot take {what}: at most {limit} are kept")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What was too large.
        what: String,
        /// The limit.
        limit: usize,
    },
    /// The file is finished.
    #[error("the trace {path} is finished: nothing more can be added")]
    Finished {
        /// The file.
        path: PathBuf,
    },
}

/// How the messages of a channel are described to a reader.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema<'a> {
    /// Name of the message type.
    pub name: &'a str,
    /// Language of the description: `jsonschema` or `protobuf`.
    pub encoding: &'a str,
    /// The description.
    pub data: &'a [u8],
    /// Encoding of the messages: `json` or `protobuf`.
    pub messages: &'a str,
}

/// A channel of an open trace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel(u16);

/// A trace file being written; shared by all that write to it. What was flushed survives the end of the process, but
/// not a power failure. Without [`TraceWriter::finish`] the file has no index, and readers say that it is cut.
pub struct TraceWriter {
    path: PathBuf,
    options: TraceOptions,
    written: Arc<AtomicU64>,
    state: Mutex<State>,
}

type Sink = NoSeek<BufWriter<Counted<Box<dyn Write + Send>>>>;

enum State {
    Open(Box<mcap::Writer<Sink>>),
    Failed(TraceError),
    Finished,
}

impl TraceWriter {
    /// Makes the file and writes its header to disk, so that an unwritable path or a full disk is known at once. An
    /// earlier trace of that name is replaced; any other file is left alone.
    pub fn create(path: &Path, options: TraceOptions) -> Result<TraceWriter, TraceError> {
        let failed = |error: io::Error| TraceError::Create { path: path.into(), reason: error.to_string() };
        if !may_replace(path).map_err(failed)? {
            return Err(TraceError::Taken { path: path.into() });
        }
        let mut open = OpenOptions::new();
        let file = open.write(true).create(true).truncate(true).open(path).map_err(failed)?;
        TraceWriter::to(Box::new(file), path, options)
    }

    /// As [`TraceWriter::create`], into something that is no file; `path` is its name in errors.
    pub fn to(sink: Box<dyn Write + Send>, path: &Path, options: TraceOptions) -> Result<TraceWriter, TraceError> {
        let written = Arc::new(AtomicU64::new(0));
        let sink = NoSeek::new(BufWriter::new(Counted { sink, written: Arc::clone(&written) }));
        // Chunks are put together in memory, so that a half-written one is as rare as can be. The number of
        // compression threads is part of the result: pinned, equal input gives equal bytes.
        let mcap = WriteOptions::new()
            .profile(PROFILE)
            .library(concat!("acm-runtime ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            // The fastest: what it leaves larger costs less than the time that the run would lose.
            .compression_level(1)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(sink)
            .and_then(|mut mcap| mcap.flush().map(|()| mcap));
        let mcap = mcap.map_err(|e| TraceError::Create { path: path.into(), reason: reason(e) })?;
        let state = Mutex::new(State::Open(Box::new(mcap)));
        Ok(TraceWriter { path: path.into(), options, written, state })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
    /// How it is written.
    pub fn options(&self) -> &TraceOptions {
        &self.options
    }
    /// Bytes that have left this process.
    pub fn bytes(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// The channel of a topic; made when it is asked for first.
    pub fn channel(&self, topic: &str, schema: &Schema<'_>) -> Result<Channel, TraceError> {
        let id = self.write(|mcap| {
            let schema_id = mcap.add_schema(schema.name, schema.encoding, schema.data)?;
            mcap.add_channel(schema_id, topic, schema.messages, &BTreeMap::new())
        })?;
        if usize::from(id) > MAX_CHANNELS {
            let (path, what) = (self.path.clone(), format!("channel {id} (`{topic}`)"));
            return Err(TraceError::TooLarge { path, what, limit: MAX_CHANNELS });
        }
        Ok(Channel(id))
    }

    /// Writes a message; `time_ns` is virtual time, `sequence` any number that helps a reader.
    pub fn put(&self, channel: Channel, sequence: u64, time_ns: u64, bytes: &[u8]) -> Result<(), TraceError> {
        self.fits(bytes, "a message")?;
        let sequence = (sequence & u64::from(u32::MAX)) as u32;
        let header = MessageHeader { channel_id: channel.0, sequence, log_time: time_ns, publish_time: time_ns };
        self.write(|mcap| mcap.write_to_known_channel(&header, bytes))
    }

    /// Writes named texts that concern the whole run.
    pub fn metadata(&self, name: &str, values: BTreeMap<String, String>) -> Result<(), TraceError> {
        self.write(|mcap| mcap.write_metadata(&Metadata { name: name.into(), metadata: values }))
    }

    /// Writes a file into the file.
    pub fn attach(&self, name: &str, media_type: &str, bytes: &[u8]) -> Result<(), TraceError> {
        self.fits(bytes, "an attachment")?;
        let (name, media_type) = (name.into(), media_type.into());
        let attachment = Attachment { log_time: 0, create_time: 0, name, media_type, data: Cow::Borrowed(bytes) };
        self.write(|mcap| mcap.attach(&attachment))
    }

    /// Closes the chunk and hands everything to the operating system: it is kept if this process ends now.
    pub fn flush(&self) -> Result<(), TraceError> {
        self.write(mcap::Writer::flush)?;
        if self.bytes() <= self.options.max_bytes {
            return Ok(());
        }
        let full = TraceError::Full { path: self.path.clone(), limit: self.options.max_bytes };
        *self.locked() = State::Failed(full.clone());
        Err(full)
    }

    /// Writes the index and ends the file; returns its size in bytes.
    pub fn finish(&self) -> Result<u64, TraceError> {
        self.write(|mcap| mcap.finish())?;
        let mut state = self.locked();
        let ended = std::mem::replace(&mut *state, State::Finished);
        if let State::Open(mcap) = ended {
            let flushed = mcap.into_inner().into_inner().flush();
            flushed.map_err(|e| TraceError::Write { path: self.path.clone(), reason: e.to_string() })?;
        }
        Ok(self.bytes())
    }

    fn fits(&self, bytes: &[u8], what: &str) -> Result<(), TraceError> {
        if bytes.len() <= MAX_RECORD_BYTES {
            return Ok(());
        }
        let what = format!("{what} of {} bytes", bytes.len());
        Err(TraceError::TooLarge { path: self.path.clone(), what, limit: MAX_RECORD_BYTES })
    }

    fn write<T>(&self, work: impl FnOnce(&mut mcap::Writer<Sink>) -> Result<T, McapError>) -> Result<T, TraceError> {
        let mut state = self.locked();
        match &mut *state {
            State::Finished => Err(TraceError::Finished { path: self.path.clone() }),
            State::Failed(error) => Err(error.clone()),
            State::Open(mcap) => work(mcap).map_err(|error| {
                let error = TraceError::Write { path: self.path.clone(), reason: reason(error) };
                *state = State::Failed(error.clone());
                error
            }),
        }
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether a path is free, is no ordinary file, or holds a trace (or nothing).
fn may_replace(path: &Path) -> io::Result<bool> {
    match path.metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
        Err(error) => Err(error),
        Ok(found) if !found.is_file() => Ok(true),
        Ok(_) => {
            let mut head = Vec::new();
            std::fs::File::open(path)?.take(MAGIC.len() as u64).read_to_end(&mut head)?;
            Ok(head.is_empty() || head == MAGIC)
        }
    }
}

fn reason(error: McapError) -> String {
    match error {
        McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// Counts what passes.
struct Counted<W> {
    sink: W,
    written: Arc<AtomicU64>,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.sink.write(bytes)?;
        self.written.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;

    const JSON: Schema<'_> = Schema { name: "n", encoding: "jsonschema", data: b"{}", messages: "json" };

    /// A disk that is full after some bytes.
    struct Small(usize);
    impl Write for Small {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn an_unwritable_path_or_a_full_disk_is_known_before_the_first_message() {
        let dir = tempfile::tempdir().unwrap();
        let create = |path: &Path| TraceWriter::create(path, TraceOptions::default()).err().unwrap().to_string();
        assert!(create(&dir.path().join("no/such.mcap")).contains("no/such.mcap cannot be created: No such file"));
        assert!(create(Path::new("/dev/full")).contains("No space left"), "{}", create(Path::new("/dev/full")));
        let other = dir.path().join("letter.txt");
        std::fs::write(&other, "dear").unwrap();
        assert!(create(&other).contains("is no trace"));
        assert_eq!(std::fs::read(&other).unwrap(), b"dear");
    }

    #[test]
    fn a_disk_that_fills_up_gives_one_error_that_stays() {
        let writer = TraceWriter::to(Box::new(Small(2000)), Path::new("t"), TraceOptions::default()).unwrap();
        let channel = writer.channel("/a", &JSON).unwrap();
        let mut noise = [0; 3000];
        blake3::Hasher::new().finalize_xof().fill(&mut noise);
        let error = writer.put(channel, 1, 5, &noise).and_then(|()| writer.flush()).unwrap_err();
        assert!(matches!(&error, TraceError::Write { .. }), "{error}");
        assert_eq!(writer.put(channel, 2, 6, b"{}"), Err(error.clone()));
        assert_eq!(writer.finish(), Err(error));
    }

    #[test]
    fn a_file_has_a_largest_size() {
        let options = TraceOptions { max_bytes: 500, ..TraceOptions::default() };
        let writer = TraceWriter::to(Box::new(Vec::new()), Path::new("t"), options).unwrap();
        let channel = writer.channel("/a", &JSON).unwrap();
        let full = (0..100).find_map(|i| writer.put(channel, i, i, b"{}").and_then(|()| writer.flush()).err());
        assert_eq!(full, Some(TraceError::Full { path: "t".into(), limit: 500 }));
        let large = TraceWriter::to(Box::new(Vec::new()), Path::new("t"), TraceOptions::default()).unwrap();
        let channel = large.channel("/a", &JSON).unwrap();
        assert!(large.put(channel, 1, 1, &vec![0; MAX_RECORD_BYTES + 1]).is_err());
        assert!(large.finish().is_ok());
        assert_eq!(large.flush(), Err(TraceError::Finished { path: "t".into() }));
    }
}
