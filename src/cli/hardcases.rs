//! `epsplat hardcases`: judges an adapter by scenes that are hard to render exactly.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::hardcases::{Outcome, Row, Verdict, cases, run as run_cases, supported};
use epsplat::low_level::plan::{Accumulator, check};
use epsplat::low_level::render::Backend;
use epsplat::{Error, Result};

use super::progress::Bars;
use super::{note, outputs, print, write_json};

/// Render hard scenes with every accumulator and judge each pixel by a derived bound.
///
/// Each row is a case with an accumulator. It gives the errors of the map that came closest to its
/// bound, as fractions of the map's range, and the used share of the bound. The bound follows from
/// the pixel's own fragments and is that of `fixed`. The row also counts the pixels that only the
/// reference covers (lost) and those that only the device covers (invented), and gives the verdict.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat hardcases --accumulator fixed --json hardcases.json\n\n\
    Exits with 1 if a row fails that is not expected to.")]
pub struct Arguments {
    /// Write the rows as JSON to a file, or to stdout for - (in place of the table)
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Only this accumulator [default: all that the adapter supports]
    #[arg(long, value_name = "NAME")]
    accumulator: Option<Accumulator>,
    /// API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists
    /// them; twin: the kernels on the processor, without a driver, slowly
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Only cases whose name contains this
    #[arg(long, value_name = "SUBSTRING")]
    case: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let chosen = arguments.accumulator.map(Accumulator::row);
    let mut cases = cases()?;
    if let Some(part) = &arguments.case {
        cases.retain(|case| case.name.contains(part.as_str()));
        if cases.is_empty() {
            return Err(Error::Usage(format!("no hard case's name contains {part:?}")));
        }
    }
    outputs::check([], &arguments.json)?;
    let gpu = Gpu::open(arguments.adapter.as_deref()).map_err(|error| match error {
        Error::NoAdapter(why) => Error::NoAdapter(format!("hard cases need an adapter to judge, but {why}")),
        other => other,
    })?;
    if let Some(chosen) = chosen {
        check::sums(&gpu.adapter, chosen.of)?;
    }
    let name = gpu.adapter.name.clone();
    note(&format!("rendering on {name} ({}, {})", gpu.adapter.api, gpu.adapter.kind));
    let backend = Backend::gpu(gpu);
    let accumulators = chosen.map_or_else(|| supported(&backend), |chosen| vec![chosen]);
    let rows = run_cases(&cases, &accumulators, &backend, &Bars::new())?;

    let outcome = Outcome::of(&name, &rows);
    let Outcome { passed, expected_failures, failed, .. } = outcome;
    if arguments.json.as_deref() != Some(Path::new("-")) {
        let mut text = table(&rows);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\n{passed} pass, {expected_failures} fail as expected, {failed} FAIL");
        print(&text)?;
    }
    if let Some(path) = &arguments.json {
        write_json(path, &outcome)?;
    }
    if failed > 0 {
        return Err(Error::Gpu { adapter: name, what: format!("{failed} of {} rows failed", rows.len()) });
    }
    Ok(())
}

fn table(rows: &[Row]) -> String {
    let width = rows.iter().map(|row| row.case.len()).max().unwrap_or(0);
    let mut text = format!(
        "{:width$}  {:11}  {:>9}  {:>9}  {:>9}  {:>6}  {:6}  {:>13}  {:>7}  verdict\n",
        "case", "accumulator", "max error", "rmse", "bound", "used", "map", "lost/invented", "excused",
    );
    for row in rows {
        let (max, rmse, bound, used, map) =
            row.worst().map_or((0.0, 0.0, 0.0, 0.0, "-"), |m| (m.max, m.rmse, m.bound, m.used, m.map));
        let verdict = match &row.verdict {
            Verdict::Pass => "pass".to_owned(),
            Verdict::ExpectedFailure(reason) => format!("expected failure ({reason})"),
            Verdict::Fail(what) => format!("FAIL ({what})"),
        };
        let mut notes = String::new();
        let mut remark = |text: String| notes.push_str(&format!("; {text}"));
        if let Some(of_smallest) = row.of_smallest {
            remark(format!("colour errors are up to {of_smallest:.1} of the smallest colour"));
        }
        if row.overflows > 0 {
            remark("a sum wrapped, so it was rendered again with fixed".to_owned());
        }
        if row.nan > 0 {
            remark(format!("{} NaN", row.nan));
        }
        if let Some(over) = &row.over_float {
            remark(format!("rmse over that of f32 sums: {over}"));
        }
        let lost = format!("{}/{}", row.lost, row.invented);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:width$}  {:11}  {max:>9.2e}  {rmse:>9.2e}  {bound:>9.2e}  {:>5.0}%  {map:6}  {lost:>13}  {:>6.2}%  {verdict}{notes}",
            row.case,
            row.accumulator,
            100.0 * used,
            100.0 * row.excused,
        );
    }
    text
}
