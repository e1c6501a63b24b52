//! NumPy's legacy generator (`numpy.random.RandomState`), bit for bit: worlds whose published seeds were drawn with
//! it start the same here.

use rand_mt::Mt;

/// MT19937 seeded by `init_genrand`, with the distributions of NumPy's legacy interface.
pub(crate) struct NumpyLegacy {
    generator: Mt,
    /// The polar method makes two normal numbers at a time; NumPy keeps the second one for the next call.
    spare_normal: Option<f64>,
}

impl NumpyLegacy {
    pub(crate) fn new(seed: u32) -> NumpyLegacy {
        NumpyLegacy { generator: Mt::new(seed), spare_normal: None }
    }

    /// A number in [0, 1) with 53 random bits.
    pub(crate) fn unit(&mut self) -> f64 {
        let high = f64::from(self.generator.next_u32() >> 5);
        let low = f64::from(self.generator.next_u32() >> 6);
        (high * 67_108_864.0 + low) / 9_007_199_254_740_992.0
    }

    /// A standard normal number by the polar method.
    pub(crate) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare_normal.take() {
            return spare;
        }
        loop {
            let first = 2.0 * self.unit() - 1.0;
            let second = 2.0 * self.unit() - 1.0;
            let square = first * first + second * second;
            if square < 1.0 && square != 0.0 {
                let factor = (-2.0 * square.ln() / square).sqrt();
                self.spare_normal = Some(factor * first);
                return factor * second;
            }
        }
    }

    /// A whole number in 0..=`largest`, by masked rejection; a range of one value draws nothing.
    pub(crate) fn below_or_equal(&mut self, largest: u32) -> u32 {
        if largest == 0 {
            return 0;
        }
        let mask = u32::MAX >> largest.leading_zeros();
        loop {
            let value = self.generator.next_u32() & mask;
            if value <= largest {
                return value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    // A failed unwrap is a failed test.
    #![allow(clippy::unwrap_used)]
    use super::super::{Stream, StreamKind};

    /// Printed by NumPy 2.4.6: `r = RandomState(100000)`, then the calls in this order.
    #[test]
    fn the_stream_equals_numpy() {
        let mut stream = Stream::new(StreamKind::NumpyLegacy, 100_000);
        assert_eq!(stream.uniform(0.0, 1.0), 0.28756086483185783);
        assert_eq!(stream.uniform(0.0, 1.0), 0.5082481908477833);
        let normals: Vec<f64> = (0..3).map(|_| stream.normal()).collect();
        assert_eq!(normals, [1.515020698303914, -0.010536791804928496, -0.37146337841258237]);
        assert_eq!(stream.uniform(-1.0, 1.0), -0.9456309742766473);
        let integers: Vec<i64> = (0..4).map(|_| stream.integer(0, 3)).collect();
        assert_eq!(integers, [2, 0, 1, 3]);
        assert_eq!(stream.permutation(6), [4, 5, 0, 3, 1, 2]);
        let integers: Vec<i64> = (0..3).map(|_| stream.integer(0, 8)).collect();
        assert_eq!(integers, [2, 5, 2]);
        assert_eq!(stream.normal(), -0.6674671180172358);
        assert_eq!(stream.permutation(4), [0, 1, 3, 2]);
        assert_eq!(stream.uniform(0.0, 1.0), 0.22127919362605086);
    }
}
