//! Intensities of laser returns as colours.

use crate::scene::Colors;

/// Grey from intensities: the 99.9th percentile is white. `None` where all intensities are the same.
#[cfg(any(feature = "e57", feature = "pcd", test))]
pub(super) fn grey(intensities: &[u16]) -> Option<Colors> {
    white(intensities).map(|white| grey_below(intensities, white))
}

/// Grey from intensities of which this one is white.
pub(super) fn grey_below(intensities: &[u16], white: u16) -> Colors {
    let code = |&intensity: &u16| (f64::from(intensity) / f64::from(white) * 255.0).round() as u8;
    let opaque = |grey| [grey, grey, grey, 255];
    Colors::Srgb8(intensities.iter().map(code).map(opaque).collect())
}

/// The 99.9th percentile, so that a few glints do not blacken the rest. `None` where all intensities are the same.
pub(super) fn white(intensities: &[u16]) -> Option<u16> {
    let mut counts = vec![0u64; 1 << 16];
    for &intensity in intensities {
        counts[usize::from(intensity)] += 1;
    }
    if counts.iter().filter(|&&count| count > 0).count() < 2 {
        return None;
    }
    let rank = (0.999 * intensities.len() as f64).ceil() as u64;
    let mut below = 0;
    let percentile = counts.iter().position(|count| {
        below += count;
        below >= rank
    });
    // Where nearly all are zero, the percentile is too: then any other intensity is white.
    Some(percentile.unwrap_or(0).max(1) as u16)
}

/// Intensities of any range as 16-bit codes: the largest becomes 65535; what is negative or no number, 0.
#[cfg(any(feature = "e57", feature = "pcd"))]
pub(super) fn codes(intensities: &[f32]) -> Vec<u16> {
    let largest = intensities.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    let scale = f64::from(u16::MAX) / f64::from(largest);
    // A cast takes what is no number for 0, and what is beyond the range for its end.
    intensities.iter().map(|&value| (f64::from(value) * scale).round() as u16).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glints_do_not_set_white() {
        let mut intensities: Vec<u16> = (0..2000).map(|i| i % 101).collect();
        intensities.push(60000);
        let Some(Colors::Srgb8(codes)) = grey(&intensities) else { return assert_eq!(1, 0) };
        assert_eq!(
            (codes[0], codes[50], codes[100], codes[2000]),
            ([0, 0, 0, 255], [128, 128, 128, 255], [255; 4], [255; 4])
        );
        assert_eq!(grey(&[7; 9]), None);
        assert_eq!(grey(&[]), None);
    }

    #[cfg(any(feature = "e57", feature = "pcd"))]
    #[test]
    fn the_largest_finite_intensity_has_the_largest_code() {
        assert_eq!(codes(&[0.0, 0.5, 1.0, -3.0, f32::NAN]), [0, 32768, 65535, 0, 0]);
        assert_eq!(codes(&[2.0, f32::INFINITY]), [65535, 65535]);
        assert_eq!(codes(&[0.0, 0.0]), [0, 0]);
    }
}
