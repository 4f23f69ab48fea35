//! Virtual point clouds: a STAC ItemCollection that names the tiles of a cloud and their bounds, as
//! PDAL and QGIS write it (`.vpc`).

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::input::text;
use crate::scene::Bounds;
use crate::{Error, Result, address};

/// Longest file, bytes: that of 65,536 tiles with a kilobyte each. Decoded JSON takes up to 30
/// times as much memory.
const MOST_TEXT: usize = 1 << 26;

/// Most tiles of a cloud.
const MOST_TILES: usize = 1 << 20;

/// A file of a virtual point cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// The path or the address of the file.
    pub path: PathBuf,
    /// The box of its points, coordinates of the file; None if it is not stated. A box of four
    /// numbers is unbounded along z.
    pub bounds: Option<Bounds>,
    /// The number of its points, if it is stated.
    pub count: Option<u64>,
}

/// Whether a path is that of a virtual point cloud, by its extension.
pub fn is_one(path: &Path) -> bool {
    address::shown(path).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vpc"))
}

/// The parts of the file that are read.
#[derive(Deserialize)]
struct Collection {
    #[serde(rename = "type")]
    kind: Option<String>,
    features: Option<Vec<Feature>>,
}

#[derive(Deserialize)]
struct Feature {
    #[serde(default)]
    id: serde_json::Value,
    #[serde(default)]
    assets: serde_json::Map<String, serde_json::Value>,
    #[serde(default)]
    properties: serde_json::Map<String, serde_json::Value>,
}

/// Reads the tiles of the virtual point cloud at a path or an address. The tiles are not opened.
///
/// The path of a tile is relative to the folder of the file. Bounds are those of `proj:bbox`,
/// because `bbox` holds degrees.
///
/// # Errors
///
/// [`Error::Read`] if the system or the server cannot read, [`Error::Malformed`] if the file is no
/// collection of tiles, or if a tile has no file, invalid bounds or an invalid count.
pub fn read(path: &Path) -> Result<Vec<Tile>> {
    tiles(&text(path)?, path).map_err(|what| Error::malformed(path, what))
}

/// Text of a file for a message: without control characters, and not too long.
fn short(text: &str) -> String {
    const MOST: usize = 160;
    let shown: String = text.chars().take(MOST).flat_map(char::escape_debug).collect();
    if text.chars().count() > MOST { format!("{shown}...") } else { shown }
}

fn tiles(text: &str, path: &Path) -> Result<Vec<Tile>, String> {
    if text.len() > MOST_TEXT {
        return Err(format!("it is longer than {} MiB: divide it into several", MOST_TEXT >> 20));
    }
    let collection: Collection = serde_json::from_str(text)
        .map_err(|error| format!("it is not a virtual point cloud in JSON: {}", short(&error.to_string())))?;
    if collection.kind.as_deref() != Some("FeatureCollection") {
        return Err("it is not a virtual point cloud: its type is not FeatureCollection".into());
    }
    let features = collection.features.unwrap_or_default();
    if features.is_empty() {
        return Err("it names no tiles".into());
    }
    if features.len() > MOST_TILES {
        return Err(format!("it names {} tiles, more than {MOST_TILES}", features.len()));
    }
    let tile = |(number, feature): (usize, &Feature)| {
        let name = match &feature.id {
            serde_json::Value::String(id) => format!("tile {} ({})", number + 1, short(id)),
            _ => format!("tile {}", number + 1),
        };
        feature.tile(path).map_err(|what| format!("{name} {what}"))
    };
    features.iter().enumerate().map(tile).collect()
}

impl Feature {
    fn tile(&self, path: &Path) -> Result<Tile, String> {
        // PDAL calls the asset "data"; other writers have one asset under another name.
        let asset = self.assets.get("data").or_else(|| self.assets.values().next().filter(|_| self.assets.len() == 1));
        let href = asset.and_then(|asset| asset.get("href")).and_then(serde_json::Value::as_str);
        let href = href.filter(|href| !href.trim().is_empty()).ok_or("names no file (assets.data.href)")?;
        let path = located(path, href)?;
        let count = match self.properties.get("pc:count") {
            None | Some(serde_json::Value::Null) => None,
            // PDAL wrote counts as floating-point numbers at times.
            Some(count) => {
                let whole = count.as_f64().filter(|count| *count >= 0.0 && count.fract() == 0.0);
                let count = count.as_u64().or(whole.map(|count| count as u64));
                Some(count.ok_or("has a number of points (pc:count) that is none")?)
            }
        };
        let bounds = self.properties.get("proj:bbox").filter(|value| !value.is_null()).map(bounds).transpose()?;
        Ok(Tile { path, bounds, count })
    }
}

/// The box of four or six numbers.
fn bounds(value: &serde_json::Value) -> Result<Bounds, String> {
    let wrong = || "has bounds (proj:bbox) that are no box of 4 or 6 numbers".to_owned();
    let numbers = value.as_array().ok_or_else(wrong)?;
    let numbers: Option<Vec<f64>> = numbers.iter().map(serde_json::Value::as_f64).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite())).ok_or_else(wrong)?;
    let bounds = match numbers[..] {
        [x, y, to_x, to_y] => Bounds { min: [x, y, f64::NEG_INFINITY].into(), max: [to_x, to_y, f64::INFINITY].into() },
        [x, y, z, to_x, to_y, to_z] => Bounds { min: [x, y, z].into(), max: [to_x, to_y, to_z].into() },
        _ => return Err(wrong()),
    };
    if bounds.min.cmple(bounds.max).all() { Ok(bounds) } else { Err(wrong()) }
}

