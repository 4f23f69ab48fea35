//! Colours by an attribute: one range and one colour map for all inputs of a scene.

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::io::dimensions::Group;
use crate::io::{ColorBy, Column, Points, class_color, class_name, settle_colors};
use crate::options::ColorOptions;
use crate::options::values::{End, ValueRange};
use crate::scene::color::{DEFAULT_COLOR, decoded, srgb8};
use crate::scene::color_map::{category, step};
use crate::scene::{ColorKey, Colors, KeyColors, Scene};
use crate::surfels::densities;

/// Colours points by the attribute of the options. The first inputs decide the range, and later
/// ones, such as other parts of the same files, follow it.
pub(super) struct Coloring<'a> {
    options: &'a ColorOptions,
    ends: Option<[f64; 2]>,
}

impl<'a> Coloring<'a> {
    /// Continues with the range that earlier inputs decided, if there were some.
    pub fn of(options: &'a ColorOptions, ends: Option<[f64; 2]>) -> Self {
        Self { options, ends }
    }

    /// The values of the ends of the colour map, once they are decided.
    pub fn ends(&self) -> Option<[f64; 2]> {
        self.ends
    }

    /// Gives the points of all inputs their colours. Returns None if they keep those of their
    /// files.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if points lack the attribute or no value is finite.
    pub fn settle(&mut self, inputs: &mut [Points]) -> Result<Option<ColorKey>> {
        let by = match &self.options.color_by {
            None | Some(ColorBy::Rgb) => return Ok(None),
            // The colours follow once surfels have normals: see `by_normals`.
            Some(ColorBy::Normal) => return Ok(Some(vectors())),
            Some(by) => by,
        };
        // Points in memory may still have the colours of a reader, which would replace these.
        settle_colors(inputs);
        let columns = columns(by, inputs)?;
        let name =
            columns.iter().find(|column| !column.values.is_empty()).map_or_else(|| by.to_string(), |c| c.name.clone());
        let group = Group::of(&name);
        let plain = self.options.color_map.is_none() && self.options.range.is_none() && columns.iter().all(are_codes);
        let colors = match group {
            Some(group @ (Group::Class | Group::Return)) if plain => {
                for (points, column) in inputs.iter_mut().zip(&columns) {
                    paint(points, column, |value| code_of(group, value));
                }
                KeyColors::Categories(categories(group, &columns))
            }
            _ => {
                let ends = match self.ends {
                    Some(ends) => ends,
                    None => ends(self.options.range.unwrap_or_default(), &columns, &name)?,
                };
                self.ends = Some(ends);
                let map = self.options.color_map.unwrap_or_default();
                let codes = map.steps();
                for (points, column) in inputs.iter_mut().zip(&columns) {
                    paint(points, column, |value| codes[step(share(value, ends))]);
                }
                KeyColors::Ramp { map, ends }
            }
        };
        Ok(Some(ColorKey { name, unit: unit(by, group), colors }))
    }
}

/// The key of colours by normals.
fn vectors() -> ColorKey {
    ColorKey { name: "normal".into(), unit: None, colors: KeyColors::Vectors }
}

/// The unit of an attribute's values, if it is known.
fn unit(by: &ColorBy, group: Option<Group>) -> Option<&'static str> {
    match (by, group) {
        (ColorBy::Density, _) => Some("points per square unit"),
        (_, Some(Group::GpsTime)) => Some("s"),
        (_, Some(Group::ScanAngle)) => Some("degrees"),
        _ => None,
    }
}

