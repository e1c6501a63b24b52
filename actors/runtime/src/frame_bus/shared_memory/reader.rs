//! A reading end.

use super::{
    super::{ByteFrame, FrameError, FrameLost, FrameReader},
    BusError, BusLimits, Events, Frames, Service,
    chunk::{FrameTag, cut},
    join,
};
use bytes::Bytes;
use iceoryx2::{
    port::{listener::Listener, subscriber::Subscriber},
    prelude::Node,
    sample::Sample,
};
use std::{
    collections::VecDeque,
    fmt,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

/// The end of a shared-memory bus where frames are taken, without a copy: their bytes lie where the writer put them,
/// and the place is free again when the last clone is dropped. A user who holds more than [`BusLimits::views`] older
/// frames gets copies of the newest ones instead, so that the bus never runs dry. Frames published before the end was
/// opened are not seen.
pub struct SharedMemoryReader {
    name: String,
    limits: BusLimits,
    /// Samples that are held at present, by the window or by users.
    held: Arc<AtomicUsize>,
    ports: Mutex<Ports>,
    listener: Mutex<Listener<Service>>,
}

struct Ports {
    window: VecDeque<(u64, Result<Arc<ByteFrame>, String>)>,
    subscriber: Subscriber<Service, [u8], FrameTag>,
    // Kept open as long as the ports are.
    _services: (Frames, Events),
    _node: Node<Service>,
}

impl fmt::Debug for SharedMemoryReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SharedMemoryReader({})", self.name)
    }
}

impl SharedMemoryReader {
    /// Joins the bus of the given name, whose writer named the same limits.
    ///
    /// # Errors
    /// There is no such bus on this host, it has other limits, or all its readers' places are taken.
    pub fn open(name: &str, limits: BusLimits) -> Result<SharedMemoryReader, BusError> {
        let joined = join(name, &limits, false)?;
        let setup = |reason: String| BusError::Setup { name: name.into(), action: "joined", reason };
        let subscriber =
            joined.frames.subscriber_builder().buffer_size(limits.frames).create().map_err(|e| setup(e.to_string()))?;
        let listener = joined.events.listener_builder().create().map_err(|e| setup(e.to_string()))?;
        let (_services, _node) = ((joined.frames, joined.events), joined.node);
        Ok(SharedMemoryReader {
            name: name.into(),
            limits,
            held: Arc::default(),
            ports: Mutex::new(Ports { window: VecDeque::new(), subscriber, _services, _node }),
            listener: Mutex::new(listener),
        })
    }

    /// Waits until a frame has been published since the last wait, at most as long as `limit`; whether one was.
    ///
    /// # Errors
    /// The event port failed.
    pub fn wait(&self, limit: Duration) -> Result<bool, BusError> {
        let listener = self.listener.lock().unwrap_or_else(PoisonError::into_inner);
        let count = listener.timed_wait(|_| {}, limit);
        count.map(|count| count > 0).map_err(|e| BusError::Setup {
            name: self.name.clone(),
            action: "waited for",
            reason: e.to_string(),
        })
    }

    /// The number of the newest frame, if there is one.
    ///
    /// # Errors
    /// The bus failed.
    pub fn newest(&self) -> Result<Option<u64>, FrameError> {
        let mut ports = self.ports.lock().unwrap_or_else(PoisonError::into_inner);
        self.take_in(&mut ports).map_err(|reason| FrameError::Unreadable { number: 0, reason })?;
        Ok(ports.window.back().map(|(number, _)| *number))
    }

    /// Moves what has come into the window, whose oldest frames go.
    fn take_in(&self, ports: &mut Ports) -> Result<(), String> {
        loop {
            while ports.window.len() > self.limits.frames {
                ports.window.pop_front();
            }
            let Some(sample) = ports.subscriber.receive().map_err(|e| e.to_string())? else { return Ok(()) };
            let tag = *sample.user_header();
            // One place always stays free to receive into, whatever the user holds.
            let held = self.held.fetch_add(1, Ordering::AcqRel) + 1;
            let sample = Held { sample: Some(sample), count: Arc::clone(&self.held) };
            let payload = match held < self.limits.borrowed() {
                true => Bytes::from_owner(sample),
                false => Bytes::copy_from_slice(sample.as_ref()),
            };
            ports.window.push_back((tag.number, cut(&tag, &payload).map(Arc::new)));
        }
    }
}

impl FrameReader<ByteFrame> for SharedMemoryReader {
    fn get(&self, number: u64) -> Result<Arc<ByteFrame>, FrameError> {
        let mut ports = self.ports.lock().unwrap_or_else(PoisonError::into_inner);
        self.take_in(&mut ports).map_err(|reason| FrameError::Unreadable { number, reason })?;
        match ports.window.iter().find(|(at, _)| *at == number) {
            Some((_, Ok(frame))) => Ok(Arc::clone(frame)),
            Some((_, Err(reason))) => Err(FrameError::Unreadable { number, reason: reason.clone() }),
            None => {
                let ends = (ports.window.front().map(|(at, _)| *at), ports.window.back().map(|(at, _)| *at));
                Err(FrameLost::new(number, ends.0, ends.1).into())
            }
        }
    }
}

/// A sample that is counted while it is held.
struct Held {
    /// Taken out when it is dropped.
    sample: Option<Sample<Service, [u8], FrameTag>>,
    count: Arc<AtomicUsize>,
}

impl AsRef<[u8]> for Held {
    fn as_ref(&self) -> &[u8] {
        self.sample.as_ref().map_or(&[], |sample| sample.payload())
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        // Given back first and uncounted then: counting one too few would let a reader ask for more than it may have.
        drop(self.sample.take());
        self.count.fetch_sub(1, Ordering::AcqRel);
    }
}
