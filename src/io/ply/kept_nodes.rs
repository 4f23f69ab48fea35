//! Nodes of levels of detail, stored in an unnamed temporary file until all nodes have been built.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::scene::hierarchy::{Node, NodeAndLow};
use crate::scene::{Cap, Surfel};
use crate::{Error, Result};

/// Size of a node, words of 32 bits.
const WORDS: usize = 24;

/// Size of a node, bytes.
const BYTES: u64 = 4 * WORDS as u64;

/// A growing array of nodes in a temporary file.
pub struct KeptNodes {
    file: Mutex<File>,
    /// The name of the file in error messages.
    path: PathBuf,
    count: u64,
}

impl KeptNodes {
    /// Creates an empty array in an unnamed file in `folder`. The system deletes the file when the
    /// array is dropped. Errors call the file `path`.
    ///
    /// # Errors
    ///
    /// [`Error::Write`] if the system cannot create the file.
    pub fn new(folder: &Path, path: &Path) -> Result<Self> {
        let file = tempfile::tempfile_in(folder).map_err(|error| Error::write(path, error))?;
        Ok(Self { file: Mutex::new(file), path: path.to_owned(), count: 0 })
    }

    /// The number of nodes.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Appends nodes.
    ///
    /// # Errors
    ///
    /// [`Error::Write`] if the system cannot write.
    pub fn append(&mut self, nodes: &[NodeAndLow]) -> Result<()> {
        let mut bytes = Vec::new();
        for nodes in nodes.chunks(1 << 14) {
            bytes.clear();
            nodes.iter().for_each(|made| bytes.extend(words(made).map(u32::to_le_bytes).as_flattened()));
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            let written = file.seek(SeekFrom::Start(self.count * BYTES)).and_then(|_| file.write_all(&bytes));
            written.map_err(|error| Error::write(&self.path, error))?;
            drop(file);
            self.count += nodes.len() as u64;
        }
        Ok(())
    }

    /// Reads the nodes with these indices.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the system cannot read, or there are fewer nodes.
    pub fn read(&self, numbers: Range<u64>) -> Result<Vec<NodeAndLow>> {
        let mut bytes = vec![0; ((numbers.end - numbers.start) * BYTES) as usize];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file.seek(SeekFrom::Start(numbers.start * BYTES)).and_then(|_| file.read_exact(&mut bytes));
        drop(file);
        read.map_err(|error| Error::read(&self.path, error))?;
        let (words, _) = bytes.as_chunks::<4>();
        let (nodes, _) = words.as_chunks::<WORDS>();
        Ok(nodes.iter().map(|words| node(words.map(u32::from_le_bytes))).collect())
    }
}

fn words((node, low): &NodeAndLow) -> [u32; WORDS] {
    let Node { surfel: Surfel { center, s, t }, cap: Cap(cap), color, radius, cone, first, count, leaf } = node;
    let floats = [&center[..], s, t, cap, color, &[*radius, *cone], low].concat();
    let mut words = [0; WORDS];
    words.iter_mut().zip(&floats).for_each(|(word, float)| *word = float.to_bits());
    words[WORDS - 3..].copy_from_slice(&[*first, *count, u32::from(*leaf)]);
    words
}

fn node(words: [u32; WORDS]) -> NodeAndLow {
    let floats = words.map(f32::from_bits);
    let three = |at: usize| [floats[at], floats[at + 1], floats[at + 2]];
    let node = Node {
        surfel: Surfel { center: three(0), s: three(3), t: three(6) },
        cap: Cap(three(9)),
        color: [floats[12], floats[13], floats[14], floats[15]],
        radius: floats[16],
        cone: floats[17],
        first: words[21],
        count: words[22],
        leaf: words[23] != 0,
    };
    (node, three(18))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn nodes_are_read_as_they_are_written() {
        let made = |k: u32| {
            let x = k as f32 + 0.5;
            let surfel = Surfel { center: [x, 1.0, 2.0], s: [3.0, x, 4.0], t: [5.0, 6.0, x] };
            let (cap, color) = (Cap([x, 0.25, -x]), [0.1, x, 0.3, 1.0]);
            let node = Node {
                surfel,
                cap,
                color,
                radius: 7.0 * x,
                cone: -x,
                first: k,
                count: 3 * k,
                leaf: k.is_multiple_of(2),
            };
            (node, [x * 1e-9, 0.0, -x])
        };
        let folder = tempfile::tempdir().unwrap();
        let mut kept = KeptNodes::new(folder.path(), Path::new("out.ply")).unwrap();
        let all: Vec<NodeAndLow> = (0..40_000).map(made).collect();
        all.chunks(17_000).for_each(|nodes| kept.append(nodes).unwrap());
        assert_eq!(kept.count(), 40_000);
        assert!(kept.read(16_000..33_000).unwrap() == all[16_000..33_000]);
        assert!(kept.read(39_990..40_001).is_err());
        // The folder shows no file.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
