//! Names of attributes, as files write them and as users call them.

use crate::io::attributes::INTENSITY;

/// Degrees in a step of the scan angle in the LAS point formats from 6 on.
pub(in crate::io) const ANGLE_STEP: f64 = 0.006;

/// A quantity that programs give different names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// The class of a point.
    Class,
    /// The number of a laser pulse's return, from 1.
    Return,
    /// The time of measurement, seconds.
    GpsTime,
    /// The angle between the laser's ray and the vertical, degrees.
    ScanAngle,
    /// The strength of the laser's echo.
    Intensity,
}

/// Each group with the names of its attributes, in the form of [`plain`]; the first is what users
/// call it.
const GROUPS: [(Group, &[&str]); 5] = [
    (Group::Class, &["class", "classification", "classificationid"]),
    (Group::Return, &["return", "returnnumber", "returnnum", "returnindex"]),
    (Group::GpsTime, &["gpstime", "time", "timestamp"]),
    (Group::ScanAngle, &["scanangle", "scananglerank"]),
    (Group::Intensity, &[]),
];

/// A name in lower case, without the prefix `scalar_` and without marks between its words.
pub(super) fn plain(name: &str) -> String {
    let mut lower = name.trim().to_lowercase();
    if let Some(rest) = lower.strip_prefix("scalar_") {
        lower = rest.to_owned();
    }
    lower.retain(|c| !matches!(c, ' ' | '_' | '-'));
    lower
}

impl Group {
    /// The group of an attribute; None for most names.
    pub fn of(name: &str) -> Option<Self> {
        let name = plain(name);
        if INTENSITY.iter().any(|known| plain(known) == name) {
            return Some(Self::Intensity);
        }
        GROUPS.iter().find(|(_, names)| names.contains(&name.as_str())).map(|(group, _)| *group)
    }
}

/// The index in `given` of the attribute that a user calls `name`: the same name, or else one of
/// another case, or else one that differs in its prefix or marks, or else one of the same group.
pub(super) fn find(name: &str, given: &[String]) -> Option<usize> {
    let first = |is: &dyn Fn(&String) -> bool| given.iter().position(is);
    let group = Group::of(name);
    first(&|given| given == name)
        .or_else(|| first(&|given| given.eq_ignore_ascii_case(name)))
        .or_else(|| first(&|given| plain(given) == plain(name)))
        .or_else(|| group.and_then(|group| first(&|given| Group::of(given) == Some(group))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_found_under_the_names_of_users() {
        let given = ["X", "Intensity", "ReturnNumber", "Classification", "GpsTime", "ScanAngleRank", "scalar_Height"];
        let given = given.map(str::to_owned);
        for (name, place) in [
            ("x", 0),
            ("intensity", 1),
            ("scalar_intensity", 1),
            ("return", 2),
            ("return_number", 2),
            ("class", 3),
            ("CLASSIFICATION", 3),
            ("gps-time", 4),
            ("GPS time", 4),
            ("scan-angle", 5),
            ("height", 6),
            ("Scalar_height", 6),
        ] {
            assert_eq!(find(name, &given), Some(place), "{name}");
        }
        assert_eq!(find("y", &given), None);
        assert_eq!(find("returns", &given), None);
        // A name of the same case goes first, and the user's own name before its group.
        let given = ["reflectance", "Intensity", "intensity"].map(str::to_owned);
        assert_eq!(["intensity", "INTENSITY", "amplitude"].map(|name| find(name, &given)), [Some(2), Some(1), Some(0)]);
    }
}
