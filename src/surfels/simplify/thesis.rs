//! Growing and selection as in Tien 2008 (sections 4.1 to 4.3), for comparison: the parent module
//! describes what it does instead.
//!
//! ```text
//! graph    = 10 nearest neighbours
//! grow     = from a point breadth first, nearest first, until one is farther from its plane than
//!            the tolerance; the radius is that of the farthest point before
//! conquers = what growth reaches within RATIO times the radius
//! Q        = the sum of w = pi d^2 over what it conquers and no selected one does, d to the tenth
//!            neighbour
//! select   = the greatest Q, until all are 0
//! ```
//!
//! Nothing guarantees that the surface between points is covered; RATIO, 0.5 to 0.7 in the thesis,
//! makes it likely.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::Report;
use super::outcome::Slopes;
use super::samples::Samples;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::scene::low_parts;
use crate::scene::{Colors, Scene, Surfel};
use crate::surfels::Coordinates;
use crate::surfels::neighbours::{Neighbour, NeighbourSearch};
use crate::surfels::texture::{in_world, slopes_along};

/// The number of neighbours of a point, K in the thesis.
const NEIGHBOURS: usize = 10;

/// A point that a growing splat will visit, or a splat with its contribution; the greatest value
/// comes first, and among equal values the lower index.
#[derive(PartialEq)]
struct Next(f64, u32);

impl Eq for Next {}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The graph: the neighbours of each point, and its surface area element, square scaled units.
struct Graph {
    neighbours: Vec<[u32; NEIGHBOURS]>,
    elements: Vec<f64>,
}

impl Graph {
    fn new(samples: &Samples) -> Self {
        let search = NeighbourSearch::new(&samples.positions, NEIGHBOURS);
        let of = |found: &mut Vec<Neighbour>, index: u32| {
            search.nearest(index, found);
            // If there are fewer points, the point itself fills the rest.
            let neighbours = std::array::from_fn(|k| found.get(k).map_or(index, |neighbour| neighbour.index));
            let squared = found.last().map_or(1.0, |last| last.squared_distance);
            (neighbours, std::f64::consts::PI * squared)
        };
        let all = (0..samples.len() as u32).into_par_iter().map_init(Vec::new, of);
        let (neighbours, elements) = all.unzip();
        Self { neighbours, elements }
    }
}

/// The buffers of a thread that grows splats one after the other.
#[derive(Default)]
struct Growth {
    /// For each point, the number of the last growth that met it.
    met: Vec<u32>,
    /// The number of the growth.
    number: u32,
    front: BinaryHeap<Next>,
    /// The points that the last growth reached, nearest first, and their distances, scaled units.
    reached: Vec<(u32, f64)>,
}

impl Growth {
    /// Grows from `seed` over points that are at most `limit` away, until the first one that is
    /// farther from the plane than `tolerance`.
    fn grow(&mut self, seed: u32, (samples, graph): (&Samples, &Graph), tolerance: f64, limit: f64) {
        self.met.resize(samples.len(), 0);
        if self.number == u32::MAX {
            self.met.fill(0);
            self.number = 0;
        }
        self.number += 1;
        self.front.clear();
        self.reached.clear();
        let (center, normal) = (samples.positions.position(seed), samples.normals[seed as usize]);
        self.met[seed as usize] = self.number;
        self.front.push(Next(0.0, seed));
        while let Some(Next(nearness, point)) = self.front.pop() {
            let offset = samples.positions.position(point) - center;
            if offset.dot(normal).abs() > tolerance {
                break;
            }
            self.reached.push((point, -nearness));
            for &other in &graph.neighbours[point as usize] {
                let distance = samples.positions.position(other).distance(center);
                if self.met[other as usize] != self.number && distance <= limit {
                    self.met[other as usize] = self.number;
                    self.front.push(Next(-distance, other));
                }
            }
        }
    }

    /// The surface area that the splat would add to what is `covered`.
    fn contribution(&self, graph: &Graph, covered: &[bool]) -> f64 {
        self.reached
            .iter()
            .filter(|(point, _)| !covered[*point as usize])
            .map(|(p, _)| graph.elements[*p as usize])
            .sum()
    }
}

/// The selected splats.
#[derive(Default)]
struct Selection {
    /// The points from which the splats grew, and their radii, scaled units.
    splats: Vec<(u32, f64)>,
    /// The slopes of the splats' texture coordinates; zero if points have none.
    slopes: Vec<Slopes>,
    /// The largest distance of a point from the plane of a splat that conquers it, scaled units.
    largest: f64,
    /// The sum of these distances, weighted by surface area elements, and the sum of the elements.
    sums: [f64; 2],
}

impl Selection {
    fn add(&mut self, (seed, radius): (u32, f64), growth: &Growth, (samples, graph): (&Samples, &Graph)) {
        self.splats.push((seed, radius));
        self.slopes.push(slopes(seed, growth, samples));
        for &(point, _) in &growth.reached {
            let offset = samples.positions.position(point) - samples.positions.position(seed);
            let (off, element) = (offset.dot(samples.normals[seed as usize]).abs(), graph.elements[point as usize]);
            self.largest = self.largest.max(off);
            self.sums = [self.sums[0] + element * off, self.sums[1] + element];
        }
    }
}

