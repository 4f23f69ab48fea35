//! OBJ and MTL files in UTF-16, which some programs of Windows write.

use std::io::{self, BufRead, Cursor, Read};

/// A file of at most `length` bytes as one in UTF-8, and how long that is: the file itself, or where it begins with the byte order mark of
/// UTF-16 what its characters are; what is none becomes the replacement character.
pub(super) fn decoded(mut file: impl BufRead + 'static, length: u64) -> io::Result<(Box<dyn BufRead>, u64)> {
    let code: fn([u8; 2]) -> u16 = match file.fill_buf()? {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Ok((Box::new(file), length)),
    };
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    let codes = bytes.as_chunks().0.iter().map(|&bytes| code(bytes));
    // Text is mostly of characters that take two bytes there and one here.
    let mut text = String::new();
    text.try_reserve(bytes.len() / 2).map_err(|_| io::ErrorKind::OutOfMemory)?;
    text.extend(char::decode_utf16(codes).skip(1).map(|char| char.unwrap_or(char::REPLACEMENT_CHARACTER)));
    let length = text.len() as u64;
    Ok((Box::new(Cursor::new(text.into_bytes())), length))
}
