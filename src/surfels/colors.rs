//! Joins the colours of several inputs.

use crate::scene::color::{DEFAULT_COLOR, linear_to_srgb};
use crate::scene::harmonics::terms_of;
use crate::scene::{Colors, Harmonics};

/// Collects the colours of all inputs before they are joined. If all of them are 8-bit codes, the
/// result is too.
#[derive(Default)]
pub(crate) struct ColorGatherer {
    inputs: Vec<Input>,
}

struct Input {
    colors: Option<Colors>,
    /// The number of the input's points, with or without colours.
    count: usize,
    /// The colours are sRGB-encoded, as those of Gaussians are
    /// ([`Scene::encoded`](crate::scene::Scene::encoded)).
    encoded: bool,
}

/// The colours of all points.
pub(crate) struct GatheredColors {
    /// None if no input has any.
    pub colors: Option<Colors>,
    /// The colours are sRGB-encoded, because those of at least one input are.
    pub encoded: bool,
    /// The number of unusable colours, which became [`DEFAULT_COLOR`], plus the number of points
    /// with unusable coefficients of harmonics, which became 0.
    pub replaced: u64,
    /// The number of colours whose alpha was outside [0, 1].
    pub clamped: u64,
}

impl ColorGatherer {
    /// Adds the colours of `count` points, sRGB-encoded if `encoded`. Missing colours become the
    /// default, surplus colours are ignored.
    pub fn append(&mut self, colors: Option<Colors>, count: usize, encoded: bool) {
        self.inputs.push(Input { colors, count, encoded });
    }

    /// Joins the colours of all points.
    pub fn finish(self) -> GatheredColors {
        let encoded = self.inputs.iter().any(|input| input.encoded && input.count > 0);
        let mut all = GatheredColors { colors: None, encoded, replaced: 0, clamped: 0 };
        let has_codes_alone = |input: &Input| matches!(input.colors, None | Some(Colors::Srgb8(_)));
        if self.inputs.iter().all(|input| input.colors.is_none()) && !encoded {
            return all;
        }
        if self.inputs.iter().all(has_codes_alone) && !encoded {
            all.colors = Some(Colors::Srgb8(codes(self.inputs)));
            return all;
        }
        let degree = |input: &Input| if let Some(Colors::Harmonics(own)) = &input.colors { own.degree() } else { 0 };
        let degree = self.inputs.iter().map(degree).max().unwrap_or(0);
        let (mut colors, mut terms) = (Vec::new(), Vec::new());
        for input in self.inputs {
            let count = input.count;
            let (own, own_terms) = input.linear(&mut all);
            append(&mut colors, own);
            if degree > 0 {
                append(&mut terms, widened(own_terms, (count, degree), &mut all.replaced));
            }
        }
        all.colors = Some(match degree {
            0 => Colors::Linear(colors),
            _ => Harmonics::new(colors, degree, terms).map_or_else(Colors::default, Colors::Harmonics),
        });
        all
    }
}

/// The degree of spherical harmonics, and their coefficients.
type Terms = (u32, Vec<f32>);

impl Input {
    /// Returns a colour per point with straight alpha, and the coefficients of the harmonics with
    /// their degree. Colours are sRGB-encoded if those of `all` are.
    fn linear(self, all: &mut GatheredColors) -> (Vec<[f32; 4]>, Option<Terms>) {
        let (mut colors, terms) = match self.colors {
            None => (Vec::new(), None),
            Some(codes @ Colors::Srgb8(_)) => {
                let of_file = if let Colors::Srgb8(codes) = &codes { codes.len() } else { 0 };
                ((0..of_file.min(self.count)).map(|i| codes.linear(i)).collect(), None)
            }
            Some(Colors::Linear(colors)) => (colors, None),
            // Inputs may have different textures, so each disk gets the mean of its texture.
            Some(Colors::Textured(textured)) => (textured.colors().to_vec(), None),
            Some(Colors::Constant(color)) => (vec![color; self.count], None),
            Some(Colors::Harmonics(harmonics)) => {
                let (colors, degree, terms) = harmonics.into_parts();
                (colors, Some((degree, terms)))
            }
        };
        let encodes = all.encoded && !self.encoded;
        for color in &mut colors {
            if !is_usable(color) {
                *color = DEFAULT_COLOR;
                all.replaced += 1;
            }
            all.clamped += u64::from(!(0.0..=1.0).contains(&color[3]));
            color[3] = color[3].clamp(0.0, 1.0);
        }
        colors.resize(self.count, DEFAULT_COLOR);
        if encodes {
            for color in &mut colors {
                let [r, g, b, a] = *color;
                let [r, g, b] = [r, g, b].map(|light| linear_to_srgb(light.into()) as f32);
                *color = [r, g, b, a];
            }
        }
        (colors, terms)
    }
}

