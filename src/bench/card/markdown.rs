//! Formats a record as a Markdown page.

use super::{ConfigRecord, PassRecord, Record, StudyRecord, Throughput};
use crate::report::Summary;

/// The passes with a column in the table, in the order of a frame.
const PASSES: [&str; 5] = ["project", "bin", "visibility", "accumulate", "resolve"];

/// Formats the overview, the failures, the times of the passes, the studies, and the skipped work.
pub fn markdown(record: &Record) -> String {
    let adapter = &record.adapter;
    let mut text = format!("# {}\n\n", adapter.name);
    if record.quick {
        text += "**A quick run: it shows that everything works; its times mean little.**\n\n";
    }
    text += "| | |\n|---|---|\n";
    for (head, cell) in overview(record) {
        text += &format!("| {head} | {} |\n", cell.replace('|', "\\|"));
    }
    text += &list("What is wrong", &record.failures());
    text += &throughput(record);
    text += &studies(record);
    text + &list("Left out", &record.left_out)
}

fn overview(record: &Record) -> Vec<(&'static str, String)> {
    let (adapter, machine) = (&record.adapter, &record.machine);
    let mut rows = vec![
        ("adapter", format!("{} ({}, {}), {}", adapter.name, adapter.api, adapter.kind, adapter.driver)),
        ("machine", format!("{}, {} cores, {}", machine.cpu, machine.cores, machine.os)),
        ("run", format!("`{}`, epsplat {}, {}", record.command, machine.version, record.date)),
        ("time", format!("{:.0} of {:.0} s{}", record.seconds, 60.0 * record.minutes, steps(record))),
    ];
    if let Some(copy) = &record.copy_bandwidth {
        let (runs, copies, mib) = (copy.runs, copy.copies, copy.buffer_bytes >> 20);
        let [speed, mad] = [copy.gb_per_second.median, copy.gb_per_second.mad];
        let wall = copy.wall_gb_per_second.median;
        let how = format!("median of {runs} runs of {copies} copies of {mib} MiB, by {}", copy.clock);
        rows.push((
            "copy bandwidth",
            format!("**{speed:.1} ± {mad:.1} GB/s** read and written ({how}; wall: {wall:.1})"),
        ));
    }
    if let Some(found) = &record.accuracy {
        let (passed, expected, failed) = (found.passed, found.expected_failures, found.failed);
        let verdict = if failed == 0 { "none fails".to_owned() } else { format!("**{failed} FAIL**") };
        let worst = found.worst.as_ref().map_or(String::new(), |worst| {
            let used = 100.0 * worst.used;
            format!("; at most {used:.0} % of a bound used ({}, {}, {})", worst.case, worst.accumulator, worst.map)
        });
        let rows_of = format!("{passed} rows of {} cases pass, {expected} fail as expected", found.cases);
        rows.push(("hard cases", format!("{rows_of}, {verdict}{worst}")));
    }
    if !record.determinism.is_empty() {
        let (all, equal) = (record.determinism.len(), record.determinism.iter().filter(|c| c.equal).count());
        let verdict = if all == equal { String::new() } else { format!(", **{} DIFFER**", all - equal) };
        rows.push(("same bits", format!("{equal} of {all} pairs of images{verdict}")));
    }
    rows
}

fn steps(record: &Record) -> String {
    let each = record.steps.iter().map(|step| format!("{} {:.1}", step.name, step.seconds));
    let each = each.collect::<Vec<_>>().join(", ");
    if each.is_empty() { each } else { format!(" ({each})") }
}

fn list(head: &str, sentences: &[String]) -> String {
    let items: String = sentences.iter().map(|sentence| format!("- {sentence}\n")).collect();
    if items.is_empty() { items } else { format!("\n## {head}\n\n{items}") }
}

