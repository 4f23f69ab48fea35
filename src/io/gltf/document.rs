//! The JSON of a glTF file, and the binary chunk of a GLB file.

use std::ops::Range;

use ::gltf::json::Root;
use glam::{DAffine3, DQuat, DVec3};
use serde_json::Value;

use crate::io::fault::Fault;
use crate::io::values::{BYTE_ORDER_MARK, one_line, shown};

/// The most bytes of JSON.
const MOST_JSON: usize = 1 << 28;

/// The most marks between values of JSON: a value takes up to 250 bytes of memory for each. Data
/// URIs have few.
const MOST_MARKS: usize = 1 << 23;

/// The most entries of a list at the top of the JSON: an empty object of two bytes becomes a node
/// of hundreds.
const MOST_LISTED: usize = 1 << 20;

/// Bytes of a GLB file's header, and of the header of each chunk.
const HEADER: usize = 12;
const CHUNK: usize = 8;

/// Extensions without which a file still shows right: none of them changes geometry or the base
/// colour, or the reader follows it. All extensions of materials belong to these.
const READ: [&str; 4] = ["KHR_lights_punctual", "KHR_mesh_quantization", "KHR_texture_transform", "KHR_xmp_json_ld"];
const MATERIALS: &str = "KHR_materials_";

/// Extensions that compress geometry.
const COMPRESSIONS: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A parsed file.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) root: Root,
    /// The transform of each node to its parent. The crate keeps these in f32, which would lose
    /// millimetres of map coordinates.
    pub(super) transforms: Vec<DAffine3>,
    pub(super) animations: usize,
    /// The place of the binary chunk in the file; None for a file of text.
    pub(super) binary: Option<Range<usize>>,
}

impl Document {
    /// Parses the bytes of a file of either form.
    pub(super) fn of(bytes: &[u8]) -> Result<Self, Fault> {
        let (text, binary) = match bytes.starts_with(b"glTF") {
            true => chunks(bytes)?,
            false => (bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes), None),
        };
        if text.len() > MOST_JSON {
            return Err(malformed(format!("its JSON is longer than {} MiB: save it as GLB", MOST_JSON >> 20)));
        }
        let marks = text.iter().filter(|byte| b"{[:,".contains(byte)).count();
        if marks > MOST_MARKS {
            return Err(malformed(format!("its JSON has {marks} values or more, beyond the limit of {MOST_MARKS}")));
        }
        let mut value: Value = serde_json::from_slice(text).map_err(not_gltf)?;
        check_version(&value)?;
        let transforms = value.get("nodes").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let transforms = transforms.iter().map(transform).collect();
        let animations = trim(&mut value)?;
        let root: Root = serde_json::from_value(value).map_err(not_gltf)?;
        check(&root)?;
        Ok(Self { root, transforms, animations, binary })
    }
}

pub(super) fn malformed(what: impl Into<String>) -> Fault {
    Fault::Malformed(what.into())
}

/// The error for JSON that the parser refuses.
fn not_gltf(error: serde_json::Error) -> Fault {
    malformed(format!("it is no glTF file: {}", one_line(&error.to_string())))
}

/// The JSON of a GLB file, and the place of its binary chunk.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<Range<usize>>), Fault> {
    let number = |at: usize| {
        let four = bytes.get(at..at + 4).and_then(|four| four.first_chunk().copied());
        four.map(u32::from_le_bytes).ok_or_else(|| malformed("the file ends inside a header"))
    };
    let (version, length) = (number(4)?, number(8)? as usize);
    if version != 2 {
        return Err(malformed(format!("it is GLB of version {version}, and only version 2 is read")));
    }
    if length > bytes.len() {
        return Err(malformed(format!("its header promises {length} bytes, the file ends after {}", bytes.len())));
    }
    let (mut text, mut binary, mut at) = (None, None, HEADER);
    while at + CHUNK <= length {
        let (size, kind) = (number(at)? as usize, &bytes[at + 4..at + CHUNK]);
        let place = at + CHUNK..at + CHUNK + size;
        if place.end > length {
            return Err(malformed(format!("a chunk of {size} bytes goes beyond the end of the file")));
        }
        // Chunks of other kinds are for extensions.
        match kind {
            b"JSON" if text.is_none() => text = Some(&bytes[place.clone()]),
            b"BIN\0" if binary.is_none() => binary = Some(place.clone()),
            _ => {}
        }
        at = place.end;
    }
    Ok((text.ok_or_else(|| malformed("the file has no chunk of JSON"))?, binary.or(Some(0..0))))
}

