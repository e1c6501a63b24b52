//! RGB-D frames from one to the other: through shared memory between two processes, beside what else could be done.

use super::{Row, Scratch, now_ns, peer, row};
use crate::{bench::BenchResult, statistics::median_and};
use acm_runtime::frame_bus::{BusLimits, ByteFrame, SharedMemoryWriter, run_id};
use anyhow::{Context, bail};
use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Write},
    num::NonZero,
    os::unix::net::UnixListener,
    process::{Child, ChildStdout, Command, Stdio},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
};
use tokio::sync::mpsc;

/// What the bus of this bench holds.
pub const LIMITS: BusLimits = BusLimits { readers: 1, frames: 2, views: 2 };
const SIZES: [(u32, u32); 4] = [(320, 240), (640, 480), (1280, 720), (1920, 1080)];
const REPETITIONS: u64 = 1000;
/// Hand-overs before those that count.
const WARM_UP: u64 = 20;
/// Small hand-overs between the copy of a frame and its own hand-over.
const REWARMING: u64 = 8;
/// From the beginning of a frame's copy to its hand-over, where sizes are compared.
const PAUSE_NS: u64 = 4_000_000;
/// The `nice` value of threads that only keep processors awake.
const LOWEST_PRIORITY: i32 = 19;

/// Measures all sizes by all ways.
pub fn measure(quick: bool, folder: &Scratch, result: &mut BenchResult) -> anyhow::Result<()> {
    let repetitions = if quick { REPETITIONS / 10 } else { REPETITIONS };
    let mut medians = BTreeMap::new();
    let _awake = Awake::start();
    for (width, height) in SIZES {
        let (name, frame) = (format!("{width}x{height}"), frame(width, height));
        match shared_memory(&frame, repetitions).and_then(|spans| Ok((spans, rested(&frame, repetitions / 4)?))) {
            Ok((spans, rested)) => {
                let ways = [
                    ("bus", "hand-over", &spans.hand_over),
                    ("rested", "hand-over after 4 ms", &rested.hand_over),
                    ("fill", "copy into it", &spans.fill),
                    ("whole", "copy and hand-over", &spans.whole),
                ];
                for (way, what, times) in ways {
                    medians.insert((way, width), median_and(0.99, times));
                    result.rows.push(row(&name, &format!("two processes, shared memory: {what}"), times));
                }
            }
            // A container may have hardly any shared memory.
            Err(error) => result.rows.push(Row::skipped(format!("{name}, shared memory"), format!("{error:#}"))),
        }
        let spans = unix_socket(&frame, repetitions, folder)?;
        medians.insert(("socket", width), median_and(0.99, &spans));
        result.rows.push(row(&name, "two processes, Unix socket", &spans));
        for (group, copies) in [("one process, Arc over mpsc", false), ("one process, cloned over mpsc", true)] {
            result.rows.push(row(&name, group, &channel(&frame, repetitions, copies)?));
        }
    }
    figures(&medians, result);
    Ok(())
}

fn figures(medians: &BTreeMap<(&str, u32), (f64, f64)>, result: &mut BenchResult) {
    let of = |way, width| medians.get(&(way, width)).copied();
    if let (Some((p50, p99)), Some((socket, _))) = (of("bus", 640), of("socket", 640)) {
        result.figure("frame_handover_p50_us", p50);
        result.figure("frame_handover_p99_us", p99);
        result.figure("frame_handover_times_faster_than_unix_socket", socket / p50);
        if let Some((whole, _)) = of("whole", 640) {
            result.figure("frame_copied_in_and_handed_over_p50_us", whole);
            result.figure("frame_copied_in_times_faster_than_unix_socket", socket / whole);
        }
    }
    if let (Some((large, _)), Some((small, _))) = (of("rested", 1920), of("rested", 320)) {
        result.figure("frame_handover_1080p_over_qvga", large / small);
    }
    let notes = [
        "What iceoryx2 buys: a frame crosses a process border without a copy on the reader's side, so the hand-over does",
        "not grow with the frame; a simulator, driver or agent may die alone; its pool of frames is bounded.",
        "What it does not buy: speed within one process. There an Arc over a queue hands over the same pixels, by no more",
        "than a pointer. The writer still copies a frame once into shared memory, unless the camera writes there itself:",
        "that row grows with the frame, and the hand-over figures do not hold it; those named `copied in` do.",
        "All these times hold the waking of a thread that sleeps; the Arc rows say about how long that takes here and now.",
        "A reader that has slept longer takes longer to wake, and large frames take longer to copy before they are sent:",
        "sizes are compared by the hand-overs 4 ms after a copy began. The Unix socket is compared without such a pause.",
        "The processors are kept from sleeping by threads of the lowest priority, for the Unix socket and the queues as well:",
        "waking a processor costs tens of microseconds more, whichever way a frame takes.",
    ];
    result.notes.extend(notes.map(str::to_owned));
}

