//! Noise whose neighbouring pixels are alike, made row by row.

use rand::RngCore;
use rand_chacha::ChaCha8Rng;

/// Edge of the averaging window, pixels: about that of a stereo matcher.
pub(crate) const WINDOW: usize = 5;
const COUNT: f32 = (WINDOW * WINDOW) as f32;

/// A field of standard normal noise, averaged over [`WINDOW`] x [`WINDOW`] pixels.
///
/// The white noise below is uniform; a sum of 25 of them is normal for our purpose. Sums are exact integers, so
/// nothing drifts from row to row. Only the rows under the window are kept.
pub(crate) struct SmoothNoise {
    white: Vec<u8>,
    /// The last rows, summed along the row.
    ring: [Vec<u16>; WINDOW],
    oldest: usize,
    fresh: Vec<u16>,
    sums: Vec<u16>,
}

impl SmoothNoise {
    pub(crate) fn new(width: usize, rng: &mut ChaCha8Rng) -> SmoothNoise {
        let row = || vec![0; width];
        let mut noise = SmoothNoise {
            white: vec![0; width + WINDOW - 1],
            ring: std::array::from_fn(|_| row()),
            oldest: 0,
            fresh: row(),
            sums: row(),
        };
        for _ in 0..WINDOW - 1 {
            noise.advance(rng);
        }
        noise
    }

    /// Writes the next row, `width` values with mean 0 and standard deviation `sigma`.
    pub(crate) fn next_row(&mut self, sigma: f32, rng: &mut ChaCha8Rng, row: &mut [f32]) {
        self.advance(rng);
        // A uniform byte has mean 127.5 and variance (256^2 - 1) / 12.
        let scale = sigma / (COUNT * (65_535.0f32 / 12.0)).sqrt();
        for (value, sum) in row.iter_mut().zip(&self.sums) {
            *value = (f32::from(*sum) - 127.5 * COUNT) * scale;
        }
    }

    fn advance(&mut self, rng: &mut ChaCha8Rng) {
        rng.fill_bytes(&mut self.white);
        let kept = &mut self.ring[self.oldest];
        self.oldest = (self.oldest + 1) % WINDOW;
        // One column of the window after the other, each over the whole row: the compiler can take many
        // at a time. 25 bytes fit 16 bits; wrapping only spares the check.
        self.fresh.fill(0);
        for offset in 0..WINDOW {
            for (sum, byte) in self.fresh.iter_mut().zip(&self.white[offset..]) {
                *sum = sum.wrapping_add(u16::from(*byte));
            }
        }
        for ((sum, fresh), kept) in self.sums.iter_mut().zip(&self.fresh).zip(kept) {
            *sum = sum.wrapping_add(*fresh).wrapping_sub(*kept);
            *kept = *fresh;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn noise_has_its_spread_and_forgets_after_a_window() {
        let (width, height) = (400, 300);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut noise = SmoothNoise::new(width, &mut rng);
        let mut field = vec![0f32; width * height];
        for row in field.chunks_exact_mut(width) {
            noise.next_row(2.0, &mut rng, row);
        }
        let covariance = |lag: usize| {
            let pairs = field.iter().zip(&field[lag..]);
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>() / (field.len() - lag) as f64
        };
        let mean = field.iter().map(|value| f64::from(*value)).sum::<f64>() / field.len() as f64;
        assert!(mean.abs() < 0.1, "{mean}");
        assert!((covariance(0) - 4.0).abs() < 0.2, "{}", covariance(0));
        // Four of five columns, or rows, of the window are shared with the neighbour, none with the fifth.
        for lag in [1, width] {
            assert!((covariance(lag) - 3.2).abs() < 0.25, "{}", covariance(lag));
            assert!(covariance(lag * WINDOW).abs() < 0.25, "{}", covariance(lag * WINDOW));
        }
    }
}
