//! Round numbers along a range, and how they are written.

/// The largest of 1, 2 and 5 times a power of ten that does not exceed a positive length.
pub(super) fn round_length(most: f64) -> f64 {
    let power = 10f64.powi(most.log10().floor() as i32);
    let fits = |factor: &f64| factor * power <= most * (1.0 + 1e-9);
    // A logarithm that is rounded up leaves a power above the length.
    [5.0, 2.0, 1.0].into_iter().find(fits).map_or(power / 2.0, |factor| factor * power)
}

/// Round numbers from `low` to `high`, about `count` of them, with their labels. The only tick of
/// a range without length is its value.
pub(super) fn ticks([low, high]: [f64; 2], count: usize) -> Vec<(f64, String)> {
    let length = high - low;
    if !(length > 0.0 && length.is_finite()) {
        return vec![(low, label(low, significant(low)))];
    }
    let mut step = round_length(length / count.max(1) as f64);
    let number = |step: f64| (high / step + 1e-9).floor() - (low / step - 1e-9).ceil() + 1.0;
    // A step that is rounded down may give twice as many: the next ones of 1, 2, 5, 10.
    while number(step) > 1.5 * count as f64 {
        let leading = step / 10f64.powi(step.log10().floor() as i32);
        step *= if (1.5..3.0).contains(&leading) { 2.5 } else { 2.0 };
    }
    let first = (low / step - 1e-9).ceil();
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    (0..number(step).max(0.0) as usize)
        .map(|k| (first + k as f64) * step)
        .map(|value| (value.clamp(low, high), label(value, decimals)))
        .collect()
}

/// Decimals that show a single value.
fn significant(value: f64) -> usize {
    match value.abs() {
        0.0 => 0,
        size => (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize,
    }
}

/// A number with these decimals, or with a power of ten where that is shorter.
pub(super) fn label(value: f64, decimals: usize) -> String {
    let text = if value.abs() >= 1e12 || decimals > 6 {
        format!("{value:.2e}")
    } else {
        // Adding 0 turns -0 into 0.
        format!("{:.decimals$}", (value * 1e9).round() / 1e9 + 0.0)
    };
    text.replace('-', "\u{2212}")
}
