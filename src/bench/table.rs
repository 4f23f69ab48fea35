//! Formats the outcome of a study: aligned text for a terminal, Markdown for a README.

use super::config::Config;
use super::definition::Definition;
use crate::plan::{BlendFormat, Features};
use crate::report::{Measurement, Study};

/// A column: its header, and a function that formats its cell for a measurement.
type Column<'a> = (String, Box<dyn Fn(&Measurement) -> String + 'a>);

/// The cell of a value that was not measured.
const NONE: &str = "-";

/// Formats a table with one line per measurement.
///
/// Columns: scene, configuration, surfels, footprint, ms per frame (median ± median absolute
/// deviation), time divided by the baseline's, largest error and RMSE against the f64 reference;
/// against ground truth PSNR, SSIM, mean errors of depth and normal, holes and leaks; PSNR against
/// the approximated configuration, surfels of a cut, speed over the fastest rasteriser of at most
/// the same error, and error limit. Columns that would be empty are left out.
pub fn text(definition: &Definition, study: &Study) -> String {
    let all = &study.measurements;
    let optional = |value: Option<f64>, digits: usize| value.map_or(NONE.to_owned(), |v| format!("{v:.digits$}"));
    let truth = |m: &Measurement, measure: &str| m.reconstruction.get(measure).copied();
    let percent = move |m: &Measurement, measure: &str| optional(truth(m, measure).map(|share| 100.0 * share), 3);
    let mut columns: Vec<Column<'_>> = vec![
        ("scene".into(), Box::new(|m| m.scene.clone())),
        ("config".into(), Box::new(|m| m.config.clone())),
        ("surfels".into(), Box::new(|m| m.surfels.to_string())),
        ("px".into(), Box::new(|m| format!("{:.2}", m.footprint_px))),
        ("ms".into(), Box::new(|m| format!("{:.2} ± {:.2}", m.total_ms.median, m.total_ms.mad))),
    ];
    if let Some(baseline) = &definition.baseline {
        columns.push((
            format!("time / {baseline}"),
            Box::new(|m| optional(relative(definition, study, (m, whole_frame)), 2)),
        ));
    }
    columns.push(("max vs f64".into(), Box::new(|m| error(m.numeric.map(|n| n.max_abs)))));
    columns.push(("RMSE vs f64".into(), Box::new(|m| error(m.numeric_error()))));
    if all.iter().any(|m| m.reconstruction.contains_key("psnr_db")) {
        columns.push(("dB vs truth".into(), Box::new(move |m| optional(truth(m, "psnr_db"), 2))));
        columns.push(("SSIM".into(), Box::new(move |m| optional(truth(m, "ssim"), 4))));
        columns.push(("depth, %".into(), Box::new(move |m| percent(m, "depth_relative_mean"))));
        columns.push(("normal, °".into(), Box::new(move |m| optional(truth(m, "normal_degrees_mean"), 2))));
        columns.push(("holes, %".into(), Box::new(move |m| percent(m, "hole_rate"))));
        columns.push(("leaks, %".into(), Box::new(move |m| percent(m, "leak_rate"))));
    }
    if all.iter().any(|m| m.reconstruction.contains_key("apart_psnr_db")) {
        columns.push(("apart, dB".into(), Box::new(move |m| optional(truth(m, "apart_psnr_db"), 2))));
    }
    if all.iter().any(|m| m.reconstruction.contains_key("cut")) {
        columns.push(("cut".into(), Box::new(move |m| optional(truth(m, "cut"), 0))));
    }
    if all.iter().any(|m| m.ratio_to_raster.is_some()) {
        columns.push(("x raster".into(), Box::new(|m| optional(m.ratio_to_raster, 2))));
    }
    if all.iter().any(|m| m.error_limit.is_some()) {
        let kept = |m: &Measurement| match m.error_limit {
            None => NONE.to_owned(),
            Some(_) => if m.kept { "kept" } else { "MISSED" }.to_owned(),
        };
        columns.push(("limit".into(), Box::new(kept)));
    }
    let heads = columns.iter().map(|(head, _)| head.clone()).collect();
    let rows = all.iter().map(|m| columns.iter().map(|(_, cell)| cell(m)).collect());
    let table = aligned(&std::iter::once(heads).chain(rows).collect::<Vec<Vec<String>>>());
    format!("{table}{}", legend(all))
}

/// Says against which picture the errors of a table are.
fn legend(all: &[Measurement]) -> String {
    let mut text =
        "\nvs f64: against the f64 reference of the same configuration, which shows rounding alone\n".to_owned();
    if all.iter().any(|m| m.reconstruction.contains_key("psnr_db")) {
        text += "vs truth: PSNR against rays that meet the true surface; SSIM to leaks are against them too\n";
    }
    if all.iter().any(|m| m.ratio_to_raster.is_some()) {
        text += "x raster: how many times as fast as the fastest rasteriser whose RMSE vs f64 is no larger\n";
    }
    text
}

