//! The points of the input files, which are read piece by piece, once for each pass.

use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use crate::io::Points;
use crate::io::ply::Rows;
use crate::scene::Places;
use crate::surfels::gather::is_usable;
use crate::{Error, Progress, Result};

/// Rows in a piece.
pub(super) const PIECE: u64 = 1 << 16;

/// The input files.
pub(super) struct Sources<'a> {
    pub files: &'a [Rows],
    pub progress: &'a dyn Progress,
}

impl Sources<'_> {
    /// The number of points in all files.
    pub fn count(&self) -> u64 {
        self.files.iter().map(Rows::count).sum()
    }

    /// The pieces of all files.
    pub fn pieces(&self) -> Vec<(&Rows, Range<u64>)> {
        self.files.iter().flat_map(|file| file.pieces(PIECE).into_iter().map(move |piece| (file, piece))).collect()
    }

    /// Maps the points of each piece and the path of its file by `of`, and merges the results by
    /// `join` in any order.
    pub fn each<T: Send>(
        &self,
        nothing: impl Fn() -> T + Sync + Send,
        of: impl Fn(Points, &Path) -> Result<T> + Sync + Send,
        join: impl Fn(T, T) -> T + Sync + Send,
    ) -> Result<T> {
        let read = |(file, piece): (&Rows, Range<u64>)| {
            let points = file.points(&file.bytes(piece)?)?;
            let count = points.positions.len() as u64;
            let made = of(points, file.path());
            self.progress.advance(count);
            made
        };
        self.pieces().into_par_iter().map(read).try_reduce(&nothing, |one, other| Ok(join(one, other)))
    }
}

/// [`Places`] that are read from files anew in each pass over them.
pub(super) struct Read<P, F> {
    count: usize,
    pieces: Vec<P>,
    of: F,
    /// The first error of reading a piece.
    failed: Failed,
}

impl<P: Clone + Sync, F: Fn(P) -> Result<Vec<(DVec3, f64)>> + Sync> Read<P, F> {
    /// Describes `count` places, which `of` reads from `pieces`.
    pub fn new(count: usize, pieces: Vec<P>, of: F) -> Self {
        Self { count, pieces, of, failed: Failed::default() }
    }

    /// Returns the result of `of`, or the first error of reading a piece.
    pub fn made<T>(self, of: impl FnOnce(&Self) -> T) -> Result<T> {
        let made = of(&self);
        self.failed.check().map(|()| made)
    }
}

impl<P: Clone + Sync, F: Fn(P) -> Result<Vec<(DVec3, f64)>> + Sync> Places for Read<P, F> {
    fn count(&self) -> usize {
        self.count
    }

    fn fold<T: Send>(
        &self,
        nothing: impl Fn() -> T + Sync + Send,
        add: impl Fn(T, DVec3, f64) -> T + Sync + Send,
        join: impl Fn(T, T) -> T + Sync + Send,
    ) -> T {
        let piece = |piece: &P| {
            let places = self.failed.noted((self.of)(piece.clone())).unwrap_or_default();
            places.into_iter().fold(nothing(), |all, (position, radius)| add(all, position, radius))
        };
        self.pieces.par_iter().map(piece).reduce(&nothing, &join)
    }
}

/// The first error in code that cannot return one.
#[derive(Default)]
pub(super) struct Failed(Mutex<Option<Error>>);

impl Failed {
    /// Returns the value, or records the error.
    pub fn noted<T>(&self, outcome: Result<T>) -> Option<T> {
        let note = |error| {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        };
        outcome.map_err(note).ok()
    }

    /// Returns the recorded error, if there is one.
    pub fn check(&self) -> Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }
}

/// The usable positions of some points.
pub(super) fn usable(points: &Points) -> impl Iterator<Item = DVec3> {
    // Adding +0 turns -0 into 0.
    points.positions.iter().filter(|position| is_usable(position)).map(|p| DVec3::from_array(*p) + DVec3::ZERO)
}
