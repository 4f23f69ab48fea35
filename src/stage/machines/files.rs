//! Exchanges through parts: what a process finds is kept for later processes, and what others
//! found is taken from their parts.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use super::Part;
use crate::error::{Error, Result};
use crate::io::part::{Section, Values};
use crate::plan::extra::TRIANGLE_PIXEL_WORDS;
use crate::plan::steps::Reduced;
use crate::render::exchange::{Exchange, Lists, Numbers, Rows, Runs, Then};

/// The sections that a process leaves. A frame that is tried again replaces them.
#[derive(Default)]
pub(super) struct Kept(Mutex<BTreeMap<(Values, usize, u32), Section>>);

impl Kept {
    pub fn into_sections(self) -> Vec<Section> {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect()
    }

    fn keep<T: Copy + Into<u64>>(&self, values: Values, rows: &Rows, all: &[T]) {
        let samples = rows.samples().len();
        let each = all.len() / samples.max(1);
        let taken = |range: std::ops::Range<usize>| {
            all[range.start * each..range.end * each].iter().map(|value| (*value).into()).collect()
        };
        let place = (rows.width, rows.first, rows.rows);
        let section = Section::new(values, rows.render as u32, place, each as u16, taken);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert((values, rows.render, rows.first), section);
    }
}

impl Part {
    /// The values of `rows`, `each` for each sample.
    ///
    /// # Errors
    /// [`Error::Malformed`] if the part does not have these rows.
    pub(super) fn values(&self, values: Values, rows: &Rows, each: usize) -> Result<Vec<u64>> {
        let samples = rows.samples();
        let mut all = vec![0; samples.len() * each];
        let mut covered = 0;
        for section in self.sections.iter().filter(|own| own.values == values && own.render as usize == rows.render) {
            let own = section.samples();
            let common = own.start.max(samples.start)..own.end.min(samples.end);
            if common.is_empty() {
                continue;
            }
            if section.width != rows.width || usize::from(section.each) != each {
                return Err(self.refused("its values are of another image: draw the part again"));
            }
            covered += common.len();
            section.reduce(samples.clone(), &mut all).map_err(|what| self.refused(what))?;
        }
        match covered == samples.len() {
            true => Ok(all),
            false => Err(self.refused("it lacks rows of the image: draw the part again")),
        }
    }
}

/// The error that files do not carry such numbers, which the options of parts exclude.
fn not_in_files<T>() -> Result<T> {
    Err(Error::Usage("files of parts carry nearest depths and sums, and this picture has others".into()))
}

/// Leaves the nearest depths of a share.
pub(super) struct Depths<'a>(pub &'a Kept);

impl Exchange for Depths<'_> {
    fn draws_triangles(&self) -> bool {
        false
    }

    fn reduce(&self, what: Reduced, rows: &Rows, numbers: Numbers<'_>, _: &mut Runs) -> Result<Then> {
        match (what, numbers) {
            (Reduced::Nearest, Numbers::Short(words)) => self.0.keep(Values::Nearest, rows, words),
            _ => return not_in_files(),
        }
        Ok(Then::Stop)
    }

    fn fragments(&self, _: &Rows, _: &mut Lists) -> Result<()> {
        not_in_files()
    }
}

/// Leaves the sums of a share, within the nearest depths of all.
pub(super) struct Sums<'a> {
    pub kept: &'a Kept,
    pub within: &'a Part,
    /// Whether the part also leaves what all parts have in common: the nearest depths and the
    /// triangles.
    pub common: bool,
}

impl Exchange for Sums<'_> {
    fn draws_triangles(&self) -> bool {
        self.common
    }

    fn triangles(&self, rows: &Rows, drawn: &dyn Fn() -> Result<Vec<u32>>) -> Result<Option<Vec<u32>>> {
        if self.common {
            self.kept.keep(Values::Triangles, rows, &drawn()?);
        }
        Ok(None)
    }

    fn reduce(&self, what: Reduced, rows: &Rows, numbers: Numbers<'_>, runs: &mut Runs) -> Result<Then> {
        match (what, numbers) {
            (Reduced::Nearest, Numbers::Short(words)) => {
                nearest(self.within, rows, words, runs)?;
                if self.common {
                    self.kept.keep(Values::Nearest, rows, words);
                }
                Ok(Then::Go)
            }
            (Reduced::Sums, Numbers::Long(sums)) => {
                self.kept.keep(Values::Sums, rows, sums);
                Ok(Then::Stop)
            }
            _ => not_in_files(),
        }
    }

    fn fragments(&self, _: &Rows, _: &mut Lists) -> Result<()> {
        not_in_files()
    }
}

/// Gives the values of a part that has all shares.
pub(super) struct All<'a>(pub &'a Part);

impl Exchange for All<'_> {
    fn draws_triangles(&self) -> bool {
        false
    }

    fn triangles(&self, rows: &Rows, _: &dyn Fn() -> Result<Vec<u32>>) -> Result<Option<Vec<u32>>> {
        let words = self.0.values(Values::Triangles, rows, TRIANGLE_PIXEL_WORDS as usize)?;
        Ok(Some(words.into_iter().map(|word| word as u32).collect()))
    }

    fn reduce(&self, what: Reduced, rows: &Rows, numbers: Numbers<'_>, runs: &mut Runs) -> Result<Then> {
        match (what, numbers) {
            (Reduced::Nearest, Numbers::Short(words)) => nearest(self.0, rows, words, runs)?,
            (Reduced::Sums, Numbers::Long(sums)) => {
                let each = sums.len().checked_div(rows.samples().len()).unwrap_or(0);
                replaced(sums, self.0.values(Values::Sums, rows, each)?, rows, runs);
            }
            _ => return not_in_files(),
        }
        Ok(Then::Go)
    }

    fn fragments(&self, _: &Rows, _: &mut Lists) -> Result<()> {
        not_in_files()
    }
}

/// Takes the nearest depths of `rows` from a part.
fn nearest(part: &Part, rows: &Rows, words: &mut [u32], runs: &mut Runs) -> Result<()> {
    let all = part.values(Values::Nearest, rows, 1)?.into_iter().map(|word| word as u32);
    replaced(words, all.collect(), rows, runs);
    Ok(())
}

/// Replaces the values of all `rows`.
fn replaced<T: Copy>(values: &mut [T], by: Vec<T>, rows: &Rows, runs: &mut Runs) {
    values.copy_from_slice(&by);
    *runs = std::iter::once(0..rows.samples().len()).collect();
}
