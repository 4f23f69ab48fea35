//! Received bytes of a remote file.

use std::collections::BTreeMap;
use std::ops::Range;

/// Most bytes that are kept. A batch of the nodes of a COPC file has 32 MiB.
const MOST_KEPT: usize = 1 << 26;

/// The ranges of bytes that were received last.
#[derive(Debug, Default)]
pub(super) struct Cache {
    /// Ranges by their start. They may overlap, but none lies within another one.
    ranges: BTreeMap<u64, Received>,
    /// Sum of the lengths, bytes.
    kept: usize,
    /// Counts uses.
    now: u64,
}

#[derive(Debug)]
struct Received {
    bytes: Vec<u8>,
    /// [`Cache::now`] at the last use.
    used: u64,
}

impl Cache {
    /// The known bytes from the offset `at` to the end of a range.
    pub fn at(&mut self, at: u64) -> Option<&[u8]> {
        self.now += 1;
        let (start, received) = self.ranges.range_mut(..=at).next_back()?;
        received.used = self.now;
        received.bytes.get((at - start) as usize..).filter(|bytes| !bytes.is_empty())
    }

    /// The start of the next range of at least `least` bytes that begins within `places`.
    pub fn next_long(&self, places: Range<u64>, least: u64) -> Option<u64> {
        self.ranges.range(places).find(|(_, range)| range.bytes.len() as u64 >= least).map(|(start, _)| *start)
    }

    /// Adds a range. Those that were not used for longest are dropped.
    pub fn insert(&mut self, start: u64, bytes: Vec<u8>) {
        self.now += 1;
        let end = start + bytes.len() as u64;
        let end_of = |(start, range): (&u64, &Received)| start + range.bytes.len() as u64;
        if bytes.is_empty() || self.ranges.range(..=start).next_back().is_some_and(|known| end_of(known) >= end) {
            return;
        }
        let within: Vec<u64> =
            self.ranges.range(start..end).filter(|known| end_of(*known) <= end).map(|(start, _)| *start).collect();
        within.iter().for_each(|start| self.remove(*start));
        self.kept += bytes.len();
        self.ranges.insert(start, Received { bytes, used: self.now });
        if self.kept > MOST_KEPT {
            self.drop_oldest(start);
        }
    }

    fn remove(&mut self, start: u64) {
        self.kept -= self.ranges.remove(&start).map_or(0, |removed| removed.bytes.len());
    }

    /// Drops all ranges.
    pub fn clear(&mut self) {
        self.ranges.clear();
        self.kept = 0;
    }

    /// Drops ranges until a quarter of the limit is free, but not the one at `newest`.
    fn drop_oldest(&mut self, newest: u64) {
        let mut by_use: Vec<(u64, u64)> = self.ranges.iter().map(|(start, range)| (range.used, *start)).collect();
        by_use.sort_unstable();
        for (_, start) in by_use {
            if self.kept <= MOST_KEPT / 4 * 3 {
                return;
            }
            if start != newest {
                self.remove(start);
            }
        }
    }

    /// The parts of `ranges` that are not known, sorted.
    pub fn missing(&mut self, ranges: impl Iterator<Item = Range<u64>>) -> Vec<Range<u64>> {
        let mut missing = Vec::new();
        for range in ranges {
            let mut at = range.start;
            while at < range.end {
                if let Some(known) = self.at(at).map(<[u8]>::len) {
                    at += known as u64;
                    continue;
                }
                let end = self.next_long(at + 1..range.end, 0).unwrap_or(range.end);
                missing.push(at..end);
                at = end;
            }
        }
        missing.sort_unstable_by_key(|range| range.start);
        missing
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn ranges_are_found_and_the_missing_ones_named() {
        let mut cache = Cache::default();
        cache.insert(10, vec![1; 10]);
        cache.insert(30, vec![2; 5]);
        assert_eq!(cache.at(12).unwrap(), [1; 8]);
        assert!(cache.at(9).is_none() && cache.at(20).is_none() && cache.at(35).is_none());
        assert_eq!(
            (cache.next_long(9..40, 6), cache.next_long(11..40, 5), cache.next_long(11..40, 6)),
            (Some(10), Some(30), None)
        );
        assert_eq!(cache.missing([32..40, 0..33].into_iter()), [0..10, 20..30, 35..40]);
        // A range within another one is not added, and a longer one replaces those within it.
        cache.insert(10, vec![3; 3]);
        assert_eq!((cache.at(10).unwrap().len(), cache.kept), (10, 15));
        cache.insert(10, vec![4; 11]);
        assert_eq!((cache.at(10).unwrap().len(), cache.kept), (11, 16));
        cache.insert(25, vec![5; 20]);
        assert_eq!(cache.at(32).unwrap(), [5; 13]);
        assert_eq!(cache.kept, 31);
        cache.insert(15, vec![6; 20]);
        assert_eq!((cache.at(14).unwrap().len(), cache.at(20).unwrap().len(), cache.at(40).unwrap().len()), (7, 15, 5));
    }

    #[test]
    fn the_oldest_ranges_are_dropped() {
        let mut cache = Cache::default();
        let (part, most) = (1 << 20, MOST_KEPT as u64 >> 20);
        for number in 0..most {
            cache.insert(number << 20, vec![0; part]);
        }
        assert!(cache.at(0).is_some());
        cache.insert(most << 20, vec![0; part]);
        assert!(cache.kept <= MOST_KEPT && cache.at(0).is_some() && cache.at(1 << 20).is_none());
        assert!(cache.at(most << 20).is_some());
        assert_eq!(cache.kept, cache.ranges.values().map(|range| range.bytes.len()).sum::<usize>());
        cache.clear();
        assert!(cache.kept == 0 && cache.at(most << 20).is_none());
    }
}
