//! Decides what the colour and intensity numbers of files mean.
//!
//! One rule holds for all formats, and one decision for all inputs of a scene, so that two tiles of
//! one scan meet without a seam.
//!
//! Readers store colours as they are in the file, with their type and the limits that the header
//! states ([`RawColors`]). [`ColorRules`] then interprets all numbers of one kind together. A few
//! outliers are allowed: "most" means at least 99 of 100 numbers that are not zero.
//!
//! - Bytes, also signed ones, are 8-bit sRGB codes.
//! - Integers are 8-bit sRGB codes if most of them are at most 255; the few larger ones become 255.
//! - 16-bit integers are the 8-bit sRGB codes `v` if most of them are `257 v`, or most are `256 v`.
//! - Other integers are 16-bit sRGB codes if most are at most 65535, else sRGB codes of their type.
//! - Whole numbers of a text are integers, or fractions of white (sRGB) if none is above 1.
//! - Numbers with limits in the header are sRGB codes between these. Limits are ignored, and the
//!   rule for the type holds, in three cases: more than 1 of 100 numbers lies outside; the limits
//!   reach from 0 to 4095 or more, but most numbers are at most 255; the limits reach from 0 to 255
//!   or more, but the numbers are fractions, none above one.
//! - Floats are sRGB codes if more of them are above 1 than between 0 and 1, and at least one is 2
//!   or more. The codes range from 0 to 255 if most are at most 255, else from 0 to 65535.
//! - Other floats are fractions of white: linear light in a PLY file, else sRGB.
//!
//! Alphas are interpreted separately, in the same way. If the colours of a file are missing or all
//! zero, its intensities become grey: white is the 99.9th percentile over all inputs, and black is
//! zero, or the 0.1th percentile if some intensities are negative.

mod apply;
mod evidence;
mod notes;
mod rule;
mod shade;

use super::{ClassOpacities, Points};
use crate::scene::Colors;
use evidence::Evidence;
use rule::{AlphaRule, Rule};
use shade::{Levels, Shading};

/// The type of a colour number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    /// An integer of 8 bits.
    Byte,
    /// An integer of more than 8 bits, with the largest value of its type.
    Integer(u64),
    /// A number of a text, which has no types, where all numbers of a colour are whole.
    Whole,
    /// A float, or an integer that the file scales.
    Float,
}

impl Number {
    /// The 16-bit integer type.
    pub(super) const WORD: Self = Self::Integer(u16::MAX as u64);
}

/// Facts about colour numbers that are known before the numbers are read. Runs of one kind are
/// interpreted together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kind {
    pub(super) number: Number,
    /// The smallest and largest value of each channel, if the header states them.
    pub(super) limits: Option<[(f64, f64); 3]>,
    /// Floats from 0 to 1 are linear light, not sRGB.
    pub(super) light: bool,
    /// By the format's convention, all zeros mean that there are no colours.
    pub(super) zero_is_none: bool,
}

impl Kind {
    /// The kind of numbers about which the header states only their type.
    pub(super) fn of(number: Number) -> Self {
        Self { number, limits: None, light: false, zero_is_none: false }
    }

    /// The key by which runs are interpreted together. Facts that do not affect the range are
    /// removed: `zero_is_none`, and `light` unless the numbers are floats.
    fn judged(self) -> Self {
        Self { light: self.light && self.number == Number::Float, zero_is_none: false, ..self }
    }
}

/// Colour numbers as they are in the file, one entry per point.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    /// 8-bit sRGB codes with alpha.
    Bytes(Vec<[u8; 4]>),
    /// 16-bit RGB.
    Words(Vec<[u16; 3]>),
    /// Other numbers: RGB, and alpha if the file has one. Red is NaN where a point has no colour.
    Floats(Vec<[f32; 4]>),
}

impl Values {
    /// Whether all colours are equal.
    fn are_one(&self) -> bool {
        match self {
            Self::Bytes(codes) => codes.windows(2).all(|pair| pair[0] == pair[1]),
            Self::Words(codes) => codes.windows(2).all(|pair| pair[0] == pair[1]),
            Self::Floats(numbers) => numbers.windows(2).all(|pair| pair[0] == pair[1]),
        }
    }
}

