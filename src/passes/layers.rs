//! Stage 4 of [`Composite::Layers`]: the fragments of a pixel are parted into surfaces, each is blended as the nearest
//! one always is, and they are composited from front to back.
//!
//! # Where a surface ends
//!
//! The fragment nearest of those that no layer has yet starts one. Those of its side that lie within epsilon of it are blended, as in an
//! opaque picture; those of its side that follow, each within epsilon of one before it, belong to the same surface but lie behind what shows
//! of it, and are passed over. So a surface ends at the first gap of epsilon, as 3DSS merges the intervals of its kernels: a window of
//! one epsilon behind the nearest fragment would cut a surface that the ray meets at a grazing angle, or at a crease, in two. Where
//! normals have sides a front and a back are two surfaces, however near they lie.
//!
//! Sums are those of [`accumulate`](mod@super::accumulate), in integers, of the same terms, so a layer of alpha 1 that is nearest has the bits of the
//! opaque picture that leaves no backs out; and a picture all of whose alphas are 1 is drawn as one.

use super::Strip;
use super::accumulate::PixelSums;
use super::fragments::{self, Fragment};
use super::resolve::{over, set, surface};
use crate::frame::Frame;
use crate::plan::pass::Pass;
use crate::plan::{Lists, RenderOptions};
use crate::scene::composite::LEAST_TRANSMITTANCE;
use crate::scene::maps::SURFACES;
use crate::scene::{Composite, Map, Tail};

/// How a pixel's fragments are parted into surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parting {
    /// At the first gap of epsilon.
    Runs,
    /// An epsilon behind the nearest fragment: what the rasteriser peels, and runs are compared with.
    Window,
}

/// The surfaces of a pixel from front to back, at most `most` and, of what follows, one more if there is a tail; and the smallest relative
/// distance to a decision.
pub fn part(
    list: &[Fragment],
    (most, tail): (u32, Tail),
    parting: Parting,
    (options, along): (&RenderOptions, f64),
) -> (Vec<PixelSums>, f64) {
    let farthest = |depth: f64, radius: f64| options.epsilon.farthest(depth, radius, along);
    let (mut layers, mut decision) = (Vec::new(), f64::INFINITY);
    // How far each side is told: to where its run ends, or as far as the window of each fragment's own epsilon behind the last front reaches.
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
        // Of a front and a back at one depth but for rounding either may be the nearer surface.
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

/// What is composited so far, from front to back.
#[derive(Clone, Copy)]
pub(super) struct Shown {
    /// Premultiplied.
    color: [f64; 4],
    transmittance: f64,
    layers: u32,
    /// Of the last one, if it is a tail.
    tail: f64,
    /// Depth and alpha.
    nearest: [[f64; 2]; SURFACES],
}

impl Shown {
    pub(super) const NOTHING: Self =
        Self { color: [0.0; 4], transmittance: 1.0, layers: 0, tail: 0.0, nearest: [[f64::INFINITY, 0.0]; SURFACES] };

    /// Whether it lets `least` through, so that what lies behind still shows.
    pub(super) fn lets_through(&self, least: f64) -> bool {
        self.transmittance >= least
    }

    /// The relative distance to letting just `least` through.
    pub(super) fn decision(&self, least: f64) -> f64 {
        (self.transmittance / least - 1.0).abs()
    }

    /// With a straight colour behind, at a depth.
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

    /// Writes it, over the background, into a pixel of `frame`.
    pub(super) fn write(&self, options: &RenderOptions, decision: f64, frame: &mut Frame, pixel: usize) {
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

/// The twin: the image of `strip`.
pub fn reference(strip: &Strip<'_>, frame: &mut Frame) {
    let Strip { scene, camera, options, first_row, .. } = *strip;
    let most = if let Composite::Layers(most) = options.composite { most } else { 1 };
    // The rasteriser's layers are windows (peel.rs).
    let parting = if options.raster.is_some() { Parting::Window } else { Parting::Runs };
    for (pixel, list) in fragments::reference(strip).into_iter().enumerate() {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let along = camera.along_axis(x, y);
        let (layers, mut decision) = part(&list.fragments, (most, options.tail), parting, (options, along));
        let mut shown = Shown::NOTHING;
        for (number, sums) in layers.iter().enumerate() {
            if shown.lets_through(LEAST_TRANSMITTANCE) {
                let color = surface(sums, scene, camera, options, (x, y)).0;
                let is_tail = number >= most as usize;
                shown.tail = if is_tail { shown.transmittance * color[3] } else { 0.0 };
                shown = shown.with(color, if is_tail { sums.nearest } else { sums.depth / sums.weight });
                decision = decision.min(shown.decision(LEAST_TRANSMITTANCE));
            }
        }
        shown.write(options, list.decision.min(decision), frame, pixel);
    }
}

/// The files and constants.
pub const PASS: Pass = Pass {
    name: "layers",
    files: |needs| match needs.lists {
        Some(Lists::Layers) => vec!["layers.wgsl"],
        _ => Vec::new(),
    },
    kernels: |_| Vec::new(),
    constants: |making| {
        let most = if let Composite::Layers(most) = making.options.composite { most } else { 1 };
        vec![("MOST_LAYERS", most.into()), ("TAIL", u32::from(making.options.tail == Tail::Sum).into())]
    },
};