/// The slopes of texture coordinates in the plane of the point `seed`, per world unit, by least
/// squares over the points that the splat reaches without crossing a seam. All are zero, that is
/// unknown, if it reaches none, or if points have no texture coordinates.
fn slopes(seed: u32, growth: &Growth, samples: &Samples) -> Slopes {
    if samples.places.is_empty() {
        return Slopes::default();
    }
    let (s, t) = samples.normals[seed as usize].any_orthonormal_pair();
    let reached = growth.reached.iter().map(|(point, _)| *point);
    let steps = reached.filter(|point| *point != seed && !samples.has_seam(seed, *point)).map(|point| {
        let (offset, gain) = samples.step(seed, point);
        (offset / samples.positions.scale(), gain)
    });
    in_world(slopes_along([s, t], steps), [s, t])
}

/// Seeds that are grown to estimate the work, and the most points that all seeds may reach
/// together, a quarter of an hour's work of a processor of 2026.
const TRIED: u32 = 64;
const MOST_REACHED: f64 = 1e10;

/// Fails if all splats together reach so many points that growing them takes hours, as on a plane,
/// where each reaches all.
fn check_reach(samples: &Samples, graph: &Graph, tolerance: f64) -> Result<()> {
    let step = (samples.len() as u32).div_ceil(TRIED).max(1);
    let reach = |growth: &mut Growth, seed: u32| {
        growth.grow(seed, (samples, graph), tolerance, f64::INFINITY);
        growth.reached.len() as f64
    };
    let seeds = (0..samples.len() as u32).step_by(step as usize).collect::<Vec<_>>();
    let reached: f64 = seeds.par_iter().map_init(Growth::default, |growth, seed| reach(growth, *seed)).sum();
    let each = reached / seeds.len().max(1) as f64;
    if each * samples.len() as f64 <= MOST_REACHED {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "each of {} points reaches about {each:.0} others within this tolerance, and growing takes hours: take a smaller \
         --tolerance, or --cover cells",
        samples.len()
    )))
}

/// Selects splats as in the thesis.
fn select(samples: &Samples, tolerance: f64, ratio: f64, progress: &dyn Progress) -> Result<Selection> {
    let graph = Graph::new(samples);
    check_reach(samples, &graph, tolerance)?;
    progress.begin("growing splats", samples.len() as u64);
    let none = vec![false; samples.len()];
    let grown = |growth: &mut Growth, seed: u32| {
        growth.grow(seed, (samples, &graph), tolerance, f64::INFINITY);
        let radius = growth.reached.iter().map(|(_, distance)| *distance).fold(0.0, f64::max);
        growth.grow(seed, (samples, &graph), tolerance, ratio * radius);
        progress.advance(1);
        (radius, growth.contribution(&graph, &none))
    };
    let (radii, contributions): (Vec<f64>, Vec<f64>) =
        (0..samples.len() as u32).into_par_iter().map_init(Growth::default, grown).unzip();
    progress.end();
    progress.begin("selecting splats", samples.len() as u64);
    let mut heap: BinaryHeap<Next> = contributions.into_iter().zip(0..).map(|(q, point)| Next(q, point)).collect();
    let (mut covered, mut selected, mut growth) = (none, Selection::default(), Growth::default());
    // Contributions only fall, so an entry that is still the greatest when computed again is the
    // greatest of all.
    while let Some(Next(_, seed)) = heap.pop() {
        growth.grow(seed, (samples, &graph), tolerance, ratio * radii[seed as usize]);
        let own = growth.contribution(&graph, &covered);
        if own == 0.0 {
            continue;
        }
        if heap.peek().is_some_and(|next| Next(own, seed) < *next) {
            heap.push(Next(own, seed));
            continue;
        }
        selected.add((seed, radii[seed as usize]), &growth, (samples, &graph));
        for (point, _) in &growth.reached {
            progress.advance(u64::from(!covered[*point as usize]));
            covered[*point as usize] = true;
        }
    }
    progress.end();
    Ok(selected)
}

