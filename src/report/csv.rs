//! Writes the measurements as a CSV table (RFC 4180): one row each, with CRLF line ends.
//!
//! The order of columns is fixed: the configuration, rates and memory, errors, the machine, the
//! total time with every run, and last the columns that only some studies have, of passes and of
//! measures against ground truth. A missing value is an empty field.

use std::collections::BTreeSet;

use super::results::{Machine, Measurement, Summary};

/// Columns that every study has, without those of the total time.
const COLUMNS: [&str; 22] = [
    "study",
    "scene",
    "config",
    "backend",
    "accumulator",
    "surfels",
    "footprint_px",
    "width",
    "height",
    "splats_per_second",
    "fragments_per_second",
    "bytes_per_splat",
    "device_bytes",
    "numeric_rmse",
    "numeric_max_abs",
    "numeric_psnr_db",
    "ratio_to_raster",
    "error_limit",
    "kept",
    "adapter",
    "driver",
    "commit",
];

/// Returns the whole table, with its header.
pub(super) fn table(measurements: &[Measurement], machine: &Machine) -> String {
    let passes: BTreeSet<&String> = measurements.iter().flat_map(|m| m.passes.keys()).collect();
    let truths: BTreeSet<&String> = measurements.iter().flat_map(|m| m.reconstruction.keys()).collect();
    let mut header: Vec<String> = COLUMNS.map(str::to_owned).to_vec();
    header.extend(summary_columns("total"));
    header.push("total_ms_runs".to_owned());
    header.extend(passes.iter().flat_map(|pass| summary_columns(&format!("pass_{pass}"))));
    header.extend(truths.iter().map(|measure| format!("reconstruction_{measure}")));
    let rows = measurements.iter().map(|m| {
        let mut row = common(m, machine).to_vec();
        row.extend(summary(Some(&m.total_ms)));
        row.push(m.runs_ms.iter().map(|ms| number(Some(*ms))).collect::<Vec<_>>().join(" "));
        row.extend(passes.iter().flat_map(|pass| summary(m.passes.get(*pass))));
        row.extend(truths.iter().map(|measure| number(m.reconstruction.get(*measure).copied())));
        row
    });
    std::iter::once(header).chain(rows).map(|row| line(&row)).collect()
}

fn common(m: &Measurement, machine: &Machine) -> [String; COLUMNS.len()] {
    let numeric = m.numeric.as_ref();
    // The reference renders on the processor.
    let of_adapter = |name: &str| if m.backend == "reference" { String::new() } else { name.to_owned() };
    [
        m.study.clone(),
        m.scene.clone(),
        m.config.clone(),
        m.backend.clone(),
        m.accumulator.clone(),
        m.surfels.to_string(),
        number(Some(m.footprint_px)),
        m.width.to_string(),
        m.height.to_string(),
        number(Some(m.splats_per_second)),
        number(m.fragments_per_second),
        number(Some(m.bytes_per_splat)),
        m.device_bytes.to_string(),
        number(numeric.map(|n| n.rmse)),
        number(numeric.map(|n| n.max_abs)),
        number(numeric.and_then(|n| n.psnr_db)),
        number(m.ratio_to_raster),
        number(m.error_limit),
        m.kept.to_string(),
        of_adapter(&machine.adapter),
        of_adapter(&machine.driver),
        machine.commit.clone(),
    ]
}

fn summary_columns(of: &str) -> [String; 4] {
    ["median", "mad", "min", "max"].map(|statistic| format!("{of}_ms_{statistic}"))
}

fn summary(summary: Option<&Summary>) -> [String; 4] {
    let statistics: [fn(&Summary) -> f64; 4] = [|s| s.median, |s| s.mad, |s| s.min, |s| s.max];
    statistics.map(|statistic| number(summary.map(statistic)))
}

/// Formats the shortest text that reads back as the same number.
fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:?}"))
}

fn line(fields: &[String]) -> String {
    let fields: Vec<String> = fields.iter().map(|field| quoted(field)).collect();
    fields.join(",") + "\r\n"
}

/// Quotes a field if RFC 4180 requires it.
fn quoted(field: &str) -> String {
    if field.contains(['"', ',', '\r', '\n']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::results::Numeric;

    #[test]
    fn fields_are_quoted_as_the_rfc_says() {
        assert_eq!(quoted("plain text; 1"), "plain text; 1");
        assert_eq!(quoted("a,b"), "\"a,b\"");
        assert_eq!(quoted("a \"b\""), "\"a \"\"b\"\"\"");
        assert_eq!(quoted("a\nb"), "\"a\nb\"");
        assert_eq!(line(&["a,b".into(), String::new(), "c".into()]), "\"a,b\",,c\r\n");
    }

    #[test]
    fn every_row_has_every_column_and_what_is_missing_is_empty() {
        let plain = Measurement { scene: "a, b".into(), ..Measurement::default() };
        let mut full = plain.clone();
        full.numeric = Some(Numeric { rmse: 1e-9, max_abs: 2.0, psnr_db: None });
        full.passes.insert("project".into(), Summary { median: 1.5, mad: 0.0, min: 1.0, max: 2.0 });
        full.reconstruction.insert("ssim".into(), 0.5);
        let machine = Machine { adapter: "card".into(), ..Machine::default() };
        full.runs_ms = vec![1.5, 2.0];
        let table = table(&[plain, full], &machine);
        let lines: Vec<&str> = table.split_terminator("\r\n").collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].ends_with(
            "kept,adapter,driver,commit,total_ms_median,total_ms_mad,total_ms_min,total_ms_max,total_ms_runs,pass_project_ms_median,\
             pass_project_ms_mad,pass_project_ms_min,pass_project_ms_max,reconstruction_ssim"
        ));
        assert!(
            lines[1].starts_with(",\"a, b\",") && lines[1].ends_with(",false,card,,,0.0,0.0,0.0,0.0,,,,,,"),
            "{}",
            lines[1]
        );
        assert!(
            lines[2].contains(",1e-9,2.0,,,,false,card,,,")
                && lines[2].contains(",1.5 2.0,")
                && lines[2].ends_with(",1.5,0.0,1.0,2.0,0.5"),
            "{}",
            lines[2]
        );
        let fields = |line: &str| line.replace("\"a, b\"", "").matches(',').count();
        assert!(lines.iter().all(|line| fields(line) == fields(lines[0])));
    }
}
