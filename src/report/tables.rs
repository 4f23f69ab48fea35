//! The section of the page with all numbers, as one table per scene.

use std::collections::BTreeSet;

use super::case::{Case, cases_of, extent, scenes};
use super::family::{self, Families};
use super::pareto::best;
use super::results::{Measurement, Summary};
use super::text::{NONE, count, escape, optional, si, significant, tick};

/// A column: its group, its head, and its cell for a measurement.
struct Column<'a> {
    group: &'static str,
    head: String,
    cell: Box<dyn Fn(&Measurement) -> String + 'a>,
}

impl<'a> Column<'a> {
    fn new(group: &'static str, head: &str, cell: impl Fn(&Measurement) -> String + 'a) -> Self {
        Self { group, head: escape(head), cell: Box::new(cell) }
    }
}

/// Passes in the order in which they run; others follow by name.
const PASSES: [&str; 4] = ["project", "visibility", "accumulate", "resolve"];

/// Heads for measures against ground truth; others are shown by their own names.
const TRUTHS: [(&str, &str); 17] = [
    ("psnr_db", "PSNR, dB"),
    ("ssim", "SSIM"),
    ("max_abs", "largest"),
    ("percentile_99_9", "99.9 %"),
    ("depth_relative_mean", "depth, mean"),
    ("depth_relative_rmse", "depth, RMSE"),
    ("depth_relative_percentile_99", "depth, 99 %"),
    ("normal_degrees_mean", "normal °, mean"),
    ("normal_degrees_percentile_99", "normal °, 99 %"),
    ("hole_rate", "holes"),
    ("leak_rate", "leaks"),
    ("silhouette_iou", "silhouette IoU"),
    ("outline_px", "outline, px"),
    ("apart_psnr_db", "apart, dB"),
    ("apart_rmse", "apart, RMSE"),
    ("cut", "surfels of the cut"),
    ("rmse", "RMSE"),
];

/// Sorts names by the order of `known`, then the others by name.
fn in_order<'a>(names: BTreeSet<&'a String>, known: &[&str]) -> Vec<&'a String> {
    let mut names: Vec<&String> = names.into_iter().collect();
    names.sort_by_key(|name| known.iter().position(|known| known == name).unwrap_or(known.len()));
    names
}

/// Formats median and deviation with the same number of decimals.
fn time(summary: &Summary) -> String {
    let median = significant(summary.median, 3);
    if median.contains('e') || !summary.mad.is_finite() {
        return format!("{median} ± {}", significant(summary.mad, 2));
    }
    let decimals = median.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    format!("{median} ± {:.decimals$}", summary.mad)
}

fn limit(m: &Measurement) -> String {
    match m.error_limit {
        None => NONE.to_owned(),
        Some(limit) if m.kept => format!("✓ {}", tick(limit)),
        Some(limit) => format!("<strong class=\"broken\">✗ {}</strong>", tick(limit)),
    }
}

/// Returns the columns after the configuration's name. Optional columns appear only if some row has
/// a value for them.
fn columns<'a>(rows: &[&'a Measurement]) -> Vec<Column<'a>> {
    let mut columns = Vec::new();
    let varies = |of: fn(&Measurement) -> u64| rows.iter().map(|m| of(m)).collect::<BTreeSet<_>>().len() > 1;
    if varies(|m| m.surfels) {
        columns.push(Column::new("", "surfels", |m| count(m.surfels)));
    }
    if varies(|m| m.footprint_px.to_bits()) {
        columns.push(Column::new("", "radius, px", |m| significant(m.footprint_px, 2)));
    }
    if varies(|m| u64::from(m.width) << 32 | u64::from(m.height)) {
        columns.push(Column::new("", "image", |m| format!("{} × {}", m.width, m.height)));
    }
    columns.push(Column::new("time", "median ± MAD, ms", |m| time(&m.total_ms)));
    columns.push(Column::new("time", "× raster", |m| optional(m.ratio_to_raster, 3)));
    for pass in in_order(rows.iter().flat_map(|m| m.passes.keys()).collect(), &PASSES) {
        columns
            .push(Column::new("passes, median ms", pass, move |m| optional(m.passes.get(pass).map(|s| s.median), 3)));
    }
    if rows.iter().any(|m| m.numeric.is_some()) {
        const GROUP: &str = "against the f64 reference";
        columns.push(Column::new(GROUP, "RMSE", |m| optional(m.numeric.map(|n| n.rmse), 2)));
        columns.push(Column::new(GROUP, "largest", |m| optional(m.numeric.map(|n| n.max_abs), 2)));
        columns.push(Column::new(GROUP, "PSNR, dB", |m| match m.numeric {
            None => NONE.to_owned(),
            Some(numeric) => numeric.psnr_db.map_or_else(|| "∞".to_owned(), |psnr| format!("{psnr:.1}")),
        }));
    }
    if rows.iter().any(|m| m.error_limit.is_some()) {
        columns.push(Column::new("against the f64 reference", "limit", limit));
    }
    let truths = in_order(rows.iter().flat_map(|m| m.reconstruction.keys()).collect(), &TRUTHS.map(|(name, _)| name));
    for truth in truths {
        let head = TRUTHS
            .iter()
            .find(|(name, _)| name == truth)
            .map_or_else(|| truth.replace('_', " "), |(_, head)| (*head).into());
        let cell = move |m: &Measurement| optional(m.reconstruction.get(truth).copied(), 3);
        columns.push(Column::new("against ground truth", &head, cell));
    }
    columns.push(Column::new("rate and memory", "splats/s", |m| si(m.splats_per_second)));
    if rows.iter().any(|m| m.fragments_per_second.is_some()) {
        let cell = |m: &Measurement| m.fragments_per_second.map_or_else(|| NONE.to_owned(), si);
        columns.push(Column::new("rate and memory", "fragments/s", cell));
    }
    columns.push(Column::new("rate and memory", "bytes/splat", |m| significant(m.bytes_per_splat, 3)));
    columns.push(Column::new("rate and memory", "device MiB", |m| significant(m.device_bytes as f64 / 1048576.0, 3)));
    columns
}

