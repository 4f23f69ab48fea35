//! Surveys a cloud: the surfels that a renderer would make of it, and how well they cover it.
//!
//! Surfels of a large cloud take many times as long as reading it, so only some places of it are
//! examined, all points there. What no neighbours are needed for is counted over all points.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::build::{Given, built};
use super::coverage::coverage_among;
use super::gather::{Gathered, gather};
use super::spacing::spacing;
use super::{Coverage, Limits, Preparation, build, coverage, guess_up, origin_for};
use crate::io::{Points, settle_colors};
use crate::random::mixed;
use crate::scene::{Listed, Provenance, Scene, core_and_box, framed_within};
use crate::{Progress, Result};

/// A cloud with at most this many points is examined as a whole.
const WHOLE: usize = 1 << 20;

/// The examined places of larger clouds hold at least this many points. Shares of surfels then err
/// by about a percent where neighbouring places are alike.
const EXAMINED: u64 = 1 << 16;

/// The examined places hold at least this many times the points of the largest of them, so that
/// none of them decides the result.
const TIMES_LARGEST: u64 = 32;

/// The side of a place, which is a cube, in spacings: about a thousand points of a surface.
const SIDE: f64 = 32.0;

/// Points at most this far around a place are neighbours of those in it, spacings: 64 neighbours
/// reach 4.5 spacings far, and their own neighbours 2.3.
const MARGIN: f64 = 8.0;

/// The surfels that a renderer would make of a cloud, and how well they cover it.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The scene; of a sampled cloud, the surfels in and around the examined places.
    pub scene: Scene,
    /// The counts of all points' preparation. Of a sampled cloud, those that depend on neighbours
    /// are estimates.
    pub preparation: Preparation,
    /// The scene's origin, world coordinates.
    pub origin: DVec3,
    /// The largest half-axis, world units: of all points that have one, and of the examined
    /// surfels.
    pub largest_radius: f32,
    /// How well the surfels cover the surface; None for Gaussians, and if all points are at one
    /// position. Of a sampled cloud, its counts are estimates.
    pub coverage: Option<Coverage>,
    /// The examined places; None if the whole cloud was examined.
    pub sample: Option<Sample>,
}

/// The part of a large cloud that was examined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Sample {
    /// The number of points whose surfels were examined.
    pub points: u64,
    /// The number of places that hold them.
    pub places: u64,
}

/// Surveys the points of one input; of a large cloud some places, unless `all` is set.
///
/// A hash of their coordinates chooses the places, so the result is the same for any order of the
/// points. Meshes, Gaussians and files with levels of detail are examined as a whole.
///
/// # Errors
///
/// The errors of [`build`](super::build()).
pub fn survey(points: Points, all: bool, progress: &dyn Progress) -> Result<Survey> {
    surveyed(points, if all { usize::MAX } else { WHOLE }, progress)
}

