//! A server that fails again and again is left alone for a while, so that the agent does not wait for it each time.

use crate::chat::CallError;
use std::time::Duration;

/// When a server is left alone, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BreakerPolicy {
    /// Calls in a row that fail, each with all its tries.
    pub failures: u32,
    /// For how long.
    pub rest: Duration,
}

impl Default for BreakerPolicy {
    fn default() -> Self {
        BreakerPolicy { failures: 3, rest: Duration::from_secs(30) }
    }
}

/// How a server has done so far. Times are since it was first known.
#[derive(Debug)]
pub(super) struct Breaker {
    policy: BreakerPolicy,
    failures: u32,
    rests_until: Duration,
}

impl Breaker {
    pub(super) fn new(policy: BreakerPolicy) -> Breaker {
        Breaker { policy, failures: 0, rests_until: Duration::ZERO }
    }

    /// Whether a call may be made now.
    pub(super) fn admit(&self, now: Duration) -> Result<(), CallError> {
        if self.failures < self.policy.failures || now >= self.rests_until {
            return Ok(());
        }
        let again_in_ms = (self.rests_until - now).as_millis() as u64;
        Err(CallError::Resting { failures: self.failures, again_in_ms })
    }

    /// Takes what a call came to. After a rest one failure is enough for the next one.
    pub(super) fn note(&mut self, now: Duration, error: Option<&CallError>) {
        if !error.is_some_and(is_the_servers) {
            self.failures = 0;
            return;
        }
        self.failures = self.failures.saturating_add(1);
        if self.failures >= self.policy.failures {
            self.rests_until = now + self.policy.rest;
        }
    }
}

/// Whether the server is to blame, and not what it was asked.
fn is_the_servers(error: &CallError) -> bool {
    !matches!(
        error,
        CallError::BadRequest { .. }
            | CallError::ContextTooLong { .. }
            | CallError::Unable { .. }
            | CallError::Budget { .. }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_failures_in_a_row_rest_the_server() {
        let seconds = Duration::from_secs;
        let mut breaker = Breaker::new(BreakerPolicy::default());
        let (busy, bad) =
            (CallError::Overloaded, CallError::BadRequest { status: 400, parameter: None, reason: String::new() });
        for error in [Some(&busy), Some(&busy), None, Some(&busy), Some(&bad), Some(&busy), Some(&busy)] {
            breaker.note(seconds(1), error);
            assert_eq!(breaker.admit(seconds(1)), Ok(()));
        }
        breaker.note(seconds(2), Some(&busy));
        assert_eq!(breaker.admit(seconds(31)), Err(CallError::Resting { failures: 3, again_in_ms: 1000 }));
        assert_eq!(breaker.admit(seconds(32)), Ok(()));
        breaker.note(seconds(33), Some(&busy));
        assert!(breaker.admit(seconds(34)).is_err());
        breaker.note(seconds(70), None);
        assert_eq!(breaker.admit(seconds(71)), Ok(()));
    }
}
