//! Noise of the colour image.

use rand::RngCore;
use rand_chacha::ChaCha8Rng;

/// Adds independent normal noise (`sigma` in 8-bit steps) to every channel.
pub(crate) fn measure(color: &[u8], sigma: f32, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let table = normal_table(sigma);
    let mut noisy = vec![0; color.len()];
    rng.fill_bytes(&mut noisy);
    for (value, exact) in noisy.iter_mut().zip(color) {
        *value = exact.saturating_add_signed(table[usize::from(*value)]);
    }
    noisy
}

/// The quantiles of a normal distribution, one a byte: looking up a random byte draws from it.
fn normal_table(sigma: f32) -> [i8; 256] {
    std::array::from_fn(|index| {
        let quantile = normal_quantile((index as f64 + 0.5) / 256.0);
        (f64::from(sigma) * quantile).round().clamp(-127.0, 127.0) as i8
    })
}

/// Inverse of the cumulative normal distribution (Abramowitz and Stegun 26.2.23, error below 4.5e-4).
fn normal_quantile(probability: f64) -> f64 {
    let tail = probability.min(1.0 - probability);
    let t = (-2.0 * tail.ln()).sqrt();
    let magnitude = t
        - (2.515_517 + 0.802_853 * t + 0.010_328 * t * t)
            / (1.0 + 1.432_788 * t + 0.189_269 * t * t + 0.001_308 * t * t * t);
    magnitude.copysign(probability - 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn noise_is_unbiased_and_as_strong_as_asked() {
        let exact = vec![128; 100_000];
        let noisy = measure(&exact, 2.0, &mut ChaCha8Rng::seed_from_u64(3));
        let errors = noisy.iter().map(|value| f64::from(*value) - 128.0);
        let (sum, squares) = errors.fold((0.0, 0.0), |(sum, squares), e| (sum + e, squares + e * e));
        assert!((sum / 1e5).abs() < 0.03, "{sum}");
        assert!(((squares / 1e5).sqrt() - 2.0).abs() < 0.05, "{squares}");
    }

    #[test]
    fn black_and_white_do_not_wrap() {
        let noisy = measure(&[0, 255].repeat(1000), 4.0, &mut ChaCha8Rng::seed_from_u64(4));
        assert!(noisy.chunks_exact(2).all(|pair| pair[0] < 30 && pair[1] > 225));
    }
}