/// Takes out the lists that are not read, and checks the lengths of the others; returns the number
/// of animations. A scene may lack its list of nodes, which the crate demands.
fn trim(value: &mut Value) -> Result<usize, Fault> {
    let Some(all) = value.as_object_mut() else { return Ok(0) };
    let animations = all.remove("animations").and_then(|list| list.as_array().map(Vec::len)).unwrap_or(0);
    for name in ["cameras", "extras", "skins"] {
        all.remove(name);
    }
    for (name, list) in all.iter() {
        let length = list.as_array().map_or(0, Vec::len);
        if length > MOST_LISTED {
            let name = shown(name.as_bytes());
            return Err(malformed(format!("it has {length} {name}, more than the limit of {MOST_LISTED}")));
        }
    }
    for scene in all.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut() {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    Ok(animations)
}

/// Checks the version. Version 1 has objects in place of lists.
fn check_version(value: &Value) -> Result<(), Fault> {
    let version = value.get("asset").and_then(|asset| asset.get("version"));
    let is_first = value.get("meshes").is_some_and(Value::is_object);
    match version.and_then(Value::as_str).unwrap_or(if is_first { "1.0" } else { "2.0" }) {
        version if version.split('.').next() == Some("2") => Ok(()),
        version => {
            let version = shown(version.as_bytes());
            Err(malformed(format!("it is glTF of version {version}, and only version 2 is read")))
        }
    }
}

/// Checks the extensions that the file requires.
fn check(root: &Root) -> Result<(), Fault> {
    let is_read = |name: &str| READ.contains(&name) || name.starts_with(MATERIALS);
    match root.extensions_required.iter().find(|name| !is_read(name)) {
        None => Ok(()),
        Some(name) if COMPRESSIONS.contains(&name.as_str()) => Err(compressed(name)),
        Some(name) => {
            let name = shown(name.as_bytes());
            Err(malformed(format!("it needs the extension {name}, which is not read: export it without")))
        }
    }
}

/// The error for compressed geometry; `name` is one of [`COMPRESSIONS`].
fn compressed(name: &str) -> Fault {
    malformed(format!("its geometry is compressed by {name}, which is not read: export it without compression"))
}

/// The error for an object with these `extensions` if they compress it.
pub(super) fn compression(extensions: Option<&serde_json::Map<String, Value>>) -> Option<Fault> {
    let named = |name: &&&str| extensions.is_some_and(|others| others.contains_key(**name));
    COMPRESSIONS.iter().find(named).map(|name| compressed(name))
}

/// The transform of a node: its matrix, or its scale, rotation and translation.
fn transform(node: &Value) -> DAffine3 {
    if let Some(m) = numbers::<16>(node.get("matrix")) {
        return DAffine3::from_cols_array(&[
            m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10], m[12], m[13], m[14],
        ]);
    }
    let three = |name: &str, unless_given: f64| numbers::<3>(node.get(name)).unwrap_or([unless_given; 3]);
    let rotation = DQuat::from_array(numbers::<4>(node.get("rotation")).unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let (scale, translation) = (DVec3::from(three("scale", 1.0)), DVec3::from(three("translation", 0.0)));
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

/// A list of `N` numbers.
fn numbers<const N: usize>(value: Option<&Value>) -> Option<[f64; N]> {
    let list = value?.as_array()?;
    let all: Option<Vec<f64>> = list.iter().take(N + 1).map(Value::as_f64).collect();
    all?.try_into().ok()
}
