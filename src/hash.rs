//! FNV-1a of 64 bits (Fowler, Noll, Vo).

/// The hash of numbers, each of which takes the place of a byte.
pub fn of(numbers: impl IntoIterator<Item = impl Into<u64>>) -> u64 {
    numbers
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, number| (hash ^ number.into()).wrapping_mul(0x0000_0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    /// The values of the authors' page.
    #[test]
    fn known_hashes() {
        let of = |text: &str| super::of(text.bytes());
        assert_eq!(
            [of(""), of("a"), of("foobar")],
            [0xcbf2_9ce4_8422_2325, 0xaf63_dc4c_8601_ec8c, 0x8594_4171_f739_67e8]
        );
    }
}
