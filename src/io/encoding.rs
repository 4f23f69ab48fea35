//! Text files in UTF-16, which some programs for Windows write.

use std::io::{self, BufRead, Cursor, Read};

/// Converts a file of at most `length` bytes to UTF-8 if it starts with the byte order mark of
/// UTF-16; returns any other file unchanged. Also returns the length of the result, bytes. Invalid
/// codes become the replacement character.
pub(super) fn decoded(mut file: impl BufRead + 'static, length: u64) -> io::Result<(Box<dyn BufRead>, u64)> {
    let code: fn([u8; 2]) -> u16 = match file.fill_buf()? {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Ok((Box::new(file), length)),
    };
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    let codes = bytes.as_chunks().0.iter().map(|&bytes| code(bytes));
    // Most characters take two bytes in UTF-16 and one in UTF-8.
    let mut text = String::new();
    text.try_reserve(bytes.len() / 2).map_err(|_| io::ErrorKind::OutOfMemory)?;
    text.extend(char::decode_utf16(codes).skip(1).map(|char| char.unwrap_or(char::REPLACEMENT_CHARACTER)));
    let length = text.len() as u64;
    Ok((Box::new(Cursor::new(text.into_bytes())), length))
}