/// As [`survey`], of some places if there are more than `whole` points.
fn surveyed(points: Points, whole: usize, progress: &dyn Progress) -> Result<Survey> {
    let is_plain = points.faces.is_none() && points.tree.is_none() && points.whole.is_none() && !points.encoded;
    if !is_plain || points.positions.len() <= whole {
        let (scene, preparation) = build(vec![points], progress)?;
        return of_whole(scene, preparation, progress);
    }
    let mut inputs = vec![points];
    settle_colors(&mut inputs);
    let mut gathered = gather(inputs)?;
    let positions = &gathered.points.positions;
    let listed = Listed(positions.len(), |index: usize| (DVec3::from_array(positions[index]), 0.0));
    let (core, bounds) = core_and_box(&listed);
    let (body, _, strays) = framed_within(core, bounds, &listed);
    let places = spacing(positions, &body).and_then(|spacing| Places::chosen(positions, body.min, spacing));
    let Some(places) = places else {
        let ((scene, preparation), _) = built(gathered, &Limits::default(), progress)?;
        return of_whole(scene, preparation, progress);
    };
    let counted = counted(&mut gathered, strays);
    let largest_given = Given(&gathered).largest_radius();
    let up = *gathered.points.up.get_or_insert_with(|| guess_up(&body));
    let examined = places.keep(&mut gathered);
    let ((mut scene, sampled), _) = built(gathered, &Limits::default(), progress)?;
    (scene.up, scene.oriented) = (up, scene.oriented && counted.estimated_normals == 0);
    let points = examined.iter().filter(|examined| **examined).count() as u64;
    let radii = scene.surfels.iter().zip(&examined).filter(|(_, examined)| **examined);
    let largest_radius = radii.map(|(surfel, _)| surfel.radius()).fold(largest_given, f32::max);
    let scaled = |count: u64, of: u64| (count as f64 * counted.surfels as f64 / of.max(1) as f64).round() as u64;
    let of_built = |count: u64| scaled(count, sampled.surfels);
    let coverage = coverage_among(&scene, Some(&examined), progress)?.map(|found| Coverage {
        open: scaled(found.open, points),
        lone: scaled(found.lone, points),
        ..found
    });
    let preparation = Preparation {
        distinct_positions: sampled.distinct_positions.map(of_built),
        opposed_normals: of_built(sampled.opposed_normals),
        // At the rim of the margin, points lack neighbours that they have in the cloud.
        limited_by_neighbours: None,
        limited_radii: of_built(sampled.limited_radii),
        rounding: sampled.rounding,
        median_spacing: sampled.median_spacing,
        ..counted
    };
    let sample = Some(Sample { points, places: places.chosen });
    Ok(Survey { scene, preparation, origin: origin_for(&body), largest_radius, coverage, sample })
}

fn of_whole(scene: Scene, preparation: Preparation, progress: &dyn Progress) -> Result<Survey> {
    // Gaussians are no samples of a closed surface, so gaps between them mean nothing.
    let coverage = if scene.encoded { None } else { coverage(&scene, progress)? };
    let (origin, largest_radius) = (scene.origin, scene.largest_radius());
    Ok(Survey { scene, preparation, origin, largest_radius, coverage, sample: None })
}

/// The counts of all points for which no neighbours are needed.
fn counted(gathered: &mut Gathered, strays: u64) -> Preparation {
    let preparation = std::mem::take(&mut gathered.preparation);
    let (given, count) = (Given(gathered), gathered.points.positions.len());
    let lacking = |lacks: &(dyn Fn(usize) -> bool + Sync)| (0..count).into_par_iter().filter(|i| lacks(*i)).count();
    Preparation {
        surfels: count as u64,
        guessed_up: gathered.points.up.is_none(),
        estimated_normals: lacking(&|i| given.lacks_normal(i)) as u64,
        estimated_radii: lacking(&|i| given.lacks_radius(i)) as u64,
        strays,
        ..preparation
    }
}

/// A cell of the grid of places.
type Cell = [i32; 3];

/// The examined places: cells of a grid.
struct Places {
    low: DVec3,
    /// The side of a cell, and the width of the margin around the chosen ones, world units.
    side: f64,
    margin: f64,
    /// The chosen cells (true), and those beside them.
    cells: HashMap<Cell, bool>,
    /// The number of chosen cells.
    chosen: u64,
}

/// A point that is no neighbour of an examined one, a neighbour of one, or an examined one.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    None,
    Neighbour,
    Examined,
}

impl Places {
    /// Chooses places with [`EXAMINED`] points or more; None if those are half of all or more.
    fn chosen(positions: &[[f64; 3]], low: DVec3, spacing: f64) -> Option<Self> {
        let mut places = Self { low, side: SIDE * spacing, margin: MARGIN * spacing, cells: HashMap::new(), chosen: 0 };
        let mut counts: Vec<(u64, Cell, u64)> =
            places.counts(positions).into_iter().map(|(cell, count)| (hash(cell), cell, count)).collect();
        counts.sort_unstable();
        let (mut held, mut largest) = (0, 0);
        for (_, cell, count) in counts {
            if held >= EXAMINED.max(TIMES_LARGEST * largest) {
                break;
            }
            (held, largest) = (held + count, largest.max(count));
            places.choose(cell);
        }
        (2 * held < positions.len() as u64).then_some(places)
    }

