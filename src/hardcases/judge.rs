//! Compares the image of a case with its reference: errors and verdict.

use std::collections::BTreeMap;

use serde::Serialize;

use super::bounds::{ColorRange, Pixel, PixelBound, color_of_samples};
use super::{HardCase, Truth};
use crate::frame::Frame;
use crate::metrics::DECISION_MARGIN;
use crate::plan::{Accumulator, AccumulatorRow};
use crate::render::Report;
use crate::scene::{Map, Samples};

/// The result of judging an image.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "reason", rename_all = "snake_case")]
pub enum Verdict {
    /// All requirements are met.
    Pass,
    /// The case's bound is exceeded, as expected of this accumulator, but not the accumulator's own
    /// bound. Has the maps and the reason.
    ExpectedFailure(String),
    /// Any other violation; has its description.
    Fail(String),
}

/// The error of one map over the pixels that are not excused.
#[derive(Clone, Debug, Serialize)]
pub struct MapError {
    /// One of color (RGB), alpha, depth, normal, weight, count.
    pub map: &'static str,
    /// The unit of errors: the range of the reference's values, or their largest magnitude if the
    /// range is under 1/1000 of it.
    pub range: f64,
    /// Largest error, as a fraction of the range.
    pub max: f64,
    /// Root of the mean squared error of all values of covered pixels, as a fraction of the range.
    pub rmse: f64,
    /// Root of the mean square of the values, as a fraction of the range.
    pub rms: f64,
    /// Largest bound of any pixel, as a fraction of the range.
    pub bound: f64,
    /// Largest ratio of a pixel's error to the case's bound; above 1, the bound is exceeded.
    pub used: f64,
    /// Largest ratio of a pixel's error to the bound of the row's own accumulator.
    pub used_of_own: f64,
}

/// One case rendered with one accumulator.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the case.
    pub case: String,
    /// [`HardCase::about`].
    pub about: &'static str,
    /// [`HardCase::bound`].
    pub bound_is: &'static str,
    /// Name of the accumulator.
    pub accumulator: &'static str,
    /// The verdict.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// The error of each map.
    pub maps: Vec<MapError>,
    /// Largest error of colours in units of [`HardCase::smallest`], if that is given.
    pub of_smallest: Option<f64>,
    /// Pixels, other than excused ones, that the reference covers and the device does not.
    pub lost: usize,
    /// Pixels, other than excused ones, that the device covers and the reference does not.
    pub invented: usize,
    /// Values of any map that are NaN, in excused pixels too.
    pub nan: usize,
    /// Fraction of pixels that are excused.
    pub excused: f64,
    /// Fraction of pixels that the reference covers.
    pub covered: f64,
    /// Number of one-word sums that wrapped; if there are any, the image is that of `fixed`.
    pub overflows: u64,
    /// The map and both values, if the RMSE of `fixed` exceeds that of f32 sums by more than one
    /// rounding of the output.
    pub over_float: Option<String>,
    /// Hashes of the picture's bits ([`Frame::hashes`]).
    pub bits: BTreeMap<&'static str, String>,
    /// Milliseconds of the render on the device, without compilation.
    pub device_ms: f64,
}

impl Row {
    /// Returns the map with the largest ratio of error to bound.
    pub fn worst(&self) -> Option<&MapError> {
        self.maps.iter().max_by(|a, b| a.used.total_cmp(&b.used))
    }

    /// Largest error of any map, as a fraction of its range.
    pub fn max_error(&self) -> f64 {
        self.maps.iter().map(|m| m.max).fold(0.0, f64::max)
    }

    /// Largest RMSE of any map, as a fraction of its range.
    pub fn rmse(&self) -> f64 {
        self.maps.iter().map(|m| m.rmse).fold(0.0, f64::max)
    }

    /// Whether the verdict is neither a pass nor an expected failure.
    pub fn failed(&self) -> bool {
        matches!(self.verdict, Verdict::Fail(_))
    }
}

/// Accumulated errors of one map, before they are divided by the range.
struct Gathered {
    map: &'static str,
    low: f64,
    high: f64,
    max: f64,
    squares: f64,
    values: f64,
    count: f64,
    bound: f64,
    used: f64,
    used_of_own: f64,
}

impl Gathered {
    fn new(map: &'static str) -> Self {
        Self {
            map,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            max: 0.0,
            squares: 0.0,
            values: 0.0,
            count: 0.0,
            bound: 0.0,
            used: 0.0,
            used_of_own: 0.0,
        }
    }

