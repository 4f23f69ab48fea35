//! The fragments of some samples as bytes.
//!
//! ```text
//! u32      number of samples
//! u32      words of a record
//! u32 [s]  numbers of the samples
//! u32 [s]  numbers of their fragments
//! words    depth and record of each fragment, sample by sample
//! ```
//!
//! All words are those of the processor, as processes of one job have the same.

use crate::render::exchange::Lists;

/// The lists of some samples.
#[derive(Clone, Default)]
pub struct Listed {
    record: u32,
    samples: Vec<u32>,
    counts: Vec<u32>,
    words: Vec<u32>,
}

impl Listed {
    /// Adds the list of a sample, unless it is empty.
    pub fn add(&mut self, lists: &Lists, sample: usize) {
        let places = lists.places(sample);
        if places.is_empty() {
            return;
        }
        self.record = lists.words() as u32;
        self.samples.push(sample as u32);
        self.counts.push(places.len() as u32);
        for place in places {
            let (depth, record) = lists.at(place);
            self.words.push(depth);
            self.words.extend_from_slice(record);
        }
    }

    /// The bytes of the lists.
    pub fn bytes(&self) -> Vec<u8> {
        let head = [self.samples.len() as u32, self.record];
        let all = [&head[..], &self.samples, &self.counts, &self.words].map(bytemuck::cast_slice::<u32, u8>);
        all.concat()
    }
}

/// Adds the fragments of [`Listed::bytes`] to lists; None if the bytes are none of such lists.
pub fn put(bytes: &[u8], lists: &mut Lists) -> Option<()> {
    let words = bytemuck::pod_collect_to_vec::<u8, u32>(bytes);
    // The message of a process to itself is empty.
    let Some(([samples, record], rest)) = words.split_first_chunk() else { return words.is_empty().then_some(()) };
    let (samples, rest) = rest.split_at_checked(*samples as usize)?;
    let (counts, mut rest) = rest.split_at_checked(samples.len())?;
    let each = 1 + *record as usize;
    for (sample, count) in samples.iter().zip(counts) {
        let (own, after) = rest.split_at_checked(each.checked_mul(*count as usize)?)?;
        rest = after;
        for fragment in own.chunks_exact(each) {
            lists.add(*sample as usize, (fragment[0], &fragment[1..]))?;
        }
    }
    rest.is_empty().then_some(())
}