    /// The cell of a position; those far outside the body share the outermost cells.
    fn cell(&self, position: DVec3) -> Cell {
        ((position - self.low) / self.side).floor().to_array().map(|c| (c as i32).clamp(-(1 << 30), 1 << 30))
    }

    /// The number of positions in each cell.
    fn counts(&self, positions: &[[f64; 3]]) -> HashMap<Cell, u64> {
        let of_part = |part: &[[f64; 3]]| {
            let mut counts = HashMap::new();
            // Most points follow one of the same cell.
            for run in part.chunk_by(|a, b| self.cell(DVec3::from_array(*a)) == self.cell(DVec3::from_array(*b))) {
                *counts.entry(self.cell(DVec3::from_array(run[0]))).or_insert(0) += run.len() as u64;
            }
            counts
        };
        positions.par_chunks(1 << 16).map(of_part).reduce(HashMap::new, |mut all, part| {
            part.into_iter().for_each(|(cell, count)| *all.entry(cell).or_insert(0) += count);
            all
        })
    }

    fn choose(&mut self, cell: Cell) {
        let [x, y, z] = cell;
        for (x, y, z) in (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| (x + i, y + j, z + k))))
        {
            *self.cells.entry([x, y, z]).or_insert(false) |= [x, y, z] == cell;
        }
        self.chosen += 1;
    }

    /// Keeps the points in and around the chosen cells. Returns for each of them whether it is in
    /// one.
    fn keep(&self, gathered: &mut Gathered) -> Vec<bool> {
        let of_part = |part: &[[f64; 3]]| -> Vec<Role> {
            let mut last = (None, None);
            let role = |position: &[f64; 3]| {
                let position = DVec3::from_array(*position);
                let cell = self.cell(position);
                if last.0 != Some(cell) {
                    last = (Some(cell), self.cells.get(&cell));
                }
                match last.1 {
                    Some(true) => Role::Examined,
                    Some(false) if self.is_near(position) => Role::Neighbour,
                    _ => Role::None,
                }
            };
            part.iter().map(role).collect()
        };
        let roles: Vec<Role> = gathered.points.positions.par_chunks(1 << 16).flat_map_iter(of_part).collect();
        let keep: Vec<bool> = roles.par_iter().map(|role| *role != Role::None).collect();
        gathered.provenance = Provenance::default();
        gathered.points.retain(&keep);
        roles.into_iter().filter(|role| *role != Role::None).map(|role| role == Role::Examined).collect()
    }

    /// Whether a position lies in the margin around a chosen cell.
    fn is_near(&self, position: DVec3) -> bool {
        let margins = [-self.margin, 0.0, self.margin];
        let steps = margins.into_iter().flat_map(|x| margins.map(move |y| (x, y)));
        let mut all = steps.flat_map(|(x, y)| margins.map(move |z| DVec3::new(x, y, z)));
        all.any(|step| self.cells.get(&self.cell(position + step)) == Some(&true))
    }
}