    /// Adds a value of the device, the reference's, and the bounds of the case and of the
    /// accumulator.
    fn add(&mut self, value: f32, truth: f32, bound: f64, own: f64) {
        let (value, truth) = (f64::from(value), f64::from(truth));
        let error = (value - truth).abs();
        // NaN and infinite errors count as the largest error.
        let error = if error.is_finite() { error } else { f64::MAX.sqrt() };
        self.low = self.low.min(truth);
        self.high = self.high.max(truth);
        self.max = self.max.max(error);
        self.squares += error * error;
        self.values += truth * truth;
        self.count += 1.0;
        self.bound = self.bound.max(bound);
        // The reference is rounded to f32 too, by half a unit in the last place.
        let rounding = truth.abs() / 16_777_216.0;
        let share = |bound: f64| if error > 0.0 { error / (bound + rounding) } else { 0.0 };
        self.used = self.used.max(share(bound));
        self.used_of_own = self.used_of_own.max(share(own));
    }

    fn finish(self) -> MapError {
        let magnitude = self.low.abs().max(self.high.abs());
        let range = self.high - self.low;
        let range = if range > 1e-3 * magnitude { range } else { magnitude };
        let of = |error: f64| if error == 0.0 { 0.0 } else { (error / range).min(f64::MAX) };
        let root = |squares: f64| if self.count > 0.0 { (squares / self.count).sqrt() } else { 0.0 };
        MapError {
            map: self.map,
            range: if self.count > 0.0 { range } else { 0.0 },
            max: of(self.max),
            rmse: of(root(self.squares)),
            rms: of(root(self.values)),
            bound: of(self.bound),
            used: self.used,
            used_of_own: self.used_of_own,
        }
    }
}

/// Judges `frame`, which was rendered with `accumulator`.
pub fn judge(case: &HardCase, truth: &Truth, accumulator: &AccumulatorRow, frame: &Frame, report: &Report) -> Row {
    let range = ColorRange::of(&case.scene);
    let exact = Accumulator::Fixed.row();
    let bits = accumulator.fraction_bits(case.scene.surfels.len() as u64);
    let mut maps = ["color", "alpha", "depth", "normal", "weight", "count"].map(Gathered::new);
    let (mut lost, mut invented, mut nan, mut excused, mut covered) = (0, 0, 0, 0, 0);
    for (index, known) in truth.pixels.iter().enumerate() {
        let (Some(here), Some(there)) = (Values::at(frame, index), Values::at(&truth.frame, index)) else { continue };
        nan += here.all().iter().filter(|value| value.is_nan()).count();
        covered += usize::from(there.weight > 0.0);
        let decision = truth.frame.map(Map::Decision).and_then(|map| map.get(index)).copied().unwrap_or(0.0);
        let samples = samples_of(case, truth, index);
        let composited = truth.composited.get(index);
        if known.open
            || composited.is_some_and(|composited| composited.open)
            || samples.iter().any(|sample| sample.open)
            || decision < DECISION_MARGIN
        {
            excused += 1;
            continue;
        }
        // Samples may be covered even if the pixel's centre is not; maps are taken at the centre.
        let edge = !samples.is_empty() && there.weight == 0.0 && here.weight == 0.0;
        let shown = |values: &Values| if edge { values.color[3] > 0.0 } else { values.weight > 0.0 };
        match (shown(&there), shown(&here)) {
            (true, false) => lost += 1,
            (false, true) => invented += 1,
            (false, false) => {}
            (true, true) => {
                let bound = |row: &AccumulatorRow| {
                    let of_center = known.bound(row, bits, &range);
                    match samples.as_slice() {
                        [] => PixelBound { color: composited.map_or(of_center.color, |own| own.color), ..of_center },
                        all => PixelBound { color: color_of_samples(all, row, bits, &range), ..of_center },
                    }
                };
                gather(&mut maps, (&here, &there), &bound(exact), &bound(accumulator));
            }
        }
    }
    let pixels = truth.pixels.len().max(1) as f64;
    let of_smallest = case.smallest.and_then(|smallest| maps.first().map(|color| color.max / smallest));
    let mut row = Row {
        case: case.name.clone(),
        about: case.about,
        bound_is: case.bound,
        accumulator: accumulator.name,
        verdict: Verdict::Pass,
        maps: maps.into_iter().map(Gathered::finish).collect(),
        of_smallest,
        lost,
        invented,
        nan,
        excused: f64::from(excused) / pixels,
        covered: covered as f64 / pixels,
        overflows: report.overflows,
        over_float: None,
        bits: frame.hashes(),
        device_ms: report.total_ms,
    };
    row.verdict = verdict(case, &row);
    row
}

