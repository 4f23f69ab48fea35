//! E57 (ASTM E2807), the format of terrestrial laser scanners, read by the `e57` crate.

mod records;

use std::fs::File;
use std::io::{self, BufReader};

use ::e57::{E57Reader, PointCloud, RecordDataType, RecordName};
use glam::DVec3;

use crate::io::about::{About, Attribute, Role};
use crate::io::color_range::{Numbers, RawColors, Run, Shades, Values};
use crate::io::dimensions::Collector;
use crate::io::fault::{self, Fault, Unread, reserve, surviving};
use crate::io::input::Local;
use crate::io::values::{one_line, shown};
use crate::io::{Input, Points, ReadOptions, Up};
use crate::{Progress, Result};
use records::{Place, color, index, kind, normal, number, pose};

/// The most attributes of a scan that is read.
const MOST_ATTRIBUTES: usize = 64;

/// Reads the points of all scans of an E57 file, in the file's coordinate system.
///
/// Each scan's pose is applied in f64. Coordinates are Cartesian or, where a scan has none,
/// spherical; points that are marked as invalid are left out. If any scan has normals (extension
/// `nor`), they are rotated with its pose, and scans without normals get zero. Colours are
/// interpreted from their values and from the limits that the scan or its type states
/// ([`RawColors`]). The intensities of scans without colours become grey. Up is z.
///
/// A scan that has no points or cannot be read is left out and named in [`Points::unread`], unless
/// no scan can be read or [`ReadOptions::strict`] is set.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) where the file is not E57, ends early, fails its
/// checksums or cannot be decoded.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Local { file, length, path } = input.local()?;
    let opened = surviving(|| {
        let reader = E57Reader::new(BufReader::with_capacity(1 << 18, file)).map_err(of_e57)?;
        let mut unread = Unread::default();
        let scans = usable(reader.pointclouds(), length.saturating_mul(8), (&mut unread, options.strict))?;
        Ok((reader, scans, unread))
    });
    let (mut reader, (scans, all), mut unread) = opened.map_err(|fault| fault.of(&path))?;
    let promised = scans.iter().map(|(_, scan)| scan.records).fold(0, u64::saturating_add);
    progress.begin(&format!("reading {}", fault::name(&path)), promised);
    let points = surviving(|| {
        let any_normals = scans.iter().any(|(_, scan)| normal(scan).is_some());
        let names = names(&scans);
        let collector = Collector::of(&names, &options.wanted)?;
        let mut reading = Reading { normals: any_normals.then(Vec::new), names, collector, ..Reading::default() };
        let mut read = false;
        for (name, scan) in &scans {
            let before = reading.state();
            match surviving(|| reading.scan(&mut reader, scan, progress)) {
                Ok(()) => read = true,
                Err(fault) => {
                    reading.go_back(before, scan.records);
                    unread.add(|what| format!("{name}: {what}"), scan.records, fault, options.strict)?;
                }
            }
        }
        let unread = unread.told(&path, ("scans", all), read)?;
        Ok(Points { unread, ..reading.into_points()? })
    });
    progress.end();
    let mut points = points.map_err(|fault| fault.of(&path))?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    points.about = options.describe.then(|| Box::new(about(&reader, &reader.pointclouds())));
    Ok(points)
}

/// The file's description of itself.
fn about(reader: &E57Reader<BufReader<File>>, scans: &[PointCloud]) -> About {
    let mut about = About { format: "E57".into(), scans: Some(scans.len() as u64), ..About::default() };
    let system = reader.coordinate_metadata().map(|text| one_line(text.trim())).filter(|text| !text.is_empty());
    about.coordinate_system = system;
    about.software = reader.library_version().map(|text| one_line(text.trim())).filter(|text| !text.is_empty());
    for scan in scans {
        let parts = [&scan.sensor_vendor, &scan.sensor_model, &scan.sensor_serial];
        let scanner = parts.into_iter().flatten().map(|part| one_line(part.trim())).collect::<Vec<_>>().join(" ");
        if !scanner.trim().is_empty() && !about.scanners.contains(&scanner) {
            about.scanners.push(scanner);
        }
        let place = Place::of(scan);
        let color = color(scan);
        for (at, record) in scan.prototype.iter().enumerate() {
            let name = name_of(&record.name);
            let is_place = place.is_some_and(|place| place.axes.contains(&at) || place.invalid == Some(at));
            let is_normal = normal(scan).is_some_and(|normal| normal.contains(&at));
            let role = match record.name {
                RecordName::Intensity => Role::Intensity,
                _ if color.is_some_and(|color| color.contains(&at)) => Role::Color,
                _ => Role::Other,
            };
            let used = is_place || is_normal || color.is_some() && record.name == RecordName::IsColorInvalid;
            if about.attributes.iter().all(|known| known.name != name) {
                about.attributes.push(Attribute::new(name, used, role));
            }
        }
    }
    about
}

