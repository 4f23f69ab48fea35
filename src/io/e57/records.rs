//! Where the records of a scan hold position, normal and colour, and its pose and limits.

use ::e57::{PointCloud, Record, RecordDataType, RecordName, RecordValue};
use glam::{DQuat, DVec3};

use super::of_e57;
use crate::io::color_range::{Kind, Number};
use crate::io::fault::Fault;

/// Indices of a scan's coordinate attributes, and of the attribute that marks invalid points.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) spherical: bool,
    pub(super) axes: [usize; 3],
    pub(super) invalid: Option<usize>,
}

impl Place {
    /// The position in the scan's own axes, from the values of the three records.
    pub(super) fn local(&self, [a, b, c]: [f64; 3]) -> DVec3 {
        if !self.spherical {
            return DVec3::new(a, b, c);
        }
        let (range, azimuth, elevation) = (a, b, c);
        range * DVec3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
    }

    pub(super) fn of(scan: &PointCloud) -> Option<Self> {
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

pub(super) fn index(scan: &PointCloud, name: &RecordName) -> Option<usize> {
    scan.prototype.iter().position(|record| record.name == *name)
}

/// Indices of the normal attributes of the extension `nor` (E57_EXT_surface_normals), under any
/// namespace prefix.
pub(super) fn normal(scan: &PointCloud) -> Option<[usize; 3]> {
    let named = |wanted: &str| {
        let is = |name: &RecordName| matches!(name, RecordName::Unknown { name, .. } if name == wanted);
        scan.prototype.iter().position(|record| is(&record.name))
    };
    Some([named("normalX")?, named("normalY")?, named("normalZ")?])
}

pub(super) fn triple(scan: &PointCloud, names: &[RecordName; 3]) -> Option<[usize; 3]> {
    let [a, b, c] = names.each_ref().map(|name| index(scan, name));
    Some([a?, b?, c?])
}

/// Indices of a scan's red, green and blue.
pub(super) fn color(scan: &PointCloud) -> Option<[usize; 3]> {
    triple(scan, &[RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue])
}

/// The kind of a scan's colour numbers.
pub(super) fn kind(scan: &PointCloud, color: [usize; 3]) -> Kind {
    let of_record = |at: usize| match scan.prototype.get(at).map(|record| &record.data_type) {
        Some(RecordDataType::Integer { min, max }) => Number::Integer(max.abs_diff(*min)),
        _ => Number::Float,
    };
    let number = if color.map(of_record).contains(&Number::Float) { Number::Float } else { of_record(color[0]) };
    Kind { limits: limits(scan, color), ..Kind::of(number) }
}

/// The rotation and translation from a scan's coordinates to the file's.
pub(super) fn pose(scan: &PointCloud) -> Result<(DQuat, DVec3), Fault> {
    let Some(pose) = &scan.transform else { return Ok((DQuat::IDENTITY, DVec3::ZERO)) };
    let (q, t) = (&pose.rotation, &pose.translation);
    let rotation = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
    let length = rotation.length();
    if !(0.99..=1.01).contains(&length) {
        return Err(Fault::Malformed(format!("the quaternion of a scan's pose has the length {length}, not 1")));
    }
    Ok((rotation.normalize(), DVec3::new(t.x, t.y, t.z)))
}

/// The smallest and largest value of each colour channel: those that the scan states, or else those
/// of its integer type. None if a channel has neither.
pub(super) fn limits(scan: &PointCloud, color: [usize; 3]) -> Option<[(f64, f64); 3]> {
    let limits = scan.color_limits.as_ref();
    let given = [
        limits.map(|limits| (&limits.red_min, &limits.red_max)),
        limits.map(|limits| (&limits.green_min, &limits.green_max)),
        limits.map(|limits| (&limits.blue_min, &limits.blue_max)),
    ];
    let of_channel = |channel: usize| {
        let Record { data_type, .. } = scan.prototype.get(color[channel])?;
        if let Some((Some(low), Some(high))) = given[channel]
            && let (Ok(low), Ok(high)) = (low.to_f64(data_type), high.to_f64(data_type))
            && low < high
        {
            return Some((low, high));
        }
        match *data_type {
            RecordDataType::Integer { min, max } if min < max => Some((min as f64, max as f64)),
            RecordDataType::ScaledInteger { min, max, scale, offset } if min < max && scale > 0.0 => {
                Some((min as f64 * scale + offset, max as f64 * scale + offset))
            }
            _ => None,
        }
    };
    Some([of_channel(0)?, of_channel(1)?, of_channel(2)?])
}

pub(super) fn number(values: &[RecordValue], prototype: &[Record], at: usize) -> Result<f64, Fault> {
    match (values.get(at), prototype.get(at)) {
        (Some(value), Some(record)) => value.to_f64(&record.data_type).map_err(of_e57),
        _ => Err(Fault::Malformed("a point lacks an attribute that its scan has".into())),
    }
}
