//! How much a frame draws, estimated before it is drawn.

/// Fragments of a frame from which on users are told. Kernels on a processor draw about 10^8 in a
/// second.
const MANY: f64 = 4e9;

/// Returns a note for users if `fragments`, those of `surfels` surfels in a frame, are so many that
/// it may take minutes.
pub(super) fn note(surfels: u64, fragments: f64) -> Option<String> {
    (fragments > MANY).then(|| {
        format!(
            "these surfels cover {:.1e} samples each on average, {fragments:.1e} in all, so a frame may take minutes: \
             --radius-scale makes them smaller, --surfel-size estimates them anew",
            fragments / surfels as f64
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_many_fragments_are_told() {
        assert!(note(437_645, 1e8).is_none());
        let told = note(20_000, 5.2e9).unwrap_or_default();
        assert!(told.contains("2.6e5 samples each") && told.contains("5.2e9 in all"), "{told}");
    }
}