/// A hash of a cell's coordinates.
fn hash(cell: Cell) -> u64 {
    cell.into_iter().fold(0, |hash, c| mixed(hash ^ c as u32 as u64).wrapping_add(1))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::Random;

    /// Rough ground of 400,000 points in map coordinates, a tenth of it without the normals that
    /// the rest has.
    fn ground(reversed: bool) -> Points {
        let mut random = Random::stream(9, 0);
        let mut number = || random.number();
        let at = |k: u32| {
            let (x, y) = (f64::from(k % 800) + 0.5 * number(), f64::from(k / 800) + 0.5 * number());
            [7e5 + 0.25 * x, 5e6 + 0.25 * y, 5.0 * (0.02 * x).sin() + 0.02 * number()]
        };
        let mut positions: Vec<[f64; 3]> = (0..400_000).map(at).collect();
        positions.extend([[0.0; 3], [f64::NAN; 3]]);
        let mut normals: Vec<[f32; 3]> =
            (0..400_002).map(|k| if k % 10 == 0 { [0.0; 3] } else { [0.0, 0.0, 1.0] }).collect();
        if reversed {
            positions.reverse();
            normals.reverse();
        }
        Points { positions, normals: Some(normals), ..Points::default() }
    }

    #[test]
    fn some_places_tell_of_the_whole() {
        let whole = surveyed(ground(false), usize::MAX, &()).unwrap();
        let some = surveyed(ground(false), 1000, &()).unwrap();
        let sample = some.sample.unwrap();
        assert!(sample.points >= EXAMINED && sample.points < 100_000 && sample.places > 20, "{sample:?}");
        let (found, all) = (some.coverage.unwrap(), whole.coverage.unwrap());
        assert!((found.spacing / all.spacing - 1.0).abs() < 0.02, "{found:?} {all:?}");
        assert!((found.covered - all.covered).abs() < 0.01, "{found:?} {all:?}");
        assert!((found.covered_aslant - all.covered_aslant).abs() < 0.03, "{found:?} {all:?}");
        assert_eq!((whole.sample, some.origin, some.scene.up), (None, whole.origin, whole.scene.up));
        let counts = |survey: &Survey| {
            let Preparation { points, dropped_non_finite, surfels, estimated_normals, estimated_radii, strays, .. } =
                survey.preparation;
            [points, dropped_non_finite, surfels, estimated_normals, estimated_radii, strays]
        };
        assert_eq!(counts(&some), counts(&whole));
        assert_eq!(counts(&some)[1..], [1, 400_001, 40_001, 400_001, 1]);
        // Given radii are all examined.
        let mut given = ground(false);
        let mut radii = vec![1.0; given.positions.len()];
        radii[123_456] = 50.0;
        given.radii = Some(radii);
        assert_eq!(surveyed(given, 1000, &()).unwrap().largest_radius, 50.0);
        // Another order of the points chooses the same places.
        let reversed = surveyed(ground(true), 1000, &()).unwrap();
        assert_eq!(reversed.sample, some.sample);
        assert_eq!((reversed.coverage, reversed.largest_radius), (some.coverage, some.largest_radius));
    }

    /// Dense clusters on sparse ground: no place with a share of the points decides the result.
    #[test]
    fn places_of_many_points_need_many_others() {
        let mut random = Random::stream(10, 0);
        let mut number = || random.number();
        let mut positions: Vec<[f64; 3]> = (0..300_000).map(|_| [1000.0 * number(), 1000.0 * number(), 0.0]).collect();
        let places = |positions: &[[f64; 3]]| Places::chosen(positions, DVec3::ZERO, 1.0);
        assert!(places(&positions).is_some());
        let mut clusters: Vec<[f64; 3]> = (0..8)
            .flat_map(|k| vec![[125.0 * f64::from(k) + 16.0, 16.0, 0.0]; 20_000])
            .map(|[x, y, z]| [x + number(), y + number(), z])
            .collect();
        positions.append(&mut clusters);
        if let Some(places) = places(&positions) {
            let of = |cell: &Cell| positions.iter().filter(|p| places.cell(DVec3::from_array(**p)) == *cell).count();
            let held = places.cells.iter().filter(|(_, chosen)| **chosen).map(|(cell, _)| of(cell));
            let held: Vec<usize> = held.collect();
            assert!(held.iter().sum::<usize>() >= 32 * held.iter().max().unwrap(), "{held:?}");
        }
    }
}
