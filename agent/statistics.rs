//! Proportions with intervals.

/// The Wilson score interval at 95 % for `successes` of `trials`; (0, 1) without trials.
///
/// ```
/// # use acm::statistics::wilson95;
/// let (low, high) = wilson95(45, 50);
/// assert!((low - 0.786).abs() < 0.001 && (high - 0.957).abs() < 0.001);
/// ```
pub fn wilson95(successes: usize, trials: usize) -> (f64, f64) {
    if trials == 0 {
        return (0.0, 1.0);
    }
    let (z, n) = (1.959_963_984_540_054_f64, trials as f64);
    let p = successes as f64 / n;
    let centre = p + z * z / (2.0 * n);
    let spread = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    (((centre - spread) / scale).max(0.0), ((centre + spread) / scale).min(1.0))
}

/// The median and another quantile (0-1) of some numbers; zeros without numbers.
pub fn median_and(quantile: f64, values: &[f64]) -> (f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |q: f64| sorted.get(((sorted.len().saturating_sub(1)) as f64 * q).round() as usize).copied();
    (at(0.5).unwrap_or(0.0), at(quantile).unwrap_or(0.0))
}
