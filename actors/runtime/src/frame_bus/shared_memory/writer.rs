//! The writing end.

use super::{
    super::{ByteFrame, MAX_FRAME_BYTES, MAX_PLANES, PublishError},
    BusError, BusLimits, Events, Frames, Service, check_room,
    chunk::{FrameTag, fill, payload_bytes},
    clean_up, join,
};
use iceoryx2::{
    port::{LoanError, notifier::Notifier, publisher::Publisher},
    prelude::{AllocationStrategy, Node},
    sample_mut::SampleMut,
};
use std::{
    fmt,
    sync::{Mutex, MutexGuard, PoisonError},
};

/// The end of a shared-memory bus that frames come from. Dropping it ends the bus; frames that readers hold stay valid.
pub struct SharedMemoryWriter {
    name: String,
    places: u64,
    ports: Mutex<Ports>,
}

struct Ports {
    last: Option<u64>,
    /// Payload bytes of the largest frame so far: places of that size exist already.
    largest: usize,
    publisher: Publisher<Service, [u8], FrameTag>,
    notifier: Notifier<Service>,
    // Kept open as long as the ports are.
    _services: (Frames, Events),
    node: Node<Service>,
}

impl fmt::Debug for SharedMemoryWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SharedMemoryWriter({})", self.name)
    }
}

impl SharedMemoryWriter {
    /// A new bus of the given name, which should hold [`super::run_id`]. Room is made for frames of `frame_bytes`;
    /// larger ones get more when they come.
    ///
    /// # Errors
    /// No shared memory or not enough of it, a name that cannot be used, or that is in use.
    pub fn create(name: &str, limits: BusLimits, frame_bytes: usize) -> Result<SharedMemoryWriter, BusError> {
        let (places, largest) = (limits.places() as u64, payload_bytes(frame_bytes));
        check_room(places * largest as u64)?;
        let joined = join(name, &limits, true)?;
        let setup = |reason: String| BusError::Setup { name: name.into(), action: "created", reason };
        let publisher = joined
            .frames
            .publisher_builder()
            .max_loaned_samples(1)
            .initial_max_slice_len(largest)
            .allocation_strategy(AllocationStrategy::BestFit)
            .create()
            .map_err(|e| setup(e.to_string()))?;
        let notifier = joined.events.notifier_builder().create().map_err(|e| setup(e.to_string()))?;
        let (_services, node) = ((joined.frames, joined.events), joined.node);
        let ports = Ports { last: None, largest, publisher, notifier, _services, node };
        Ok(SharedMemoryWriter { name: name.into(), places, ports: Mutex::new(ports) })
    }

    /// The name by which readers find the bus.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Copies a frame into shared memory and tells those who wait; numbers must rise. Never waits for a reader.
    ///
    /// # Errors
    /// See [`PublishError`]; after an error the bus is as before.
    pub fn publish(&self, number: u64, frame: &ByteFrame) -> Result<(), PublishError> {
        self.prepare(number, frame)?.send()
    }

    /// Copies a frame into shared memory, to be sent later. Nobody else can publish until then.
    ///
    /// # Errors
    /// As [`SharedMemoryWriter::publish`].
    pub fn prepare(&self, number: u64, frame: &ByteFrame) -> Result<PreparedFrame<'_>, PublishError> {
        let (bytes, planes) = (frame.bytes(), frame.planes.len());
        if bytes > MAX_FRAME_BYTES || planes > MAX_PLANES {
            return Err(PublishError::TooLarge { bytes, planes });
        }
        let ports = self.ports.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = ports.last.filter(|last| *last >= number) {
            return Err(PublishError::NotRising { number, last });
        }
        let length = payload_bytes(bytes);
        let grown = length > ports.largest;
        check_room(length as u64 * if grown { self.places } else { 1 }).map_err(PublishError::Full)?;
        let loan = match ports.publisher.loan_slice_uninit(length) {
            Err(LoanError::OutOfMemory) => return Err(PublishError::Port("no place is left for a frame".into())),
            loan => loan.map_err(|e| PublishError::Port(e.to_string()))?,
        };
        let sample = fill(loan, number, frame);
        Ok(PreparedFrame { ports, sample, number, length })
    }
}

/// A frame that lies in shared memory already: what is left is to hand it over, which costs the same for every size.
pub struct PreparedFrame<'a> {
    ports: MutexGuard<'a, Ports>,
    sample: SampleMut<Service, [u8], FrameTag>,
    number: u64,
    length: usize,
}

impl PreparedFrame<'_> {
    /// Hands the frame over and tells those who wait.
    ///
    /// # Errors
    /// See [`PublishError`].
    pub fn send(mut self) -> Result<(), PublishError> {
        self.sample.send().map_err(|e| PublishError::Port(e.to_string()))?;
        (self.ports.last, self.ports.largest) = (Some(self.number), self.ports.largest.max(self.length));
        self.ports.notifier.notify().map_err(|e| PublishError::Port(e.to_string()))?;
        Ok(())
    }
}

impl Drop for SharedMemoryWriter {
    fn drop(&mut self) {
        // A reader whose process was killed leaves its share of the bus behind.
        clean_up(&self.ports.get_mut().unwrap_or_else(PoisonError::into_inner).node);
    }
}
