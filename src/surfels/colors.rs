//! The colours of several inputs as one.

use crate::scene::Colors;
use crate::scene::color::{DEFAULT_COLOR, linear_to_srgb};

/// Joins colours input by input. 8-bit colours stay so as long as nothing else comes.
pub(crate) struct ColorGatherer {
    colors: Option<Colors>,
    /// Points so far, with colours or without.
    count: usize,
    /// How many colours were not usable and became [`DEFAULT_COLOR`].
    pub replaced: u64,
}

impl ColorGatherer {
    pub fn new() -> Self {
        Self { colors: None, count: 0, replaced: 0 }
    }

    /// Adds `count` points and their colours; missing ones get the default, surplus ones are ignored.
    pub fn append(&mut self, colors: Option<Colors>, count: usize) {
        let before = self.count;
        let total = before + count;
        self.count = total;
        match colors {
            None => match &mut self.colors {
                None => {}
                Some(Colors::Srgb8(codes)) => codes.resize(total, default_code()),
                Some(Colors::Linear(colors)) => colors.resize(total, DEFAULT_COLOR),
                Some(Colors::Constant(_) | Colors::Textured(_)) => {}
            },
            Some(Colors::Srgb8(mut added)) => {
                added.resize(count, default_code());
                match self.colors.take() {
                    Some(Colors::Linear(mut colors)) => {
                        let added = Colors::Srgb8(added);
                        colors.extend((0..count).map(|i| added.linear(i)));
                        self.colors = Some(Colors::Linear(colors));
                    }
                    Some(Colors::Srgb8(mut codes)) => {
                        codes.extend(added);
                        self.colors = Some(Colors::Srgb8(codes));
                    }
                    _ if before == 0 => self.colors = Some(Colors::Srgb8(added)),
                    _ => {
                        let mut codes = vec![default_code(); before];
                        codes.extend(added);
                        self.colors = Some(Colors::Srgb8(codes));
                    }
                }
            }
            Some(Colors::Linear(mut added)) => {
                for color in &mut added {
                    if !is_usable(color) {
                        *color = DEFAULT_COLOR;
                        self.replaced += 1;
                    }
                    color[3] = color[3].clamp(0.0, 1.0);
                }
                added.resize(count, DEFAULT_COLOR);
                self.append_linear(added, before);
            }
            // The inputs of a scene may have different textures: the means over the disks.
            Some(Colors::Textured(textured)) => {
                let mut added = textured.colors().to_vec();
                added.resize(count, DEFAULT_COLOR);
                self.append_linear(added, before);
            }
            Some(Colors::Constant(color)) => {
                let usable = is_usable(&color);
                self.replaced += if usable { 0 } else { count as u64 };
                self.append_linear(vec![if usable { color } else { DEFAULT_COLOR }; count], before);
            }
        }
    }

    fn append_linear(&mut self, added: Vec<[f32; 4]>, before: usize) {
        let mut colors = match self.colors.take() {
            Some(Colors::Linear(colors)) => colors,
            Some(codes @ Colors::Srgb8(_)) => (0..before).map(|i| codes.linear(i)).collect(),
            _ => vec![DEFAULT_COLOR; before],
        };
        if colors.is_empty() {
            colors = added;
        } else {
            colors.extend(added);
        }
        self.colors = Some(Colors::Linear(colors));
    }

    /// The colours of all points. None if none came with any.
    pub fn finish(self) -> Option<Colors> {
        self.colors
    }
}

/// The same colours, as [`Colors::Constant`] where there is one only. The default where there are none.
pub(crate) fn folded(colors: Option<Colors>) -> Colors {
    let Some(colors) = colors else { return Colors::Constant(DEFAULT_COLOR) };
    let first = match &colors {
        Colors::Constant(color) => Some(*color),
        Colors::Srgb8(codes) if codes.windows(2).all(|pair| pair[0] == pair[1]) => {
            codes.first().map(|_| colors.linear(0))
        }
        Colors::Linear(all) if all.windows(2).all(|pair| pair[0] == pair[1]) => all.first().copied(),
        _ => None,
    };
    first.map_or(colors, Colors::Constant)
}

/// Whether the colour, and its products and differences on the way through f32, stay finite. NaN is not usable.
fn is_usable(color: &[f32; 4]) -> bool {
    color.iter().all(|c| c.abs() <= 1e18)
}

/// The 8-bit sRGB code nearest to [`DEFAULT_COLOR`].
fn default_code() -> [u8; 4] {
    let [r, g, b, a] = DEFAULT_COLOR.map(f64::from);
    let code = |linear: f64| (linear_to_srgb(linear) * 255.0).round() as u8;
    [code(r), code(g), code(b), (a * 255.0).round() as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined(inputs: Vec<(Option<Colors>, usize)>) -> (Colors, u64) {
        let mut gatherer = ColorGatherer::new();
        for (colors, count) in inputs {
            gatherer.append(colors, count);
        }
        let replaced = gatherer.replaced;
        (folded(gatherer.finish()), replaced)
    }

    #[test]
    fn no_colours_are_the_default() {
        assert_eq!(joined(vec![(None, 3), (None, 2)]).0, Colors::Constant(DEFAULT_COLOR));
    }

    #[test]
    fn codes_stay_codes() {
        let (red, blue) = ([255, 0, 0, 255], [0, 0, 255, 255]);
        let default = default_code();
        assert_eq!(default, [218, 218, 218, 255]);
        let (colors, _) = joined(vec![
            (None, 1),
            (Some(Colors::Srgb8(vec![red])), 1),
            (None, 1),
            (Some(Colors::Srgb8(vec![blue])), 1),
        ]);
        assert_eq!(colors, Colors::Srgb8(vec![default, red, default, blue]));
        assert_eq!(joined(vec![(Some(Colors::Srgb8(vec![red; 3])), 3)]).0, Colors::Constant([1.0, 0.0, 0.0, 1.0]));
    }

    #[test]
    fn linear_wins_over_codes() {
        let linear = [2.0, 0.5, 0.25, 1.0];
        let codes = || Some(Colors::Srgb8(vec![[255, 0, 255, 255]]));
        let expected = [1.0, 0.0, 1.0, 1.0];
        let first = joined(vec![(codes(), 1), (Some(Colors::Linear(vec![linear])), 1), (None, 1)]).0;
        assert_eq!(first, Colors::Linear(vec![expected, linear, DEFAULT_COLOR]));
        let last = joined(vec![(None, 1), (Some(Colors::Linear(vec![linear])), 1), (codes(), 1)]).0;
        assert_eq!(last, Colors::Linear(vec![DEFAULT_COLOR, linear, expected]));
    }

    #[test]
    fn colours_that_are_not_numbers_are_replaced() {
        let bad = vec![[f32::NAN, 0.0, 0.0, 1.0], [1e30, 0.0, 0.0, 1e30], [0.0; 4]];
        let (colors, replaced) = joined(vec![(Some(Colors::Linear(bad)), 3)]);
        assert_eq!((colors, replaced), (Colors::Linear(vec![DEFAULT_COLOR, DEFAULT_COLOR, [0.0; 4]]), 2));
    }
}
