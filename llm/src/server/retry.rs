//! When a failed call is made again, and after how long.

use super::transport::Failed;
use crate::chat::CallError;
use std::time::Duration;

/// How often and after how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetryPolicy {
    /// How often is asked at most, the first time included.
    pub attempts: u32,
    /// First wait; each further one is twice as long.
    pub base: Duration,
    /// Longest wait of our own choice.
    pub cap: Duration,
    /// Longest wait that a server may ask for; where it asks for more there is no further try.
    pub max_retry_after: Duration,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        let [base, cap, max_retry_after] = [500, 8_000, 120_000].map(Duration::from_millis);
        RetryPolicy { attempts: 3, base, cap, max_retry_after }
    }
}

impl RetryPolicy {
    /// The wait before the next try, after `attempt` tries; `None` where there is none: what failed fails again, too often
    /// was asked, or the time that is left does not suffice. `jitter` is between 0 and 1.
    pub(super) fn wait(&self, failed: &Failed, attempt: u32, left: Duration, jitter: f64) -> Option<Duration> {
        if attempt >= self.attempts || !failed.should_retry.unwrap_or_else(|| passes(&failed.error)) {
            return None;
        }
        let asked = match &failed.error {
            CallError::RateLimited { retry_after_ms } => retry_after_ms.or(failed.retry_after_ms),
            _ => failed.retry_after_ms,
        };
        let own = self.base.saturating_mul(1 << (attempt - 1).min(16)).min(self.cap).mul_f64(0.75 + 0.25 * jitter);
        let wait = match asked.map(Duration::from_millis) {
            Some(asked) if asked > self.max_retry_after => return None,
            // Not a moment earlier than asked, and not all at once.
            Some(asked) => asked + self.base.mul_f64(0.25 * jitter),
            None => own,
        };
        (wait < left).then_some(wait)
    }
}

/// Whether the same call may well go through a little later.
fn passes(error: &CallError) -> bool {
    match error {
        CallError::Unreachable { .. }
        | CallError::Overloaded
        | CallError::RateLimited { .. }
        | CallError::Stalled { .. }
        | CallError::BrokenOff { .. }
        | CallError::Server { .. } => true,
        CallError::Timeout { .. }
        | CallError::Unreadable { .. }
        | CallError::Auth { .. }
        | CallError::Quota { .. }
        | CallError::BadRequest { .. }
        | CallError::ContextTooLong { .. }
        | CallError::Unable { .. }
        | CallError::Resting { .. }
        | CallError::Budget { .. }
        | CallError::NoRule { .. }
        | CallError::ReplayMiss { .. } => false,
    }
}

/// A number between 0 and 1 that is another one for each try.
pub(super) fn jitter(seed: u64, call: u64, attempt: u32) -> f64 {
    let mut hash = blake3::Hasher::new();
    hash.update(&seed.to_le_bytes()).update(&call.to_le_bytes()).update(&attempt.to_le_bytes());
    let [a, b, c, d, ..] = *hash.finalize().as_bytes();
    f64::from(u32::from_le_bytes([a, b, c, d])) / f64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Duration = Duration::from_secs(3600);

    fn failed(error: CallError, should_retry: Option<bool>, retry_after_ms: Option<u64>) -> Failed {
        Failed { error, should_retry, retry_after_ms }
    }

    #[test]
    fn waits_grow_and_are_never_shorter_than_asked() {
        let policy = RetryPolicy { attempts: 9, ..RetryPolicy::default() };
        let busy = failed(CallError::Overloaded, None, None);
        let wait = |attempt, jitter| policy.wait(&busy, attempt, HOUR, jitter).unwrap().as_millis();
        assert_eq!([wait(1, 0.0), wait(1, 1.0), wait(2, 1.0), wait(8, 1.0)], [375, 500, 1000, 8000]);
        assert_eq!(policy.wait(&busy, 9, HOUR, 0.0), None);
        let limited = failed(CallError::RateLimited { retry_after_ms: Some(2000) }, None, None);
        assert_eq!(policy.wait(&limited, 1, HOUR, 0.0), Some(Duration::from_secs(2)));
        assert_eq!(policy.wait(&limited, 1, Duration::from_secs(2), 0.0), None, "the call's time would be up");
        let long = failed(CallError::Overloaded, None, Some(121_000));
        assert_eq!(policy.wait(&long, 1, HOUR, 0.0), None);
    }

    #[test]
    fn what_fails_for_good_is_not_asked_again_unless_the_server_says_so() {
        let policy = RetryPolicy::default();
        let bad = CallError::BadRequest { status: 400, parameter: None, reason: String::new() };
        assert_eq!(policy.wait(&failed(bad.clone(), None, None), 1, HOUR, 0.0), None);
        assert!(policy.wait(&failed(bad, Some(true), None), 1, HOUR, 0.0).is_some());
        assert_eq!(policy.wait(&failed(CallError::Overloaded, Some(false), None), 1, HOUR, 0.0), None);
    }

    #[test]
    fn jitter_is_spread_and_follows_from_the_seed() {
        assert_eq!(jitter(1, 2, 3), jitter(1, 2, 3));
        let drawn: Vec<f64> = (0..100).map(|call| jitter(7, call, 1)).collect();
        let mean = drawn.iter().sum::<f64>() / 100.0;
        assert!(drawn.iter().all(|value| (0.0..=1.0).contains(value)) && (0.4..0.6).contains(&mean), "{mean}");
    }
}
