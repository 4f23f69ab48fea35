//! Facts in the header of a LAS file, and notes about fields that contradict each other.

use super::chunks::promised;
use super::dimensions::Dimensions;
use super::extra::{self, Field, Normals};
use super::shown::Shown;
use super::system::{self, System};
use super::{early, of_las};
use crate::Result as Outcome;
use crate::io::about::{About, Attribute, Role};
use crate::io::fault::{Fault, surviving};
use crate::io::place::GeoKeys;
use crate::io::source::Source;
use las::point::Format;
use las::raw::{Header, Vlr};
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Size of the header, bytes: of versions 1.0 to 1.2, of 1.3 and of 1.4.
const SIZES: [u16; 3] = [227, 235, 375];

/// Size of the header of a variable-length record, bytes.
const RECORD_HEADER: u64 = 54;

/// Flag: the coordinate system is given as text (WKT).
const IS_TEXT: u16 = 1 << 4;

/// Start of a note about a defect that probably spoils the picture.
const WARNING: &str = "warning: ";

/// System identifiers that do not name a scanner.
const NO_SYSTEMS: [&str; 5] = ["MERGE", "MODIFICATION", "EXTRACTION", "TRANSFORMATION", "OTHER"];

/// Points may exceed the header's bounding box by this many steps (scale factors) of the
/// coordinates.
const STEPS: f64 = 2.0;

/// Facts of a file that are known before its points are read.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    pub about: About,
    /// Whether coordinates are degrees, if a coordinate system says so.
    pub geographic: Option<bool>,
    /// The keys of the coordinate system.
    pub keys: Option<GeoKeys>,
    /// The normals among the extra bytes of points.
    pub normals: Option<Normals>,
    /// The numbers of records.
    pub dimensions: Dimensions,
    /// Sentences about odd fields.
    pub notes: Vec<String>,
    /// The bounding box in the header, and the step of coordinates.
    bounds: [[f64; 3]; 2],
    step: [f64; 3],
}

/// Reads the facts in the header and its records. `legacy` is the file's own point count in the
/// field of LAS 1.0 to 1.3.
pub(super) fn look(
    file: &mut (impl Read + Seek),
    (header, legacy): (&Header, u32),
    (length, name): (u64, &str),
) -> Result<Found, Fault> {
    let Records { systems, extra, end } = records(file, header)?;
    let system = System::of(&systems);
    let mut notes = Vec::from_iter(counts(header, legacy));
    notes.extend(room(header, length));
    notes.extend(formats(header));
    notes.extend(places(header, end));
    if system.is_some() && (header.global_encoding & IS_TEXT != 0) != systems.text.is_some() {
        let (says, has) = if systems.text.is_some() { ("GeoTIFF keys", "a text") } else { ("a text", "GeoTIFF keys") };
        notes.push(format!("its header gives its coordinate system by {says}, but its records have {has}"));
    }
    let scales = [header.x_scale_factor, header.y_scale_factor, header.z_scale_factor];
    notes.extend(scale(scales));
    let bounds = [[header.min_x, header.min_y, header.min_z], [header.max_x, header.max_y, header.max_z]];
    if (0..3).any(|axis| bounds[0][axis] > bounds[1][axis]) && promised(header) > 0 {
        notes.push(format!("the box in its header is upside down: from {:?} to {:?}", bounds[0], bounds[1]));
    }
    let named = |note: String| match note.strip_prefix(WARNING) {
        Some(note) => format!("{WARNING}{name}: {note}"),
        None => format!("{name}: {note}"),
    };
    let notes = notes.into_iter().map(named).collect();
    let geographic = system.as_ref().and_then(|system| system.geographic);
    let own = Format::new(header.point_data_record_format & 0x3f);
    let dimensions = own.as_ref().map_or_else(|_| Dimensions::default(), |format| Dimensions::of(format, &extra));
    let normals = Normals::of(&extra, own.map_or(0, |format| format.len()));
    let about = about(header, system, &extra);
    let keys = systems.geo_keys();
    Ok(Found { about, geographic, keys, normals, dimensions, notes, bounds, step: scales.map(f64::abs) })
}

