//! Builds levels of detail of more points than fit in memory. The file is identical, bit for bit,
//! to that of [`build`](super::build()) and [`write_scene`](crate::io::ply::write_scene).
//!
//! A first pass collects facts about all points (`survey`). The points are then copied into a file
//! and divided at their means into files of fewer points, until a set fits in memory (`runs`). The
//! subtree of such a set is built in memory and stored in files (`kept`). Nodes above subtrees are
//! computed from what is stored. In the end everything is written level by level (`write`). A tree
//! depends on the set of points alone, so it does not matter where it was built.

mod kept;
mod pages;
mod runs;
mod share;
mod sources;
mod survey;
#[cfg(test)]
mod tests;
mod write;

pub use self::share::share;

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use self::kept::{Branch, Kept};
use self::runs::{Run, Runs};
use self::sources::{PIECE, Sources};
use self::survey::Survey;
use super::lattice::Lattice;
use super::moments::Moments;
use super::octree::Octree;
use super::sums::Sums;
use super::{bounds, nodes, scene_as_in_a_file, sorted};
use crate::io::Points;
use crate::io::ply::Rows;
use crate::scene::Scene;
use crate::scene::hierarchy::{DEEPEST, Node};
use crate::surfels::{Preparation, complete};
use crate::{Error, Progress, Result};

/// Memory of the program and its file buffers, bytes. `OF_THREAD` is the memory of each thread for
/// the pieces that it reads.
const PROGRAM: u64 = 96 << 20;
const OF_THREAD: u64 = 48 << 20;

/// Memory for each surfel of a subtree, beside that of the scene, bytes: its lattice coordinates,
/// and its share of the nodes and their sums.
const OF_SURFEL: u64 = 150;

/// The most memory that a scene uses for each surfel, bytes ([`Survey::surfel_bytes`]).
const LARGEST_SURFEL: u64 = 112;

/// At least this many points must fit in memory.
const FEWEST: u64 = 1 << 16;

/// The outcome of [`write_levels`].
#[derive(Clone, Debug)]
pub struct Report {
    /// Surfels that were written.
    pub surfels: u64,
    /// Nodes that were written.
    pub nodes: u64,
    /// Levels of the tree.
    pub levels: u64,
    /// Subtrees that were built in memory, one after the other.
    pub subtrees: u64,
    /// Facts about the preparation of the points, such as how many were dropped.
    pub preparation: Preparation,
}

/// Writes the surfels of all points of `files`, with levels of detail, to the file `path`.
///
/// It takes about `memory` bytes of memory. Unnamed files in `folder` hold intermediate data, up to
/// twice the size of the output.
///
/// # Errors
///
/// [`Error::Usage`] for too little memory, or too many points or nodes; [`Error::Malformed`] for
/// points without a normal or a radius; [`Error::EmptyScene`] without usable points;
/// [`Error::Read`] and [`Error::Write`] from the system.
pub fn write_levels(
    files: &[Rows],
    memory: u64,
    (path, folder): (&Path, &Path),
    progress: &dyn Progress,
) -> Result<Report> {
    let fixed = fixed();
    if memory < fixed + FEWEST * OF_SURFEL {
        // The points have not been read yet, so ask for memory that suffices for any kind.
        return Err(too_little(fixed + FEWEST * (LARGEST_SURFEL + OF_SURFEL)));
    }
    let sources = Sources { files, progress, among: None };
    let survey = Survey::of(&sources)?;
    let of_surfel = survey.surfel_bytes() + OF_SURFEL;
    let fits = memory.saturating_sub(fixed) / of_surfel;
    if fits < FEWEST {
        return Err(too_little(fixed + FEWEST * of_surfel));
    }
    let runs = Runs { survey: &survey, folder, path, progress };
    made(&sources, runs, (fits, of_surfel))
}

/// Memory that does not depend on the number of points, bytes.
fn fixed() -> u64 {
    PROGRAM + OF_THREAD * rayon::current_num_threads() as u64
}

fn too_little(least: u64) -> Error {
    let least = least.div_ceil(1 << 20);
    Error::Usage(format!("--memory is less than the {least}MiB that levels of detail of these points take at least"))
}

/// Writes the file. Subtrees of up to `fits` surfels, at `of_surfel` bytes each, are built in
/// memory.
fn made(sources: &Sources<'_>, runs: Runs<'_>, (fits, of_surfel): (u64, u64)) -> Result<Report> {
    let Runs { survey, folder, path, progress } = runs;
    let root = Lattice::over(&survey.bounds);
    let kept = Kept::new(survey, folder, path)?;
    let mut divider = Divider { runs, kept, fits, of_surfel, lattices: vec![root] };
    if survey.preparation.surfels <= fits {
        let scene = divider.loaded(survey.preparation.surfels, &sources.pieces(), Survey::part)?;
        divider.subtree(scene_as_in_a_file(scene), 0)?;
    } else {
        let run = divider.runs.all(sources, &root)?;
        divider.branch(run, 0)?;
    }
    write::write(path, divider.kept, survey, progress)
}

/// Makes a part of a scene from points.
type MadeOf = fn(&Survey, Points) -> Option<Scene>;

/// A branch, and the sums from which its parent's sums are computed.
struct Summed {
    branch: Branch,
    sums: Sums,
    /// Moments on each lattice of [`Divider::lattices`].
    moments: Vec<Moments>,
}

