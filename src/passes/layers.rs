//! Stage 4 of [`Composite::Layers`]: splits each pixel's fragments into surfaces, blends each
//! surface as an opaque picture blends the nearest one, and composites the surfaces from front to
//! back.
//!
//! # Where a surface ends
//!
//! The nearest fragment that no layer has yet consumed starts a surface. Fragments of the same side
//! within epsilon of this first one are blended, as in an opaque picture. Further fragments of that
//! side, each within epsilon of a fragment before it, belong to the same surface but lie behind its
//! visible part and are skipped. So a surface ends at the first gap of epsilon, as 3DSS merges the
//! intervals of its kernels. If instead a surface ended one epsilon behind its nearest fragment, it
//! would be cut in two where the ray meets it at a grazing angle or at a crease. Where normals have
//! sides, a front and a back are two surfaces, however close they lie.
//!
//! The sums are the integers of [`accumulate`](mod@super::accumulate), from the same terms. A
//! nearest layer of alpha 1 therefore has the bits of the opaque picture without culling, and a
//! picture whose alphas are all 1 is drawn as an opaque one.

use super::Strip;
use super::accumulate::PixelSums;
use super::fragments::{self, Fragment};
use super::join::Beside;
use super::resolve::{over, set, surface};
use crate::frame::Frame;
use crate::plan::pass::Pass;
use crate::plan::{Lists, Settings};
use crate::scene::composite::LEAST_TRANSMITTANCE;
use crate::scene::maps::SURFACES;
use crate::scene::{Composite, Map, Tail};

/// Where a pixel's surface ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parting {
    /// At the first gap of epsilon.
    Runs,
    /// One epsilon behind the nearest fragment, as in the layers that the rasteriser peels
    /// ([`peel`](super::peel)).
    Window,
}

/// Splits a pixel's sorted fragments into surfaces, from front to back, and returns the smallest
/// relative distance to a decision.
///
/// There are at most `most` surfaces, and with a tail one more that holds all remaining fragments.
pub fn part(
    list: &[Fragment],
    (most, tail): (u32, Tail),
    parting: Parting,
    (options, along): (&Settings, f64),
) -> (Vec<PixelSums>, f64) {
    let farthest = |depth: f64, radius: f64| options.epsilon.farthest(depth, radius, along);
    let (mut layers, mut decision) = (Vec::new(), f64::INFINITY);
    // Per side, the depth up to which fragments are consumed: the end of the last surface, or with
    // windows the depth of its nearest fragment, to which `untold` adds each fragment's epsilon.
    let mut told = [f64::NEG_INFINITY; 2];
    let untold = |f: &Fragment, told: [f64; 2]| {
        let told = told[usize::from(f.back)];
        f.depth > if parting == Parting::Runs { told } else { farthest(told, f.radius) }
    };
    while let Some(first) = list.iter().position(|f| untold(f, told)) {
        let last = layers.len() >= most as usize;
        if last && tail == Tail::None {
            break;
        }
        let front = list[first];
        // If a front and a back have the same depth but for rounding, either may start the surface.
        let other = list[first..].iter().find(|f| f.back != front.back && untold(f, told));
        decision = other.map_or(decision, |other| decision.min(other.depth / front.depth - 1.0));
        let mut sums = PixelSums { back: front.back && !last, nearest: front.depth, ..PixelSums::ZERO };
        let mut end = farthest(front.depth, front.radius);
        for (number, f) in list.iter().enumerate().skip(first) {
            if !untold(f, told) || !last && f.back != front.back {
                continue;
            }
            if last {
                sums.add(f);
                continue;
            }
            let window = farthest(front.depth, f.radius);
            if number > first {
                let ends = if parting == Parting::Runs { [end, window] } else { [window; 2] };
                let margins = ends.map(|limit| (limit / f.depth - 1.0).abs());
                decision = margins.into_iter().fold(decision, f64::min);
            }
            if parting == Parting::Runs {
                if f.depth > end {
                    break;
                }
                end = end.max(farthest(f.depth, f.radius));
            }
            if f.depth <= window {
                sums.add(f);
            }
        }
        told[usize::from(front.back)] = if parting == Parting::Runs { end } else { front.depth };
        if last {
            told = [f64::INFINITY; 2];
        }
        layers.push(sums);
    }
    (layers, decision)
}

impl PixelSums {
    /// Adds a fragment.
    fn add(&mut self, f: &Fragment) {
        self.weight += f.weight;
        self.color.iter_mut().zip(f.color).for_each(|(sum, value)| *sum += f.weight * value);
        self.normal.iter_mut().zip(f.normal.to_array()).for_each(|(sum, value)| *sum += f.weight * value);
        self.depth += f.weight * f.depth;
        self.count += 1;
    }
}

/// A pixel's composited colour so far, from front to back.
#[derive(Clone, Copy)]
pub(super) struct Shown {
    /// Premultiplied linear colour and alpha.
    color: [f64; 4],
    transmittance: f64,
    layers: u32,
    /// How much the last layer shows, alpha times transmittance, if it is a tail; else 0.
    tail: f64,
    /// Depth (`Camera::depth`, world units) and alpha of the nearest surfaces.
    nearest: [[f64; 2]; SURFACES],
}

