//! Processor time, which other programs disturb less than the time on the wall.

use rustix::time::{ClockId, clock_gettime};

fn seconds(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Processor seconds that some work takes, of all threads of this process: software drivers have their own.
pub fn cpu_s<T, E>(work: impl FnOnce() -> Result<T, E>) -> Result<(T, f64), E> {
    let began = seconds(ClockId::ProcessCPUTime);
    let done = work()?;
    Ok((done, seconds(ClockId::ProcessCPUTime) - began))
}
