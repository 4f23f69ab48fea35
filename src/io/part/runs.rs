//! Run lengths of samples: the number of empty samples, the number of filled ones, the values of
//! these, and so on until the last sample.
//!
//! A sample is empty if all of its values are 0. The two numbers of a run are LEB128: seven bits in
//! each byte, the low ones first, and the highest bit is set in all bytes but the last. Values are
//! little-endian, in as many bytes as the greatest one of the section takes. So rows in which
//! nothing shows take no bytes, whatever their number.

use std::ops::Range;

/// Samples that are encoded at once.
const AT_ONCE: usize = 1 << 20;

/// Returns the bytes of each value, and the runs of `samples` samples with `each` values. `all`
/// returns the values of a range of samples.
pub(super) fn encoded(samples: usize, each: usize, all: impl Fn(Range<usize>) -> Vec<u64>) -> (u8, Vec<u8>) {
    let pieces = || (0..samples).step_by(AT_ONCE).map(|first| all(first..samples.min(first + AT_ONCE)));
    let greatest = pieces().flatten().max().unwrap_or(0);
    let bytes = ((71 - greatest.leading_zeros().min(63)) / 8) as usize;
    let (mut runs, mut empty, mut filled, mut values) = (Vec::new(), 0, 0u64, Vec::new());
    let mut end = |empty: u64, filled: u64, values: &mut Vec<u8>| {
        number(empty, &mut runs);
        number(filled, &mut runs);
        runs.append(values);
    };
    for piece in pieces() {
        for sample in piece.chunks_exact(each) {
            if sample.iter().all(|value| *value == 0) {
                if filled > 0 {
                    end(empty, filled, &mut values);
                    (empty, filled) = (0, 0);
                }
                empty += 1;
            } else {
                filled += 1;
                sample.iter().for_each(|value| values.extend(&value.to_le_bytes()[..bytes]));
            }
        }
    }
    if empty + filled > 0 {
        end(empty, filled, &mut values);
    }
    (bytes as u8, runs)
}

/// Calls `each` with the first sample of every run of filled ones, and with their bytes, `size` for
/// each sample.
///
/// # Errors
/// A sentence unless the runs cover `samples` samples.
pub(super) fn filled(
    mut runs: &[u8],
    samples: usize,
    size: usize,
    mut each: impl FnMut(usize, &[u8]),
) -> Result<(), String> {
    let damaged = || "its runs do not cover its samples: draw the part again".to_owned();
    let mut at = 0usize;
    while !runs.is_empty() {
        let mut next = || -> Option<usize> { usize::try_from(read_number(&mut runs)?).ok() };
        let (empty, filled) = next().zip(next()).ok_or_else(damaged)?;
        let start = at.checked_add(empty).ok_or_else(damaged)?;
        at = start.checked_add(filled).filter(|end| *end <= samples).ok_or_else(damaged)?;
        let bytes = filled.checked_mul(size).and_then(|len| runs.split_at_checked(len));
        let (own, rest) = bytes.ok_or_else(damaged)?;
        each(start, own);
        runs = rest;
    }
    if at == samples { Ok(()) } else { Err(damaged()) }
}

/// The value of at most eight bytes.
pub(super) fn value(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}

/// Appends a number as LEB128.
fn number(mut number: u64, into: &mut Vec<u8>) {
    while number >= 0x80 {
        into.push(number as u8 | 0x80);
        number >>= 7;
    }
    into.push(number as u8);
}

/// Reads a number as LEB128, and removes its bytes.
fn read_number(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0u64;
    for shift in (0..63).step_by(7) {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}
