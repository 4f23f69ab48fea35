//! E57 (ASTM E2807): the scans of laser scanners on the ground, through the `e57` crate.

use std::fs::File;
use std::io::{self, BufReader};

use ::e57::{E57Reader, PointCloud, Record, RecordDataType, RecordName, RecordValue};
use glam::{DQuat, DVec3};

use crate::io::fault::{self, Fault, Unread, reserve, surviving};
use crate::io::values::{one_line, shown};
use crate::io::{Input, Points, Up, intensity};
use crate::scene::Colors;
use crate::scene::color::{DEFAULT_COLOR, linear_to_srgb, srgb_to_linear};
use crate::{Progress, Result};

/// No scan has more attributes.
const MOST_ATTRIBUTES: usize = 64;

/// Reads the points of all scans of an E57 file, in the file's own system: each scan's pose is applied, in f64.
///
/// Coordinates are Cartesian or, where a scan has none, spherical; points that are marked as invalid are left out. Normals, if any
/// scan has the extension `nor` for them, are turned with its pose, and zero where it has none. Colours are sRGB codes, in the range that the scan gives or else its type: of 0 to 255 they stay 8-bit, else they become linear light. Without
/// colours, intensities become grey as in a LAS file. Up is z.
///
/// A scan that has no points or cannot be read is left out, and told by [`Points::unread`], if
/// another one can be read and this is not `strict`.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where the file
/// is not E57, ends early, fails its checksums or cannot be decoded.
pub fn read(input: Input, strict: bool, progress: &dyn Progress) -> Result<Points> {
    let Input { file, length, path, .. } = input;
    let opened = surviving(|| {
        let reader = E57Reader::new(BufReader::with_capacity(1 << 18, file)).map_err(of_e57)?;
        let mut unread = Unread::default();
        let scans = usable(reader.pointclouds(), length.saturating_mul(8), (&mut unread, strict))?;
        Ok((reader, scans, unread))
    });
    let (mut reader, (scans, all), mut unread) = opened.map_err(|fault| fault.of(&path))?;
    let promised = scans.iter().map(|(_, scan)| scan.records).fold(0, u64::saturating_add);
    progress.begin(&format!("reading {}", fault::name(&path)), promised);
    let points = surviving(|| {
        let any_normals = scans.iter().any(|(_, scan)| normal(scan).is_some());
        let mut reading = Reading { normals: any_normals.then(Vec::new), ..Reading::default() };
        let mut read = unread.is_empty();
        for (name, scan) in &scans {
            let before = reading.state();
            match surviving(|| reading.scan(&mut reader, scan, progress)) {
                Ok(()) => read = true,
                Err(fault) => {
                    reading.go_back(before, scan.records);
                    unread.add(|what| format!("{name}: {what}"), scan.records, fault, strict)?;
                }
            }
        }
        let unread = unread.told(&path, ("scans", all), read)?;
        Ok(Points { unread, ..reading.into_points() })
    });
    progress.end();
    points.map_err(|fault| fault.of(&path))
}

