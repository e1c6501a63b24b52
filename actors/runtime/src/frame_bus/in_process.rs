//! The bus within one process.

use super::{FrameBus, FrameError, FrameLost, FrameReader, PublishError};
use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError},
};

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

impl<F: Send + Sync> FrameReader<F> for InProcessBus<F> {
    fn get(&self, number: u64) -> Result<Arc<F>, FrameError> {
        let ring = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        let found = ring.iter().find(|(at, _)| *at == number).map(|(_, frame)| Arc::clone(frame));
        let ends = (ring.front().map(|(at, _)| *at), ring.back().map(|(at, _)| *at));
        found.ok_or_else(|| FrameLost::new(number, ends.0, ends.1).into())
    }
}

impl<F: Send + Sync> FrameBus<F> for InProcessBus<F> {
    fn publish(&self, number: u64, frame: Arc<F>) -> Result<(), PublishError> {
        let mut ring = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((last, _)) = ring.back().filter(|(last, _)| *last >= number) {
            return Err(PublishError::NotRising { number, last: *last });
        }
        while ring.len() >= self.capacity {
            ring.pop_front();
        }
        ring.push_back((number, frame));
        Ok(())
    }
}
