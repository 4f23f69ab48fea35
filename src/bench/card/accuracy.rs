//! Runs the hard cases on the adapter, judged as by `epsplat hardcases`.

use std::time::Instant;

use serde::Serialize;

use super::{Card, record};
use crate::error::Result;
use crate::hardcases::{self, Outcome, Row, Verdict};

/// The fraction of the remaining time that this step may use.
const SHARE: f64 = 0.4;

/// A quick run renders every eighth case, with the first accumulator only.
const QUICK_STEP: usize = 8;

/// The file with all rows, in the format of `epsplat hardcases --json`.
pub(super) const FILE: &str = "hardcases.json";

/// The results of the hard cases. A row is a case rendered with one accumulator.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// Rows within their bounds.
    pub passed: usize,
    /// Rows that exceed a bound as expected for their accumulator.
    pub expected_failures: usize,
    /// Rows that failed unexpectedly.
    pub failed: usize,
    /// Cases that were rendered.
    pub cases: usize,
    /// The row that came nearest to a bound and passed.
    pub worst: Option<Worst>,
    /// One sentence per failed row: case, accumulator and reason.
    pub failures: Vec<String>,
}

/// The largest share of a bound that an image used.
#[derive(Clone, Debug, Serialize)]
pub struct Worst {
    /// The case's name.
    pub case: String,
    /// The accumulator's name.
    pub accumulator: &'static str,
    /// The name of the map.
    pub map: &'static str,
    /// The largest error of the map as a share of the bound at the same pixel.
    pub used: f64,
}

impl Accuracy {
    /// Summarises the `rows` of the `cases` cases.
    pub fn of(rows: &[Row], cases: usize) -> Self {
        let Outcome { passed, expected_failures, failed, .. } = Outcome::of("", rows);
        let worst = |row: &Row| {
            let map = row.worst()?;
            Some(Worst { case: row.case.clone(), accumulator: row.accumulator, map: map.map, used: map.used })
        };
        let kept = rows.iter().filter(|row| row.verdict == Verdict::Pass).filter_map(worst);
        let failure = |row: &Row| match &row.verdict {
            Verdict::Fail(what) => Some(format!("{}, {}: {what}", row.case, row.accumulator)),
            Verdict::Pass | Verdict::ExpectedFailure(_) => None,
        };
        Self {
            passed,
            expected_failures,
            failed,
            cases,
            worst: kept.max_by(|a, b| a.used.total_cmp(&b.used)),
            failures: rows.iter().filter_map(failure).collect(),
        }
    }
}

/// Renders and judges as many cases as the time allows.
pub(super) fn check(card: &mut Card<'_>) -> Result<()> {
    let deadline = card.budget.share(SHARE);
    let all = hardcases::cases()?;
    let mut accumulators = hardcases::supported(&card.backend);
    let cases: Vec<_> = all.iter().step_by(if card.asked.quick { QUICK_STEP } else { 1 }).collect();
    if card.asked.quick {
        accumulators.truncate(1);
    }
    let (mut rows, mut done, mut failed) = (Vec::new(), 0, None);
    card.told.progress.begin("hard cases", cases.len() as u64);
    for case in &cases {
        if Instant::now() >= deadline {
            break;
        }
        match hardcases::run(std::slice::from_ref(case), &accumulators, &card.backend, &()) {
            Ok(of_case) => rows.extend(of_case),
            Err(error) => {
                failed = Some(error);
                break;
            }
        }
        done += 1;
        card.told.progress.advance(1);
    }
    card.told.progress.end();
    record::write_json(&card.folder.join(FILE), &Outcome::of(&card.record.adapter.name, &rows))?;
    let found = Accuracy::of(&rows, done);
    (card.told.say)(&format!(
        "  {} pass, {} fail as expected, {} FAIL",
        found.passed, found.expected_failures, found.failed
    ));
    card.record.accuracy = Some(found);
    if done < all.len() {
        let why = if card.asked.quick {
            "in a quick run"
        } else {
            "there was no time for them, or one could not be rendered"
        };
        card.leave_out(format!("{} of {} hard cases: {why}", all.len() - done, all.len()));
    }
    failed.map_or(Ok(()), Err)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::render::Backend;

    #[test]
    fn a_row_that_fails_is_counted_and_named() {
        let cases = hardcases::cases().unwrap();
        let accumulators = &hardcases::supported(&Backend::Reference)[..1];
        let mut rows = hardcases::run(&cases[..1], accumulators, &Backend::Reference, &()).unwrap();
        let right = Accuracy::of(&rows, 1);
        assert_eq!((right.passed, right.failed, right.failures.len()), (1, 0, 0), "{right:?}");
        assert!(right.worst.unwrap().used <= 1.0);
        rows[0].verdict = Verdict::Fail("a pixel is lost".into());
        let wrong = Accuracy::of(&rows, 1);
        assert_eq!((wrong.passed, wrong.failed), (0, 1));
        assert!(wrong.failures[0].starts_with(&cases[0].name) && wrong.failures[0].ends_with("a pixel is lost"));
        assert!(wrong.worst.is_none());
    }
}