/// Divides sets, from the root down.
struct Divider<'a> {
    runs: Runs<'a>,
    kept: Kept<'a>,
    /// The number of surfels that fit in memory.
    fits: u64,
    /// Memory for each surfel, bytes.
    of_surfel: u64,
    /// The lattices from the root down to the current set, without repetitions. The places of the
    /// current set are on the last one.
    lattices: Vec<Lattice>,
}

impl Divider<'_> {
    /// Builds the tree of a set that lies `depth` levels below the root.
    fn branch(&mut self, mut run: Run, depth: usize) -> Result<Summed> {
        if run.rows.count() <= self.fits {
            let pieces: Vec<_> = run.rows.pieces(PIECE).into_iter().map(|piece| (&run.rows, piece)).collect();
            let scene = self.loaded(run.rows.count(), &pieces, Survey::part_again)?;
            drop(run);
            return self.subtree(scene, depth);
        }
        let known = self.lattices.len();
        self.lattices.extend(self.runs.refined(&mut run)?);
        let lattice = self.lattices[self.lattices.len() - 1];
        let count = run.rows.count();
        let below = if depth < DEEPEST { self.runs.divided(run, &lattice)? } else { Vec::new() };
        if below.len() < 2 {
            let enough = (fixed() + count * self.of_surfel).div_ceil(1 << 20);
            return Err(Error::Usage(format!(
                "{count} points are too near each other to be divided, and --memory has room for only {} of them: give it {enough}MiB",
                self.fits
            )));
        }
        let children = below.into_iter().map(|run| self.branch(run, depth + 1)).collect::<Result<Vec<_>>>()?;
        let summed = self.above(children, (depth, &lattice));
        self.lattices.truncate(known);
        summed.map(|summed| Summed { moments: summed.moments[..known].to_vec(), ..summed })
    }

    /// Computes the node above some branches. `lattice` is that of the node's set.
    fn above(&mut self, children: Vec<Summed>, (depth, lattice): (usize, &Lattice)) -> Result<Summed> {
        let mut moments = vec![Moments::default(); self.lattices.len()];
        let mut sums = Sums::default();
        for child in &children {
            moments.iter_mut().zip(&child.moments).for_each(|(all, own)| all.add(own));
            sums.add(&child.sums);
        }
        sums.moments = moments[moments.len() - 1];
        let (known, count) = (self.runs.survey.known, children.len() as u32);
        let children = children.into_iter().map(|child| child.branch).collect();
        let branch = self.kept.above(depth, children, |kept, key| {
            let (node, low) = bounds::node(key, &sums, lattice, kept, &known);
            (Node { count, leaf: false, ..node }, low)
        })?;
        Ok(Summed { branch, sums, moments })
    }

    /// Builds the tree of a set that fits in memory.
    fn subtree(&mut self, scene: Scene, depth: usize) -> Result<Summed> {
        let (survey, progress) = (self.runs.survey, self.runs.progress);
        let count = scene.surfels.len() as u32;
        let inherited = self.lattices[self.lattices.len() - 1];
        progress.begin("dividing points", count.into());
        let center = |index: u32| scene.center(index as usize);
        let (tree, points) = Octree::grow_below((inherited, depth), count, center, |points| progress.advance(points));
        progress.end();
        let (scene, places) = sorted(&tree, points, scene);
        let (nodes, sums) = nodes::nodes((&tree, &places), &scene, &survey.known, progress);
        let on = |lattice: &Lattice| Moments::of((0..scene.surfels.len()).map(|k| lattice.place(scene.center(k))));
        let mut moments: Vec<Moments> = Vec::with_capacity(self.lattices.len());
        for (index, lattice) in self.lattices.iter().enumerate() {
            let own = index + 1 == self.lattices.len() && tree.sets[0].lattice == 0;
            moments.push(if own { sums.moments } else { on(lattice) });
        }
        let branch = self.kept.subtree(depth, &tree, &scene, nodes)?;
        Ok(Summed { branch, sums, moments })
    }

    /// Reads `count` surfels from pieces of files, and joins the parts that `made` makes of their
    /// points to one scene.
    fn loaded(&self, count: u64, pieces: &[(&Rows, Range<u64>)], made: MadeOf) -> Result<Scene> {
        loaded(self.runs.survey, (count, pieces), made, self.runs.progress)
    }
}

/// Reads `count` surfels from pieces of files, and joins the parts that `made` makes of their
/// points to one scene.
fn loaded(
    survey: &Survey,
    (count, pieces): (u64, &[(&Rows, Range<u64>)]),
    made: MadeOf,
    progress: &dyn Progress,
) -> Result<Scene> {
    let mut scene = survey.empty.clone();
    survey.reserve(&mut scene, count as usize);
    let read = |(rows, piece): &(&Rows, Range<u64>)| {
        let points = rows.points(&rows.bytes(piece.clone())?)?;
        progress.advance(points.positions.len() as u64);
        made(survey, points).ok_or_else(|| rows.malformed("it changed while it was read"))
    };
    progress.begin("reading points", count);
    let loaded = pieces.chunks(rayon::current_num_threads()).try_for_each(|pieces| {
        let parts: Vec<Scene> = pieces.par_iter().map(read).collect::<Result<_>>()?;
        parts.into_iter().for_each(|part| complete::append(&mut scene, part));
        Ok(())
    });
    progress.end();
    loaded.map(|()| scene)
}