/// The path or the address of a tile that the file at `path` names by `href`.
fn located(path: &Path, href: &str) -> Result<PathBuf, String> {
    if let Some(base) = address::of(path) {
        // A file from elsewhere must not name files of this system.
        if href.starts_with("file:") {
            return Err("is a file of the server, which cannot be read from here".into());
        }
        other_scheme(href)?;
        return Ok(address::resolved(base, href).into());
    }
    if address::is_remote(Path::new(href)) {
        return Ok(address::resolved(href, href).into());
    }
    let local = href.strip_prefix("file://").unwrap_or(href);
    other_scheme(local)?;
    let local = local.strip_prefix("./").unwrap_or(local);
    if local == "-" {
        return Err("is standard input, which is no tile".into());
    }
    let local = Path::new(local);
    Ok(path.parent().unwrap_or(Path::new("")).join(local))
}

/// Fails for an address that is not read.
fn other_scheme(href: &str) -> Result<(), String> {
    match href.split_once("://") {
        // The rest of an address may hold a password.
        Some((scheme, _)) if !address::is_remote(Path::new(href)) => {
            Err(format!("has an address that is not read ({}): use https", short(scheme)))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use glam::DVec3;

    const FEATURE: &str = r#"{"type": "Feature", "id": "a", "assets": {"data": {"href": "./a.copc.laz"}},
        "properties": {"pc:count": 5, "proj:bbox": [0, 1, 2, 3.5, 4, 5]}}"#;

    fn collection(features: &str) -> String {
        format!(r#"{{"type": "FeatureCollection", "features": [{features}]}}"#)
    }

    #[test]
    fn tiles_have_files_bounds_and_counts() {
        let text = collection(&[FEATURE, &FEATURE.replace("./a.", "/b.").replace("5, 4, 5]", "5]")].join(","));
        let text = text
            .replace("[0, 1, 2, 3.5]", "[0, 1, 2, 3]")
            .replace("\"pc:count\": 5, \"proj:bbox\": [0, 1, 2, 3]", "\"proj:bbox\": [0, 1, 2, 3]");
        let tiles = tiles(&text, Path::new("c/d.vpc")).unwrap();
        assert_eq!(tiles[0].path, Path::new("c/a.copc.laz"));
        assert_eq!(tiles[0].bounds, Some(Bounds { min: DVec3::new(0.0, 1.0, 2.0), max: DVec3::new(3.5, 4.0, 5.0) }));
        assert_eq!(
            (tiles[0].count, tiles[1].count, tiles[1].path.as_path()),
            (Some(5), None, Path::new("/b.copc.laz"))
        );
        assert_eq!(tiles[1].bounds.unwrap().max, DVec3::new(2.0, 3.0, f64::INFINITY));
    }

    #[test]
    fn a_file_of_a_server_names_files_of_servers() {
        let (base, local) = (Path::new("https://host/c/d.vpc"), Path::new("c/d.vpc"));
        assert_eq!(located(base, "/etc/a.laz").unwrap(), Path::new("https://host/etc/a.laz"));
        assert_eq!(located(base, "../a.laz").unwrap(), Path::new("https://host/a.laz"));
        assert!(located(base, "file:///a.laz").is_err() && located(local, "s3://a/b.laz").is_err());
        assert_eq!(located(local, "file:///a.laz").unwrap(), Path::new("/a.laz"));
        assert_eq!(located(local, "http://host/a.laz").unwrap(), Path::new("http://host/a.laz"));
    }

    #[test]
    fn damage_is_one_sentence() {
        let whole = collection(FEATURE);
        for (text, said) in [
            (whole[..whole.len() - 9].to_owned(), "at line 2"),
            (String::new(), "it is not a virtual point cloud in JSON"),
            ("[]".into(), "it is not a virtual point cloud in JSON"),
            ("{}".into(), "its type is not FeatureCollection"),
            (collection(""), "it names no tiles"),
            (whole.replace("href", "link"), "tile 1 (a) names no file (assets.data.href)"),
            (whole.replace("./a.copc.laz", " "), "tile 1 (a) names no file (assets.data.href)"),
            (whole.replace("[0, 1,", "[NaN, 1,"), "it is not a virtual point cloud in JSON"),
            (whole.replace("[0, 1,", "[\"NaN\", 1,"), "bounds (proj:bbox) that are no box"),
            (whole.replace("[0, 1,", "[null, 1,"), "bounds (proj:bbox) that are no box"),
            (whole.replace("[0, 1,", "[1e999, 1,"), "it is not a virtual point cloud in JSON"),
            (whole.replace("[0, 1,", "[9, 1,"), "bounds (proj:bbox) that are no box"),
            (whole.replace("[0, 1,", "[1,"), "bounds (proj:bbox) that are no box"),
            (whole.replace("\"pc:count\": 5", "\"pc:count\": -5"), "a number of points (pc:count) that is none"),
            (whole.replace("\"pc:count\": 5", "\"pc:count\": \"x\""), "a number of points (pc:count) that is none"),
        ] {
            let told = tiles(&text, Path::new("a.vpc")).unwrap_err();
            assert!(told.contains(said) && told.lines().count() == 1, "{told}");
        }
        assert!(tiles(&whole, Path::new("a.vpc")).is_ok());
    }
}
