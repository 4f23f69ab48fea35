//! Whole lines of a text, in blocks that threads parse side by side.

use std::io::{BufRead, Read};

use crate::io::fault::{Fault, reserve};
use crate::io::values::{BYTE_ORDER_MARK, line_end};

/// Bytes of a block, and the longest line.
const BLOCK: usize = 1 << 20;

/// Reads a text block by block.
pub(in crate::io) struct Blocks {
    reader: Box<dyn BufRead>,
    /// The byte that ends a line: `\n` or `\r`.
    pub(in crate::io) line_end: u8,
    /// The start of a line whose end is not read yet.
    rest: Vec<u8>,
    /// Bytes that were put back, and the next call returns.
    back: Option<Vec<u8>>,
    ended: bool,
    /// The length of the byte order mark, bytes.
    pub(in crate::io) mark: u64,
}

impl Blocks {
    /// Starts at the first byte of a text, without its byte order mark.
    pub(in crate::io) fn new(mut reader: Box<dyn BufRead>) -> Result<Self, Fault> {
        let line_end = line_end(&mut reader)?;
        let mark = if reader.fill_buf()?.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
        reader.consume(mark);
        Ok(Self { reader, line_end, rest: Vec::new(), back: None, ended: false, mark: mark as u64 })
    }

    /// Makes the next call of [`next`](Self::next) return these bytes.
    pub(super) fn put_back(&mut self, bytes: Vec<u8>) {
        self.back = Some(bytes);
    }

    /// Reads whole lines, about a megabyte; returns None at the end of the text.
    ///
    /// # Errors
    ///
    /// [`Fault::Malformed`] for a line that is longer.
    pub(in crate::io) fn next(&mut self) -> Result<Option<Vec<u8>>, Fault> {
        if self.back.is_some() {
            return Ok(self.back.take());
        }
        let mut block = std::mem::take(&mut self.rest);
        while !self.ended {
            let more = BLOCK.saturating_sub(block.len());
            reserve(&mut block, more as u64)?;
            let read = self.reader.by_ref().take(more as u64).read_to_end(&mut block)?;
            self.ended = read < more;
            let last = block.iter().rposition(|byte| *byte == self.line_end);
            match last.filter(|_| !self.ended) {
                Some(last) => {
                    self.rest = block.split_off(last + 1);
                    break;
                }
                None if !self.ended => {
                    return Err(Fault::Malformed(format!("it has a line of more than {BLOCK} bytes")));
                }
                None => {}
            }
        }
        Ok(Some(block).filter(|block| !block.is_empty()))
    }
}