/// Returns the heads of the groups; neighbouring columns of one group share a cell.
fn group_row(columns: &[Column<'_>]) -> String {
    let groups = columns.chunk_by(|a, b| a.group == b.group);
    groups
        .map(|group| {
            format!("<th class=\"group\" scope=\"colgroup\" colspan=\"{}\">{}</th>", group.len(), group[0].group)
        })
        .collect()
}

/// Returns the section of the page.
pub(super) fn section(measurements: &[Measurement], families: &Families) -> String {
    let tables: String = scenes(measurements).into_iter().map(|(scene, rows)| table(scene, &rows, families)).collect();
    format!(
        "<section><h2>All numbers</h2><p>The fastest first. Bold: no other configuration beats it in both time and RMSE. \
         × raster: how many times as fast as the fastest raster configuration with an equal or smaller RMSE. \
         Errors are over linear RGBA.</p>{tables}</section>"
    )
}

/// Returns the table of a scene. Its cases are parts of one table, so that columns can be compared.
fn table(scene: &str, rows: &[&Measurement], families: &Families) -> String {
    let columns = columns(rows);
    let swept = columns.iter().any(|column| column.group.is_empty());
    let about = rows.first().filter(|_| !swept).map(|m| format!(": {}", extent(m))).unwrap_or_default();
    let heads: String =
        columns.iter().map(|column| format!("<th class=\"n\" scope=\"col\">{}</th>", column.head)).collect();
    let bodies: String = cases_of(scene, rows).iter().map(|case| body(case, &columns, families)).collect();
    let (scene, groups) = (escape(scene), group_row(&columns));
    format!(
        "<h3>{scene}{about}</h3><div class=\"scroll\"><table class=\"numbers\"><thead><tr><th></th><th></th>{groups}</tr>\
         <tr><th scope=\"col\">configuration</th><th scope=\"col\">backend</th>{heads}</tr></thead>{bodies}</table></div>"
    )
}

fn body(case: &Case<'_>, columns: &[Column<'_>], families: &Families) -> String {
    let front = best(&case.measurements);
    let mut rows = case.measurements.clone();
    rows.sort_by(|a, b| a.total_ms.median.total_cmp(&b.total_ms.median));
    let row = |m: &&Measurement| {
        let cells: String = columns.iter().map(|column| format!("<td class=\"n\">{}</td>", (column.cell)(m))).collect();
        let class = if front.iter().any(|best| std::ptr::eq(*best, *m)) { " class=\"front\"" } else { "" };
        let (swatch, config, family) = (families.style(m).swatch(), escape(&m.config), escape(&family::name(m)));
        format!("<tr{class}><th scope=\"row\">{swatch} {config}</th><td>{family}</td>{cells}</tr>")
    };
    format!("<tbody>{}</tbody>", rows.iter().map(row).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_and_its_deviation_have_equally_many_decimals() {
        let of = |median: f64, mad: f64| time(&Summary { median, mad, ..Summary::default() });
        assert_eq!([of(12.34, 0.256), of(1234.0, 8.4), of(0.1234, 0.01)], ["12.3 ± 0.3", "1,234 ± 8", "0.123 ± 0.010"]);
    }

    #[test]
    fn columns_are_those_that_have_values_in_the_order_of_the_passes() {
        let mut m = Measurement::default();
        let heads = |m: &Measurement| columns(&[m]).iter().map(|column| column.head.clone()).collect::<Vec<_>>();
        assert_eq!(heads(&m), ["median ± MAD, ms", "× raster", "splats/s", "bytes/splat", "device MiB"]);
        for pass in ["resolve", "bin", "project", "accumulate"] {
            m.passes.insert(pass.into(), Summary::default());
        }
        m.reconstruction.insert("ssim".into(), 0.9);
        m.reconstruction.insert("new_measure".into(), 0.9);
        let heads = heads(&m);
        assert_eq!(heads[2..8], ["project", "accumulate", "resolve", "bin", "SSIM", "new measure"]);
    }
}