/// The values of each input.
fn columns(by: &ColorBy, inputs: &mut [Points]) -> Result<Vec<Column>> {
    if *by == ColorBy::Density {
        let columns = densities(inputs)?.into_iter().map(|values| Column::new("density", values));
        return Ok(columns.collect());
    }
    let of_input = |points: &mut Points| {
        if let Some(column) = points.column.take() {
            return Ok(*column);
        }
        // Points in memory have no reader that stores the attribute.
        let name = by.to_string();
        let axis = ["X", "Y", "Z"].into_iter().enumerate().find(|(_, axis)| axis.eq_ignore_ascii_case(&name));
        match axis {
            Some((axis, name)) => Ok(Column::new(name, points.positions.iter().map(|position| position[axis]))),
            None if points.positions.is_empty() => Ok(Column::default()),
            None => Err(Error::Usage(format!("the points have no attribute '{name}': set Points::column"))),
        }
    };
    inputs.iter_mut().map(of_input).collect()
}

/// A value's place between the ends, from 0 to 1 for values in between.
fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    if low < high {
        (value - low) / (high - low)
    } else if value == low {
        0.5
    } else {
        f64::from(u8::from(value > low))
    }
}

/// The values that the ends of a range stand for. Percentiles are those of all finite values.
fn ends(ValueRange(range): ValueRange, columns: &[Column], name: &str) -> Result<[f64; 2]> {
    let mut values: Vec<f64> = Vec::new();
    if range.iter().any(|end| matches!(end, End::Percent(_))) {
        for column in columns {
            values.extend((0..column.values.len()).map(|index| column.value(index)).filter(|value| value.is_finite()));
        }
        if values.is_empty() {
            return Err(Error::Usage(format!("no point has a finite value of {name}: choose another --color-by")));
        }
    }
    let mut value = |end: End| match end {
        End::Value(value) => value,
        End::Percent(percent) => {
            let place = (percent / 100.0 * (values.len() - 1) as f64).round() as usize;
            let (_, value, _) = values.select_nth_unstable_by(place, f64::total_cmp);
            *value
        }
    };
    let ends = [value(range[0]), value(range[1])];
    if ends[0] > ends[1] {
        let what = format!("the range of {name} runs from {} to {}: give the lesser end first", ends[0], ends[1]);
        return Err(Error::Usage(what));
    }
    Ok(ends)
}

/// Whether all finite values are whole numbers that are not negative.
fn are_codes(column: &Column) -> bool {
    let values = (0..column.values.len()).map(|index| column.value(index)).filter(|value| value.is_finite());
    values.into_iter().all(|value| (0.0..=f64::from(u16::MAX)).contains(&value) && value.fract() == 0.0)
}

/// The colour of a number of classes or returns.
fn code_of(group: Group, value: f64) -> [u8; 3] {
    let number = value as u32;
    let class = u8::try_from(number).ok().filter(|_| group == Group::Class).and_then(class_color);
    class.unwrap_or_else(|| category(number))
}

/// The numbers that occur, with their names and colours.
fn categories(group: Group, columns: &[Column]) -> Vec<(String, [u8; 3])> {
    let numbers = |column: &Column| {
        let whole =
            |index: usize| Some(column.value(index)).filter(|value| value.is_finite()).map(|value| value as u32);
        (0..column.values.len()).filter_map(whole).collect::<BTreeSet<u32>>()
    };
    let all: BTreeSet<u32> = columns.iter().flat_map(numbers).collect();
    let named = |number: u32| {
        let class = u8::try_from(number).ok().filter(|_| group == Group::Class).and_then(class_name);
        let name = match group {
            Group::Class => class.map_or_else(|| format!("class {number}"), str::to_owned),
            _ => format!("return {number}"),
        };
        (name, code_of(group, f64::from(number)))
    };
    all.into_iter().map(named).collect()
}

/// Gives points the colours of their values; alphas stay. Points without a value are grey.
fn paint(points: &mut Points, column: &Column, code: impl Fn(f64) -> [u8; 3] + Sync) {
    let [r, g, b, _] = srgb8(DEFAULT_COLOR);
    let code = |index: usize| {
        let value = column.value(index);
        if value.is_finite() { code(value) } else { [r, g, b] }
    };
    let codes: Vec<[u8; 3]> = (0..column.values.len()).into_par_iter().map(code).collect();
    points.colors = Some(tinted(points.colors.take(), &codes, points.encoded));
    if let Some(faces) = &mut points.faces {
        faces.paint = None;
    }
    // The nodes of levels of detail have the colours of the file.
    (points.tree, points.whole, points.texture) = (None, None, None);
    (points.texture_numbers, points.texture_slopes) = (None, None);
}

