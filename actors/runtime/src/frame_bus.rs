//! Frames handed over by number: messages stay small and no pixel is copied.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};
use thiserror::Error;

/// A frame that is no longer, or not yet, on the bus.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("frame {wanted} is not on the bus, which holds {held}: it was overwritten by newer frames or never published")]
pub struct FrameLost {
    wanted: u64,
    held: String,
}

/// A bounded hand-over of frames between a producer and its consumers. When it is full the oldest frame goes.
pub trait FrameBus<F>: Send + Sync {
    /// Puts a frame on the bus under its number; numbers must rise.
    fn publish(&self, number: u64, frame: Arc<F>);
    /// Takes a share of a frame.
    fn get(&self, number: u64) -> Result<Arc<F>, FrameLost>;
}

/// The bus within one process: a ring of shared frames.
#[derive(Debug)]
pub struct InProcessBus<F> {
    capacity: usize,
    ring: Mutex<VecDeque<(u64, Arc<F>)>>,
}

impl<F> InProcessBus<F> {
    /// A bus that holds at most `capacity` frames (at least 1).
    pub fn new(capacity: usize) -> InProcessBus<F> {
        InProcessBus { capacity: capacity.max(1), ring: Mutex::new(VecDeque::new()) }
    }
}

impl<F: Send + Sync> FrameBus<F> for InProcessBus<F> {
    fn publish(&self, number: u64, frame: Arc<F>) {
        let mut ring = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        while ring.len() >= self.capacity {
            ring.pop_front();
        }
        ring.push_back((number, frame));
    }

    fn get(&self, number: u64) -> Result<Arc<F>, FrameLost> {
        let ring = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        let found = ring.iter().find(|(at, _)| *at == number).map(|(_, frame)| Arc::clone(frame));
        found.ok_or_else(|| FrameLost {
            wanted: number,
            held: match (ring.front(), ring.back()) {
                (Some((first, _)), Some((last, _))) => format!("{first} to {last}"),
                _ => "none".into(),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_frame_goes_first_and_its_loss_is_said() {
        let bus = InProcessBus::new(2);
        for number in 0..3 {
            bus.publish(number, Arc::new(number * 10));
        }
        assert_eq!(bus.get(2).as_deref(), Ok(&20));
        let lost = bus.get(0).map(|frame| *frame);
        assert_eq!(
            lost.map_err(|e| e.to_string()),
            Err("frame 0 is not on the bus, which holds 1 to 2: it was overwritten by newer frames or never published"
                .into())
        );
    }
}