/// The colour numbers of a run of points.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers {
    pub(super) values: Values,
    pub(super) kind: Kind,
    /// The type of the alphas, if there are any.
    pub(super) alpha: Option<Number>,
}

/// The intensities of a run of points.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shades {
    Words(Vec<u16>),
    /// Other types; `integer` if they are integers in the file.
    Floats {
        values: Vec<f32>,
        integer: bool,
    },
}

/// Consecutive points whose colours are of one kind, such as a scan of an E57 file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) count: usize,
    pub(super) colors: Option<Numbers>,
    /// The intensities, stored only if colours are missing or all zero.
    pub(super) shades: Option<Shades>,
}

/// The colours and intensities of an input as they are in the file, before their range is decided.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawColors {
    /// The name of the file, for notes.
    pub(super) name: String,
    /// The runs, in the order of the points.
    pub(super) runs: Vec<Run>,
    /// The class of each point; empty unless classes have different opacities.
    pub(super) classes: Vec<u8>,
    pub(super) opacities: ClassOpacities,
    /// For each point, whether it is kept; None if all are. Dropped points still count in the
    /// decision about the range.
    pub(super) keep: Option<Vec<bool>>,
}

impl RawColors {
    /// The numbers of points that form a single run.
    pub(super) fn of_run(count: usize, colors: Option<Numbers>, shades: Option<Shades>) -> Self {
        Self { runs: vec![Run { count, colors, shades }], ..Self::default() }
    }

    /// Leaves out the points whose flag is not set, once the range of colours is decided.
    pub(super) fn leave_out(&mut self, flags: Vec<bool>) {
        self.keep = Some(flags);
    }

    /// Forgets the colours, or the intensities, of a file that turns out to have none of them.
    pub(super) fn leave_out_columns(&mut self, [has_colors, has_shades]: [bool; 2]) {
        for run in &mut self.runs {
            run.colors = run.colors.take().filter(|_| has_colors);
            run.shades = run.shades.take().filter(|_| has_shades);
        }
    }

    /// Whether there is at most one run, all its colours are equal, and no intensities are stored.
    pub(super) fn is_one_color(&self) -> bool {
        let is_one =
            |run: &Run| run.shades.is_none() && run.colors.as_ref().is_none_or(|colors| colors.values.are_one());
        self.runs.len() < 2 && self.runs.iter().all(is_one)
    }

    /// Whether a run has colours and no stored intensities. Readers drop intensities at the first
    /// non-zero colour.
    pub(super) fn is_colored(&self) -> bool {
        self.runs.iter().any(|run| run.colors.is_some() && run.shades.is_none())
    }
}

/// The rule for each kind of numbers. The first inputs decide it, and later ones, such as other
/// parts of the same files, follow it.
#[derive(Clone, Debug, Default)]
pub struct ColorRules {
    colors: Vec<(Kind, Rule)>,
    alphas: Vec<(Number, AlphaRule)>,
    /// The intensities that become black and white: of integers, and of floats. The outer option is
    /// None until they are decided; the inner one is None if all intensities are equal.
    shades: [Option<Option<Shading>>; 2],
}

/// Statistics of the numbers of inputs, from which the rules are decided.
#[derive(Clone, Debug, Default)]
pub(super) struct Survey {
    colors: Vec<(Kind, Evidence)>,
    alphas: Vec<(Number, Evidence)>,
    shades: [Levels; 2],
}

/// Decides what the colours of one scene's inputs mean, from all of their numbers together, and
/// sets [`Points::colors`].
pub fn settle_colors(inputs: &mut [Points]) {
    ColorRules::default().settle(inputs);
}

impl ColorRules {
    /// Converts the raw colours of the inputs to [`Points::colors`], and adds notes about them.
    pub fn settle(&mut self, inputs: &mut [Points]) {
        let mut survey = Survey::default();
        let found = |points: &Points| points.raw.as_deref().map_or(Vec::new(), |raw| survey.add(raw));
        let found: Vec<Vec<Evidence>> = inputs.iter().map(found).collect();
        self.decide(&survey);
        for (points, found) in inputs.iter_mut().zip(found) {
            if let Some(raw) = points.raw.take() {
                self.give(points, *raw, &found);
            }
        }
    }