/// Reads the keys of the coordinate system from the header of a file. None if it names none.
///
/// # Errors
///
/// As [`read`](super::read).
pub(in crate::io) fn geo_keys(file: Source, length: u64, path: &Path) -> Outcome<Option<GeoKeys>> {
    let found = surviving(|| {
        let mut file = BufReader::new(Shown::new(file)?);
        let legacy = file.get_ref().legacy;
        let header = Header::read_from(&mut file).map_err(of_las)?;
        look(&mut file, (&header, legacy), (length, "")).map_err(early)
    });
    found.map(|found| found.keys).map_err(|fault| fault.of(path))
}

impl Found {
    /// A sentence if points lie outside the bounding box in the header.
    pub fn outside(&self, name: &str, positions: &[[f64; 3]]) -> Option<String> {
        let [min, max] = self.bounds;
        let is_outside = |position: &&[f64; 3]| {
            let beyond = |axis: usize| {
                let room = STEPS * self.step[axis];
                position[axis] < min[axis] - room || position[axis] > max[axis] + room
            };
            (0..3).any(beyond)
        };
        // An inverted box and a scale of 0 have notes of their own.
        if (0..3).any(|axis| min[axis] > max[axis] || self.step[axis] == 0.0) {
            return None;
        }
        let count = positions.iter().filter(is_outside).count();
        let spans = |of: fn(f64, f64) -> f64, start: f64| {
            positions.iter().fold([start; 3], |all, position| [0, 1, 2].map(|axis| of(all[axis], position[axis])))
        };
        (count > 0).then(|| {
            format!(
                "{name}: {count} of {} points lie outside of the box in its header, {min:?} to {max:?}: they span {:?} to {:?}",
                positions.len(),
                spans(f64::min, f64::INFINITY),
                spans(f64::max, f64::NEG_INFINITY)
            )
        })
    }
}

/// Facts in the variable-length records of a file.
struct Records {
    systems: system::Records,
    /// Attributes in the extra bytes of points.
    extra: Vec<Field>,
    /// Offset of the end of the last record, bytes.
    end: u64,
}

fn records(file: &mut (impl Read + Seek), header: &Header) -> Result<Records, Fault> {
    let (mut found, mut extra) = (system::Records::default(), Vec::new());
    let mut end = u64::from(header.header_size);
    file.seek(SeekFrom::Start(end))?;
    for _ in 0..header.number_of_variable_length_records {
        // A file that ends here is refused elsewhere.
        let Ok(record) = Vlr::read_from(&mut *file, false) else { break };
        end += RECORD_HEADER + record.data.len() as u64;
        found.take(&record);
        extra.extend(extra::fields(&record).unwrap_or_default());
    }
    if let Some(extended) = header.evlr.filter(|_| found.text.is_none()) {
        found.look_in_extended(file, extended.start_of_first_evlr, extended.number_of_evlrs);
    }
    Ok(Records { systems: found, extra, end })
}

/// A sentence if the point count of LAS 1.4 and the legacy count disagree.
fn counts(header: &Header, legacy: u32) -> Option<String> {
    let large = header.large_file?.number_of_point_records;
    let legacy = u64::from(legacy);
    // Writers put 0 into a field that they do not use.
    if legacy == 0 || legacy == large {
        return None;
    }
    let taken = promised(header);
    Some(format!("its header says {large} points, and {legacy} in the field of older versions: {taken} are read"))
}

/// A sentence if the file has space for more points than its header says, or if the point counts by
/// return add up to more.
fn room(header: &Header, length: u64) -> Option<String> {
    let count = promised(header);
    let by_return: u64 = match header.large_file {
        Some(large) => large.number_of_points_by_return.iter().fold(0, |sum, count| sum.saturating_add(*count)),
        None => header.number_of_points_by_return.iter().map(|count| u64::from(*count)).sum(),
    };
    if by_return > count {
        return Some(format!("its header says {count} points, and {by_return} points over all returns"));
    }
    let is_plain = header.point_data_record_format & 0x80 == 0
        && header.evlr.is_none()
        && header.start_of_waveform_data_packet_record.is_none();
    let room = length.saturating_sub(header.offset_to_point_data.into());
    let held = room.checked_div(header.point_data_record_length.into())?;
    (is_plain && held > count).then(|| format!("its header says {count} points, and the file has bytes for {held}"))
}

/// A sentence if the file's version does not define its point format.
fn formats(header: &Header) -> Option<String> {
    let format = header.point_data_record_format & 0x3f;
    let since = match format {
        0 | 1 => 0,
        2 | 3 => 2,
        4 | 5 => 3,
        _ => 4,
    };
    let minor = header.version.minor;
    (minor < since)
        .then(|| format!("its header says LAS 1.{minor}, and point format {format}, which LAS 1.{since} introduced"))
}

