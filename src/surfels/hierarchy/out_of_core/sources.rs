//! The points of the input files, which are read piece by piece, once for each pass.

use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use crate::io::Points;
use crate::io::ply::Rows;
use crate::network::{Carried, Network, joined};
use crate::scene::{Places, Share};
use crate::surfels::gather::is_usable;
use crate::{Error, Progress, Result};

/// Rows in a piece.
pub(super) const PIECE: u64 = 1 << 16;

/// The input files.
pub(super) struct Sources<'a> {
    pub files: &'a [Rows],
    pub progress: &'a dyn Progress,
    /// The processes among which the points are divided; None if this process has all of them.
    pub among: Option<Among<'a>>,
}

/// The processes among which points are divided. Each makes partial results of its own points, and
/// all get what these join to.
#[derive(Clone, Copy)]
pub(super) struct Among<'a>(pub &'a dyn Network);

impl Among<'_> {
    /// The share of this process.
    pub fn share(self) -> Result<Share> {
        Share::new(self.0.rank() as u32 + 1, self.0.size() as u32)
    }

    /// Joins the results of all processes. If one of them has points from which no share can be
    /// made, all get [`no_share`]; other errors end all.
    fn joined<T: Carried>(self, own: Result<T>, join: impl Fn(T, T) -> T) -> Result<T> {
        let own = match own {
            Ok(own) => Ok(Some(own)),
            Err(Error::Usage(_) | Error::Malformed { .. } | Error::EmptyScene(_)) => Ok(None),
            Err(error) => Err(error),
        };
        joined(self.0, own, join)?.ok_or_else(no_share)
    }
}

/// The sentence of [`no_share`].
const NO_SHARE: &str = "the surfels of these points depend on all of them";

/// The error, in all processes, that a share cannot be made of its points alone.
pub(super) fn no_share() -> Error {
    Error::Usage(NO_SHARE.into())
}

/// Whether an error is [`no_share`].
pub(super) fn is_no_share(error: &Error) -> bool {
    matches!(error, Error::Usage(what) if what == NO_SHARE)
}

impl Sources<'_> {
    /// The number of points in all files.
    pub fn count(&self) -> u64 {
        self.files.iter().map(Rows::count).sum()
    }

    /// The pieces that this process reads, of all files.
    pub fn pieces(&self) -> Vec<(&Rows, Range<u64>)> {
        self.numbered().into_iter().map(|(_, file, piece)| (file, piece)).collect()
    }

    /// The pieces that this process reads, each with the number of points before it in all files.
    pub fn numbered(&self) -> Vec<(u64, &Rows, Range<u64>)> {
        let count = self.count();
        let share = self.among.and_then(|among| among.share().ok());
        let own: Vec<Range<u64>> = match share {
            Some(share) => share.pieces(count as usize).map(|own| own.start as u64..own.end as u64).collect(),
            None => std::iter::once(0..count).collect(),
        };
        let mut all = Vec::new();
        for own in own {
            let mut before = 0;
            for file in self.files {
                let (start, end) = (own.start.max(before), own.end.min(before + file.count()));
                for first in (start..end).step_by(PIECE as usize) {
                    all.push((first, file, first - before..end.min(first + PIECE) - before));
                }
                before += file.count();
            }
        }
        all
    }

    /// Joins the results of all processes among which the points are divided.
    pub fn joined<T: Carried>(&self, own: Result<T>, join: impl Fn(T, T) -> T) -> Result<T> {
        match self.among {
            Some(among) => among.joined(own, join),
            None => own,
        }
    }

    /// Maps the points of each piece and the path of its file by `of`, and merges the results by
    /// `join` in any order.
    pub fn each<T: Carried>(
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
        self.joined(
            self.pieces().into_par_iter().map(read).try_reduce(&nothing, |one, other| Ok(join(one, other))),
            &join,
        )
    }
}

/// [`Places`] that are read from files anew in each pass over them.
pub(super) struct Read<'a, P, F> {
    count: usize,
    pieces: Vec<P>,
    of: F,
    /// The processes that hold the other places.
    among: Option<Among<'a>>,
    /// The first error of reading a piece.
    failed: Failed,
}

impl<'a, P: Clone + Sync, F: Fn(P) -> Result<Vec<(DVec3, f64)>> + Sync> Read<'a, P, F> {
    /// Describes `count` places, of which `of` reads those of this process from `pieces`.
    pub fn new(count: usize, pieces: Vec<P>, of: F, among: Option<Among<'a>>) -> Self {
        Self { count, pieces, of, among, failed: Failed::default() }
    }

    /// Returns the result of `of`, or the first error of reading a piece.
    pub fn made<T>(self, of: impl FnOnce(&Self) -> T) -> Result<T> {
        let made = of(&self);
        self.failed.check().map(|()| made)
    }
}

impl<P: Clone + Sync, F: Fn(P) -> Result<Vec<(DVec3, f64)>> + Sync> Places for Read<'_, P, F> {
    fn count(&self) -> usize {
        self.count
    }

    fn fold<T: Carried>(
        &self,
        nothing: impl Fn() -> T + Sync + Send,
        add: impl Fn(T, DVec3, f64) -> T + Sync + Send,
        join: impl Fn(T, T) -> T + Sync + Send,
    ) -> T {
        let piece = |piece: &P| {
            let places = self.failed.noted((self.of)(piece.clone())).unwrap_or_default();
            places.into_iter().fold(nothing(), |all, (position, radius)| add(all, position, radius))
        };
        let own = self.pieces.par_iter().map(piece).reduce(&nothing, &join);
        let Some(among) = self.among else { return own };
        // After an error the processes have ended together, and no message is sent.
        if self.failed.is_told() {
            return own;
        }
        let own = self.failed.check().map(|()| own);
        self.failed.noted(among.joined(own, join)).unwrap_or_else(nothing)
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

    /// Whether the recorded error is one that all processes know.
    fn is_told(&self) -> bool {
        let failed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        failed.as_ref().is_some_and(|error| {
            is_no_share(error) || matches!(error, Error::Process { .. } | Error::OtherProcess { .. })
        })
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
