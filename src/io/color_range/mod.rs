//! How the numbers that files have for colours and intensities become colours: one rule for all
//! formats, and one decision for all inputs of a scene, so that two tiles of one scan meet without
//! a seam.
//!
//! Readers keep colours as they are in the file, with their type and the limits that the header
//! states ([`RawColors`]). [`ColorRules`] then looks at all numbers of one kind together:
//!
//! | numbers | taken for |
//! |---|---|
//! | bytes, signed ones too | 8-bit sRGB codes |
//! | integers of which at most 1 of 100 that are not zero is above 255 | 8-bit sRGB codes; the few above become 255 |
//! | 16-bit integers of which 99 of 100 are `257 v`, or 99 of 100 `256 v` | the 8-bit sRGB codes `v` |
//! | other integers | sRGB codes of 16 bits, or of the type if more than 1 of 100 is above 65535 |
//! | integers with limits in the header | sRGB codes between these, unless more than 1 of 100 lies outside; 8-bit codes where the limits reach 4095 or more and no more than 1 of 100 is above 255 |
//! | floats of which more are above 1 than between 0 and 1, and one is 2 or more | sRGB codes of 0 to 255, or of 0 to 65535 if more than 1 of 100 is above 255 |
//! | other floats | shares of 1: linear light in a PLY file, else sRGB |
//!
//! Alphas are judged in the same way by themselves. Where the colours of a file are missing or all
//! zero, its intensities become grey: the 99.9th percentile of all inputs is white, and zero is
//! black, or where some are negative the 0.1th percentile.

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

/// The meaning of a number of a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    /// An 8-bit code.
    Byte,
    /// An integer of more than 8 bits, whose largest is this.
    Integer(u64),
    /// A float.
    Float,
}

impl Number {
    /// 16-bit integers.
    pub(super) const WORD: Self = Self::Integer(u16::MAX as u64);
}

/// Facts of numbers before their values are read: runs of one kind are judged together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kind {
    pub(super) number: Number,
    /// The smallest and the largest of each channel, if the header states them.
    pub(super) limits: Option<[(f64, f64); 3]>,
    /// Floats from 0 to 1 are linear light, and not sRGB.
    pub(super) light: bool,
    /// By the format's convention zeros alone mean that there are no colours.
    pub(super) zero_is_none: bool,
}

impl Kind {
    /// Numbers of which the header states no more than their type.
    pub(super) fn of(number: Number) -> Self {
        Self { number, limits: None, light: false, zero_is_none: false }
    }

    /// The kind by which runs are judged together: a format's conventions are no
    /// matter of what numbers range over.
    fn judged(self) -> Self {
        Self { light: self.light && self.number == Number::Float, zero_is_none: false, ..self }
    }
}

/// Colours as a file has them.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    /// 8-bit sRGB codes with alpha.
    Bytes(Vec<[u8; 4]>),
    /// 16-bit numbers.
    Words(Vec<[u16; 3]>),
    /// Other numbers, with alpha if there is one; red is not a number where a point has no colour.
    Floats(Vec<[f32; 4]>),
}

impl Values {
    /// Whether none differs from another.
    fn are_one(&self) -> bool {
        match self {
            Self::Bytes(codes) => codes.windows(2).all(|pair| pair[0] == pair[1]),
            Self::Words(codes) => codes.windows(2).all(|pair| pair[0] == pair[1]),
            Self::Floats(numbers) => numbers.windows(2).all(|pair| pair[0] == pair[1]),
        }
    }
}

/// The colours of a run of points.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers {
    pub(super) values: Values,
    pub(super) kind: Kind,
    /// The kind of alphas, if there are some.
    pub(super) alpha: Option<Number>,
}

/// The intensities of a run of points.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shades {
    Words(Vec<u16>),
    /// Others, which are integers in the file or not.
    Floats {
        values: Vec<f32>,
        integer: bool,
    },
}

/// Points one after the other whose colours are of one kind, such as a scan of an E57 file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) count: usize,
    pub(super) colors: Option<Numbers>,
    /// Kept where colours are missing or all zero.
    pub(super) shades: Option<Shades>,
}

/// The colours and intensities of an input as its file has them, before it is known what they range
/// over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawColors {
    /// The file's name in notes.
    pub(super) name: String,
    /// In the order of the points.
    pub(super) runs: Vec<Run>,
    /// The class of each point, where classes make a difference to their opacities.
    pub(super) classes: Vec<u8>,
    pub(super) opacities: ClassOpacities,
    /// Whether each point stays, where some go: all of them tell what numbers range over.
    pub(super) keep: Option<Vec<bool>>,
}

impl RawColors {
    /// Numbers of points that are one run.
    pub(super) fn of_run(count: usize, colors: Option<Numbers>, shades: Option<Shades>) -> Self {
        Self { runs: vec![Run { count, colors, shades }], ..Self::default() }
    }

    /// Whether no colour differs from another, and no intensities are kept.
    pub(super) fn is_one_color(&self) -> bool {
        let is_one =
            |run: &Run| run.shades.is_none() && run.colors.as_ref().is_none_or(|colors| colors.values.are_one());
        self.runs.len() < 2 && self.runs.iter().all(is_one)
    }

    /// Whether some colour is not zero: then no intensities are kept.
    pub(super) fn is_colored(&self) -> bool {
        self.runs.iter().any(|run| run.colors.is_some() && run.shades.is_none())
    }
}

/// Meanings of numbers, which the first settled inputs decide and all later ones keep,
/// such as other parts of the same files.
#[derive(Clone, Debug, Default)]
pub struct ColorRules {
    colors: Vec<(Kind, Rule)>,
    alphas: Vec<(Number, AlphaRule)>,
    /// One for integers and one for floats.
    shades: [Option<Option<Shading>>; 2],
}

/// Evidence in the numbers of inputs, before it is decided what they mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Survey {
    colors: Vec<(Kind, Evidence)>,
    alphas: Vec<(Number, Evidence)>,
    shades: [Levels; 2],
}

/// Settles what the colours of inputs mean that are one scene: by all of their numbers together.
pub fn settle_colors(inputs: &mut [Points]) {
    ColorRules::default().settle(inputs);
}

impl ColorRules {
    /// Gives the inputs the colours that their numbers mean.
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

    /// Decides what is not decided yet.
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

    /// Gives points their colours, and what is to be told of these.
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

/// Whether colours show, and not the intensities beside them.
fn shows(kind: &Kind, evidence: &Evidence, shading: Option<Shading>) -> bool {
    evidence.nonzero > 0 || shading.is_none() && !kind.zero_is_none
}

impl Survey {
    /// Adds the numbers of an input; what the colours of each of its runs say.
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

/// Adds what numbers say to what others of their kind say.
fn merge<K: PartialEq>(all: &mut Vec<(K, Evidence)>, kind: K, evidence: Evidence) {
    match all.iter_mut().find(|(known, _)| *known == kind) {
        Some((_, known)) => *known = known.both(evidence),
        None => all.push((kind, evidence)),
    }
}

#[cfg(test)]
mod tests;
