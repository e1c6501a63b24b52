//! Lines of JSON and raw bytes over a connection, with limits and deadlines.

use super::address::Stream;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::{
    io::{self, Read, Write},
    time::{Duration, Instant},
};
use thiserror::Error;

/// Longest line, bytes.
pub const MAX_LINE_BYTES: usize = 1 << 20;
/// Bytes asked for at a time.
const CHUNK_BYTES: usize = 1 << 16;

/// Why a message could not be sent or received. The connection cannot be used after it.
#[derive(Debug, Error)]
pub enum WireError {
    /// The other end is gone.
    #[error("the other end closed the connection")]
    Closed,
    /// The other end hangs or is overloaded.
    #[error("the other end did not answer within {:.1} s", .0.as_secs_f64())]
    Late(Duration),
    /// The socket failed.
    #[error("the connection failed: {0}")]
    Io(io::Error),
    /// The other end does not speak the protocol.
    #[error("what came is no message of the robot protocol: {0}")]
    Message(String),
}

impl From<io::Error> for WireError {
    fn from(error: io::Error) -> Self {
        use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, NotConnected, UnexpectedEof};
        match error.kind() {
            BrokenPipe | ConnectionReset | ConnectionAborted | NotConnected | UnexpectedEof => WireError::Closed,
            _ => WireError::Io(error),
        }
    }
}

/// A moment by which something must be over.
#[derive(Debug, Clone, Copy)]
struct Deadline {
    limit: Duration,
    at: Instant,
}

impl Deadline {
    fn after(limit: Duration) -> Deadline {
        Deadline { limit, at: now() + limit }
    }
    /// What is left of it; never zero, which sockets take for no limit.
    fn left(&self) -> Result<Duration, WireError> {
        let left = self.at.saturating_duration_since(now());
        if left.is_zero() { Err(WireError::Late(self.limit)) } else { Ok(left) }
    }
    /// The error of a call that was given [`Deadline::left`].
    fn fault(&self, error: io::Error) -> WireError {
        match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => WireError::Late(self.limit),
            _ => error.into(),
        }
    }
}

/// A dead connection must end in wall time; no core ever sees this clock.
#[allow(clippy::disallowed_methods)]
fn now() -> Instant {
    Instant::now()
}

/// One end of a connection.
#[derive(Debug)]
pub struct Wire {
    stream: Stream,
    /// Bytes that came and were not yet used, from `used` on.
    buffer: Vec<u8>,
    used: usize,
}

impl Wire {
    pub fn new(stream: Stream) -> Wire {
        Wire { stream, buffer: Vec::new(), used: 0 }
    }

    pub fn stream(&self) -> &Stream {
        &self.stream
    }

    /// Sends a message and the raw bytes that follow it. Their number stands in the message under `bytes`.
    pub fn send<'a>(
        &mut self,
        message: &impl Serialize,
        raw: impl IntoIterator<Item = &'a [u8]>,
        limit: Duration,
    ) -> Result<(), WireError> {
        let deadline = Deadline::after(limit);
        let mut line = serde_json::to_vec(message).map_err(|e| WireError::Message(e.to_string()))?;
        if line.len() >= MAX_LINE_BYTES {
            return Err(WireError::Message(format!("a line of {} bytes is too long to send", line.len())));
        }
        line.push(b'\n');
        self.write(&line, &deadline)?;
        raw.into_iter().try_for_each(|part| self.write(part, &deadline))
    }

    /// Receives a message and the raw bytes that follow it, at most `most`. The first byte may take as long as
    /// `patience`, the rest as long as `limit`.
    pub fn receive<T: DeserializeOwned>(
        &mut self,
        patience: Duration,
        limit: Duration,
        most: usize,
    ) -> Result<(T, Vec<u8>), WireError> {
        if self.used == self.buffer.len() {
            self.read_more(&Deadline::after(patience))?;
        }
        let deadline = Deadline::after(limit);
        let line = self.line(&deadline)?;
        let fault = |error: serde_json::Error| {
            let begin = String::from_utf8_lossy(line.get(..60).unwrap_or(&line)).into_owned();
            WireError::Message(format!("{error}, in `{begin}`"))
        };
        let value: Value = serde_json::from_slice(&line).map_err(fault)?;
        let count = value.get("bytes").and_then(Value::as_u64).unwrap_or(0);
        let message = serde_json::from_value(value).map_err(fault)?;
        let count = usize::try_from(count).ok().filter(|count| *count <= most);
        let count = count.ok_or_else(|| WireError::Message(format!("more than {most} raw bytes are announced")))?;
        Ok((message, self.raw(count, &deadline)?))
    }

    fn line(&mut self, deadline: &Deadline) -> Result<Vec<u8>, WireError> {
        let mut searched = self.used;
        loop {
            let fresh = self.buffer.get(searched..).unwrap_or_default();
            if let Some(length) = fresh.iter().position(|byte| *byte == b'\n') {
                let line = self.buffer[self.used..searched + length].to_vec();
                self.used = searched + length + 1;
                return Ok(line);
            }
            if self.buffer.len() - self.used >= MAX_LINE_BYTES {
                return Err(WireError::Message(format!("a line is longer than {MAX_LINE_BYTES} bytes")));
            }
            searched = self.buffer.len();
            self.read_more(deadline)?;
        }
    }

    fn raw(&mut self, count: usize, deadline: &Deadline) -> Result<Vec<u8>, WireError> {
        let waiting = (self.buffer.len() - self.used).min(count);
        let mut raw = vec![0; count];
        raw[..waiting].copy_from_slice(&self.buffer[self.used..self.used + waiting]);
        self.used += waiting;
        let mut filled = waiting;
        while filled < count {
            filled += read(&mut self.stream, &mut raw[filled..], deadline)?;
        }
        Ok(raw)
    }

    /// Appends what comes to the buffer, whose used part goes when nothing else is in it.
    fn read_more(&mut self, deadline: &Deadline) -> Result<(), WireError> {
        if self.used == self.buffer.len() {
            self.buffer.clear();
            self.used = 0;
        }
        let end = self.buffer.len();
        self.buffer.resize(end + CHUNK_BYTES, 0);
        let outcome = read(&mut self.stream, &mut self.buffer[end..], deadline);
        self.buffer.truncate(end + outcome.as_ref().copied().unwrap_or(0));
        outcome.map(|_| ())
    }

    fn write(&mut self, mut bytes: &[u8], deadline: &Deadline) -> Result<(), WireError> {
        while !bytes.is_empty() {
            self.stream.limit_write(deadline.left()?)?;
            match self.stream.write(bytes) {
                Ok(0) => return Err(WireError::Closed),
                Ok(written) => bytes = &bytes[written..],
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(deadline.fault(error)),
            }
        }
        Ok(())
    }
}