/// The names of the attributes that any of the scans has.
fn names(scans: &[(String, PointCloud)]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in scans.iter().flat_map(|(_, scan)| &scan.prototype).map(|record| name_of(&record.name)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// The name of an attribute as files write it.
fn name_of(name: &RecordName) -> String {
    if let RecordName::Unknown { namespace, name } = name {
        return one_line(&format!("{namespace}:{name}"));
    }
    // The crate's names differ from the format's only in the case of the first letter.
    let name = format!("{name:?}");
    let (first, rest) = name.split_at(1);
    first.to_ascii_lowercase() + rest
}

/// Returns the readable scans with their names, and the number of all scans.
///
/// Leaves out scans without points, and scans that [`check`] refuses. `left` is the size of the
/// file, bits.
fn usable(
    scans: Vec<PointCloud>,
    mut left: u64,
    (unread, strict): (&mut Unread, bool),
) -> Result<(Vec<(String, PointCloud)>, u64), Fault> {
    let (mut usable, all) = (Vec::new(), scans.len() as u64);
    let has_points = scans.iter().any(|scan| scan.records > 0);
    for (number, scan) in (1..).zip(scans) {
        let name = match scan.name.as_deref().map(str::trim).filter(|name| !name.is_empty()) {
            Some(name) => format!("scan {number} '{}'", shown(name.as_bytes())),
            None => format!("scan {number}"),
        };
        match check(&scan, left) {
            // If no scan has points, the file is empty, which is not an error.
            Ok(_) if scan.records == 0 && has_points => {
                let fault = Fault::Malformed(format!("its scan {number} has no points"));
                unread.add(|_| format!("{name} has no points"), 0, fault, strict)?;
            }
            Ok(_) if scan.records == 0 => {}
            Ok(rest) => {
                left = rest;
                usable.push((name, scan));
            }
            Err(what) => {
                let fault = Fault::Malformed(format!("its scan {number} {what}"));
                unread.add(|_| format!("{name} {what}"), scan.records, fault, strict)?;
            }
        }
    }
    Ok((usable, all))
}

/// Converts an error of the `e57` crate: either the file is damaged, or the system failed.
fn of_e57(error: ::e57::Error) -> Fault {
    if let ::e57::Error::Read { source: Some(source), .. } = &error
        && let Some(of_system) = source.downcast_ref::<io::Error>()
    {
        match of_system.kind() {
            io::ErrorKind::UnexpectedEof => return Fault::Malformed("the file ends early".into()),
            io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => {}
            kind => return Fault::Io(kind.into()),
        }
    }
    Fault::Malformed(one_line(&error.to_string()))
}

/// Checks a scan's attributes, and its number of points against the `left` bits of the file, before
/// memory is allocated. Returns the bits that remain for the other scans.
fn check(scan: &PointCloud, left: u64) -> Result<u64, String> {
    if Place::of(scan).is_none() {
        return Err("has no coordinates".into());
    }
    if scan.prototype.len() > MOST_ATTRIBUTES {
        return Err(format!("has {} attributes, more than {MOST_ATTRIBUTES}", scan.prototype.len()));
    }
    // An attribute with constant values takes no bits. If all are constant, the file's length does
    // not limit the number of points: `checked_div` then returns None, and the scan is refused.
    let bits: u64 = scan.prototype.iter().map(|record| bits(&record.data_type)).sum();
    let held = left.checked_div(bits).unwrap_or(0);
    if held < scan.records {
        return Err(format!("promises {} points, the file holds {held} at most", scan.records));
    }
    Ok(left - bits * scan.records)
}

/// Bits of one value in the file.
fn bits(kind: &RecordDataType) -> u64 {
    match *kind {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            u64::from(u64::BITS - max.abs_diff(min).leading_zeros())
        }
    }
}

/// The points of a file while it is being read.
#[derive(Default)]
struct Reading {
    positions: Vec<[f64; 3]>,
    /// None if no scan has normals; zero for scans without.
    normals: Option<Vec<[f32; 3]>>,
    /// Colours and intensities, one run per scan.
    runs: Vec<Run>,
    /// Indices of the points that are marked as invalid or that could not be read, over all scans.
    left_out: Vec<u64>,
    /// The names of the attributes of all scans.
    names: Vec<String>,
    /// Collects the attributes that options ask for.
    collector: Option<Collector>,
}

impl Reading {
    /// The number of points that are kept so far, and the number of points that are left out.
    fn state(&self) -> (usize, usize) {
        (self.positions.len(), self.left_out.len())
    }

    /// Goes back to the [`state`](Self::state) before a scan, and leaves out all its `records`
    /// points.
    fn go_back(&mut self, (positions, left_out): (usize, usize), records: u64) {
        self.positions.truncate(positions);
        self.normals.iter_mut().for_each(|normals| normals.truncate(positions));
        self.left_out.truncate(left_out);
        self.collector.iter_mut().for_each(|collector| collector.truncate(positions));
        // Points keep the indices that they have in the file.
        let first = (positions + left_out) as u64;
        self.left_out.extend(first..first.saturating_add(records));
    }

    fn scan(
        &mut self,
        reader: &mut E57Reader<BufReader<File>>,
        scan: &PointCloud,
        progress: &dyn Progress,
    ) -> Result<(), Fault> {
        let Some(place) = Place::of(scan) else { return Ok(()) };
        let (rotation, translation) = pose(scan)?;
        let color = color(scan);
        let normal = normal(scan);
        let color_invalid = index(scan, &RecordName::IsColorInvalid);
        let intensity = index(scan, &RecordName::Intensity);
        let intensity_invalid = index(scan, &RecordName::IsIntensityInvalid);
        let mut looks = Looks::default();
        reserve(&mut self.positions, scan.records)?;
        self.normals.as_mut().map_or(Ok(()), |normals| reserve(normals, scan.records))?;
        reserve(&mut looks.colors, if color.is_some() { scan.records } else { 0 })?;
        reserve(&mut looks.intensities, if color.is_none() && intensity.is_some() { scan.records } else { 0 })?;
        let before = self.positions.len();
        let mut unreported = 0;
        let wanted = self.collector.as_ref().map(|collector| collector.fields.iter().map(|field| &self.names[*field]));
        let place_of = |name: &String| scan.prototype.iter().position(|record| name_of(&record.name) == *name);
        let wanted: Vec<Option<usize>> = wanted.into_iter().flatten().map(place_of).collect();
        for values in reader.pointcloud_raw(scan).map_err(of_e57)? {
            let values = values.map_err(of_e57)?;
            let number = |at: usize| number(&values, &scan.prototype, at);
            unreported += 1;
            if unreported == 1 << 16 {
                progress.advance(std::mem::take(&mut unreported));
            }
            let marked = |at: Option<usize>| at.map_or(Ok(false), |at| Ok::<_, Fault>(number(at)? != 0.0));
            if marked(place.invalid)? {
                self.left_out.push((self.positions.len() + self.left_out.len()) as u64);
                continue;
            }
            let [a, b, c] = place.axes;
            let local = place.local([number(a)?, number(b)?, number(c)?]);
            let position = (rotation * local + translation).to_array();
            if let Some(collector) = &mut self.collector {
                // A scan without the attribute gives none.
                let given = |field: usize| wanted[field].and_then(|at| number(at).ok()).unwrap_or(f64::NAN);
                if !collector.take(&position, given) {
                    self.left_out.push((self.positions.len() + self.left_out.len()) as u64);
                    continue;
                }
            }
            self.positions.push(position);
            if let Some(normals) = &mut self.normals {
                let local = match normal {
                    Some([x, y, z]) => DVec3::new(number(x)?, number(y)?, number(z)?),
                    None => DVec3::ZERO,
                };
                normals.push((rotation * local).as_vec3().to_array());
            }
            if let Some([r, g, b]) = color {
                let is_given = !marked(color_invalid)?;
                looks.color(if is_given { Some([number(r)?, number(g)?, number(b)?]) } else { None });
            }
            if let Some(intensity) = intensity.filter(|_| !looks.colored) {
                let is_given = !marked(intensity_invalid)?;
                looks.intensities.push(if is_given { number(intensity)? as f32 } else { 0.0 });
            }
        }
        progress.advance(unreported);
        self.runs.push(looks.into_run(scan, self.positions.len() - before, (color, intensity)));
        Ok(())
    }

    fn into_points(self) -> Result<Points, Fault> {
        let mut points = Points {
            positions: self.positions,
            normals: self.normals,
            raw: Some(Box::new(RawColors { runs: self.runs, ..RawColors::default() })),
            up: Some(Up::Z),
            left_out: self.left_out,
            ..Points::default()
        };
        self.collector.map_or(Ok(()), |collector| collector.finish(&mut points, false))?;
        Ok(points)
    }
}

/// The colours and intensities of a scan while it is being read.
#[derive(Default)]
struct Looks {
    /// Numbers as they are in the file; NaN where a point has no colour.
    colors: Vec<[f32; 4]>,
    /// Whether any colour is not zero.
    colored: bool,
    /// Whether any point has a colour.
    given: bool,
    /// Intensities, stored until the first non-zero colour; 0 where a point has none.
    intensities: Vec<f32>,
}

impl Looks {
    fn color(&mut self, color: Option<[f64; 3]>) {
        self.given |= color.is_some();
        let [r, g, b] = color.unwrap_or([f64::NAN; 3]).map(|value| value as f32);
        self.colors.push([r, g, b, 1.0]);
        if !self.colored && color.is_some_and(|color| color != [0.0; 3]) {
            (self.colored, self.intensities) = (true, Vec::new());
        }
    }

    fn into_run(self, scan: &PointCloud, count: usize, (color, intensity): (Option<[usize; 3]>, Option<usize>)) -> Run {
        let colors = color.filter(|_| self.given).map(|color| Numbers {
            values: Values::Floats(self.colors),
            kind: kind(scan, color),
            alpha: None,
        });
        let shades = intensity.filter(|_| !self.colored).map(|at| {
            let kind = scan.prototype.get(at).map(|record| &record.data_type);
            let integer = matches!(kind, Some(RecordDataType::Integer { .. }));
            Shades::Floats { values: self.intensities, integer }
        });
        Run { count, colors, shades }
    }
}
