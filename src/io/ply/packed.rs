//! SuperSplat's compressed Gaussians: four words each, quantised in the ranges of a chunk of 256.
//!
//! | property | bits, highest first | content |
//! |---|---|---|
//! | `packed_position` | 11, 10, 11 | x, y, z from `min_x` to `max_x` and so on |
//! | `packed_rotation` | 2, 10, 10, 10 | index of the largest `rot_k`; the other three times √2   |
//! | `packed_scale` | 11, 10, 11 | `scale_0` to `scale_2` from `min_scale_x` to `max_scale_x` ... |
//! | `packed_color` | 8, 8, 8, 8 | red, green, blue from `min_r` to `max_r` ..., opacity |
//!
//! Without `min_r` and so on, colours range from 0 to 1. An element `sh` has one byte for each of
//! `f_rest_0`, `f_rest_1` and so on, which range from -4 to 4.

use std::io::BufRead;

use super::binary::read_until_end;
use super::contents::ends_early;
use super::gaussian::{Base, CONSTANT, GaussianLayout, Gaussians};
use super::header::{Element, Encoding, Header, Kind, Scalar};
use crate::Progress;
use crate::io::Points;
use crate::io::fault::{Fault, reserve};
use crate::scene::harmonics::{MOST_DEGREE, terms_of};

/// Gaussians in a chunk.
const CHUNK: usize = 256;

/// Size of one read of rows, bytes.
const BLOCK: usize = 1 << 20;

/// The four words of a Gaussian.
pub(super) const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// Properties of a chunk: the smallest and largest positions, scales and colours. Those of colours
/// may be missing.
const RANGES: [[[&str; 3]; 2]; 3] = [
    [["min_x", "min_y", "min_z"], ["max_x", "max_y", "max_z"]],
    [["min_scale_x", "min_scale_y", "min_scale_z"], ["max_scale_x", "max_scale_y", "max_scale_z"]],
    [["min_r", "min_g", "min_b"], ["max_r", "max_g", "max_b"]],
];

/// Whether a file holds compressed Gaussians.
pub(super) fn is_packed(header: &Header) -> bool {
    header.elements.iter().any(is_packed_element)
}

/// Whether the rows of an element are compressed Gaussians.
pub(super) fn is_packed_element(element: &Element) -> bool {
    element.name == "vertex" && offset_of(element, WORDS[0], None).is_some()
}

/// Reads the Gaussians; `reader` must stand just after the header.
pub(super) fn read(
    mut reader: impl BufRead,
    header: &Header,
    length: u64,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    if header.encoding != Encoding::LittleEndian {
        return Err(Fault::Malformed(
            "its Gaussians are packed, which can be read from binary_little_endian files alone".into(),
        ));
    }
    let element = |name: &str| header.elements.iter().find(|element| element.name == name);
    let (Some(vertices), Some(chunks)) = (element("vertex"), element("chunk")) else {
        return Err(Fault::Malformed(
            "its Gaussians are packed, but there is no element 'chunk' with their ranges".into(),
        ));
    };
    if chunks.count < vertices.count.div_ceil(CHUNK as u64) {
        let (count, of) = (chunks.count, vertices.count);
        return Err(Fault::Malformed(format!(
            "its {of} packed Gaussians need one chunk for each {CHUNK}, but there are {count}"
        )));
    }
    let words = places(vertices, WORDS, Scalar::U32)?;
    let ranges = ranges(chunks)?;
    let rest = element("sh").map_or(Ok(Vec::new()), rest)?;
    let mut tables = [const { Vec::new() }; 3];
    let used = [Some(vertices), Some(chunks), element("sh")];
    for own in &header.elements {
        let table = used.iter().position(|used| used.is_some_and(|used| std::ptr::eq(used, own)));
        let rows = table_of(&mut reader, own, length)?;
        if let Some(table) = table {
            tables[table] = rows;
        }
    }
    let [rows, chunk_rows, rest_rows] = &tables;
    let sizes = [vertices, chunks].map(row_size);
    let rest_size = element("sh").map_or(1, row_size);
    if !rest.is_empty() && rest_rows.len() / rest_size != rows.len() / sizes[0] {
        return Err(Fault::Malformed("its element 'sh' does not have one row for each of its packed Gaussians".into()));
    }
    let layout = layout(rest.len());
    let mut gaussians = Gaussians::with_capacity(&layout, vertices.count)?;
    let mut positions = Vec::new();
    reserve(&mut positions, vertices.count)?;
    for (index, row) in rows.chunks_exact(sizes[0]).enumerate() {
        let of_chunk = &chunk_rows[index / CHUNK * sizes[1]..];
        let (position, values) = unpacked(words.map(|place| word(row, place)), &ranges, of_chunk);
        let of_rest = |k: usize| coefficient(rest_rows[index * rest_size + rest[k]]);
        let value = |column: usize| values.get(column).copied().unwrap_or_else(|| of_rest(column - values.len()));
        gaussians.push(position, value);
        positions.push(position);
        if index % CHUNK == CHUNK - 1 {
            progress.advance(CHUNK as u64);
        }
    }
    progress.advance(vertices.count % CHUNK as u64);
    let mut points = Points { positions, ..Points::default() };
    gaussians.finish(&mut points);
    Ok(points)
}