/// Simplifies `scene` as in the thesis, to disks that are each centred at a surfel and have its
/// colour and texture coordinates. The tolerance is in world units; a disk conquers the points
/// within `ratio` times its radius.
///
/// # Errors
///
/// [`Error::Usage`] for more than 2^32 - 1 surfels, for a tolerance that is not finite or below 0,
/// for a ratio that is not above 0 and at most 1, and if growing would take hours.
pub fn as_in_the_thesis(
    (scene, coordinates): (&Scene, &Coordinates),
    tolerance: f64,
    ratio: f64,
    progress: &dyn Progress,
) -> Result<(Scene, Coordinates, Report)> {
    if !(tolerance.is_finite() && tolerance >= 0.0 && ratio > 0.0 && ratio <= 1.0) {
        return Err(Error::Usage(format!(
            "a tolerance is finite and at least 0, and a ratio above 0 and at most 1: {tolerance} and {ratio} are not"
        )));
    }
    let samples = Samples::new(scene, coordinates)?;
    let scale = samples.positions.scale();
    let Selection { splats: selected, slopes, largest, sums: [off, area] } =
        select(&samples, tolerance * scale, ratio, progress)?;
    let mut kept = Coordinates { atlas: coordinates.atlas, ..Coordinates::default() };
    if !samples.places.is_empty() {
        kept.centers = selected.iter().map(|(point, _)| samples.places[*point as usize].as_vec2().to_array()).collect();
        kept.slopes = slopes;
    }
    let disk = |&(point, radius): &(u32, f64)| {
        // The disk of a point that conquers no other point is as large as that point's surfel.
        let radius = if radius > 0.0 { radius } else { samples.radii[point as usize] } / scale;
        let center = samples.positions.position(point) / scale;
        Surfel::disk(center.as_vec3(), samples.normals[point as usize].as_vec3(), radius as f32)
    };
    let surfels: Vec<Surfel> = selected.iter().map(disk).collect();
    let low = low_parts(&surfels, |index| samples.positions.position(selected[index].0) / scale);
    let color = |&(point, _): &(u32, f64)| super::outcome::mean_color(samples.colors[point as usize], 1.0);
    let colors = match scene.colors {
        Colors::Constant(color) => Colors::Constant(color),
        _ => Colors::Linear(selected.iter().map(color).collect()),
    };
    let count = selected.len() as u64;
    let report = Report {
        surfels: scene.surfels.len() as u64,
        distinct_positions: samples.len() as u64,
        selected: count,
        before_relaxation: count,
        tolerance,
        max_deviation: largest / scale,
        mean_deviation: off / area / scale,
        beyond_tolerance: 0,
    };
    let Scene { origin, encoded, oriented, closed, up, .. } = *scene;
    Ok((Scene { origin, surfels, low, colors, encoded, oriented, closed, up, ..Scene::default() }, kept, report))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use super::*;

    /// Points on a sphere, in a known order.
    fn sphere(count: u32) -> Scene {
        let disk = |k: u32| {
            let (z, angle) = (1.0 - (2.0 * k as f32 + 1.0) / count as f32, 2.399_963 * k as f32);
            let normal = Vec3::new(angle.cos() * (1.0 - z * z).sqrt(), angle.sin() * (1.0 - z * z).sqrt(), z);
            Surfel::disk(normal, normal, 0.1)
        };
        Scene { surfels: (0..count).map(disk).collect(), oriented: true, ..Scene::default() }
    }

    /// The selection is the greedy one: each time the splat that adds most.
    #[test]
    fn the_greatest_contribution_is_selected_first() {
        let scene = sphere(300);
        let samples = Samples::new(&scene, &Coordinates::default()).unwrap();
        let (tolerance, ratio) = (0.15 * samples.positions.scale(), 0.6);
        let graph = Graph::new(&samples);
        let conquered = |seed: u32| {
            let mut growth = Growth::default();
            growth.grow(seed, (&samples, &graph), tolerance, f64::INFINITY);
            let radius = growth.reached.iter().map(|(_, distance)| *distance).fold(0.0, f64::max);
            let mut growth = Growth::default();
            growth.grow(seed, (&samples, &graph), tolerance, ratio * radius);
            growth
        };
        let all: Vec<Growth> = (0..300).map(conquered).collect();
        let (mut covered, mut expected) = (vec![false; 300], Vec::new());
        loop {
            let adds = |seed: &u32| Next(all[*seed as usize].contribution(&graph, &covered), *seed);
            let Some(Next(gain, seed)) = (0..300).map(|seed| adds(&seed)).max() else { break };
            if gain == 0.0 {
                break;
            }
            expected.push(seed);
            all[seed as usize].reached.iter().for_each(|(point, _)| covered[*point as usize] = true);
        }
        let selected = select(&samples, tolerance, ratio, &()).unwrap();
        assert_eq!(selected.splats.iter().map(|(seed, _)| *seed).collect::<Vec<_>>(), expected);
        assert!((10..100).contains(&expected.len()), "{}", expected.len());
    }

    #[test]
    fn growth_that_would_take_hours_and_numbers_without_sense_are_refused() {
        let scene = sphere(300);
        let by =
            |tolerance: f64, ratio: f64| as_in_the_thesis((&scene, &Coordinates::default()), tolerance, ratio, &());
        for (tolerance, ratio) in [(f64::NAN, 0.6), (-1.0, 0.6), (0.01, 0.0), (0.01, 1.5), (0.01, f64::NAN)] {
            assert!(matches!(by(tolerance, ratio), Err(Error::Usage(_))), "{tolerance} {ratio}");
        }
        assert!(by(0.01, 1.0).is_ok());
        let flat = |k: u32| Surfel::disk(Vec3::new((k % 400) as f32, (k / 400) as f32, 0.0), Vec3::Z, 1.0);
        let plane = Scene { surfels: (0..120_000).map(flat).collect(), oriented: true, ..Scene::default() };
        let error = as_in_the_thesis((&plane, &Coordinates::default()), 0.01, 0.6, &()).unwrap_err().to_string();
        assert!(error.contains("each of 120000 points reaches about"), "{error}");
    }
}
