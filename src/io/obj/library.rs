//! The lines of an MTL file that define colours and images.

use glam::DVec2;

use crate::io::values::parse_number;

/// A material as its library defines it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Definition {
    /// `Kd`, linear light.
    pub(super) diffuse: Option<[f64; 3]>,
    /// `d`, the opacity.
    pub(super) dissolve: Option<f64>,
    /// `map_Kd`, the image.
    pub(super) map: Option<ColorMap>,
}

/// An image, and how texture coordinates map to positions in it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ColorMap {
    pub(super) name: String,
    /// `-s`: the factor on texture coordinates.
    pub(super) scale: DVec2,
    /// `-o`: the offset that is added after scaling.
    pub(super) offset: DVec2,
    /// `-clamp on`: the image does not repeat, and its edge pixels continue outwards.
    pub(super) clamps: bool,
}

impl ColorMap {
    /// Maps texture coordinates to the position in the image.
    pub(super) fn place(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        (DVec2::new(u.into(), v.into()) * self.scale + self.offset).as_vec2().to_array()
    }

    /// Whether positions are the texture coordinates themselves.
    pub(super) fn is_plain(&self) -> bool {
        (self.scale, self.offset) == (DVec2::ONE, DVec2::ZERO)
    }
}

/// The materials of a library with their names, in order. Keywords may be upper or lower case.
/// Lines that cannot be read are skipped: a single one would make the parser (`tobj`) drop all
/// materials.
pub(super) fn definitions(text: &str) -> Vec<(String, Definition)> {
    let (mut lines, mut named) = (String::new(), false);
    for line in text.lines() {
        let (keyword, rest) = first_word(line.trim());
        let line = match keyword.to_ascii_lowercase().as_str() {
            "newmtl" => {
                named = !rest.is_empty();
                named.then(|| format!("newmtl {rest}"))
            }
            "kd" => color(rest).map(|[r, g, b]| format!("Kd {r:?} {g:?} {b:?}")),
            "d" => rest.split_whitespace().find_map(number).map(|alpha| format!("d {alpha:?}")),
            "map_kd" => color_map(rest).map(|_| format!("map_Kd {rest}")),
            _ => None,
        };
        if let Some(line) = line.filter(|_| named) {
            lines.push_str(&line);
            lines.push('\n');
        }
    }
    let (materials, _) = tobj::load_mtl_buf(&mut lines.as_bytes()).unwrap_or_default();
    let definition = |material: tobj::Material| {
        let map = material.diffuse_texture.as_deref().and_then(color_map);
        (material.name, Definition { diffuse: material.diffuse, dissolve: material.dissolve, map })
    };
    materials.into_iter().map(definition).collect()
}

fn number(word: &str) -> Option<f64> {
    parse_number(word.as_bytes())
}

/// Parses `r g b`, or `r` for all three.
fn color(rest: &str) -> Option<[f64; 3]> {
    let words = rest.split_whitespace().take_while(|word| !word.starts_with('#'));
    let values: Option<Vec<f64>> = words.map(number).collect();
    match values?[..] {
        [r, g, b, ..] => Some([r, g, b]),
        [r] => Some([r; 3]),
        _ => None,
    }
}

/// Parses the rest of a `map_Kd` line: options, then the name of the file, which may have spaces.
pub(super) fn color_map(map: &str) -> Option<ColorMap> {
    let (mut scale, mut offset, mut clamps) = (DVec2::ONE, DVec2::ZERO, false);
    let mut rest = map.trim();
    while rest.starts_with('-') {
        let (option, mut beyond) = first_word(rest);
        let (least, most) = match option.to_ascii_lowercase().as_str() {
            "-o" | "-s" | "-t" => (1, 3),
            "-mm" => (2, 2),
            "-blendu" | "-blendv" | "-bm" | "-boost" | "-cc" | "-clamp" | "-imfchan" | "-texres" | "-type" => (1, 1),
            _ => break,
        };
        let mut given = Vec::new();
        for argument in 0..most {
            let (word, after) = first_word(beyond);
            if argument >= least && (number(word).is_none() || after.is_empty()) {
                break;
            }
            given.push(word);
            beyond = after;
        }
        let along =
            |axis: usize, unless_given: f64| given.get(axis).and_then(|word| number(word)).unwrap_or(unless_given);
        match option.to_ascii_lowercase().as_str() {
            "-s" => scale = DVec2::new(along(0, 1.0), along(1, 1.0)),
            "-o" => offset = DVec2::new(along(0, 0.0), along(1, 0.0)),
            "-clamp" => clamps = given.first().is_some_and(|word| word.eq_ignore_ascii_case("on")),
            _ => {}
        }
        rest = beyond;
    }
    (!rest.is_empty()).then(|| ColorMap { name: rest.to_owned(), scale, offset, clamps })
}

/// The first word of a text, and the rest after it.
pub(super) fn first_word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn options_of_a_map_come_before_its_name() {
        for (map, name, scale, offset, clamps) in [
            ("a b.png", "a b.png", [1.0, 1.0], [0.0, 0.0], false),
            ("-s 2 3 1 a.png", "a.png", [2.0, 3.0], [0.0, 0.0], false),
            ("-S 2 a.png", "a.png", [2.0, 1.0], [0.0, 0.0], false),
            ("-o .5 -0.25 -s 4 4 a.png", "a.png", [4.0, 4.0], [0.5, -0.25], false),
            ("-clamp ON -blendu off -mm 0 1 a.png", "a.png", [1.0, 1.0], [0.0, 0.0], true),
            ("-clamp off -s 1 1 1 7", "7", [1.0, 1.0], [0.0, 0.0], false),
            ("-s 2 2 7", "7", [2.0, 2.0], [0.0, 0.0], false),
            ("-what.png", "-what.png", [1.0, 1.0], [0.0, 0.0], false),
        ] {
            let found = color_map(map).unwrap();
            let expected = ColorMap { name: name.into(), scale: scale.into(), offset: offset.into(), clamps };
            assert_eq!(found, expected, "{map}");
        }
        assert_eq!((color_map(""), color_map("-clamp on")), (None, None));
    }

    #[test]
    fn keywords_are_in_any_case_and_what_is_none_is_passed_over() {
        let text = "KD 1 1 1\nNewMtl a b\n\tKD .5 0 1 # red\nd -halo 0.5\nMAP_KD x.png\nnewmtl c\nkd 0.25\nKd spectral a.rfl 1\nKd\nmap_kd\n";
        let all = definitions(text);
        let [(a, first), (c, second)] = &all[..] else { unreachable!() };
        assert_eq!((a.as_str(), c.as_str()), ("a b", "c"));
        assert_eq!((first.diffuse, first.dissolve), (Some([0.5, 0.0, 1.0]), Some(0.5)));
        assert_eq!(first.map.as_ref().unwrap().name, "x.png");
        assert_eq!(*second, Definition { diffuse: Some([0.25; 3]), ..Definition::default() });
    }
}