/// Sentences about offsets and sizes that contradict each other.
fn places(header: &Header, end: u64) -> Vec<String> {
    let mut notes = Vec::new();
    let size = match header.version.minor {
        0..=2 => SIZES[0],
        3 => SIZES[1],
        _ => SIZES[2],
    };
    let (own, start) = (header.header_size, u64::from(header.offset_to_point_data));
    if own < size {
        notes.push(format!("its header says that it is {own} bytes long, and those of its version have {size}"));
    }
    if end > start {
        notes.push(format!("its points start at byte {start}, and the records before them end at byte {end}"));
    }
    if let Some(extended) = header.evlr {
        let at = extended.start_of_first_evlr;
        let record = u64::from(header.point_data_record_length);
        let plain = header.point_data_record_format & 0x80 == 0;
        let points_end = start.saturating_add(if plain { record.saturating_mul(promised(header)) } else { 0 });
        if at < points_end && extended.number_of_evlrs > 0 {
            notes.push(format!("its extended records start at byte {at}, and its points end at byte {points_end}"));
        }
    }
    notes
}

/// A warning if a scale is 0, negative or not finite.
fn scale(scales: [f64; 3]) -> Option<String> {
    let along = |is: fn(f64) -> bool| {
        let axes = scales.iter().zip(["x", "y", "z"]).filter(|(scale, _)| is(**scale)).map(|(_, axis)| axis);
        axes.collect::<Vec<_>>()
    };
    let zero = along(|scale| scale == 0.0);
    if !zero.is_empty() {
        return Some(format!(
            "{WARNING}its header says that the scale along {} is 0, so all points have the same coordinate there",
            zero.join(", ")
        ));
    }
    let odd = along(|scale| !(scale.is_finite() && scale > 0.0));
    (!odd.is_empty())
        .then(|| format!("{WARNING}its header gives a scale along {} that is no positive number", odd.join(", ")))
}

/// The description of the file for its user.
fn about(header: &Header, system: Option<System>, extra: &[Field]) -> About {
    let text = |bytes: &[u8]| {
        let text = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
        let text = String::from_utf8_lossy(text).trim().to_owned();
        (!text.is_empty()).then_some(text)
    };
    let format = header.point_data_record_format & 0x3f;
    let kind = if header.point_data_record_format & 0x80 != 0 { "LAZ" } else { "LAS" };
    let minor = header.version.minor;
    About {
        format: format!("{kind} 1.{minor}, point format {format}"),
        coordinate_system: system.map(|system| system.name),
        scanners: text(&header.system_identifier)
            .filter(|name| !NO_SYSTEMS.contains(&name.as_str()))
            .into_iter()
            .collect(),
        software: text(&header.generating_software),
        attributes: attributes(format, header.point_data_record_length, extra),
        ..About::default()
    }
}

/// The attributes of a point, and which of them are used.
fn attributes(format: u8, record: u16, named: &[Field]) -> Vec<Attribute> {
    let Ok(known) = Format::new(format) else { return Vec::new() };
    let always = [("x y z", true, Role::Other), ("intensity", false, Role::Intensity), ("returns", false, Role::Other)];
    let mut all: Vec<Attribute> = always.map(|(name, used, role)| Attribute::new(name, used, role)).into();
    all.push(Attribute::new("classification", true, Role::Other));
    for name in ["scan angle", "user data", "point source"] {
        all.push(Attribute::new(name, false, Role::Other));
    }
    let more = [
        (known.has_gps_time, "GPS time", Role::Other),
        (known.has_color, "red green blue", Role::Color),
        (known.has_nir, "near infrared", Role::Other),
        (known.has_waveform, "waveform", Role::Other),
    ];
    all.extend(more.into_iter().filter(|(has, ..)| *has).map(|(_, name, role)| Attribute::new(name, false, role)));
    let mut extra = record.saturating_sub(known.len());
    let normals = Normals::of(named, known.len());
    for field in named {
        extra = extra.saturating_sub(field.size);
        let is_used = normals.as_ref().is_some_and(|normals| normals.fields.contains(field));
        all.push(Attribute::new(field.name.clone(), is_used, Role::Other));
    }
    if extra > 0 {
        all.push(Attribute::new(format!("{extra} extra bytes"), false, Role::Other));
    }
    all
}
