//! Bounds on each pixel's error if surfaces show through each other. They combine the bounds of
//! each surface or fragment ([`bounds`](super::bounds)) by the rules of compositing.
//!
//! From front to back, a pixel's transmittance T starts at 1. A surface has the alpha a with error
//! da, and the premultiplied colour p with error dp. It adds T p to the colour and leaves the
//! transmittance T (1 - a). With errors dT of T and dC of the colour, and u = 2^-24:
//!
//! - `dC += dT |p| + T dp + T |p| (d + 6 u)`, as p is divided by a and multiplied again, with the
//!   error d of a division and six roundings;
//! - `dT <- dT (1 - a) + (T + dT) da + 4 u T`.
//!
//! A pixel is **open** if these errors leave undecided whether a front or a back is nearer, where a
//! gap of epsilon lies, or which fragments lie within epsilon of a surface's nearest fragment. With
//! sorted fragments, a pixel is open if the errors leave undecided which of two fragments is
//! nearer. Fragments of disks in the same place are exempt: their depths are the same numbers, and
//! the order of the surfels decides.

use super::bounds::{ColorRange, DIVISION, NOTHING, Pixel, straight};
use super::fragment_bounds::{Fragment, Surface, fragments, weight_error};
use super::precision::E as U;
use crate::passes::project::reference_all;
use crate::passes::sorted::Rules;
use crate::plan::{Accumulator, Facts, Settings, Sides};
use crate::scene::{Camera, Composite, Scene, Tail};

/// The bound on a pixel's colour.
#[derive(Clone, Copy, Debug)]
pub struct Composited {
    /// Whether the device may rightly decide otherwise about something.
    pub open: bool,
    /// Bounds on straight linear RGB, and on alpha.
    pub color: [f64; 4],
}

/// A fragment with its surfel's attributes.
#[derive(Clone, Copy)]
struct Listed {
    fragment: Fragment,
    surface: Surface,
    /// The surfel's centre and half-axes.
    place: [[f32; 3]; 3],
}

/// Returns the bound of each pixel of `scene` seen by `camera`.
pub fn pixels(scene: &Scene, camera: &Camera, options: &Settings) -> Vec<Composited> {
    let splats = reference_all(scene, camera, options);
    let view = (camera, Sides::of(&Facts::of(scene), camera, options));
    let mut lists: Vec<(bool, Vec<Listed>)> = vec![(false, Vec::new()); camera.pixels()];
    fragments(&splats, scene, view, |pixel, splat, surface, f| {
        let (open, list) = &mut lists[pixel];
        *open |= f.may_hit(camera) != f.surely_hits(camera);
        if f.hits(camera) {
            let surfel = &scene.surfels[splat.surfel as usize];
            let place = [surfel.center, surfel.s, surfel.t];
            list.push(Listed { fragment: *f, surface: *surface, place });
        }
    });
    let range = ColorRange::of(scene);
    let known = |(open, mut list): (bool, Vec<Listed>)| {
        list.sort_by(|a, b| a.fragment.depth.total_cmp(&b.fragment.depth));
        let (undecided, shown) = match options.composite {
            Composite::Sorted | Composite::Gaussians => sorted(&list, options),
            _ => layers(&list, options, &range),
        };
        Composited { open: open || undecided, color: shown.bound() }
    };
    lists.into_iter().map(known).collect()
}

/// A premultiplied colour with its alpha, and the error of each channel.
type Known = [[f64; 4]; 2];

/// The composite so far, with the error of the device.
#[derive(Clone, Copy)]
struct Shown {
    color: Known,
    transmittance: f64,
    transmittance_error: f64,
}

impl Shown {
    const NOTHING: Self = Self { color: [[0.0; 4]; 2], transmittance: 1.0, transmittance_error: 0.0 };

    fn with(mut self, [mean, error]: Known, opacity: f64) -> Self {
        let (t, dt) = (self.transmittance, self.transmittance_error);
        for k in 0..4 {
            let (p, dp) = (opacity * mean[k].abs(), opacity * error[k]);
            self.color[0][k] += t * opacity * mean[k];
            self.color[1][k] += dt * p + t * dp + t * p * (DIVISION + 6.0 * U);
        }
        let (alpha, alpha_error) = (opacity * mean[3], opacity * error[3] + U * opacity * mean[3]);
        self.transmittance = t * (1.0 - alpha);
        self.transmittance_error = dt * (1.0 - alpha) + (t + dt) * alpha_error + 4.0 * U * t;
        self
    }

