//! Parsers of argument values. Errors are sentences that say what is expected.

use std::num::NonZeroU32;

use glam::DVec3;

use super::values::numbers;
use crate::scene::camera::check_size;
use crate::surfels::Orientation;

/// Parses a size in pixels: `WIDTHxHEIGHT`, or one number for a square.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |part: &str| {
        part.parse::<u32>()
            .map_err(|_| format!("a size is WIDTHxHEIGHT or a number, and {part:?} is not a number of pixels"))
    };
    let (width, height) = text.split_once('x').unwrap_or((text, text));
    let (width, height) = (side(width)?, side(height)?);
    check_size(width, height).map_err(|e| e.to_string())?;
    Ok((width, height))
}

/// Parses a positive factor on the size of pictures.
pub fn scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if factor > 0.0 && factor.is_finite() => Ok(factor),
        _ => Err("a factor is a positive number".into()),
    }
}

/// The most pictures of a turntable.
const MOST_TURNS: u32 = 100_000;

/// Parses the number of pictures of a turntable.
pub fn turns(text: &str) -> Result<NonZeroU32, String> {
    let count = text.parse().ok().filter(|count: &NonZeroU32| count.get() <= MOST_TURNS);
    count.ok_or_else(|| format!("a turntable has 1 to {MOST_TURNS} pictures"))
}

/// Parses a vector: `X,Y,Z`.
pub fn vector(text: &str) -> Result<DVec3, String> {
    match numbers(text).map_err(|error| error.to_string())?[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err("three numbers are needed: X,Y,Z".into()),
    }
}

/// Parses a direction: `X,Y,Z`, or the name of an axis: x, y, z, -x, -y or -z.
pub fn up(text: &str) -> Result<DVec3, String> {
    let (name, sign) = text.strip_prefix('-').map_or((text, 1.0), |name| (name, -1.0));
    match name {
        "x" => Ok(DVec3::X * sign),
        "y" => Ok(DVec3::Y * sign),
        "z" => Ok(DVec3::Z * sign),
        _ => vector(text).map_err(|what| format!("it is none of x, y, z, -x, -y and -z, and {what}")),
    }
}

/// Formats a direction for [`up`]: by its name if it is an axis.
pub fn up_argument(up: DVec3) -> String {
    let axes = [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")];
    let named = |(axis, name): (DVec3, &str)| match up {
        _ if up == axis => Some(name.to_owned()),
        _ if up == -axis => Some(format!("-{name}")),
        _ => None,
    };
    axes.into_iter().find_map(named).unwrap_or_else(|| vector_argument(up))
}

/// Formats a vector for [`vector`], which restores it exactly.
pub fn vector_argument(v: DVec3) -> String {
    format!("{},{},{}", v.x, v.y, v.z)
}

/// Parses an orientation: `propagate`, `up`, or the position `X,Y,Z` of a scanner.
pub fn orientation(text: &str) -> Result<Orientation, String> {
    match text {
        "propagate" => Ok(Orientation::Propagate),
        "up" => Ok(Orientation::Up),
        _ => vector(text)
            .map(|scanner| Orientation::Toward(vec![scanner]))
            .map_err(|what| format!("it is neither propagate nor up nor the position of a scanner: {what}")),
    }
}

/// Parses a size of memory, such as `2GiB`, `512MiB` or `4GB`, and returns bytes.
pub fn memory(text: &str) -> Result<u64, String> {
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30), ("TiB", 40)].map(|(unit, power)| (unit, 2f64.powi(power)));
    let decimal = [("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];
    let mut all = units.into_iter().chain(decimal);
    let number = |unit: &str| text.strip_suffix(unit).and_then(|number| number.trim_end().parse::<f64>().ok());
    let bytes = all.find_map(|(unit, size)| Some(number(unit)? * size));
    let bytes = bytes.filter(|bytes| *bytes > 0.0 && *bytes < 1e18);
    bytes
        .map(|bytes| bytes as u64)
        .ok_or_else(|| format!("'{text}' is not a size of memory: give a number and a unit, such as 2GiB or 512MiB"))
}

/// Parses the bounds of a map: `XMIN,YMIN,XMAX,YMAX`.
pub fn bounds(text: &str) -> Result<[f64; 4], String> {
    match numbers(text).map_err(|error| error.to_string())?[..] {
        [left, bottom, right, top] if left < right && bottom < top => Ok([left, bottom, right, top]),
        _ => Err("four numbers are needed, the lesser first: XMIN,YMIN,XMAX,YMAX".into()),
    }
}

/// Parses intrinsics in pixels: `FX,FY,CX,CY`.
pub fn intrinsics(text: &str) -> Result<[f64; 4], String> {
    numbers(text)
        .map_err(|error| error.to_string())?
        .try_into()
        .map_err(|_| "four numbers are needed: FX,FY,CX,CY".into())
}