/// Returns the samples of a pixel; none if a pixel has one sample, its centre.
fn samples_of<'a>(case: &HardCase, truth: &'a Truth, pixel: usize) -> Vec<&'a Pixel> {
    let Samples { across, down } = case.options.samples;
    let (across, down, width) = (across as usize, down as usize, case.camera.width as usize);
    let first = pixel / width * down * width * across + pixel % width * across;
    let places = (0..down).flat_map(|row| (0..across).map(move |column| first + row * width * across + column));
    places.filter_map(|place| truth.samples.get(place)).collect()
}

fn gather(maps: &mut [Gathered; 6], (here, there): (&Values, &Values), bound: &PixelBound, own: &PixelBound) {
    let [color, alpha, depth, normal, weight, count] = maps;
    let channels = here.color.iter().zip(&there.color).zip(bound.color.iter().zip(&own.color));
    for (k, ((here, there), (bound, own))) in channels.enumerate() {
        (if k == 3 { &mut *alpha } else { &mut *color }).add(*here, *there, *bound, *own);
    }
    if here.weight == 0.0 && there.weight == 0.0 {
        return;
    }
    for (here, there) in here.normal.iter().zip(&there.normal) {
        normal.add(*here, *there, bound.normal, own.normal);
    }
    depth.add(here.depth, there.depth, bound.depth, own.depth);
    weight.add(here.weight, there.weight, bound.weight, own.weight);
    count.add(here.count, there.count, 0.0, 0.0);
}

/// The values of one pixel in all maps.
struct Values {
    color: [f32; 4],
    depth: f32,
    normal: [f32; 3],
    weight: f32,
    count: f32,
}

impl Values {
    fn at(frame: &Frame, index: usize) -> Option<Self> {
        let scalar = |map| frame.map(map)?.get(index).copied();
        Some(Self {
            color: *frame.color.get(index)?,
            depth: scalar(Map::Depth)?,
            normal: frame.normals().map_or(Some([0.0; 3]), |normals| normals.get(index).copied())?,
            weight: scalar(Map::Weight)?,
            count: scalar(Map::Count)?,
        })
    }

    fn all(&self) -> [f32; 10] {
        let ([r, g, b, a], [x, y, z]) = (self.color, self.normal);
        [r, g, b, a, x, y, z, self.depth, self.weight, self.count]
    }
}

fn verdict(case: &HardCase, row: &Row) -> Verdict {
    let (least, most) = case.covered;
    if !(least..=most).contains(&row.covered) {
        return Verdict::Fail(format!("the reference covers {:.4} of the image, not {least} to {most}", row.covered));
    }
    if row.excused > case.excused {
        return Verdict::Fail(format!("{:.4} of the pixels are excused, more than {}", row.excused, case.excused));
    }
    if row.nan > 0 {
        return Verdict::Fail(format!("{} values are NaN", row.nan));
    }
    if row.lost + row.invented > 0 {
        return Verdict::Fail(format!("{} pixels lost and {} invented", row.lost, row.invented));
    }
    let over = |used: fn(&MapError) -> f64| row.maps.iter().filter(move |m| used(m) > 1.0).map(|m| m.map);
    let own: Vec<_> = over(|m| m.used_of_own).collect();
    if !own.is_empty() {
        return Verdict::Fail(format!("{} over the proven bound of {}", own.join(", "), row.accumulator));
    }
    let case_bound: Vec<_> = over(|m| m.used).collect();
    if case_bound.is_empty() {
        return Verdict::Pass;
    }
    match case.expected.iter().find(|expected| expected.accumulator.name() == row.accumulator) {
        Some(expected) => Verdict::ExpectedFailure(format!("{}: {}", case_bound.join(", "), expected.reason)),
        None => Verdict::Fail(format!("{} over the case's bound", case_bound.join(", "))),
    }
}

