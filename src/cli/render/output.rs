//! The summary of a render and notes on stderr.

use std::num::NonZeroU64;
use std::path::Path;

use epsplat::low_level::render::Report;

use super::super::note;
use super::target::STANDARD;

/// Prints a note if sums overflowed, so that the frame was rendered twice.
pub(super) fn note_overflows(report: &Report) {
    if report.overflows > 0 {
        note(&format!(
            "{} sums overflowed: rendered again with the accumulator {}",
            report.overflows, report.accumulator
        ));
    }
}

/// Prints a note about the first picture that draws more than `most` surfels and nodes.
pub(super) fn note_cut<'a>(reports: impl IntoIterator<Item = &'a Report>, most: Option<NonZeroU64>) {
    let Some(most) = most.map(NonZeroU64::get) else { return };
    if let Some(cut) = reports.into_iter().filter_map(|report| report.cut).find(|cut| *cut > most) {
        note(&format!(
            "{cut} surfels and nodes are drawn, not the {most} of --splats: nodes at the camera's plane and at the outline of a closed mesh are \
             always divided (with --cull none those at the outline are not)"
        ));
    }
}

/// Returns the name of an output for people.
pub(super) fn named(output: &Path) -> String {
    if output == Path::new(STANDARD) { "standard output".into() } else { output.display().to_string() }
}

/// Returns one line: counts of what was drawn, and the time of each pass.
pub(super) fn summary(report: &Report, output: &Path) -> String {
    let order = ["select_ms", "project_ms", "visibility_ms", "triangles_ms", "accumulate_ms", "sort_ms", "resolve_ms"];
    let passes = order
        .iter()
        .filter_map(|name| report.passes.get(*name).map(|ms| format!("{} {ms:.1}", name.trim_end_matches("_ms"))));
    let clock = match (report.backend, report.clock) {
        ("gpu", "wall") => ", wall time",
        _ => "",
    };
    let tail = report.tail.map_or_else(String::new, |tail| {
        format!(
            "; the tail's weight is {:.2} % on average, at most {:.1} % at a pixel",
            100.0 * tail.mean,
            100.0 * tail.largest
        )
    });
    let surfels = match (report.surfels, report.triangles) {
        (0, triangles) if triangles > 0 => String::new(),
        (surfels, _) => match report.cut {
            Some(cut) => format!("{} of a cut of {cut} in place of {surfels} surfels", report.splats_drawn),
            None => format!("{} of {surfels} surfels", report.splats_drawn),
        },
    };
    let triangles = (report.triangles > 0).then(|| format!("{} triangles", report.triangles));
    let drawn: Vec<_> = Some(surfels).filter(|text| !text.is_empty()).into_iter().chain(triangles).collect();
    format!(
        "{}: {} drawn, {:.1} ms ({}{clock}){tail}",
        named(output),
        drawn.join(" and "),
        report.total_ms,
        passes.collect::<Vec<_>>().join(", "),
    )
}