/// The scans that have points, by their names, and how many there are in all: those that have none,
/// or promise more than is left of so many bits of the file, are left out.
fn usable(
    scans: Vec<PointCloud>,
    mut left: u64,
    (unread, strict): (&mut Unread, bool),
) -> Result<(Vec<(String, PointCloud)>, u64), Fault> {
    let (mut usable, all) = (Vec::new(), scans.len() as u64);
    for (number, scan) in (1..).zip(scans) {
        let name = match scan.name.as_deref().map(str::trim).filter(|name| !name.is_empty()) {
            Some(name) => format!("scan {number} '{}'", shown(name.as_bytes())),
            None => format!("scan {number}"),
        };
        match check(&scan, left) {
            // One scan without points is a file without points, which is no fault.
            Ok(_) if scan.records == 0 && all > 1 => {
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

/// The crate's failures that are the file's fault, told from the system's.
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

/// Holds what a scan promises against the `left` bits of the file, before anything is allocated for it; the bits that it leaves
/// to the others.
fn check(scan: &PointCloud, left: u64) -> Result<u64, String> {
    if Place::of(scan).is_none() {
        return Err("has no coordinates".into());
    }
    if scan.prototype.len() > MOST_ATTRIBUTES {
        return Err(format!("has {} attributes, more than {MOST_ATTRIBUTES}", scan.prototype.len()));
    }
    // Values that are all the same take no bits; points of which none takes any would have no end.
    let bits: u64 = scan.prototype.iter().map(|record| bits(&record.data_type)).sum();
    let held = left.checked_div(bits).unwrap_or(0);
    if held < scan.records {
        return Err(format!("promises {} points, the file holds {held} at most", scan.records));
    }
    Ok(left - bits * scan.records)
}

/// Bits of a value in the file.
fn bits(kind: &RecordDataType) -> u64 {
    match *kind {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            u64::from(u64::BITS - max.abs_diff(min).leading_zeros())
        }
    }
}

/// Which of a scan's attributes are its coordinates, and which marks the invalid ones.
#[derive(Clone, Copy)]
struct Place {
    spherical: bool,
    axes: [usize; 3],
    invalid: Option<usize>,
}

impl Place {
    fn of(scan: &PointCloud) -> Option<Self> {
        let cartesian = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
        let spherical = [RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation];
        if let Some(axes) = triple(scan, &cartesian) {
            let invalid = index(scan, &RecordName::CartesianInvalidState);
            return Some(Self { spherical: false, axes, invalid });
        }
        let axes = triple(scan, &spherical)?;
        Some(Self { spherical: true, axes, invalid: index(scan, &RecordName::SphericalInvalidState) })
    }
}

fn index(scan: &PointCloud, name: &RecordName) -> Option<usize> {
    scan.prototype.iter().position(|record| record.name == *name)
}

/// The attributes of the extension `nor` (E57_EXT_surface_normals), by whatever prefix a file has it, if by one at all.
fn normal(scan: &PointCloud) -> Option<[usize; 3]> {
    let named = |wanted: &str| {
        let is = |name: &RecordName| matches!(name, RecordName::Unknown { name, .. } if name == wanted);
        scan.prototype.iter().position(|record| is(&record.name))
    };
    Some([named("normalX")?, named("normalY")?, named("normalZ")?])
}

fn triple(scan: &PointCloud, names: &[RecordName; 3]) -> Option<[usize; 3]> {
    let [a, b, c] = names.each_ref().map(|name| index(scan, name));
    Some([a?, b?, c?])
}

/// The points of a file while they are being read.
#[derive(Default)]
struct Reading {
    positions: Vec<[f64; 3]>,
    /// If any scan has normals; zero where there is none.
    normals: Option<Vec<[f32; 3]>>,
    /// Colours as shares of their range; not numbers where there is none.
    colors: Vec<[f32; 3]>,
    /// Whether any point has a colour, and whether all ranges are 0 to 255.
    colored: bool,
    wide: bool,
    /// 0 where there is none.
    intensities: Vec<f32>,
    /// Numbers of points that are marked as invalid, over all scans.
    left_out: Vec<u64>,
}

impl Reading {
    /// Points so far, those that are left out, and what is known of colours.
    fn state(&self) -> (usize, usize, [bool; 2]) {
        (self.positions.len(), self.left_out.len(), [self.colored, self.wide])
    }

    /// Leaves out all points of a scan of so many, since which this was the state.
    fn go_back(&mut self, (positions, left_out, [colored, wide]): (usize, usize, [bool; 2]), records: u64) {
        self.positions.truncate(positions);
        self.normals.iter_mut().for_each(|normals| normals.truncate(positions));
        self.colors.truncate(positions);
        self.intensities.truncate(positions);
        self.left_out.truncate(left_out);
        (self.colored, self.wide) = (colored, wide);
        // Their numbers stay those of the file.
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
        let color = triple(scan, &[RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue]);
        let ranges = color.map(|color| ranges(scan, color));
        let normal = normal(scan);
        let color_invalid = index(scan, &RecordName::IsColorInvalid);
        let intensity = index(scan, &RecordName::Intensity);
        let intensity_invalid = index(scan, &RecordName::IsIntensityInvalid);
        self.wide |= ranges.is_some_and(|ranges| ranges != [(0.0, 255.0); 3]);
        reserve(&mut self.positions, scan.records)?;
        self.normals.as_mut().map_or(Ok(()), |normals| reserve(normals, scan.records))?;
        reserve(&mut self.colors, scan.records)?;
        reserve(&mut self.intensities, scan.records)?;
        let mut unreported = 0;
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
            let [a, b, c] = [number(place.axes[0])?, number(place.axes[1])?, number(place.axes[2])?];
            let local = if place.spherical {
                let (range, azimuth, elevation) = (a, b, c);
                range * DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
            } else {
                DVec3::new(a, b, c)
            };
            self.positions.push((rotation * local + translation).to_array());
            if let Some(normals) = &mut self.normals {
                let local = match normal {
                    Some([x, y, z]) => DVec3::new(number(x)?, number(y)?, number(z)?),
                    None => DVec3::ZERO,
                };
                normals.push((rotation * local).as_vec3().to_array());
            }
            let mut share = [f32::NAN; 3];
            if let (Some(color), Some(ranges), false) = (color, ranges, marked(color_invalid)?) {
                for (share, (at, (low, high))) in share.iter_mut().zip(color.into_iter().zip(ranges)) {
                    *share = ((number(at)? - low) / (high - low)).clamp(0.0, 1.0) as f32;
                }
                self.colored = true;
            }
            self.colors.push(share);
            let intensity = intensity.filter(|_| !marked(intensity_invalid).unwrap_or(true));
            self.intensities.push(intensity.map_or(Ok(0.0), number)? as f32);
        }
        progress.advance(unreported);
        Ok(())
    }

    fn into_points(self) -> Points {
        let colors = if !self.colored {
            intensity::grey(&intensity::codes(&self.intensities))
        } else if self.wide {
            let light = |share: f32| srgb_to_linear(f64::from(share)) as f32;
            let color = |[r, g, b]: [f32; 3]| {
                if r.is_nan() { DEFAULT_COLOR } else { [light(r), light(g), light(b), 1.0] }
            };
            Some(Colors::Linear(self.colors.into_iter().map(color).collect()))
        } else {
            let code = |share: f64| (share * 255.0).round() as u8;
            let [r, g, b, _] = DEFAULT_COLOR.map(|light| code(linear_to_srgb(light.into())));
            let default = [r, g, b, 255];
            let color = |[r, g, b]: [f32; 3]| {
                if r.is_nan() { default } else { [code(r.into()), code(g.into()), code(b.into()), 255] }
            };
            Some(Colors::Srgb8(self.colors.into_iter().map(color).collect()))
        };
        Points {
            positions: self.positions,
            normals: self.normals,
            colors,
            up: Some(Up::Z),
            left_out: self.left_out,
            ..Points::default()
        }
    }
}

/// What takes a scan's coordinates to the file's.
fn pose(scan: &PointCloud) -> Result<(DQuat, DVec3), Fault> {
    let Some(pose) = &scan.transform else { return Ok((DQuat::IDENTITY, DVec3::ZERO)) };
    let (q, t) = (&pose.rotation, &pose.translation);
    let rotation = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
    let length = rotation.length();
    if !(0.99..=1.01).contains(&length) {
        return Err(Fault::Malformed(format!("the quaternion of a scan's pose has the length {length}, not 1")));
    }
    Ok((rotation.normalize(), DVec3::new(t.x, t.y, t.z)))
}

/// Smallest and largest values of a scan's colours: those it gives, or else those of their types.
fn ranges(scan: &PointCloud, color: [usize; 3]) -> [(f64, f64); 3] {
    let limits = scan.color_limits.as_ref();
    let given = [
        limits.map(|limits| (&limits.red_min, &limits.red_max)),
        limits.map(|limits| (&limits.green_min, &limits.green_max)),
        limits.map(|limits| (&limits.blue_min, &limits.blue_max)),
    ];
    std::array::from_fn(|channel| {
        let Some(Record { data_type, .. }) = scan.prototype.get(color[channel]) else { return (0.0, 1.0) };
        if let Some((Some(low), Some(high))) = given[channel]
            && let (Ok(low), Ok(high)) = (low.to_f64(data_type), high.to_f64(data_type))
            && low < high
        {
            return (low, high);
        }
        match *data_type {
            RecordDataType::Integer { min, max } if min < max => (min as f64, max as f64),
            RecordDataType::ScaledInteger { min, max, scale, offset } if min < max && scale > 0.0 => {
                (min as f64 * scale + offset, max as f64 * scale + offset)
            }
            _ => (0.0, 1.0),
        }
    })
}

fn number(values: &[RecordValue], prototype: &[Record], at: usize) -> Result<f64, Fault> {
    match (values.get(at), prototype.get(at)) {
        (Some(value), Some(record)) => value.to_f64(&record.data_type).map_err(of_e57),
        _ => Err(Fault::Malformed("a point lacks an attribute that its scan has".into())),
    }
}