/// Fails the row of `fixed` if f32 sums have a smaller RMSE, in any map, by more than one rounding
/// of the output: `rmse(fixed) > rmse(float or cas) + 2^-24 rms(values)`. Also stores the values in
/// [`Row::over_float`]. `rows` must be those of one case.
pub fn compare_rmse(rows: &mut [Row]) {
    let rounding = 1.0 / 16_777_216.0;
    let floats = |row: &&Row| [Accumulator::Float, Accumulator::Cas].map(Accumulator::name).contains(&row.accumulator);
    let worse = |fixed: &Row| {
        let mut worse = Vec::new();
        for float in rows.iter().filter(floats) {
            for (here, there) in fixed.maps.iter().zip(&float.maps) {
                if here.rmse > there.rmse + rounding * here.rms {
                    worse.push(format!(
                        "{} {:.3e} against {:.3e} of {}",
                        here.map, here.rmse, there.rmse, float.accumulator
                    ));
                }
            }
        }
        (!worse.is_empty()).then(|| worse.join("; "))
    };
    let found = rows.iter().find(|row| row.accumulator == Accumulator::Fixed.name()).and_then(worse);
    if let Some(row) = rows.iter_mut().find(|row| row.accumulator == Accumulator::Fixed.name()) {
        if let (Some(what), false) = (&found, row.failed()) {
            row.verdict = Verdict::Fail(format!("a larger RMSE than f32 sums: {what}"));
        }
        row.over_float = found;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use crate::hardcases::cases;
    use crate::plan::Settings;
    use crate::render::{Backend, render};
    use crate::scene::Maps;

    /// The reference passes when it is judged by itself, and each change to it is noticed.
    #[test]
    fn each_fault_of_an_image_is_found() {
        let cases = cases().unwrap();
        let case = cases.iter().find(|case| case.name == "intersecting sheets").unwrap();
        let truth = case.truth().unwrap();
        let options = Settings { maps: Maps::ON_DEVICE, ..case.options.clone() };
        let (frame, report) = render(&case.scene, &case.camera, &options, &Backend::Reference, &()).unwrap();
        let (exact, one_word) = (Accumulator::Fixed.row(), Accumulator::Fixed32.row());
        let row = judge(case, &truth, exact, &frame, &report);
        assert_eq!((row.verdict, row.lost, row.invented, row.nan), (Verdict::Pass, 0, 0, 0));
        let decided = truth.pixels.iter().position(|pixel| !pixel.open && pixel.count > 1).unwrap();
        let verdict = |change: &dyn Fn(&mut Frame), accumulator| {
            let mut changed = frame.clone();
            change(&mut changed);
            judge(case, &truth, accumulator, &changed, &report).verdict
        };
        let fails = |change: &dyn Fn(&mut Frame), word: &str| match verdict(change, exact) {
            Verdict::Fail(what) => assert!(what.contains(word), "{what}"),
            other => panic!("{word}: {other:?}"),
        };
        fails(&|f| f.color[decided][1] = f32::NAN, "NaN");
        fails(&|f| f.map_mut(Map::Weight).unwrap()[decided] = 0.0, "1 pixels lost");
        fails(&|f| f.color[decided][0] += 1e-3, "color");
        fails(&|f| f.map_mut(Map::Depth).unwrap()[decided] *= 1.0001, "depth");
        fails(&|f| f.map_mut(Map::Count).unwrap()[decided] += 1.0, "count");
        // The one-word accumulator is expected to fail, but only within its own bound.
        assert!(matches!(verdict(&|f| f.color[decided][0] += 1e-2, one_word), Verdict::Fail(_)));
        let bits = one_word.fraction_bits(case.scene.surfels.len() as u64);
        let range = ColorRange::of(&case.scene);
        let bounds =
            |pixel: &Pixel| (pixel.bound(exact, bits, &range).color[0], pixel.bound(one_word, bits, &range).color[0]);
        let worse = |pixel: &Pixel| {
            let (case, own) = bounds(pixel);
            !pixel.open && own > 3.0 * case
        };
        let rim = truth.pixels.iter().position(worse).unwrap();
        let between = 1.5 * bounds(&truth.pixels[rim]).0;
        let change = |f: &mut Frame| f.color[rim][0] += between as f32;
        assert!(matches!(verdict(&change, one_word), Verdict::ExpectedFailure(_)));
        assert!(matches!(verdict(&change, exact), Verdict::Fail(_)));
    }
}