/// Formats a Markdown table per scene.
///
/// Columns: configuration, time divided by the baseline's, largest error and RMSE against the f64
/// reference, whether the bits are the same in any surfel order, and which adapters run it.
pub fn markdown(definition: &Definition, study: &Study) -> String {
    let baseline = definition.baseline.as_deref().unwrap_or("baseline");
    let mut text = String::new();
    for case in study.measurements.chunk_by(same_case) {
        let first = &case[0];
        text += &format!("**{}**, {} surfels, {}x{}\n\n", first.scene, first.surfels, first.width, first.height);
        text += &format!("| | time / {baseline} | largest error | RMSE vs f64 | same bits in any order | runs on |\n");
        text += "|---|---|---|---|---|---|\n";
        for m in case {
            let time =
                relative(definition, study, (m, whole_frame)).map_or(NONE.to_owned(), |ratio| format!("{ratio:.2}"));
            let (largest, rmse) = (error(m.numeric.map(|n| n.max_abs)), error(m.numeric_error()));
            let config = definition.configs.iter().find(|config| config.name == m.config);
            let bits = config.map_or(NONE, |config| if config.deterministic() { "yes" } else { "no" });
            let on = config.map_or(NONE, runs_on);
            text += &format!("| `{}` | {time} | {largest} | {rmse} | {bits} | {on} |\n", m.config);
        }
        text.push('\n');
    }
    text
}

/// Names the adapters that run `config`.
fn runs_on(config: &Config) -> &'static str {
    let raster = config.settings(None).raster;
    match (raster.map(|raster| raster.format), config.accumulator().map(|sums| sums.row().features)) {
        (Some(BlendFormat::Rgba32Float), _) => "adapters that blend 32-bit floats",
        (Some(_), _) | (None, Some(Features::None)) => "any adapter",
        (None, Some(Features::AtomicsU64)) => "adapters with 64-bit atomics",
        (None, Some(Features::AtomicsF32)) => "adapters with f32 atomics",
        (None, None) => "the processor",
    }
}

/// Whether two measurements are of the same scene, surfel count and footprint.
fn same_case(a: &Measurement, b: &Measurement) -> bool {
    a.scene == b.scene && a.surfels == b.surfels && a.footprint_px == b.footprint_px
}

/// The median time of a frame, milliseconds.
pub(super) fn whole_frame(measurement: &Measurement) -> f64 {
    measurement.total_ms.median
}

/// Returns the time `ms` of a measurement divided by the baseline's in the same case; `None`
/// without a baseline.
pub(super) fn relative(
    definition: &Definition,
    study: &Study,
    (of, ms): (&Measurement, fn(&Measurement) -> f64),
) -> Option<f64> {
    let baseline = definition.baseline.as_ref()?;
    let base = study.measurements.iter().find(|m| m.config == *baseline && same_case(m, of))?;
    Some(ms(of) / ms(base)).filter(|ratio| ratio.is_finite())
}

fn error(value: Option<f64>) -> String {
    value.map_or(NONE.to_owned(), |value| format!("{value:.1e}"))
}

/// Pads the columns to their widest cell: the first two to the left, the others to the right.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
            0 | 1 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}"),
        });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::report::{Machine, Numeric, Summary};
    use std::path::Path;

    fn study() -> (Definition, Study) {
        let text = "name = \"n\"\nabout = \"a\"\nbaseline = \"base\"\n[[scene]]\nname = \"s\"\nshape = \"torus\"\ncount = 9\n\
                    [[config]]\nname = \"base\"\nbackend = \"gpu\"\naccumulator = \"fixed32\"\n\
                    [[config]]\nname = \"float\"\nbackend = \"gpu\"\naccumulator = \"float\"\nerror_limit = 1e-9\n";
        let definition = Definition::parse(text, Path::new("x.toml")).unwrap();
        let of = |config: &str, median| Measurement {
            scene: "s".into(),
            config: config.into(),
            surfels: 9,
            total_ms: Summary { median, ..Summary::default() },
            numeric: Some(Numeric { rmse: 1e-7, max_abs: 2e-6, psnr_db: Some(140.0) }),
            ..Measurement::default()
        };
        let float = Measurement { error_limit: Some(1e-9), ..of("float", 3.0) };
        let study = Study {
            name: "n".into(),
            about: "a".into(),
            command: String::new(),
            date: String::new(),
            machine: Machine::default(),
            runs: 1,
            measurements: vec![of("base", 2.0), float],
            images: Vec::new(),
        };
        (definition, study)
    }

    #[test]
    fn times_are_relative_to_the_baseline_and_empty_columns_are_not_there() {
        let (definition, study) = study();
        let text = text(&definition, &study);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].contains("time / base") && !text.contains("vs truth") && !text.contains("x raster"), "{text}");
        assert!(lines[1].starts_with("s      base ") && lines[1].contains("2.00 ± 0.00"), "{text}");
        assert!(lines[2].contains(" 1.50 ") && lines[2].ends_with("MISSED"), "{text}");
        assert!(lines[1].contains("2.0e-6") && lines[1].contains("1.0e-7"), "{text}");
    }

    #[test]
    fn the_readmes_table_says_what_runs_where() {
        let (definition, study) = study();
        let text = markdown(&definition, &study);
        assert!(text.contains("| `base` | 1.00 | 2.0e-6 | 1.0e-7 | yes | any adapter |"), "{text}");
        assert!(text.contains("| `float` | 1.50 | 2.0e-6 | 1.0e-7 | no | adapters with f32 atomics |"), "{text}");
        assert!(text.starts_with("**s**, 9 surfels"), "{text}");
    }
}