/// Reads at least one byte.
fn read(stream: &mut Stream, buffer: &mut [u8], deadline: &Deadline) -> Result<usize, WireError> {
    loop {
        stream.limit_read(deadline.left()?)?;
        match stream.read(buffer) {
            Ok(0) => return Err(WireError::Closed),
            Ok(count) => return Ok(count),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(deadline.fault(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixStream;

    const PATIENCE: Duration = Duration::from_secs(60);

    fn pair() -> (UnixStream, Wire) {
        let (other, own) = UnixStream::pair().unwrap();
        (other, Wire::new(Stream::Unix(own)))
    }

    fn receive(wire: &mut Wire) -> Result<(Value, Vec<u8>), WireError> {
        wire.receive(PATIENCE, PATIENCE, 8)
    }

    #[test]
    fn lines_and_raw_bytes_come_apart_however_they_were_sent() {
        let (mut other, mut wire) = pair();
        other.write_all(b"{\"a\":1}\n{\"bytes\":5}\n12\n45{\"b\":2}\n{\"bytes\"").unwrap();
        other.write_all(b":3}\nabc").unwrap();
        assert_eq!(receive(&mut wire).unwrap().0["a"], 1);
        assert_eq!(receive(&mut wire).unwrap().1, b"12\n45");
        assert_eq!(receive(&mut wire).unwrap().0["b"], 2);
        assert_eq!(receive(&mut wire).unwrap().1, b"abc");
        drop(other);
        assert!(matches!(receive(&mut wire), Err(WireError::Closed)));
    }

    #[test]
    fn what_is_sent_is_received() {
        let (other, mut wire) = pair();
        let message = serde_json::json!({"number": 0.1, "bytes": 4});
        wire.send(&message, [&b"ab"[..], b"cd"], PATIENCE).unwrap();
        assert_eq!(receive(&mut Wire::new(Stream::Unix(other))).unwrap(), (message, b"abcd".to_vec()));
    }

    #[test]
    fn what_is_no_message_or_too_much_is_refused() {
        let refused = |sent: &[u8], part: &str| {
            let (mut other, mut wire) = pair();
            let sent = sent.to_vec();
            let writer = std::thread::scope(|threads| {
                threads.spawn(move || other.write_all(&sent).map(|()| drop(other)));
                receive(&mut wire)
            });
            let error = writer.unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        };
        refused(b"GET / HTTP/1.1\n", "GET / HTTP");
        refused(b"{\"bytes\":9}\n123456789", "more than 8 raw bytes");
        refused(b"{\"bytes\":18446744073709551615}\n", "more than 8 raw bytes");
        refused(&vec![b'x'; MAX_LINE_BYTES + CHUNK_BYTES], "longer than");
        refused(b"{\"a\":", "closed");
    }

    #[test]
    fn an_end_that_says_nothing_or_stops_in_a_message_is_not_waited_for() {
        let short = Duration::from_millis(20);
        let (mut other, mut wire) = pair();
        assert!(matches!(wire.receive::<Value>(short, PATIENCE, 0), Err(WireError::Late(_))));
        other.write_all(b"{\"a\"").unwrap();
        assert!(matches!(wire.receive::<Value>(PATIENCE, short, 0), Err(WireError::Late(_))));
        // Nobody reads: the socket's buffers fill up.
        let raw = vec![0; 1 << 24];
        assert!(matches!(wire.send(&Value::Null, [&raw[..]], short), Err(WireError::Late(_))));
    }
}