/// Formats a table of frame times: a row per number of surfels, a column per pass that ran.
fn throughput(record: &Record) -> String {
    let Some(first) = record.throughput.first() else { return String::new() };
    let [width, height] = first.size;
    let there = |pass: &&&str| record.throughput.iter().any(|row| row.passes.contains_key(**pass));
    let passes: Vec<&str> = PASSES.iter().filter(there).copied().collect();
    let mut text = format!(
        "\n## Frames of a lit sphere, {width}x{height}\n\n\
         Medians in ms (clock of the passes: {}). In brackets: the least bytes that a pass moves, in GB/s and as a share of\n\
         the copy bandwidth; caches make shares above 100 % possible.\n\n",
        first.clock,
    );
    let heads = passes.iter().map(|pass| format!(" {pass} |")).collect::<String>();
    text += &format!(
        "| surfels | px | drawn | frame | million splats/s |{heads} rest |\n|{}\n",
        "---|".repeat(passes.len() + 6)
    );
    for row in &record.throughput {
        let cells = passes.iter().map(|pass| format!(" {} |", cell(row.passes.get(*pass)))).collect::<String>();
        let Throughput { surfels, footprint_px, splats_drawn, total_ms, rest_ms, splats_per_second, .. } = row;
        text += &format!(
            "| {surfels} | {footprint_px:.1} | {splats_drawn} | {:.2} ± {:.2} | {:.3} |{cells} {rest_ms:.2} |\n",
            total_ms.median,
            total_ms.mad,
            splats_per_second * 1e-6,
        );
    }
    text
}

fn cell(pass: Option<&PassRecord>) -> String {
    let Some(pass) = pass else { return "-".to_owned() };
    let ms = format!("{:.3}", pass.ms.median);
    match (pass.gb_per_second, pass.share_of_copy) {
        (Some(speed), Some(share)) => format!("{ms} ({speed:.1}, {:.1} %)", 100.0 * share),
        (Some(speed), None) => format!("{ms} ({speed:.1})"),
        _ => ms,
    }
}

/// Formats a table of the studies, and for each a table of its configurations' times and errors.
fn studies(record: &Record) -> String {
    if record.studies.is_empty() {
        return String::new();
    }
    let head = "\n## Studies\n\n| report | rows | s | failures | left out | notes |\n|---|---|---|---|---|---|\n";
    let mut text = head.to_owned();
    for study in &record.studies {
        let name = &study.name;
        let report = if study.measurements > 0 { format!("[{name}](<{name}/index.html>)") } else { name.clone() };
        let counts = [study.failures.len(), study.left_out.len(), study.notes.len()];
        let counts = counts.map(|count| format!(" {count} |")).concat();
        text += &format!("| {report} | {} | {:.1} |{counts}\n", study.measurements, study.seconds);
    }
    text += &record.studies.iter().map(configs).collect::<String>();
    let notes =
        |study: &StudyRecord| study.notes.iter().map(|note| format!("{}: {note}", study.name)).collect::<Vec<_>>();
    text + &list("Notes of the studies", &record.studies.iter().flat_map(notes).collect::<Vec<_>>())
}

fn configs(study: &StudyRecord) -> String {
    if study.configs.is_empty() {
        return String::new();
    }
    let baseline = study.baseline.as_deref().unwrap_or("-");
    let mut text = format!("\n**{}**: {}\n\n", study.name, study.about);
    text +=
        &format!("| | scenes | time / {baseline}: median | least | most | worst RMSE |\n|---|---|---|---|---|---|\n");
    for ConfigRecord { config, scenes, time_over_baseline, worst_rmse } in &study.configs {
        let times = time_over_baseline.map_or("- | - | -".to_owned(), |time| {
            let Summary { median, min, max, .. } = time;
            format!("{median:.2} | {min:.2} | {max:.2}")
        });
        let error = worst_rmse.map_or("-".to_owned(), |rmse| format!("{rmse:.1e}"));
        text += &format!("| {config} | {scenes} | {times} | {error} |\n");
    }
    text
}
