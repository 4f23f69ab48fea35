//! Notes and warnings for users about how numbers became colours.

use super::Numbers;
use super::evidence::Evidence;
use super::rule::{AlphaRule, Rule};
use super::shade::Shading;
use crate::io::about::{Attribute, Role};
use crate::scene::color::srgb_to_linear;

/// Colours are nearly black if fewer than one number in [`FEW`] reaches this 8-bit code.
const DARK: f64 = 16.0;
const FEW: u64 = 100;

/// Findings over all runs of an input.
#[derive(Debug, Default)]
pub(super) struct Told {
    /// The counts of all colour numbers, of those that reach [`DARK`], and of those above white.
    count: u64,
    bright: u64,
    clamped: u64,
    outside: u64,
    nonzero: u64,
    largest: f64,
    white: f64,
    limits: Option<(f64, f64)>,
    descriptions: Vec<String>,
    /// Black and white of the intensities, if they are drawn.
    shading: Option<Shading>,
    /// The largest alpha, if all alphas are so small that they can hardly be opacities.
    doubtful_alpha: Option<f64>,
}

/// The counts of numbers that reach [`DARK`], and of those above white.
fn levels(numbers: &Numbers, rule: Rule) -> [u64; 2] {
    let white = rule.white();
    let dark = |channel: usize| match rule {
        Rule::Light => srgb_to_linear(DARK / 255.0),
        Rule::Codes(limits) => limits[channel].0 + (limits[channel].1 - limits[channel].0) * DARK / 255.0,
        _ => white[channel] * DARK / 255.0,
    };
    let dark = [0, 1, 2].map(dark);
    let add = |mut all: [u64; 2], color: [f64; 3]| {
        for channel in 0..3 {
            all[0] += u64::from(color[channel] >= dark[channel]);
            all[1] += u64::from(color[channel] > white[channel]);
        }
        all
    };
    numbers.fold(add, |a, b| [a[0] + b[0], a[1] + b[1]])
}

impl Told {
    /// Adds the colours of a run.
    pub fn colors(&mut self, numbers: &Numbers, evidence: &Evidence, (rule, alpha): (Rule, Option<AlphaRule>)) {
        let [bright, clamped] = levels(numbers, rule);
        self.count += evidence.count;
        self.bright += bright;
        self.clamped += clamped;
        self.nonzero += evidence.nonzero;
        self.largest = self.largest.max(evidence.largest);
        self.white = self.white.max(rule.white()[0]);
        if let Some(limits) = numbers.kind.limits {
            self.outside += evidence.outside;
            self.limits = Some(limits[0]);
        }
        let description = rule.describe(&numbers.kind);
        if !self.descriptions.contains(&description) {
            self.descriptions.push(description);
        }
        let doubtful = alpha.filter(AlphaRule::is_doubtful).map(|alpha| alpha.largest);
        self.doubtful_alpha = self.doubtful_alpha.or(doubtful);
    }

    /// Records the intensities that become black and white.
    pub fn shades(&mut self, shading: Shading) {
        self.shading = Some(shading);
    }

    /// A description of the colours, if there are any.
    pub fn description(&self) -> Option<String> {
        (!self.descriptions.is_empty()).then(|| self.descriptions.join("; "))
    }

    /// Black and white of the intensities, if they are drawn.
    pub fn intensities(&self) -> Option<[f64; 2]> {
        self.shading.map(|shading| [shading.black, shading.white])
    }

    /// Sets `used` of colours and intensities according to what is drawn.
    pub fn mark(&self, attributes: &mut [Attribute]) {
        for attribute in attributes {
            match attribute.role {
                Role::Color => attribute.used = !self.descriptions.is_empty(),
                Role::Intensity => attribute.used = self.shading.is_some(),
                Role::Other => {}
            }
        }
    }

    /// One sentence for each finding that may surprise.
    pub fn notes(&self, name: &str) -> Vec<String> {
        let Self { count, bright, clamped, outside, nonzero, largest, white, .. } = *self;
        let mut notes = Vec::new();
        if let Some((low, high)) = self.limits.filter(|_| FEW * outside > count) {
            notes.push(format!(
                "{name}: its header says that colours range from {low} to {high}, but {outside} of {count} numbers lie \
                 outside, so their values decide: white is {white}"
            ));
        }
        if count > 0 && FEW * bright < count {
            notes.push(match nonzero {
                0 => format!("warning: {name}: its colours are all zero, so it is black"),
                _ => format!(
                    "warning: {name}: its colours are nearly black: only {bright} of {count} numbers reach {DARK} of 255 where \
                     white is {white}, and the largest is {largest}"
                ),
            });
        }
        if FEW * clamped > count {
            notes.push(format!(
                "warning: {name}: {clamped} of {count} numbers of its colours are above {white}, which is white, and the largest is {largest}"
            ));
        }
        if let Some(largest) = self.doubtful_alpha {
            notes.push(format!(
                "{name}: its alpha is at most {largest} of 255, which looks like class numbers and not like opacities: \
                 --ignore-alpha leaves it out"
            ));
        }
        notes
    }
}
