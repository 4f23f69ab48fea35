//! Fuzzes virtual point clouds.

use std::path::Path;

use epsplat::io::vpc;

use super::mutate::Grammar;
use super::random::Random;
use super::session::sentence;
use super::{Outcome, Target};

pub const TARGET: Target = Target {
    name: "vpc",
    extension: "vpc",
    generate,
    grammar: Grammar {
        words: &[
            "null",
            "[]",
            "{}",
            "\"\"",
            "[[[[[[[[",
            "\"type\":",
            "\"FeatureCollection\"",
            "\"features\":",
            "\"assets\":",
            "\"data\":",
            "\"href\":",
            "\"../../../a.laz\"",
            "\"file:///etc/passwd\"",
            "\"https://[::1\"",
            "\"a\\nb\"",
            "\"proj:bbox\":",
            "\"pc:count\":",
            "1e-320",
            "1e308",
            "18446744073709551616",
            "-",
            "\\u0007",
            "\u{85}",
        ],
        separators: b",:[]{}",
        text: 1 << 12,
        numbers: |_| Vec::new(),
    },
    execute,
};

/// A valid cloud of one to four tiles, and their number.
fn generate(random: &mut Random) -> (Vec<u8>, usize) {
    let count = 1 + random.below(4);
    let tile = |number: usize, random: &mut Random| {
        let number_of = |random: &mut Random| random.between(-1e6, 1e6);
        let low: Vec<f64> = (0..if random.one_in(2) { 2 } else { 3 }).map(|_| number_of(random)).collect();
        let numbers = low.iter().copied().chain(low.iter().map(|low| low + 10.0)).map(|x| x.to_string());
        let bounds = format!("\"proj:bbox\": [{}]", numbers.collect::<Vec<_>>().join(", "));
        let points = format!("\"pc:count\": {}", random.below(1 << 20));
        let properties = match random.below(3) {
            0 => String::new(),
            1 => bounds,
            _ => format!("{bounds}, {points}"),
        };
        format!(
            "{{\"id\": \"{number}\", \"assets\": {{\"data\": {{\"href\": \"./{number}.laz\"}}}}, \"properties\": {{{properties}}}}}"
        )
    };
    let tiles: Vec<String> = (0..count).map(|number| tile(number, random)).collect();
    (format!("{{\"type\": \"FeatureCollection\", \"features\": [{}]}}", tiles.join(",\n")).into_bytes(), count)
}

fn execute(path: &Path, valid: Option<usize>) -> Result<Outcome, String> {
    let tiles = match vpc::read(path) {
        Ok(tiles) => tiles,
        Err(error) if valid.is_some() => return Err(format!("a valid file is refused: {error}")),
        Err(error) => return sentence(&error, Some(path)).map(|()| Outcome::Refused),
    };
    if valid.is_some_and(|valid| valid != tiles.len()) {
        return Err(format!("{} tiles", tiles.len()));
    }
    let is_box = |tile: &vpc::Tile| tile.bounds.is_none_or(|bounds| bounds.min.cmple(bounds.max).all());
    match !tiles.is_empty() && tiles.iter().all(is_box) {
        // A cloud of tiles is drawn by the readers of its tiles.
        true => Ok(if valid.is_some() { Outcome::Drawn } else { Outcome::Read }),
        false => Err("a tile has a box that is none, or there are no tiles".into()),
    }
}
