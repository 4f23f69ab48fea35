//! LZF decompression (Lehmann's LibLZF) for `binary_compressed` files.

/// The longest copy that a token gives, 7 + 2 + 255 bytes: no input byte expands to more.
pub(super) const MOST_GROWTH: u64 = 264;

/// Decompresses `packed` to `length` bytes. None if the result has another length, or if a copy
/// starts before the data.
///
/// The upper three bits of a token are n, the lower five are m, and b is the byte that follows.
/// - n = 0: m + 1 literal bytes follow.
/// - n = 1 to 6: a copy of n + 2 bytes from the distance 256 m + b + 1.
/// - n = 7: the same, but a byte before b is added to the length.
///
/// A copy may overlap its own output.
pub(super) fn unpack(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    out.try_reserve_exact(length).ok()?;
    let mut rest = packed;
    while let Some((&token, after)) = rest.split_first() {
        if token < 32 {
            let (run, after) = after.split_at_checked(usize::from(token) + 1)?;
            out.extend_from_slice(run);
            rest = after;
        } else {
            let (mut copied, mut after) = (usize::from(token >> 5) + 2, after);
            if token >> 5 == 7 {
                let (&more, beyond) = after.split_first()?;
                copied += usize::from(more);
                after = beyond;
            }
            let (&low, beyond) = after.split_first()?;
            let distance = (usize::from(token & 31) << 8 | usize::from(low)) + 1;
            let start = out.len().checked_sub(distance)?;
            if copied > length - out.len() {
                return None;
            }
            for at in start..start + copied {
                out.push(out[at]);
            }
            rest = beyond;
        }
        if out.len() > length {
            return None;
        }
    }
    (out.len() == length).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_copies_are_unpacked() {
        // A literal run of three bytes, a copy of 8 bytes from distance 2, a literal run of one.
        let packed = [2, b'a', b'b', b'c', (6 << 5), 1, 0, b'!'];
        assert_eq!(unpack(&packed, 12).as_deref(), Some(&b"abcbcbcbcbc!"[..]));
        // A long copy: 7 + 2 + 255 times the same byte.
        let packed = [0, b'x', 7 << 5, 255, 0];
        assert_eq!(unpack(&packed, 265), Some(vec![b'x'; 265]));
        assert_eq!(unpack(&[], 0), Some(vec![]));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let packed = [2, b'a', b'b', b'c', (6 << 5), 1, 0, b'!'];
        for cut in 0..packed.len() {
            assert_eq!(unpack(&packed[..cut], 12), None, "{cut}");
        }
        assert_eq!((unpack(&packed, 11), unpack(&packed, 13)), (None, None));
        assert_eq!(unpack(&[0, b'a', 1 << 5, 1], 4), None);
    }
}
