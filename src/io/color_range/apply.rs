//! Conversion of a file's colour numbers to [`Colors`].

use super::rule::{AlphaRule, Rule};
use super::{Kind, Number, Numbers, Values};
use crate::io::values::{SRGB16_TO_LINEAR, finite};
use crate::scene::Colors;
use crate::scene::color::{DEFAULT_COLOR, SRGB8_TO_LINEAR, linear_to_srgb, srgb_to_linear};
use rayon::prelude::*;

/// Converts the colour numbers of a run of points to colours, by the rules for their kind.
///
/// Points without a colour get the default colour. Floats become 8-bit codes if both the rule and
/// the alphas are 8-bit, else linear light.
pub(super) fn colors(numbers: Numbers, rule: Rule, alpha: Option<AlphaRule>) -> Colors {
    let kind = numbers.kind;
    match (numbers.values, rule) {
        (Values::Bytes(codes), _) => Colors::Srgb8(codes),
        (Values::Words(codes), Rule::Bytes) => of_words(&codes, |code| code.min(255) as u8),
        (Values::Words(codes), Rule::HighBytes) => of_words(&codes, |code| (code >> 8) as u8),
        (Values::Words(codes), rule) => {
            let light = light(rule, kind);
            let color = |code: &[u16; 3]| opaque([0, 1, 2].map(|k| light(k, code[k].into())));
            Colors::Linear(codes.par_iter().map(color).collect())
        }
        (Values::Floats(colors), Rule::Bytes | Rule::HighBytes) if alpha.is_none_or(|alpha| alpha.bytes) => {
            let byte = byte(rule);
            let default = default_code();
            let code = |[r, g, b, a]: &[f32; 4]| {
                if r.is_nan() {
                    return default;
                }
                // A point without an alpha is opaque.
                [byte(*r), byte(*g), byte(*b), if alpha.is_some() && !a.is_nan() { *a as u8 } else { 255 }]
            };
            Colors::Srgb8(colors.par_iter().map(code).collect())
        }
        (Values::Floats(mut colors), rule) => {
            let light = light(rule, kind);
            let color = |color: &mut [f32; 4]| {
                if color[0].is_nan() {
                    *color = DEFAULT_COLOR;
                    return;
                }
                for (channel, value) in color.iter_mut().take(3).enumerate() {
                    *value = light(channel, (*value).into());
                }
                let given = alpha.filter(|_| !color[3].is_nan());
                color[3] = given.map_or(1.0, |alpha| finite(f64::from(color[3]) / alpha.full));
            };
            colors.par_iter_mut().for_each(color);
            Colors::Linear(colors)
        }
    }
}

/// The 8-bit code of one float channel.
fn byte(rule: Rule) -> impl Fn(f32) -> u8 {
    move |value| match rule {
        Rule::HighBytes => (value as u16 >> 8) as u8,
        // The cast saturates: values above 255 become 255.
        _ => value as u8,
    }
}

fn of_words(codes: &[[u16; 3]], byte: impl Fn(u16) -> u8 + Sync) -> Colors {
    let code = |code: &[u16; 3]| {
        let [r, g, b] = code.map(&byte);
        [r, g, b, 255]
    };
    Colors::Srgb8(codes.par_iter().map(code).collect())
}

fn opaque([r, g, b]: [f32; 3]) -> [f32; 4] {
    [r, g, b, 1.0]
}

/// Returns the function that maps (channel, number) to linear light.
fn light(rule: Rule, kind: Kind) -> impl Fn(usize, f64) -> f32 {
    let (bytes, words) = (&*SRGB8_TO_LINEAR, &*SRGB16_TO_LINEAR);
    // Floats without limits in the header may be brighter than white, so they are not clamped.
    let is_limited = kind.limits.is_some() || kind.number != Number::Float;
    let is_word = is_limited && rule == Rule::Codes([(0.0, 65535.0); 3]);
    move |channel, value| match rule {
        Rule::Light => value as f32,
        Rule::Bytes => bytes[usize::from(value as u8)],
        Rule::HighBytes => bytes[usize::from(value as u16 >> 8)],
        Rule::Codes(_) if is_word => words[usize::from(value.round() as u16)],
        Rule::Codes(limits) => {
            let (low, high) = limits[channel];
            let share = (value - low) / (high - low);
            finite(srgb_to_linear(if is_limited { share.clamp(0.0, 1.0) } else { share }))
        }
    }
}

/// The default colour as 8-bit sRGB codes.
pub(super) fn default_code() -> [u8; 4] {
    let code = |light: f32| (linear_to_srgb(light.into()) * 255.0).round() as u8;
    let [r, g, b, _] = DEFAULT_COLOR;
    [code(r), code(g), code(b), 255]
}

/// Joins the colours of runs, each with its number of points. None if no run has colours.
///
/// If all runs with colours have 8-bit codes, so does the result; else it is linear light. Runs
/// without colours get the default colour.
pub(super) fn joined(mut runs: Vec<(Option<Colors>, usize)>) -> Option<Colors> {
    if runs.iter().all(|(colors, _)| colors.is_none()) {
        return None;
    }
    if runs.len() == 1 {
        return runs.pop().and_then(|(colors, _)| colors);
    }
    let has_codes = |(colors, _): &(Option<Colors>, usize)| matches!(colors, None | Some(Colors::Srgb8(_)));
    if runs.iter().all(has_codes) {
        let mut all = Vec::with_capacity(runs.iter().map(|(_, count)| count).sum());
        for (colors, count) in runs {
            match colors {
                Some(Colors::Srgb8(mut codes)) => all.append(&mut codes),
                _ => all.resize(all.len() + count, default_code()),
            }
        }
        return Some(Colors::Srgb8(all));
    }
    let mut all = Vec::with_capacity(runs.iter().map(|(_, count)| count).sum());
    for (colors, count) in runs {
        let colors = colors.unwrap_or_default();
        all.extend((0..count).map(|index| colors.linear(index)));
    }
    Some(Colors::Linear(all))
}