fn frame(width: u32, height: u32) -> ByteFrame {
    let pixels = width as usize * height as usize;
    let noise = |bytes: usize| (0..bytes).map(|i| (i.wrapping_mul(2_654_435_761) >> 7) as u8).collect::<Vec<u8>>();
    let planes = vec![noise(3 * pixels).into(), noise(4 * pixels).into()];
    ByteFrame { size: [width, height], header: vec![0; 256].into(), planes }
}

/// Times of a frame's way through shared memory, in microseconds.
#[derive(Default)]
struct Spans {
    /// Copying the pixels into shared memory.
    fill: Vec<f64>,
    /// From sending a frame that lies there to its presence in the other process.
    hand_over: Vec<f64>,
    /// From the pixels at the writer to the frame at the reader.
    whole: Vec<f64>,
}

fn shared_memory(frame: &ByteFrame, repetitions: u64) -> anyhow::Result<Spans> {
    spans(frame, repetitions, 0)
}

/// The same with hand-overs at equal distances. Large frames take long to copy, and a reader that has slept longer takes
/// longer to wake: only so do sizes compare.
fn rested(frame: &ByteFrame, repetitions: u64) -> anyhow::Result<Spans> {
    spans(frame, repetitions, PAUSE_NS)
}

/// `pause_ns`: the least time from the beginning of a frame's copy to its hand-over.
fn spans(frame: &ByteFrame, repetitions: u64, pause_ns: u64) -> anyhow::Result<Spans> {
    let mut pair = Pair::start(frame)?;
    let thumbnail = self::frame(16, 16);
    let mut small = Pair::start(&thumbnail)?;
    let mut spans = Spans::default();
    for repetition in 0..WARM_UP + repetitions {
        let counts = repetition >= WARM_UP;
        let began = now_ns();
        let there = pair.hand_over(2 * repetition, frame, || Ok(began))?.1;
        if counts {
            spans.whole.push(microseconds(began, there));
        }
        // The copy empties the caches, which a camera that writes into shared memory would not. Small frames to a second
        // reader go between, so that the cost of the copy is not taken for one of the hand-over.
        let began = now_ns();
        let mut filled = began;
        let between = || {
            filled = now_ns();
            while now_ns() < began + pause_ns {
                std::hint::spin_loop();
            }
            for number in REWARMING * repetition..REWARMING * (repetition + 1) {
                small.hand_over(number, &thumbnail, || Ok(0))?;
            }
            Ok(now_ns())
        };
        let (sent, there) = pair.hand_over(2 * repetition + 1, frame, between)?;
        if counts {
            spans.fill.push(microseconds(began, filled));
            spans.hand_over.push(microseconds(sent, there));
        }
    }
    Ok(spans)
}

/// A bus and a process that reads from it.
struct Pair {
    writer: SharedMemoryWriter,
    reader: Reader,
}

impl Pair {
    fn start(frame: &ByteFrame) -> anyhow::Result<Pair> {
        let name = format!("acm/bench/{}/{}", run_id(), frame.size[0]);
        let writer = SharedMemoryWriter::create(&name, LIMITS, frame.bytes())?;
        Ok(Pair { reader: Reader::start("bus", &name)?, writer })
    }
    /// Copies a frame in, does what is to be done before it is sent, and sends it. When `between` ended, and when the
    /// reader had the frame.
    fn hand_over(
        &mut self,
        number: u64,
        frame: &ByteFrame,
        between: impl FnOnce() -> anyhow::Result<u64>,
    ) -> anyhow::Result<(u64, u64)> {
        let prepared = self.writer.prepare(number, frame)?;
        let sent = between()?;
        prepared.send()?;
        Ok((sent, self.reader.there(number)?))
    }
}

