//! A seeded stream of random numbers, of one of two documented kinds.

use super::numpy::NumpyLegacy;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::Deserialize;

/// Which generator a scenario's draws come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum StreamKind {
    /// NumPy's legacy generator: MT19937 with the distributions of `numpy.random.RandomState`.
    NumpyLegacy,
    /// ChaCha with 8 rounds.
    Chacha8,
}

pub(crate) enum Stream {
    Numpy(Box<NumpyLegacy>),
    ChaCha(Box<ChaCha8Rng>),
}

impl Stream {
    /// NumPy's generator takes 32-bit seeds; the higher half of a larger one is ignored there.
    pub(crate) fn new(kind: StreamKind, seed: u64) -> Stream {
        match kind {
            StreamKind::NumpyLegacy => Stream::Numpy(Box::new(NumpyLegacy::new(seed as u32))),
            StreamKind::Chacha8 => Stream::ChaCha(Box::new(ChaCha8Rng::seed_from_u64(seed))),
        }
    }
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        let unit = match self {
            Stream::Numpy(numpy) => numpy.unit(),
            Stream::ChaCha(chacha) => chacha.random::<f64>(),
        };
        low + (high - low) * unit
    }
    pub(crate) fn normal(&mut self) -> f64 {
        match self {
            Stream::Numpy(numpy) => numpy.normal(),
            Stream::ChaCha(chacha) => chacha.sample(rand_distr::StandardNormal),
        }
    }
    /// A whole number, both ends included. The span must be below 2^32, which the parser sees to.
    pub(crate) fn integer(&mut self, low: i64, high: i64) -> i64 {
        let largest = (high - low).clamp(0, i64::from(u32::MAX)) as u32;
        let offset = match self {
            Stream::Numpy(numpy) => numpy.below_or_equal(largest),
            Stream::ChaCha(chacha) => chacha.random_range(0..=largest),
        };
        low + i64::from(offset)
    }
    /// A random order of 0..`length`, shuffled from the last place down.
    pub(crate) fn permutation(&mut self, length: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..length).collect();
        for last in (1..length).rev() {
            let other = self.integer(0, last as i64) as usize;
            order.swap(last, other);
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn draws_stay_in_range(seed in any::<u64>(), low in -5i64..5, span in 0i64..20, numpy in any::<bool>()) {
            let kind = if numpy { StreamKind::NumpyLegacy } else { StreamKind::Chacha8 };
            let mut stream = Stream::new(kind, seed);
            let value = stream.integer(low, low + span);
            prop_assert!((low..=low + span).contains(&value));
            prop_assert!((-0.5..0.25).contains(&stream.uniform(-0.5, 0.25)));
            let mut order = stream.permutation(7);
            order.sort_unstable();
            prop_assert_eq!(order, (0..7).collect::<Vec<_>>());
        }
    }
}
