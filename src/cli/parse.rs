//! Values of arguments: texts into numbers, or a sentence that says what is expected.

use epsplat::options::values::numbers;
use epsplat::surfels::Orientation;
use glam::DVec3;

/// `WIDTHxHEIGHT`, pixels.
pub(super) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |part: &str| part.parse::<u32>().map_err(|_| format!("{part:?} is not a number of pixels"));
    let (width, height) = text.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let (width, height) = (side(width)?, side(height)?);
    epsplat::scene::camera::check_size(width, height).map_err(|e| e.to_string())?;
    Ok((width, height))
}

/// A factor that makes pictures larger or smaller.
pub(super) fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if factor > 0.0 && factor.is_finite() => Ok(factor),
        _ => Err("a factor is a positive number".into()),
    }
}

/// `X,Y,Z`.
pub(super) fn parse_vector(text: &str) -> Result<DVec3, String> {
    match numbers(text).map_err(|error| error.to_string())?[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err("three numbers are needed: X,Y,Z".into()),
    }
}

/// `X,Y,Z`, or an axis by its name: x, y, z, -x, -y or -z.
pub(super) fn parse_up(text: &str) -> Result<DVec3, String> {
    let (name, sign) = text.strip_prefix('-').map_or((text, 1.0), |name| (name, -1.0));
    match name {
        "x" => Ok(DVec3::X * sign),
        "y" => Ok(DVec3::Y * sign),
        "z" => Ok(DVec3::Z * sign),
        _ => parse_vector(text).map_err(|what| format!("it is none of x, y, z, -x, -y and -z, and {what}")),
    }
}

/// A direction as [`parse_up`] reads it: the axis by its name, if it is one.
pub(super) fn up_argument(up: DVec3) -> String {
    let axes = [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")];
    let named = |(axis, name): (DVec3, &str)| match up {
        _ if up == axis => Some(name.to_owned()),
        _ if up == -axis => Some(format!("-{name}")),
        _ => None,
    };
    axes.into_iter().find_map(named).unwrap_or_else(|| vector_argument(up))
}

/// A vector as [`parse_vector`] reads it, to the last bit.
pub(super) fn vector_argument(v: DVec3) -> String {
    format!("{},{},{}", v.x, v.y, v.z)
}

/// `propagate`, `up`, or the `X,Y,Z` of a scanner.
pub(super) fn parse_orientation(text: &str) -> Result<Orientation, String> {
    match text {
        "propagate" => Ok(Orientation::Propagate),
        "up" => Ok(Orientation::Up),
        _ => parse_vector(text)
            .map(|scanner| Orientation::Toward(vec![scanner]))
            .map_err(|what| format!("it is neither propagate nor up nor the position of a scanner: {what}")),
    }
}

/// Bytes of memory: `2GiB`, `512MiB` or `4GB`.
pub(super) fn parse_memory(text: &str) -> Result<u64, String> {
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30), ("TiB", 40)].map(|(unit, power)| (unit, 2f64.powi(power)));
    let decimal = [("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];
    let mut all = units.into_iter().chain(decimal);
    let number = |unit: &str| text.strip_suffix(unit).and_then(|number| number.trim_end().parse::<f64>().ok());
    let bytes = all.find_map(|(unit, size)| Some(number(unit)? * size));
    let bytes = bytes.filter(|bytes| *bytes > 0.0 && *bytes < 1e18);
    bytes
        .map(|bytes| bytes as u64)
        .ok_or_else(|| format!("'{text}' is no size of memory: a number and a unit, 2GiB or 512MiB"))
}

/// `FX,FY,CX,CY`, pixels.
pub(super) fn parse_intrinsics(text: &str) -> Result<[f64; 4], String> {
    numbers(text)
        .map_err(|error| error.to_string())?
        .try_into()
        .map_err(|_| "four numbers are needed: FX,FY,CX,CY".into())
}