/// Keeps all processors from sleeping while it lives, by threads of the lowest priority that any other thread displaces.
struct Awake {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Awake {
    fn start() -> Awake {
        let stop = Arc::new(AtomicBool::new(false));
        let processors = std::thread::available_parallelism().map_or(1, NonZero::get);
        let spin = |stop: Arc<AtomicBool>| {
            // Without the low priority the threads would take part in what is measured.
            if rustix::process::nice(LOWEST_PRIORITY).is_ok() {
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            }
        };
        #[allow(clippy::disallowed_methods, reason = "a bench's own threads; no actor's core is near")]
        let thread = |_| {
            let stop = Arc::clone(&stop);
            std::thread::spawn(move || spin(stop))
        };
        Awake { threads: (0..processors).map(thread).collect(), stop }
    }
}

impl Drop for Awake {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                eprintln!("acm: a thread that keeps the processors awake has failed");
            }
        }
    }
}

fn unix_socket(frame: &ByteFrame, repetitions: u64, folder: &Scratch) -> anyhow::Result<Vec<f64>> {
    let path = folder.path().join(format!("{}.socket", frame.size[0]));
    let listener = UnixListener::bind(&path)?;
    let mut reader = Reader::start("socket", &path.to_string_lossy())?;
    let (mut socket, _) = listener.accept()?;
    let mut spans = Vec::new();
    for number in 0..WARM_UP + repetitions {
        let bytes: usize = frame.planes.iter().map(|plane| plane.len()).sum();
        let sent = now_ns();
        socket.write_all(&number.to_le_bytes())?;
        socket.write_all(&(bytes as u64).to_le_bytes())?;
        for plane in &frame.planes {
            socket.write_all(plane)?;
        }
        let there = reader.there(number)?;
        if number >= WARM_UP {
            spans.push(microseconds(sent, there));
        }
    }
    Ok(spans)
}

/// A frame through a bounded queue between two tasks, shared or copied.
fn channel(frame: &ByteFrame, repetitions: u64, copies: bool) -> anyhow::Result<Vec<f64>> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).build()?;
    let shared: Arc<Vec<Vec<u8>>> = Arc::new(frame.planes.iter().map(|plane| plane.to_vec()).collect());
    runtime.block_on(async {
        let (sender, mut frames) = mpsc::channel::<Arc<Vec<Vec<u8>>>>(2);
        let (back, mut times) = mpsc::channel(2);
        #[allow(clippy::disallowed_methods, reason = "the peer that is compared with: a plain task")]
        let consumer = tokio::spawn(async move {
            while let Some(frame) = frames.recv().await {
                frame.iter().for_each(|plane| peer::touch(plane));
                if back.send(now_ns()).await.is_err() {
                    break;
                }
            }
        });
        let mut spans = Vec::new();
        for number in 0..WARM_UP + repetitions {
            let sent = now_ns();
            let frame = if copies { Arc::new((*shared).clone()) } else { Arc::clone(&shared) };
            sender.send(frame).await.context("the consumer is gone")?;
            let there = times.recv().await.context("the consumer is gone")?;
            if number >= WARM_UP {
                spans.push(microseconds(sent, there));
            }
        }
        drop(sender);
        consumer.await?;
        Ok(spans)
    })
}

/// The other process, ended with this value.
struct Reader {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Reader {
    fn start(way: &str, name: &str) -> anyhow::Result<Reader> {
        let program = std::env::current_exe().context("this program's own file is not known")?;
        let mut child = Command::new(program)
            .args(["bench-reader", way, name])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .context("the other process cannot be started")?;
        let lines = BufReader::new(child.stdout.take().context("the other process has no output")?);
        let mut reader = Reader { child, lines };
        if way == "bus" && reader.line()?.trim() != "ready" {
            bail!("the other process did not join the bus");
        }
        Ok(reader)
    }
    /// Waits until the other process has a frame; when that was.
    fn there(&mut self, number: u64) -> anyhow::Result<u64> {
        loop {
            let line = self.line()?;
            let Some((said, time_ns)) = line.trim().split_once(' ') else { continue };
            if said.parse() == Ok(number) {
                return time_ns.parse().with_context(|| format!("the other process says `{}`", line.trim()));
            }
        }
    }
    fn line(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        if self.lines.read_line(&mut line)? == 0 {
            bail!("the other process has ended");
        }
        Ok(line)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        if self.child.kill().and_then(|()| self.child.wait()).is_err() {
            eprintln!("acm: the other process could not be ended");
        }
    }
}

fn microseconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-3
}
