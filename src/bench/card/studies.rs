//! Runs the studies, each within a share of the remaining time. Each has a folder for its report.

use std::path::{Component, Path};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::Card;
use crate::bench::definition::{Definition, SceneEntry};
use crate::bench::runner::{self, Outcome};
use crate::bench::staging::{Point, points};
use crate::bench::table::{relative, whole_frame};
use crate::error::{Error, Result};
use crate::report::{self, Measurement, Study, Summary};

/// Interval at which the report of an unfinished study is written.
const WRITTEN_EVERY: Duration = Duration::from_secs(20);

/// The outcome of a study in a run.
#[derive(Clone, Debug, Serialize)]
pub struct StudyRecord {
    /// The name of the study and of its report's folder.
    pub name: String,
    /// One sentence that says what the study shows.
    pub about: String,
    /// Duration, seconds.
    pub seconds: f64,
    /// Number of measurements: one per configuration and point of a scene's sweep.
    pub measurements: usize,
    /// The configuration whose time is the unit of relative times, if there is one.
    pub baseline: Option<String>,
    /// The results of each configuration over all scenes.
    pub configs: Vec<ConfigRecord>,
    /// Configurations that the adapter cannot run, and frames that were rendered twice.
    pub notes: Vec<String>,
    /// Missed error limits, and configurations that gave different bits in two runs.
    pub failures: Vec<String>,
    /// Scenes that were skipped because time was short or after an error.
    pub left_out: Vec<String>,
}

/// The results of a configuration over all scenes of a study.
#[derive(Clone, Debug, Serialize)]
pub struct ConfigRecord {
    /// The name.
    pub config: String,
    /// Number of points in the sweeps of all scenes that the configuration was measured on.
    pub scenes: usize,
    /// Time divided by the baseline's time on the same scene; `None` without a baseline.
    pub time_over_baseline: Option<Summary>,
    /// The passes' times alone, without submission and read-back, divided by the baseline's;
    /// `None` without a baseline.
    pub passes_over_baseline: Option<Summary>,
    /// The largest RMSE against the f64 reference.
    pub worst_rmse: Option<f64>,
}

/// Summarises each configuration over all scenes, in the order of the definition.
fn digest(definition: &Definition, study: &Study) -> Vec<ConfigRecord> {
    let of = |config: &str| {
        let all: Vec<_> = study.measurements.iter().filter(|m| m.config == config).collect();
        let ratios = |ms: fn(&Measurement) -> f64| {
            Summary::of(&all.iter().filter_map(|m| relative(definition, study, (m, ms))).collect::<Vec<_>>())
        };
        (!all.is_empty()).then(|| ConfigRecord {
            config: config.to_owned(),
            scenes: all.len(),
            time_over_baseline: ratios(whole_frame),
            passes_over_baseline: ratios(|m| m.passes.values().map(|ms| ms.median).sum()),
            worst_rmse: all.iter().filter_map(|m| m.numeric_error()).max_by(f64::total_cmp),
        })
    };
    definition.configs.iter().filter_map(|config| of(&config.name)).collect()
}

/// Checks that the names of all studies differ and can be folder names.
///
/// # Errors
/// [`Error::Usage`] if a name is not a plain folder name, or if two studies share it.
pub fn check_names(studies: &[Definition]) -> Result<()> {
    for (number, study) in studies.iter().enumerate() {
        let name = &study.name;
        let parts: Vec<_> = Path::new(name).components().collect();
        if !matches!(parts[..], [Component::Normal(part)] if part == name.as_str()) {
            return Err(Error::Usage(format!("the study name {name:?} cannot be a folder name: choose another")));
        }
        if studies[..number].iter().any(|other| other.name == *name) {
            return Err(Error::Usage(format!("two studies are called {name:?} and would share a folder: rename one")));
        }
    }
    Ok(())
}

/// Runs as many studies as the time allows.
pub(super) fn run(card: &mut Card<'_>) -> Result<()> {
    let asked = card.asked;
    for (number, definition) in asked.studies.iter().enumerate() {
        let left = asked.studies.len() - number;
        // Time that a study leaves unused is shared among the following ones.
        let deadline = card.budget.share(1.0 / left as f64);
        if card.budget.left().is_zero() {
            card.leave_out(format!("the study {}: the time was over", definition.name));
            continue;
        }
        (card.told.say)(&format!("  {} ({:.0} s for it)", definition.name, (deadline - Instant::now()).as_secs_f64()));
        if let Err(error) = study(card, definition, deadline) {
            card.problem(&format!("the study {}", definition.name), error)?;
        }
        card.write()?;
    }
    Ok(())
}

/// Runs one study. Its results so far are written even if it fails.
fn study(card: &mut Card<'_>, definition: &Definition, deadline: Instant) -> Result<()> {
    let (start, mut written) = (Instant::now(), Instant::now());
    let mut outcome = runner::begin(definition, Some(&card.backend))?;
    outcome.study.command.clone_from(&card.asked.command);
    outcome.study.date.clone_from(&card.asked.date);
    let mut left_out = Vec::new();
    let mut failed = None;
    let mut last: Option<(Option<u64>, Duration)> = None;
    let all = definition.scenes.iter().flat_map(|entry| points(entry).into_iter().map(move |point| (entry, point)));
    for (entry, point) in all {
        if failed.is_some() || Instant::now() + expected(last, point) >= deadline {
            left_out.push(named(entry, point));
            continue;
        }
        let begun = Instant::now();
        let measured =
            runner::measure(definition, (entry, point), Some(&card.backend), &mut outcome, card.told.progress);
        failed = measured.err();
        (card.told.say)(&format!("    {}: {:.1} s", named(entry, point), begun.elapsed().as_secs_f64()));
        last = Some((point.count, begun.elapsed()));
        if written.elapsed() > WRITTEN_EVERY {
            report::write(&card.folder.join(&definition.name), &outcome.study)?;
            written = Instant::now();
        }
    }
    keep(card, definition, outcome, (left_out, failed.is_some(), start))?;
    failed.map_or(Ok(()), Err)
}

