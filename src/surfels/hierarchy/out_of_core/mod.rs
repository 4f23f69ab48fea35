//! Levels of detail of more points than memory has room for: the same file, to the bit, as of [`build`](super::build()) and [`write_scene`](crate::io::ply::write_scene).
//!
//! What all points say together is looked for first (`survey`); then they are copied into a file and divided at their means into files of fewer, until memory has room for
//! those of a set (`runs`). Its subtree is made there, and kept in files (`kept`); nodes above subtrees are made of what is kept. At the end all is written level by level
//! (`write`). A tree depends on the set of points alone, and so it is of no matter where it was made.

mod kept;
mod pages;
mod runs;
mod sources;
mod survey;
#[cfg(test)]
mod tests;
mod write;

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

/// Memory of the program and of what is read and written at once, bytes, and of each thread for pieces.
const PROGRAM: u64 = 96 << 20;
const OF_THREAD: u64 = 48 << 20;

/// Memory of a surfel of a subtree beside what the scene has of it, bytes: its place, its part of the nodes and of their sums.
const OF_SURFEL: u64 = 150;

/// The most bytes that a scene has of a surfel ([`Survey::surfel_bytes`]).
const LARGEST_SURFEL: u64 = 112;

/// Points that memory must have room for.
const FEWEST: u64 = 1 << 16;

/// What came of it.
#[derive(Clone, Debug)]
pub struct Report {
    /// Surfels.
    pub surfels: u64,
    /// Nodes of the tree.
    pub nodes: u64,
    /// Its levels.
    pub levels: u64,
    /// Subtrees that were made one after the other.
    pub subtrees: u64,
    /// What was done to the points.
    pub preparation: Preparation,
}

/// Writes the surfels of all points of `files` with levels of detail at `path`, within about so many bytes of `memory`; what is kept meanwhile is in files without a name in
/// `folder`, of up to twice the size of what is written.
///
/// # Errors
///
/// [`Error::Usage`] for too little memory, or too many points or nodes, [`Error::Malformed`] for points without a normal or a radius, [`Error::EmptyScene`], and [`Error::Read`]
/// and [`Error::Write`] of the system.
pub fn write_levels(
    files: &[Rows],
    memory: u64,
    (path, folder): (&Path, &Path),
    progress: &dyn Progress,
) -> Result<Report> {
    let fixed = fixed();
    if memory < fixed + FEWEST * OF_SURFEL {
        // Enough for points of any kind, as nobody has looked at these.
        return Err(too_little(fixed + FEWEST * (LARGEST_SURFEL + OF_SURFEL)));
    }
    let sources = Sources { files, progress };
    let survey = Survey::of(&sources)?;
    let of_surfel = survey.surfel_bytes() + OF_SURFEL;
    let fits = memory.saturating_sub(fixed) / of_surfel;
    if fits < FEWEST {
        return Err(too_little(fixed + FEWEST * of_surfel));
    }
    let runs = Runs { survey: &survey, folder, path, progress };
    made(&sources, runs, (fits, of_surfel))
}

/// Memory that is taken however few points there are, bytes.
fn fixed() -> u64 {
    PROGRAM + OF_THREAD * rayon::current_num_threads() as u64
}

fn too_little(least: u64) -> Error {
    let least = least.div_ceil(1 << 20);
    Error::Usage(format!("--memory is less than the {least}MiB that levels of detail of these points take at least"))
}

/// The file, where memory has room for the tree of so many points at once.
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

/// How a part of a scene is made of points.
type MadeOf = fn(&Survey, Points) -> Option<Scene>;

/// A branch, and what its parent's sums are made of.
struct Summed {
    branch: Branch,
    sums: Sums,
    /// On each of the lattices of the sets that it is in.
    moments: Vec<Moments>,
}

/// What sets are divided with, from the root down.
struct Divider<'a> {
    runs: Runs<'a>,
    kept: Kept<'a>,
    /// Points that memory has room for.
    fits: u64,
    /// Memory of each, bytes.
    of_surfel: u64,
    /// Those of the sets that the one which is looked at is in, each on the last.
    lattices: Vec<Lattice>,
}

impl Divider<'_> {
    /// The tree of a set, so many levels below the root.
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
                "{count} points are too near each other to be divided, and --memory has room for {}: give {enough}MiB",
                self.fits
            )));
        }
        let children = below.into_iter().map(|run| self.branch(run, depth + 1)).collect::<Result<Vec<_>>>()?;
        let summed = self.above(children, (depth, &lattice));
        self.lattices.truncate(known);
        summed.map(|summed| Summed { moments: summed.moments[..known].to_vec(), ..summed })
    }

    /// The node above some branches, which has this lattice.
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

    /// The tree of a set's surfels.
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

    /// So many surfels of some pieces of files, as they are `made` of points.
    fn loaded(&self, count: u64, pieces: &[(&Rows, Range<u64>)], made: MadeOf) -> Result<Scene> {
        let survey = self.runs.survey;
        let mut scene = survey.empty.clone();
        survey.reserve(&mut scene, count as usize);
        let read = |(rows, piece): &(&Rows, Range<u64>)| {
            let points = rows.points(&rows.bytes(piece.clone())?)?;
            self.runs.progress.advance(points.positions.len() as u64);
            made(survey, points).ok_or_else(|| rows.malformed("it changed while it was read"))
        };
        self.runs.progress.begin("reading points", count);
        let loaded = pieces.chunks(rayon::current_num_threads()).try_for_each(|pieces| {
            let parts: Vec<Scene> = pieces.par_iter().map(read).collect::<Result<_>>()?;
            parts.into_iter().for_each(|part| complete::append(&mut scene, part));
            Ok(())
        });
        self.runs.progress.end();
        loaded.map(|()| scene)
    }
}