    /// Decides the rules that are not decided yet.
    pub(super) fn decide(&mut self, survey: &Survey) {
        for (kind, evidence) in &survey.colors {
            if self.colors.iter().all(|(known, _)| known != kind) {
                self.colors.push((*kind, Rule::of(kind, evidence)));
            }
        }
        for (number, evidence) in &survey.alphas {
            if self.alphas.iter().all(|(known, _)| known != number) {
                self.alphas.push((*number, AlphaRule::of(*number, evidence)));
            }
        }
        for (shading, levels) in self.shades.iter_mut().zip(&survey.shades) {
            if shading.is_none() && !levels.is_empty() {
                *shading = Some(levels.shading());
            }
        }
    }

    /// Sets the colours of an input, adds notes and descriptions of them, and drops points that are
    /// not kept.
    fn give(&self, points: &mut Points, raw: RawColors, found: &[Evidence]) {
        let RawColors { name, runs, classes, opacities, keep } = raw;
        let mut all = Vec::with_capacity(runs.len());
        let mut told = notes::Told::default();
        for (run, evidence) in runs.into_iter().zip(found) {
            let shading = run.shades.as_ref().and_then(|shades| self.shades[shades.class()].flatten());
            let count = run.count;
            let colors = match (run.colors, run.shades, shading) {
                (Some(numbers), ..) if shows(&numbers.kind, evidence, shading) => {
                    let rule = self.rule(&numbers.kind);
                    let alpha = numbers.alpha.map(|number| self.alpha(number));
                    told.colors(&numbers, evidence, (rule, alpha));
                    Some(apply::colors(numbers, rule, alpha))
                }
                (_, Some(shades), Some(shading)) => {
                    told.shades(shading);
                    Some(Colors::Srgb8(shades.grey(shading)))
                }
                _ => None,
            };
            all.push((colors, count));
        }
        points.colors = opacities.fade(apply::joined(all), &classes);
        points.notes.extend(told.notes(&name));
        if let Some(about) = &mut points.about {
            about.colors = told.description();
            about.intensities = told.intensities();
            told.mark(&mut about.attributes);
        }
        if let Some(keep) = keep {
            points.retain(&keep);
        }
    }

    fn rule(&self, kind: &Kind) -> Rule {
        self.colors.iter().find(|(known, _)| *known == kind.judged()).map_or(Rule::Bytes, |(_, rule)| *rule)
    }

    fn alpha(&self, number: Number) -> AlphaRule {
        self.alphas.iter().find(|(known, _)| *known == number).map_or(AlphaRule::BYTES, |(_, rule)| *rule)
    }
}

/// Whether the colours are drawn, rather than the intensities beside them.
fn shows(kind: &Kind, evidence: &Evidence, shading: Option<Shading>) -> bool {
    evidence.nonzero > 0 || shading.is_none() && !kind.zero_is_none
}

impl Survey {
    /// Adds the numbers of an input, and returns the statistics of the colours of each of its runs.
    pub(super) fn add(&mut self, raw: &RawColors) -> Vec<Evidence> {
        raw.runs.iter().map(|run| self.add_run(run)).collect()
    }

    fn add_run(&mut self, run: &Run) -> Evidence {
        let mut own = Evidence::default();
        if let Some(numbers) = &run.colors {
            own = Evidence::of(numbers);
            merge(&mut self.colors, numbers.kind.judged(), own);
            if let Some(alpha) = numbers.alpha {
                merge(&mut self.alphas, alpha, Evidence::of_alphas(numbers));
            }
        }
        if let Some(shades) = run.shades.as_ref().filter(|_| own.nonzero == 0) {
            self.shades[shades.class()].add(shades);
        }
        own
    }
}

/// Adds statistics to those of the same kind.
fn merge<K: PartialEq>(all: &mut Vec<(K, Evidence)>, kind: K, evidence: Evidence) {
    match all.iter_mut().find(|(known, _)| *known == kind) {
        Some((_, known)) => *known = known.both(evidence),
        None => all.push((kind, evidence)),
    }
}

#[cfg(test)]
mod tests;