/// These sRGB codes with the alphas of `colors`. The codes of `encoded` colours stay codes.
fn tinted(colors: Option<Colors>, codes: &[[u8; 3]], encoded: bool) -> Colors {
    let with = |alpha: u8| move |[r, g, b]: &[u8; 3]| [*r, *g, *b, alpha];
    match colors {
        Some(Colors::Srgb8(old)) if !encoded => {
            Colors::Srgb8(codes.iter().zip(old).map(|(code, [.., alpha])| with(alpha)(code)).collect())
        }
        Some(old) if encoded || (0..codes.len()).any(|index| old.linear(index)[3] != 1.0) => {
            let color = |(index, code): (usize, &[u8; 3])| {
                let [r, g, b, _] = match encoded {
                    true => with(255)(code).map(|code| f32::from(code) / 255.0),
                    false => decoded(with(255)(code)),
                };
                [r, g, b, old.linear(index)[3]]
            };
            Colors::Linear(codes.iter().enumerate().map(color).collect())
        }
        _ => Colors::Srgb8(codes.iter().map(with(255)).collect()),
    }
}

/// Colours surfels by their normals: red, green and blue are the sRGB codes of 0.5 + 0.5 n.
pub(super) fn by_normals(mut scene: Scene) -> Scene {
    let code =
        |surfel: &crate::scene::Surfel| surfel.normal().to_array().map(|n| (255.0 * (0.5 + 0.5 * n)).round() as u8);
    let codes: Vec<[u8; 3]> = scene.surfels.par_iter().map(code).collect();
    scene.colors = tinted(Some(std::mem::take(&mut scene.colors)), &codes, scene.encoded);
    scene.hierarchy = None;
    scene
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Points in a row with an attribute.
    fn points(name: &str, values: &[f64]) -> Points {
        let positions = (0..values.len()).map(|x| [x as f64, 0.0, 0.0]).collect();
        Points { positions, column: Some(Box::new(Column::new(name, values.iter().copied()))), ..Points::default() }
    }

    fn options(by: &str, map: Option<&str>, range: Option<&str>) -> ColorOptions {
        ColorOptions {
            color_by: Some(by.parse().unwrap()),
            color_map: map.map(|map| map.parse().unwrap()),
            range: range.map(|range| range.parse().unwrap()),
        }
    }

    fn codes(points: &Points) -> &[[u8; 4]] {
        let Some(Colors::Srgb8(codes)) = &points.colors else { unreachable!() };
        codes
    }

    #[test]
    fn all_inputs_share_one_range() {
        let options = options("height", Some("gray"), Some("0%,100%"));
        let mut inputs = [points("height", &[0.0, 50.0, f64::NAN]), points("scalar_height", &[100.0])];
        let mut coloring = Coloring::of(&options, None);
        let key = coloring.settle(&mut inputs).unwrap().unwrap();
        assert_eq!(key.colors, KeyColors::Ramp { map: "gray".parse().unwrap(), ends: [0.0, 100.0] });
        let grey = srgb8(DEFAULT_COLOR);
        assert_eq!(codes(&inputs[0]), [[0, 0, 0, 255], [128, 128, 128, 255], grey]);
        assert_eq!(codes(&inputs[1]), [[255; 4]]);
        // A later part follows the range, and its values beyond are clamped.
        let mut part = [points("height", &[25.0, 1000.0])];
        coloring.settle(&mut part).unwrap();
        assert_eq!(codes(&part[0]), [[64, 64, 64, 255], [255; 4]]);
    }

    #[test]
    fn percentiles_leave_out_a_few_values() {
        let values: Vec<f64> = (0..=100).map(|k| f64::from(k) + 3e8).collect();
        let options = options("gps-time", None, None);
        let mut coloring = Coloring::of(&options, None);
        let key = coloring.settle(&mut [points("GpsTime", &values)]).unwrap().unwrap();
        assert_eq!((coloring.ends(), key.unit), (Some([3e8 + 2.0, 3e8 + 98.0]), Some("s")));
    }

    #[test]
    fn classes_have_their_own_colours_unless_a_map_is_given() {
        let values = [2.0, 6.0, 2.0, 77.0];
        let mut inputs = [points("Classification", &values)];
        let plain = options("class", None, None);
        let key = Coloring::of(&plain, None).settle(&mut inputs).unwrap().unwrap();
        let KeyColors::Categories(named) = key.colors else { unreachable!() };
        let names: Vec<_> = named.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["ground", "building", "class 77"]);
        let [r, g, b] = class_color(6).unwrap();
        assert_eq!((codes(&inputs[0])[1], codes(&inputs[0])[0]), ([r, g, b, 255], codes(&inputs[0])[2]));
        let mapped = options("class", Some("gray"), Some("2,6"));
        let mut inputs = [points("Classification", &values)];
        Coloring::of(&mapped, None).settle(&mut inputs).unwrap();
        assert_eq!(codes(&inputs[0])[..2], [[0, 0, 0, 255], [255; 4]]);
    }

    #[test]
    fn the_order_of_inputs_decides_no_range() {
        let time = |base: f64| (0..50).map(|k| base + 0.123 * f64::from(k)).collect::<Vec<_>>();
        let (first, second) = (points("t", &time(3e8)), points("t", &time(3e8 + 9.1e5)));
        let options = options("t", None, Some("60%,98%"));
        let ends = |mut inputs: [Points; 2]| {
            let mut coloring = Coloring::of(&options, None);
            coloring.settle(&mut inputs).unwrap();
            coloring.ends().unwrap()
        };
        let expected = ends([first.clone(), second.clone()]);
        assert_eq!(ends([second, first]), expected);
        assert!((expected[0] - (3e8 + 9.1e5 + 0.123 * 9.0)).abs() < 1e-3, "{expected:?}");
    }

    /// Clusterings call noise -1, which is no class.
    #[test]
    fn numbers_that_are_no_codes_are_no_categories() {
        for values in [[-1.0, 2.0], [0.5, 2.0]] {
            let options = options("class", None, None);
            let mut inputs = [points("Classification", &values)];
            let key = Coloring::of(&options, None).settle(&mut inputs).unwrap().unwrap();
            assert!(matches!(key.colors, KeyColors::Ramp { .. }), "{values:?}");
        }
    }

    #[test]
    fn alphas_stay() {
        let options = options("a", Some("gray"), Some("0,1"));
        let mut inputs = [points("a", &[1.0])];
        inputs[0].colors = Some(Colors::Srgb8(vec![[1, 2, 3, 51]]));
        Coloring::of(&options, None).settle(&mut inputs).unwrap();
        assert_eq!(codes(&inputs[0]), [[255, 255, 255, 51]]);
        let mut inputs = [points("a", &[1.0])];
        inputs[0].colors = Some(Colors::Linear(vec![[0.1, 0.2, 0.3, 0.3]]));
        Coloring::of(&options, None).settle(&mut inputs).unwrap();
        assert_eq!(inputs[0].colors, Some(Colors::Linear(vec![[1.0, 1.0, 1.0, 0.3]])));
    }

    #[test]
    fn ends_without_values_or_in_the_wrong_order_are_refused() {
        let refused = |range: Option<&str>, values: &[f64]| {
            let options = options("a", None, range);
            Coloring::of(&options, None).settle(&mut [points("a", values)]).unwrap_err().to_string()
        };
        assert!(refused(None, &[f64::NAN]).contains("no point has a finite value of a"));
        assert!(refused(Some("2%,1"), &[5.0, 6.0]).contains("the lesser end first"));
    }
}