/// Appends `added` to `all`; the first vector is moved, not copied.
fn append<T>(all: &mut Vec<T>, mut added: Vec<T>) {
    if all.is_empty() {
        *all = added;
    } else {
        all.append(&mut added);
    }
}

/// Extends the coefficients of `count` points to the possibly higher `degree` with zeros. Unusable
/// coefficients become 0 and are counted.
fn widened(terms: Option<Terms>, (count, degree): (usize, u32), replaced: &mut u64) -> Vec<f32> {
    let each = 3 * terms_of(degree);
    let Some((own_degree, mut terms)) = terms else { return vec![0.0; count * each] };
    let own_each = 3 * terms_of(own_degree);
    for of_point in terms.chunks_exact_mut(own_each) {
        let mut unusable = false;
        for term in of_point.iter_mut().filter(|term| !is_held(**term)) {
            (*term, unusable) = (0.0, true);
        }
        *replaced += u64::from(unusable);
    }
    if own_degree == degree {
        return terms;
    }
    let mut wide = vec![0.0; count * each];
    for (wide, own) in wide.chunks_exact_mut(each).zip(terms.chunks_exact(own_each)) {
        wide[..own_each].copy_from_slice(own);
    }
    wide
}

/// The 8-bit codes of all points, for inputs that have only codes or no colours.
fn codes(inputs: Vec<Input>) -> Vec<[u8; 4]> {
    let mut all = Vec::new();
    for input in inputs {
        let mut own = if let Some(Colors::Srgb8(codes)) = input.colors { codes } else { Vec::new() };
        own.resize(input.count, default_code());
        append(&mut all, own);
    }
    all
}

/// The same colours, as [`Colors::Constant`] if all are equal; [`DEFAULT_COLOR`] if there are none.
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

/// The largest magnitude of a colour channel: products and differences of such f32 values stay
/// finite.
const LARGEST: f32 = 1e18;

fn is_held(value: f32) -> bool {
    value.abs() <= LARGEST
}

/// Whether all channels are within [`LARGEST`]; false for NaN.
fn is_usable(color: &[f32; 4]) -> bool {
    color.iter().all(|c| is_held(*c))
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
        let mut gatherer = ColorGatherer::default();
        for (colors, count) in inputs {
            gatherer.append(colors, count, false);
        }
        let all = gatherer.finish();
        (folded(all.colors), all.replaced)
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

    #[test]
    fn harmonics_have_the_highest_degree_and_others_none() {
        let of_degree = |degree: u32, term: f32| {
            let terms = vec![term; 2 * 3 * terms_of(degree)];
            Harmonics::new(vec![[0.25, -0.5, 2.0, 0.5]; 2], degree, terms).map(Colors::Harmonics)
        };
        let (all, replaced) = joined(vec![(of_degree(1, 0.5), 2), (None, 1), (of_degree(2, f32::NAN), 2)]);
        let Colors::Harmonics(all) = all else { unreachable!() };
        assert_eq!((all.degree(), replaced), (2, 2));
        assert_eq!((all.colors()[0], all.colors()[2]), ([0.25, -0.5, 2.0, 0.5], DEFAULT_COLOR));
        assert_eq!(all.terms(1), [[0.5; 9].as_slice(), &[0.0; 15]].concat());
        assert!(all.terms(2).iter().chain(all.terms(4)).all(|term| *term == 0.0));
    }

    #[test]
    fn beside_codes_all_are_codes() {
        let mut gatherer = ColorGatherer::default();
        gatherer.append(Some(Colors::Srgb8(vec![[0, 255, 128, 51]])), 1, false);
        gatherer.append(Some(Colors::Linear(vec![[1.5, -0.5, 0.25, 2.0]])), 1, true);
        gatherer.append(None, 1, false);
        let all = gatherer.finish();
        let Some(Colors::Linear(colors)) = all.colors else { unreachable!() };
        assert!(all.encoded);
        assert_eq!((all.replaced, all.clamped), (0, 1));
        let expected = [[0.0, 1.0, 128.0 / 255.0, 0.2], [1.5, -0.5, 0.25, 1.0], [218.0 / 255.0; 4]];
        for (found, expected) in colors.iter().flatten().zip(expected.iter().flatten()).take(11) {
            assert!((found - expected).abs() < 2e-3, "{colors:?}");
        }
    }
}
