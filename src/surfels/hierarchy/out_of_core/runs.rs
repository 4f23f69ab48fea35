//! Runs: sets of points that do not fit in memory. The rows of a run lie in an unnamed file, from
//! which they are divided into the files of the child sets.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use super::super::lattice::Lattice;
use super::super::octree::{FEWEST_STEPS, octant};
use super::super::split;
use super::sources::{PIECE, Sources};
use super::survey::Survey;
use crate::io::ply::{ColorProperties, Properties, Rows, position};
use crate::scene::{Bounds, Colors};
use crate::{Error, Progress, Result};

/// A set of points in an unnamed file.
pub(super) struct Run {
    pub rows: Rows,
    spread: Spread,
}

/// Sums and bounds of a set's places on a lattice.
#[derive(Clone, Copy)]
struct Spread {
    sum: [i64; 3],
    low: [i32; 3],
    high: [i32; 3],
    bounds: Bounds,
}

impl Spread {
    const NOTHING: Self = Self { sum: [0; 3], low: [i32::MAX; 3], high: [i32::MIN; 3], bounds: Bounds::EMPTY };

    fn add(&mut self, place: [i32; 3], center: DVec3) {
        for (k, place) in place.into_iter().enumerate() {
            self.sum[k] += i64::from(place);
            self.low[k] = self.low[k].min(place);
            self.high[k] = self.high[k].max(place);
        }
        self.bounds = self.bounds.with_point(center);
    }

    fn both(self, other: Self) -> Self {
        Self {
            sum: std::array::from_fn(|k| self.sum[k] + other.sum[k]),
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
            bounds: self.bounds.union(other.bounds),
        }
    }

    /// The longest side of the box around the set, lattice steps.
    fn extent(&self) -> i64 {
        (0..3).map(|k| i64::from(self.high[k]) - i64::from(self.low[k])).max().unwrap_or(0)
    }
}

/// The inputs that all runs share.
pub(super) struct Runs<'a> {
    pub survey: &'a Survey,
    /// The folder of the unnamed files.
    pub folder: &'a Path,
    /// The name of these files in error messages.
    pub path: &'a Path,
    pub progress: &'a dyn Progress,
}

impl Runs<'_> {
    /// Creates an empty run.
    fn none(&self) -> Result<Run> {
        let (empty, has) = (&self.survey.empty, &self.survey.has);
        let properties = Properties {
            double_coordinates: true,
            normals: has.normals,
            axes: true,
            clips: has.clips,
            caps: has.caps,
            colors: match empty.colors {
                Colors::Srgb8(_) => ColorProperties::Srgb8Alpha,
                Colors::Linear(_) => ColorProperties::Linear,
                _ => ColorProperties::Absent,
            },
            ..Properties::default()
        };
        Ok(Run { rows: Rows::temporary(self.folder, properties, self.path)?, spread: Spread::NOTHING })
    }

    /// Copies the points of all files to one run, with places on the root's lattice.
    pub fn all(&self, sources: &Sources<'_>, lattice: &Lattice) -> Result<Run> {
        let run = Mutex::new(self.none()?);
        self.progress.begin("copying points", sources.count());
        let copied = sources.each(
            || (),
            |points, path| {
                let scene =
                    self.survey.part(points).ok_or_else(|| Error::malformed(path, "it changed while it was read"))?;
                let mut run = run.lock().unwrap_or_else(PoisonError::into_inner);
                let bytes = run.rows.encoded(&scene, 0..scene.surfels.len());
                let size = run.rows.size();
                run.rows.append(&bytes)?;
                let spread = self.spread(&bytes, size, lattice);
                run.spread = run.spread.both(spread);
                Ok(())
            },
            |(), ()| (),
        );
        self.progress.end();
        copied?;
        Ok(run.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// The centre in a row, equal to the bit to that of the surfel that is later made from the row.
    fn center(&self, row: &[u8]) -> DVec3 {
        let origin = self.survey.known.origin;
        let [short, rest] = split(DVec3::from_array(position(row)) - origin);
        let wide = |part: [f32; 3]| DVec3::from_array(part.map(f64::from));
        if self.survey.known.low { wide(short) + wide(rest) } else { wide(short) }
    }

    fn spread(&self, bytes: &[u8], size: usize, lattice: &Lattice) -> Spread {
        let mut spread = Spread::NOTHING;
        for row in bytes.chunks_exact(size) {
            let center = self.center(row);
            spread.add(lattice.place(center), center);
        }
        spread
    }

    /// Maps the bytes of each piece of a run by `of`, and merges the results by `join` in any
    /// order.
    fn each<T: Send>(
        &self,
        run: &Run,
        nothing: impl Fn() -> T + Sync + Send,
        of: impl Fn(&[u8]) -> Result<T> + Sync + Send,
        join: impl Fn(T, T) -> T + Sync + Send,
    ) -> Result<T> {
        let piece = |piece| of(&run.rows.bytes(piece)?);
        run.rows.pieces(PIECE).into_par_iter().map(piece).try_reduce(&nothing, |one, other| Ok(join(one, other)))
    }

    /// Gives a set that spans few steps of its lattice a finer lattice, under the same condition as
    /// sets in memory.
    pub fn refined(&self, run: &mut Run) -> Result<Option<Lattice>> {
        if run.spread.extent() >= FEWEST_STEPS {
            return Ok(None);
        }
        let (finer, size) = (Lattice::over(&run.spread.bounds), run.rows.size());
        run.spread = self.each(run, || Spread::NOTHING, |bytes| Ok(self.spread(bytes, size, &finer)), Spread::both)?;
        Ok(Some(finer))
    }

    /// Divides a set at its mean on this lattice. Returns the child sets in the order of octants;
    /// fewer than two if the set cannot be divided.
    pub fn divided(&self, run: Run, lattice: &Lattice) -> Result<Vec<Run>> {
        let (sum, count, size) = (run.spread.sum, run.rows.count() as i64, run.rows.size());
        let below: Vec<Mutex<Run>> = (0..8).map(|_| self.none().map(Mutex::new)).collect::<Result<_>>()?;
        self.progress.begin("dividing points in files", run.rows.count());
        let divide = |bytes: &[u8]| {
            let mut parts: [(Vec<u8>, Spread); 8] = std::array::from_fn(|_| (Vec::new(), Spread::NOTHING));
            for row in bytes.chunks_exact(size) {
                let center = self.center(row);
                let place = lattice.place(center);
                let (rows, spread) = &mut parts[octant(place, count, sum)];
                rows.extend_from_slice(row);
                spread.add(place, center);
            }
            for ((rows, spread), run) in parts.iter().zip(&below).filter(|((rows, _), _)| !rows.is_empty()) {
                let mut run = run.lock().unwrap_or_else(PoisonError::into_inner);
                run.rows.append(rows)?;
                run.spread = run.spread.both(*spread);
            }
            self.progress.advance((bytes.len() / size) as u64);
            Ok(())
        };
        let divided = self.each(&run, || (), divide, |(), ()| ());
        self.progress.end();
        divided?;
        let below = below.into_iter().map(|run| run.into_inner().unwrap_or_else(PoisonError::into_inner));
        Ok(below.filter(|run| run.rows.count() > 0).collect())
    }
}