impl Shown {
    pub(super) const NOTHING: Self =
        Self { color: [0.0; 4], transmittance: 1.0, layers: 0, tail: 0.0, nearest: [[f64::INFINITY, 0.0]; SURFACES] };

    /// Whether the transmittance is at least `least`, so that surfaces behind still show.
    pub(super) fn lets_through(&self, least: f64) -> bool {
        self.transmittance >= least
    }

    /// The relative distance of the transmittance to `least`.
    pub(super) fn decision(&self, least: f64) -> f64 {
        (self.transmittance / least - 1.0).abs()
    }

    /// Composites a straight colour at `depth` behind the layers so far.
    pub(super) fn with(mut self, [r, g, b, alpha]: [f64; 4], depth: f64) -> Self {
        let shows = self.transmittance * alpha;
        if let Some(surface) = self.nearest.get_mut(self.layers as usize) {
            *surface = [depth, alpha];
        }
        self.color.iter_mut().zip([r, g, b, 1.0]).for_each(|(sum, value)| *sum += shows * value);
        self.transmittance *= 1.0 - alpha;
        self.layers += 1;
        self
    }

    /// Writes the result, over the background, into a pixel of `frame`.
    pub(super) fn write(&self, options: &Settings, decision: f64, frame: &mut Frame, pixel: usize) {
        let [r, g, b, alpha] = self.color;
        let straight = [r, g, b].map(|c| if alpha > 0.0 { c / alpha } else { 0.0 });
        let color = over([straight[0], straight[1], straight[2], alpha], options.background.map(f64::from));
        frame.color[pixel] = color.map(|c| c as f32);
        set(frame, pixel, Map::Transmittance, &[self.transmittance]);
        set(frame, pixel, Map::Layers, &[self.layers.into()]);
        set(frame, pixel, Map::Tail, &[self.tail]);
        set(frame, pixel, Map::Surfaces, self.nearest.as_flattened());
        set(frame, pixel, Map::Decision, &[decision]);
    }
}

/// The depth of a surface: blended, or for a tail that of its nearest fragment.
fn depth_of(sums: &PixelSums, is_tail: bool) -> f64 {
    if is_tail { sums.nearest } else { sums.depth / sums.weight }
}

/// The f64 twin: the image of `strip`, whose triangles are surfaces like all others.
pub fn reference(strip: &Strip<'_>, beside: &Beside<'_>, frame: &mut Frame) {
    let Strip { scene, camera, options, first_row, .. } = *strip;
    let all = if let Composite::Layers(most) = options.composite { most } else { 1 };
    // The rasteriser ends a surface one epsilon behind its nearest fragment (peel.rs).
    let parting = if options.raster.is_some() { Parting::Window } else { Parting::Runs };
    for (pixel, list) in fragments::reference(strip).into_iter().enumerate() {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let along = camera.along_axis(x, y);
        let part = |most: u32| part(&list.fragments, (most, options.tail), parting, (options, along));
        let (mut layers, mut decision) = part(all);
        let triangle = beside.triangle(pixel);
        let (mut most, mut place) = (all, None);
        if let Some(triangle) = &triangle {
            let depth = |number: usize| depth_of(&layers[number], number >= all as usize);
            let margins = (0..layers.len()).map(|number| (depth(number) / triangle.depth - 1.0).abs());
            decision = margins.fold(decision.min(triangle.decision), f64::min);
            let before = (0..layers.len()).take_while(|number| depth(*number) < triangle.depth).count();
            place = Some(before);
            if before < all as usize {
                // The triangle is one of the layers.
                most = all - 1;
                layers = part(most).0;
            } else if options.tail == Tail::None {
                place = None;
            }
        }
        let mut shown = Shown::NOTHING;
        let join = |shown: &mut Shown, number: usize| {
            let here = triangle.as_ref().filter(|_| place == Some(number) && shown.lets_through(LEAST_TRANSMITTANCE));
            let Some(triangle) = here else { return };
            *shown = Shown { tail: shown.tail, ..shown.with(triangle.color, triangle.depth) };
        };
        for (number, sums) in layers.iter().enumerate() {
            join(&mut shown, number);
            if shown.lets_through(LEAST_TRANSMITTANCE) {
                let color = surface(sums, scene, camera, options, (x, y)).0;
                let is_tail = number >= most as usize;
                shown.tail = if is_tail { shown.transmittance * color[3] } else { 0.0 };
                shown = shown.with(color, depth_of(sums, is_tail));
                decision = decision.min(shown.decision(LEAST_TRANSMITTANCE));
            }
        }
        join(&mut shown, layers.len());
        shown.write(options, list.decision.min(decision), frame, pixel);
    }
}

/// The pass's files and constants.
pub const PASS: Pass = Pass {
    name: "layers",
    files: |needs| match needs.surface.lists() {
        Some(Lists::Layers) => vec!["layers.wgsl"],
        _ => Vec::new(),
    },
    kernels: |_| Vec::new(),
    constants: |making| {
        let most = if let Composite::Layers(most) = making.options.composite { most } else { 1 };
        vec![("MOST_LAYERS", most.into()), ("TAIL", u32::from(making.options.tail == Tail::Sum).into())]
    },
};
