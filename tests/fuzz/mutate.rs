//! Damages files: bytes, numbers at known offsets, and the words of a text.

use super::random::Random;
use std::ops::Range;

/// Knowledge of a format, used to damage its files effectively.
pub struct Grammar {
    /// Words that the reader interprets.
    pub words: &'static [&'static str],
    /// Characters that end a word, besides white space.
    pub separators: &'static [u8],
    /// Number of bytes from the start that are searched for words.
    pub text: usize,
    /// Returns offsets and sizes of a file's binary numbers.
    pub numbers: fn(&[u8]) -> Vec<(usize, usize)>,
}

/// Numbers at the limits of types, as text.
const EXTREMES: [&str; 24] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "127",
    "128",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "nan",
    "inf",
    "1e400",
    "1e-400",
    "1e18",
];

/// Bit patterns at the limits of integer and float types.
const PATTERNS: [u64; 14] = [
    0,
    1,
    2,
    0x7f,
    0xff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
    0x7ff8_0000_0000_0000, // NaN
    0x7ff0_0000_0000_0000, // infinity
    0x7fef_ffff_ffff_ffff, // the largest f64
];

/// Maximum size of an input, bytes.
const LARGEST: usize = 1 << 17;

/// Damages `bytes` in a few places; `other` is a second file of the format.
pub fn mutate(random: &mut Random, grammar: &Grammar, bytes: &mut Vec<u8>, other: &[u8]) {
    for _ in 0..1 + random.below(2) * random.below(4) {
        match random.below(14) {
            0 => on_byte(random, bytes, |random, byte| *byte ^= 1 << random.below(8)),
            1 => on_byte(random, bytes, |random, byte| *byte = random.bits() as u8),
            2 => {
                let value = [0, 0xff, b' ', b'\n', random.bits() as u8][random.below(5)];
                let run = range(random, bytes.len(), 32);
                bytes[run].fill(value);
            }
            3 => bytes.truncate(offset(random, bytes.len() + 1)),
            4 => {
                let copied = bytes[range(random, bytes.len(), 256)].to_vec();
                let at = offset(random, bytes.len() + 1);
                bytes.splice(at..at, copied);
            }
            5 => {
                let _ = bytes.drain(range(random, bytes.len(), 64));
            }
            6 => {
                bytes.truncate(offset(random, bytes.len() + 1));
                bytes.extend(&other[offset(random, other.len() + 1)..]);
            }
            7 | 8 => extreme_bits(random, grammar, bytes),
            9 | 10 => replace_word(random, grammar, bytes, |random| EXTREMES[random.below(EXTREMES.len())].into()),
            11 => replace_word(random, grammar, bytes, |random| random.pick(grammar.words).into()),
            12 => {
                let found = words(grammar, bytes);
                let mut one = || found.get(random.below(found.len())).cloned().unwrap_or(0..0);
                let (a, b) = (one(), one());
                if a.end <= b.start {
                    let (first, second) = (bytes[a.clone()].to_vec(), bytes[b.clone()].to_vec());
                    bytes.splice(b, first);
                    bytes.splice(a, second);
                }
            }
            _ => {
                let at = offset(random, bytes.len() + 1);
                bytes.splice(at..at, random.pick(grammar.words).bytes().chain([b' ']));
            }
        }
        bytes.truncate(LARGEST);
    }
}

/// A position before `end`, half of the time near the start, where headers are.
fn offset(random: &mut Random, end: usize) -> usize {
    let near = if random.one_in(2) { 400 } else { usize::MAX };
    random.below(end.min(near))
}

/// A range of 1 to `longest` bytes that ends at or before `end`.
fn range(random: &mut Random, end: usize, longest: usize) -> Range<usize> {
    let start = offset(random, end);
    start..(start + 1 + random.below(longest)).min(end)
}

fn on_byte(random: &mut Random, bytes: &mut [u8], change: impl FnOnce(&mut Random, &mut u8)) {
    let at = offset(random, bytes.len());
    if let Some(byte) = bytes.get_mut(at) {
        change(random, byte);
    }
}

/// Overwrites a binary number with an extreme pattern or changes it by one. If `grammar` knows
/// offsets of numbers, most numbers are at these.
fn extreme_bits(random: &mut Random, grammar: &Grammar, bytes: &mut [u8]) {
    let known = (grammar.numbers)(bytes);
    let (at, size) = match known.get(random.below(known.len())) {
        Some(&place) if !random.one_in(4) => place,
        _ => (offset(random, bytes.len()), 1 << random.below(4)),
    };
    let Some(number) = bytes.get_mut(at..at + size) else { return };
    let pattern = PATTERNS[random.below(PATTERNS.len())];
    match random.below(6) {
        0 => number[0] = number[0].wrapping_add(1),
        1 => number[0] = number[0].wrapping_sub(1),
        2 => number.copy_from_slice(&pattern.to_be_bytes()[8 - size..]),
        _ => number.copy_from_slice(&pattern.to_le_bytes()[..size]),
    }
}

/// The words in the text part.
fn words(grammar: &Grammar, bytes: &[u8]) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut start = 0;
    let text = &bytes[..bytes.len().min(grammar.text)];
    for (at, byte) in text.iter().chain(b" ").enumerate() {
        if byte.is_ascii_whitespace() || grammar.separators.contains(byte) {
            if start < at {
                found.push(start..at);
            }
            start = at + 1;
        }
    }
    found
}

fn replace_word(random: &mut Random, grammar: &Grammar, bytes: &mut Vec<u8>, by: impl FnOnce(&mut Random) -> String) {
    let found = words(grammar, bytes);
    if let Some(word) = found.get(random.below(found.len())).cloned() {
        bytes.splice(word, by(random).into_bytes());
    }
}
