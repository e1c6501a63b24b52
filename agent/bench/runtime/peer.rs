//! The other process: takes frames and says when it had each.

use super::{frames::LIMITS, now_ns};
use crate::cli::{BenchReaderArgs, Exit};
use acm_runtime::frame_bus::{FrameReader, SharedMemoryReader};
use anyhow::{Context, bail};
use std::{
    hint::black_box,
    io::{ErrorKind, Read, Write},
    os::unix::net::UnixStream,
    time::Duration,
};

/// How long nothing may come before the process ends by itself.
const PATIENCE: Duration = Duration::from_secs(20);

/// Takes frames until none comes any more. Says `ready`, then for each frame its number and the time it was there.
pub fn run(args: &BenchReaderArgs) -> anyhow::Result<Exit> {
    match args.way.as_str() {
        "bus" => from_bus(&args.name)?,
        "socket" => from_socket(&args.name)?,
        way => bail!("there is no way `{way}`: bus or socket"),
    }
    Ok(Exit::Success)
}

fn from_bus(name: &str) -> anyhow::Result<()> {
    let reader = SharedMemoryReader::open(name, LIMITS)?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "ready")?;
    let mut last = None;
    while reader.wait(PATIENCE)? {
        let Some(number) = reader.newest()?.filter(|number| last != Some(*number)) else { continue };
        let frame = reader.get(number)?;
        frame.planes.iter().for_each(|plane| touch(plane));
        writeln!(out, "{number} {}", now_ns())?;
        last = Some(number);
    }
    Ok(())
}

fn from_socket(path: &str) -> anyhow::Result<()> {
    let mut socket = UnixStream::connect(path).with_context(|| format!("the socket {path} cannot be joined"))?;
    socket.set_read_timeout(Some(PATIENCE))?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "ready")?;
    let mut buffer = Vec::new();
    loop {
        let mut head = [0; 16];
        match socket.read_exact(&mut head) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(()),
            read => read?,
        }
        let [number, bytes] = head_numbers(head);
        // The memory is kept from frame to frame, as a careful receiver would.
        buffer.resize(usize::try_from(bytes)?.min(acm_runtime::frame_bus::MAX_FRAME_BYTES), 0);
        socket.read_exact(&mut buffer)?;
        touch(&buffer);
        writeln!(out, "{number} {}", now_ns())?;
    }
}

/// Number and size that stand before a frame on the socket.
pub fn head_numbers(head: [u8; 16]) -> [u64; 2] {
    let (number, bytes) = head.split_at(8);
    [number, bytes].map(|part| part.try_into().map_or(0, u64::from_le_bytes))
}

/// Reads both ends, so that what was handed over is there for certain.
pub fn touch(bytes: &[u8]) {
    black_box((bytes.first(), bytes.last()));
}