    fn bound(&self) -> [f64; 4] {
        if self.color[0][3] > 0.0 { straight(self.color) } else { [0.0; 4] }
    }
}

/// Composites the fragments one by one, and returns whether the pixel is **open**. A pixel is also
/// open if errors leave undecided whether a fragment is listed, or which fragment is the last.
fn sorted(list: &[Listed], options: &Settings) -> (bool, Shown) {
    let (mut open, mut shown) = (false, Shown::NOTHING);
    let (rules, opacity) = (Rules::of(options), f64::from(options.opacity));
    for pair in list.windows(2) {
        let [a, b] = [&pair[0], &pair[1]];
        let margin = a.fragment.depth_error + b.fragment.depth_error;
        open |= a.place != b.place && b.fragment.depth - a.fragment.depth <= margin;
    }
    for Listed { fragment, surface, .. } in list {
        let weight = fragment.weight(options.kernel);
        let wrong = weight_error(options.kernel, fragment);
        let error = |k: usize| (wrong + 4.0 * U * weight) * surface.color[k].abs();
        let (alpha, alpha_error) = (opacity * weight * surface.color[3], opacity * error(3) + U);
        open |= rules.least_alpha > 0.0 && (alpha - rules.least_alpha).abs() <= alpha_error;
        if alpha < rules.least_alpha {
            continue;
        }
        // If alpha is clamped, the whole premultiplied colour is scaled.
        let cut = (rules.most_alpha / alpha).min(1.0);
        let next = shown.with([surface.color.map(|c| cut * weight * c), [0, 1, 2, 3].map(error)], opacity);
        open |= (next.transmittance - rules.least_shown).abs() <= next.transmittance_error;
        let shows_more = next.transmittance >= rules.least_shown;
        if shows_more || !rules.leaves_last {
            shown = next;
        }
        if !shows_more {
            break;
        }
    }
    (open, shown)
}

fn layers(list: &[Listed], options: &Settings, range: &ColorRange) -> (bool, Shown) {
    let Composite::Layers(most) = options.composite else { return (false, Shown::NOTHING) };
    let rounding = |depth: f64| 4.0 * U * depth.abs();
    let farthest = |f: &Listed, radius: f64| options.epsilon.farthest(f.fragment.depth, radius, 1.0);
    let near = |a: f64, b: f64, margin: f64| (a - b).abs() <= margin;
    let (mut open, mut shown, mut count) = (false, Shown::NOTHING, 0);
    let mut told = [f64::NEG_INFINITY; 2];
    let side = |f: &Listed| usize::from(f.fragment.back);
    while let Some(first) = list.iter().position(|f| f.fragment.depth > told[side(f)]) {
        let last = count == most;
        if last && options.tail == Tail::None {
            break;
        }
        let front = &list[first];
        let margin = |f: &Listed| f.fragment.depth_error + front.fragment.depth_error + rounding(f.fragment.depth);
        let other = list[first..].iter().find(|f| side(f) != side(front) && f.fragment.depth > told[side(f)]);
        open |= other.is_some_and(|other| near(other.fragment.depth, front.fragment.depth, margin(other)));
        let (mut end, mut end_error) = (farthest(front, front.surface.radius), front.fragment.depth_error);
        let mut sums: Pixel = NOTHING;
        for (number, f) in list.iter().enumerate().skip(first) {
            let own = f.fragment.depth <= told[side(f)];
            if own || !last && side(f) != side(front) {
                continue;
            }
            if !last && number > first {
                let window = farthest(front, f.surface.radius);
                open |= near(f.fragment.depth, window, margin(f));
                open |= near(f.fragment.depth, end, f.fragment.depth_error + end_error + rounding(f.fragment.depth));
                if f.fragment.depth > end {
                    break;
                }
                end = end.max(farthest(f, f.surface.radius));
                end_error = end_error.max(f.fragment.depth_error);
                if f.fragment.depth > window {
                    continue;
                }
            }
            sums.add(options.kernel, &f.surface, &f.fragment);
        }
        told[side(front)] = end;
        if last {
            told = [f64::INFINITY; 2];
        }
        shown = shown.with(sums.premultiplied(Accumulator::Fixed.row(), 32, range), f64::from(options.opacity));
        count += 1;
    }
    (open, shown)
}
