//! Files of glTF made by hand: buffers, accessors, and either form.

use base64::prelude::{BASE64_STANDARD, Engine};

/// The codes of component types; a test program needs some of them.
pub const U8: u32 = 5121;
#[allow(dead_code)]
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
#[allow(dead_code)]
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// A file while it is made: its one buffer, with a buffer view for each accessor.
#[derive(Default)]
pub struct Made {
    pub bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Made {
    /// Adds bytes; returns the number of their buffer view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.bytes.extend(bytes);
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#));
        self.views.len() - 1
    }

    /// Adds an accessor described by the end of its object; returns its number.
    pub fn described(&mut self, object: &str) -> usize {
        self.accessors.push(object.to_owned());
        self.accessors.len() - 1
    }

    /// Adds elements and their accessor; returns its number.
    pub fn accessor(&mut self, count: usize, (kind, shape): (u32, &str), bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.described(&format!(
            r#"{{"bufferView":{view},"componentType":{kind},"type":"{shape}","count":{count},"normalized":{}}}"#,
            shape != "SCALAR" && kind != F32
        ))
    }

    /// Adds elements of `N` floats.
    pub fn floats<const N: usize>(&mut self, elements: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = elements.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(elements.len(), (F32, ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1]), &bytes)
    }

    /// Adds indices of 16 bits.
    pub fn indices(&mut self, corners: &[u16]) -> usize {
        let bytes: Vec<u8> = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(corners.len(), (U16, "SCALAR"), &bytes)
    }

    /// The JSON; `uri` is that of the buffer, and `rest` the other members.
    pub fn json(&self, uri: Option<&str>, rest: &str) -> String {
        let uri = uri.map_or(String::new(), |uri| format!(r#","uri":"{uri}""#));
        format!(
            r#"{{"asset":{{"version":"2.0","generator":"by hand"}},"buffers":[{{"byteLength":{}{uri}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.bytes.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    /// The file as text with its buffer inside.
    pub fn text(&self, rest: &str) -> String {
        let uri = format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&self.bytes));
        self.json(Some(&uri), rest)
    }

    /// The file as binary.
    pub fn binary(&self, rest: &str) -> Vec<u8> {
        let mut json = self.json(None, rest).into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut binary = self.bytes.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let chunk = |kind: &[u8], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], kind, bytes].concat();
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &binary)].concat();
        [&b"glTF\x02\0\0\0"[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
    }
}
