//! The names of the columns of a table.

use super::cells::Separator;
use super::head::MOST_COLUMNS;
use crate::io::attributes::{self, find, find_spelling};

/// Names of coordinates in headers. All three are of one row, the first of them that fits: a table
/// may also have coordinates in pixels.
const COORDINATES: [[&str; 3]; 14] = [
    ["x", "y", "z"],
    // ParaView.
    ["Points:0", "Points:1", "Points:2"],
    ["Points_0", "Points_1", "Points_2"],
    ["easting", "northing", "z"],
    ["easting", "northing", "elevation"],
    ["easting", "northing", "height"],
    ["easting", "northing", "altitude"],
    ["east", "north", "z"],
    ["east", "north", "elevation"],
    ["east", "north", "height"],
    ["east", "north", "altitude"],
    ["x", "y", "elevation"],
    ["x", "y", "height"],
    ["x", "y", "altitude"],
];

/// The names of the columns in a header; None if x, y and z are not among them. Coordinates get the
/// names `x`, `y` and `z`, known attributes lose their units, and `i` behind the coordinates is an
/// intensity.
pub(super) fn names_in(line: &[u8]) -> Option<Vec<String>> {
    let separator = Separator::of(line).ok()?;
    let name = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
    let mut names: Vec<String> = separator.cells(line).take(MOST_COLUMNS).map(name).collect();
    let plain: Vec<String> = names.iter().map(|name| without_unit(name).to_owned()).collect();
    let given = || plain.iter().map(String::as_str);
    let places = COORDINATES.iter().find_map(|known| find_spelling(*known, given()))?;
    for (name, plain) in names.iter_mut().zip(&plain) {
        if is_known(plain) {
            name.clone_from(plain);
        }
    }
    // Other columns of these names, such as places in an image, must not be taken for coordinates.
    let is_axis = |name: &str| ["x", "y", "z"].iter().any(|axis| name.eq_ignore_ascii_case(axis));
    names.iter_mut().filter(|name| is_axis(name)).for_each(|name| name.push_str("_2"));
    for (axis, place) in ["x", "y", "z"].into_iter().zip(places) {
        *names.get_mut(place)? = axis.to_owned();
    }
    if find(attributes::INTENSITY, names.iter().map(String::as_str)).is_none() {
        // Before the coordinates, `i` counts the points.
        let last = places.into_iter().max()?;
        let own = names.iter_mut().skip(last + 1).find(|name| name.eq_ignore_ascii_case("i"));
        own.into_iter().for_each(|name| "intensity".clone_into(name));
    }
    Some(names)
}

/// A name without the unit that may follow it, as in `X [m]`, `Reflectance[dB]` and `Amplitude[]`.
/// Numbers in brackets are indices.
fn without_unit(name: &str) -> &str {
    let Some((plain, unit)) = name.split_once(['[', '(']) else { return name.trim() };
    let is_index = unit.starts_with(|c: char| c.is_ascii_digit());
    if is_index || plain.trim().is_empty() { name.trim() } else { plain.trim() }
}

/// Whether a name is that of an intensity, a channel or a part of a normal.
fn is_known(name: &str) -> bool {
    let lists = attributes::COLOR.iter().chain(&attributes::NORMAL).chain([&attributes::INTENSITY, &attributes::ALPHA]);
    lists.into_iter().any(|list| find(list, [name].into_iter()).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_get_the_names_of_attributes() {
        for (line, names) in [
            ("X,Y,Z,I", "x y z intensity"),
            ("i,x,y,z", "i x y z"),
            ("x y z i intensity", "x y z i intensity"),
            ("X,Y,Z,Amplitude[],Reflectance[dB],Range [m]", "x y z Amplitude Reflectance Range [m]"),
            ("Points:0,Points:1,Points:2,RGB:0", "x y z RGB:0"),
            ("Points_0,Points_1,Points_2", "x y z"),
            ("X,Y,Z,x,y", "x y z x_2 y_2"),
            ("x,y,Easting,Northing,Height", "x_2 y_2 x y z"),
            ("Easting [m];Northing [m];Height [m];rgb[0]", "x y z rgb[0]"),
            ("x y height", "x y z"),
        ] {
            assert_eq!(names_in(line.as_bytes()).map(|names| names.join(" ")).as_deref(), Some(names), "{line}");
        }
        assert_eq!(names_in(b"x y"), None);
    }
}