/// Estimates the time of the next point of a sweep from the last point's time. The estimate grows
/// in proportion to the number of surfels, but never shrinks.
fn expected(last: Option<(Option<u64>, Duration)>, next: Point) -> Duration {
    let Some((count, time)) = last else { return Duration::ZERO };
    let ratio = next.count.zip(count).map_or(1.0, |(next, last)| next as f64 / last.max(1) as f64);
    time.mul_f64(ratio.max(1.0))
}

/// Names a point of a sweep, for messages.
fn named(entry: &SceneEntry, point: Point) -> String {
    let count = point.count.map_or(String::new(), |count| format!(", {count} surfels"));
    let size = point.footprint_px.map_or(String::new(), |radius| format!(" of {radius} px"));
    format!("{}{count}{size}", entry.name)
}

fn keep(
    card: &mut Card<'_>,
    definition: &Definition,
    outcome: Outcome,
    (left_out, failed, start): (Vec<String>, bool, Instant),
) -> Result<()> {
    let Outcome { study, notes, failures } = outcome;
    if !study.measurements.is_empty() {
        report::write(&card.folder.join(&study.name), &study)?;
    }
    if !left_out.is_empty() {
        let why = if failed { "after an error" } else { "for lack of time" };
        card.leave_out(format!("of the study {}, {why}: {}", study.name, left_out.join("; ")));
    }
    card.record.studies.push(StudyRecord {
        seconds: start.elapsed().as_secs_f64(),
        measurements: study.measurements.len(),
        baseline: definition.baseline.clone(),
        configs: digest(definition, &study),
        name: study.name,
        about: study.about,
        notes,
        failures,
        left_out,
    });
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::render::Backend;
    use crate::report::Numeric;

    fn study(name: &str) -> Definition {
        let text = format!(
            "name = \"{name}\"\nabout = \"a\"\n[[scene]]\nname = \"s\"\nshape = \"sphere\"\ncount = 9\n\
             [[config]]\nname = \"c\"\nbackend = \"gpu\"\n"
        );
        Definition::parse(&text, Path::new("x.toml")).unwrap()
    }

    #[test]
    fn a_study_has_a_folder_of_its_own_within_that_of_the_run() {
        check_names(&["one", "other", "a b"].map(study)).unwrap();
        for name in ["", ".", "..", "../one", "/one", "one/other", "one/"] {
            assert!(check_names(&[study(name)]).unwrap_err().to_string().contains("folder"), "{name:?}");
        }
        assert!(check_names(&[study("one"), study("one")]).unwrap_err().to_string().contains("two studies"));
    }

    #[test]
    fn a_configuration_is_told_by_its_worst_error_and_its_times_over_all_scenes() {
        let text = "name = \"n\"\nabout = \"a\"\nbaseline = \"a\"\n[[scene]]\nname = \"s\"\nshape = \"sphere\"\n\
            count = [9, 19]\nquick = true\n[[config]]\nname = \"b\"\nbackend = \"gpu\"\n[[config]]\nname = \"a\"\n\
            backend = \"gpu\"\n[[config]]\nname = \"c\"\nbackend = \"gpu\"\n";
        let definition = Definition::parse(text, Path::new("x.toml")).unwrap();
        let mut outcome = runner::begin(&definition, Some(&Backend::Reference)).unwrap();
        let rows = [("a", 9, 2.0, 1e-6), ("b", 9, 4.0, 1e-3), ("a", 19, 10.0, 1e-5), ("b", 19, 30.0, 1e-4)];
        outcome.study.measurements = rows
            .map(|(config, surfels, median, rmse)| Measurement {
                scene: "s".into(),
                config: config.into(),
                surfels,
                total_ms: Summary { median, ..Summary::default() },
                passes: [("project".to_owned(), Summary { median: median * median, ..Summary::default() })].into(),
                numeric: Some(Numeric { rmse, ..Numeric::default() }),
                ..Measurement::default()
            })
            .to_vec();
        let found = digest(&definition, &outcome.study);
        let of = |r: &ConfigRecord| {
            let [time, passes] = [r.time_over_baseline, r.passes_over_baseline].map(|ratio| ratio.unwrap().median);
            (r.config.clone(), r.scenes, time, passes, r.worst_rmse)
        };
        let found: Vec<_> = found.iter().map(of).collect();
        assert_eq!(found, [("b".to_owned(), 2, 2.5, 6.5, Some(1e-3)), ("a".to_owned(), 2, 1.0, 1.0, Some(1e-5))]);
    }

    #[test]
    fn what_comes_next_takes_as_long_for_each_surfel() {
        let point = |count| Point { count, footprint_px: None };
        let second = Duration::from_secs(1);
        assert_eq!(expected(None, point(Some(10))), Duration::ZERO);
        assert_eq!(expected(Some((Some(10), second)), point(Some(30))), 3 * second);
        assert_eq!(expected(Some((Some(10), second)), point(Some(1))), second);
        assert_eq!(expected(Some((None, second)), point(None)), second);
    }
}