/// The columns of an unpacked Gaussian: scales, rotation, opacity, the constant harmonic, and
/// `rest` coefficients of the other harmonics.
fn layout(rest: usize) -> GaussianLayout {
    let degree = (0..=MOST_DEGREE).find(|degree| 3 * terms_of(*degree) == rest).unwrap_or(0);
    GaussianLayout {
        scales: vec![0, 1, 2],
        rotation: [3, 4, 5, 6],
        opacity: 7,
        base: Base::Constant([8, 9, 10]),
        degree,
        rest: (11..11 + rest).collect(),
        filter: None,
    }
}

/// Unpacks the words of a Gaussian: its position, and its values in the order of [`layout`].
fn unpacked(
    [position, rotation, scale, color]: [u32; 4],
    [places, scales, colors]: &[Option<[[usize; 3]; 2]>; 3],
    chunk: &[u8],
) -> ([f64; 3], [f64; 11]) {
    let within = |range: &Option<[[usize; 3]; 2]>, parts: [f64; 3]| match range {
        Some([least, most]) => std::array::from_fn(|k| {
            let [least, most] = [least[k], most[k]].map(|place| f64::from(f32::from_bits(word(chunk, place))));
            // Rounded to f32, as other programs compute it.
            f64::from((least * (1.0 - parts[k]) + most * parts[k]) as f32)
        }),
        None => parts,
    };
    let three = |word: u32| [part(word >> 21, 11), part(word >> 11, 10), part(word, 11)];
    let [r, g, b, opacity] = [24, 16, 8, 0].map(|shift| part(color >> shift, 8));
    let [a, b_, c] = [20, 10, 0].map(|shift| (part(rotation >> shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    let largest = (1.0 - a * a - b_ * b_ - c * c).max(0.0).sqrt();
    let turn = match rotation >> 30 {
        0 => [largest, a, b_, c],
        1 => [a, largest, b_, c],
        2 => [a, b_, largest, c],
        _ => [a, b_, c, largest],
    };
    let color = within(colors, [r, g, b]).map(|code| (code - 0.5) / CONSTANT);
    let mut values = [0.0; 11];
    values[..3].copy_from_slice(&within(scales, three(scale)));
    values[3..7].copy_from_slice(&turn);
    values[7] = -(1.0 / opacity - 1.0).ln();
    values[8..].copy_from_slice(&color);
    (within(places, three(position)), values)
}

/// The lowest `bits` bits of a word, mapped to [0, 1].
fn part(word: u32, bits: u32) -> f64 {
    let most = (1 << bits) - 1;
    f64::from(word & most) / f64::from(most)
}

/// The coefficient of a spherical harmonic that a byte encodes.
fn coefficient(byte: u8) -> f64 {
    let part = match byte {
        0 => 0.0,
        255 => 1.0,
        other => (f64::from(other) + 0.5) / 256.0,
    };
    (part - 0.5) * 8.0
}

/// Finds the ranges of positions, scales and colours in a chunk's row, as offsets in bytes. None
/// for colours whose range is missing.
fn ranges(chunks: &Element) -> Result<[Option<[[usize; 3]; 2]>; 3], Fault> {
    let mut all = [None; 3];
    for (k, names) in RANGES.into_iter().enumerate() {
        if k < 2 || offset_of(chunks, names[0][0], None).is_some() {
            let [least, most] = names;
            all[k] = Some([places(chunks, least, Scalar::F32)?, places(chunks, most, Scalar::F32)?]);
        }
    }
    Ok(all)
}

/// Offsets within a row of the bytes that are coefficients of harmonics.
fn rest(element: &Element) -> Result<Vec<usize>, Fault> {
    let place = |k: usize| offset_of(element, &format!("f_rest_{k}"), Some(Scalar::U8));
    let found: Vec<usize> = (0..element.properties.len()).map_while(place).collect();
    match (0..=MOST_DEGREE).any(|degree| 3 * terms_of(degree) == found.len()) {
        true => Ok(found),
        false => Err(Fault::Malformed(format!(
            "its packed Gaussians have {} bytes f_rest_0, f_rest_1 and so on, and spherical harmonics of degree 0 to 3 have 0, 9, 24 or 45",
            found.len()
        ))),
    }
}

/// Offsets of these properties within a row, bytes; an error unless all have the type `scalar`.
fn places<const N: usize>(element: &Element, names: [&str; N], scalar: Scalar) -> Result<[usize; N], Fault> {
    let mut found = [0; N];
    for (place, name) in found.iter_mut().zip(names) {
        *place = offset_of(element, name, Some(scalar)).ok_or_else(|| {
            let kind = if scalar == Scalar::U32 { "uint" } else { "float" };
            Fault::Malformed(format!(
                "its Gaussians are packed, but its element '{}' has no {kind} {name}",
                element.name
            ))
        })?;
    }
    Ok(found)
}

/// Offset of a property in a row, bytes; None if it is missing, behind a list or of another type.
fn offset_of(element: &Element, name: &str, of: Option<Scalar>) -> Option<usize> {
    let mut offset = 0;
    for property in &element.properties {
        let Kind::Scalar(scalar) = property.kind else { return None };
        if property.name == name {
            return of.is_none_or(|of| of == scalar).then_some(offset);
        }
        offset += scalar.size();
    }
    None
}

/// Size of a row without lists, bytes; at least 1, as it is a divisor.
fn row_size(element: &Element) -> usize {
    let size = |kind: Kind| if let Kind::Scalar(scalar) = kind { scalar.size() } else { 0 };
    element.properties.iter().map(|property| size(property.kind)).sum::<usize>().max(1)
}

/// Reads all rows of an element. Memory for them is reserved up to the `length` of the file.
fn table_of(reader: &mut impl BufRead, element: &Element, length: u64) -> Result<Vec<u8>, Fault> {
    if element.properties.iter().any(|property| matches!(property.kind, Kind::List { .. })) {
        let name = &element.name;
        return Err(Fault::Malformed(format!(
            "its Gaussians are packed, but its element '{name}' has lists, which such files cannot have"
        )));
    }
    let size = if element.properties.is_empty() { 0 } else { row_size(element) as u64 };
    let bytes = element.count.saturating_mul(size);
    let mut rows = Vec::new();
    reserve(&mut rows, bytes.min(length))?;
    while (rows.len() as u64) < bytes {
        let (before, more) = (rows.len(), (bytes - rows.len() as u64).min(BLOCK as u64) as usize);
        rows.resize(before + more, 0);
        let read = read_until_end(reader, &mut rows[before..])?;
        if read < more {
            return Err(ends_early(element, (before + read) as u64 / size));
        }
    }
    Ok(rows)
}

/// The little-endian word at `place` bytes in a row; 0 past its end.
fn word(row: &[u8], place: usize) -> u32 {
    row.get(place..).and_then(|rest| rest.first_chunk()).map_or(0, |bytes| u32::from_le_bytes(*bytes))
}
