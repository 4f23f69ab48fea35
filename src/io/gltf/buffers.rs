//! The bytes that a glTF file refers to: its own, data URIs, and files beside it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::gltf::json::{Index, buffer};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::document::{Document, compression, malformed};
use crate::io::beside::Beside;
use crate::io::fault::Fault;
use crate::io::image;
use crate::io::values::{one_line, shown};

/// Base64 with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The buffers of a file.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    /// The bytes of each buffer, or why there are none.
    all: Vec<Result<Bytes<'a>, String>>,
}

/// Bytes of the file itself, of a data URI, or of another file that several buffers may name.
#[derive(Clone)]
enum Bytes<'a> {
    Own(&'a [u8]),
    Other(Arc<[u8]>),
}

impl Bytes<'_> {
    fn get(&self) -> &[u8] {
        match self {
            Self::Own(bytes) => bytes,
            Self::Other(bytes) => bytes,
        }
    }
}

impl<'a> Buffers<'a> {
    /// Reads all buffers of the `document` of the file at `path` with these bytes.
    pub(super) fn of(document: &'a Document, file: &'a [u8], path: &Path) -> Self {
        let mut beside = Beside::of(path);
        let mut known = HashMap::new();
        let own = document.binary.clone().and_then(|binary| file.get(binary)).filter(|own| !own.is_empty());
        let of_buffer = |(number, buffer): (usize, &buffer::Buffer)| match &buffer.uri {
            Some(uri) => named(uri, &mut beside, &mut known).map(Bytes::Other),
            None => own.filter(|_| number == 0).map(Bytes::Own).ok_or_else(|| "it has no data".to_owned()),
        };
        let all = document.root.buffers.iter().enumerate().map(of_buffer).collect();
        Self { document, all }
    }

    /// The number of bytes of all buffers. Buffers that name one file count once, and the file's
    /// own bytes not at all.
    pub(super) fn length(&self) -> u64 {
        let others = self.all.iter().flatten().filter_map(|bytes| match bytes {
            Bytes::Own(_) => None,
            Bytes::Other(bytes) => Some((bytes.as_ptr(), bytes.len() as u64)),
        });
        others.collect::<HashMap<_, _>>().values().sum()
    }

    /// The bytes of a buffer view, and the step between its elements if it has one.
    pub(super) fn view(&self, index: Index<buffer::View>) -> Result<(&[u8], Option<usize>), Fault> {
        let number = index.value();
        let view = self.document.root.buffer_views.get(number);
        let view = view.ok_or_else(|| malformed(format!("it names the buffer view {number}, which does not exist")))?;
        let buffer = view.buffer.value();
        let bytes = match self.all.get(buffer) {
            Some(Ok(bytes)) => bytes.get(),
            Some(Err(why)) => {
                let others = view.extensions.as_ref().map(|extensions| &extensions.others);
                return Err(compression(others)
                    .unwrap_or_else(|| malformed(format!("its buffer {buffer} cannot be read: {why}"))));
            }
            None => return Err(malformed(format!("it names the buffer {buffer}, which does not exist"))),
        };
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let end = start.checked_add(view.byte_length.0).filter(|end| *end <= bytes.len() as u64);
        let Some(end) = end else {
            let what = format!("the buffer view {number} goes beyond the end of its buffer, which has {}", bytes.len());
            return Err(malformed(format!("{what} bytes")));
        };
        Ok((&bytes[start as usize..end as usize], view.byte_stride.map(|stride| stride.0)))
    }
}

/// The bytes that a URI names. Files are read once, whatever they are called.
fn named(uri: &str, beside: &mut Beside, known: &mut HashMap<PathBuf, Arc<[u8]>>) -> Result<Arc<[u8]>, String> {
    if let Some(data) = data_of(uri) {
        return data.map(Into::into);
    }
    let path = file_of(uri, beside)?;
    let place = path.canonicalize().unwrap_or_else(|_| path.clone());
    if let Some(bytes) = known.get(&place) {
        return Ok(bytes.clone());
    }
    let bytes: Arc<[u8]> = image::bytes(&path).map_err(|error| one_line(&error.to_string()))?.into();
    known.insert(place, bytes.clone());
    Ok(bytes)
}

/// The bytes of a data URI; None for another URI.
pub(super) fn data_of(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let start = uri.get(..5).filter(|start| start.eq_ignore_ascii_case("data:"))?;
    let Some((kind, data)) = uri[start.len()..].split_once(',') else {
        return Some(Err("its data URI has no data".to_owned()));
    };
    if !kind.ends_with(";base64") {
        return Some(Ok(unescaped(data)));
    }
    Some(BASE64.decode(data.trim_ascii()).map_err(|error| format!("its data URI is damaged: {error}")))
}

/// The path of the file that a URI names.
pub(super) fn file_of(uri: &str, beside: &mut Beside) -> Result<PathBuf, String> {
    if uri.contains("://") {
        return Err(format!("only files are read, not {}", shown(uri.as_bytes())));
    }
    let name = unescaped(uri);
    let plain = beside.file(uri);
    // Some programs write names as they are, with spaces and percent signs.
    Ok(if plain.exists() { plain } else { beside.file(&String::from_utf8_lossy(&name)) })
}

/// Replaces `%20` and the like by their bytes.
fn unescaped(text: &str) -> Vec<u8> {
    let mut plain = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [byte, after @ ..] = rest {
        // The parser of numbers would take a sign.
        let code = after.get(..2).filter(|code| *byte == b'%' && code.iter().all(u8::is_ascii_hexdigit));
        let code = code.and_then(|code| std::str::from_utf8(code).ok());
        let code = code.and_then(|code| u8::from_str_radix(code, 16).ok());
        plain.push(code.unwrap_or(*byte));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_may_be_in_base64_or_escaped() {
        let of = |uri: &str| data_of(uri).map(|data| data.unwrap_or_default());
        assert_eq!(of("data:application/octet-stream;base64,AQID"), Some(vec![1, 2, 3]));
        assert_eq!(of("DATA:;base64,AQI="), Some(vec![1, 2]));
        assert_eq!(of("data:;base64,AQI"), Some(vec![1, 2]));
        assert_eq!(of("data:,a%20%zz%+5%4"), Some(b"a %zz%+5%4".to_vec()));
        assert_eq!((of("a.bin"), of("dat"), of("däta")), (None, None, None));
        for damaged in ["data:", "data:;base64,A", "data:;base64,*"] {
            assert!(data_of(damaged).is_some_and(|data| data.is_err()), "{damaged}");
        }
    }
}
