//! LZF (Lehmann's LibLZF), with which `binary_compressed` files are packed: runs of bytes as they are, and copies of earlier ones.

/// No three bytes of a compressed stream become more.
pub(super) const MOST_GROWTH: u64 = 264;

/// The `length` bytes that `packed` stands for; none if it stands for more or fewer, or copies from before the start.
///
/// A token's upper three bits are the length of a copy, less 2; 0 stands for a run of bytes, whose number, less 1, is in the
/// lower five; 7 for a length to which the next byte is added. Those five and a byte more are the distance of the copy, less 1.
/// Copies may reach into themselves.
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
        // A run of three, the last two of them four times over, and a run of one.
        let packed = [2, b'a', b'b', b'c', (6 << 5), 1, 0, b'!'];
        assert_eq!(unpack(&packed, 12).as_deref(), Some(&b"abcbcbcbcbc!"[..]));
        // A long copy: 7 + 2 + 255 of one byte.
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
