//! Formats a record as a Markdown page.

use super::{ConfigRecord, Record, StudyRecord, speeds};
use crate::bench::bandwidth::Copier;
use crate::report::Summary;

/// Formats the overview, the failures, the speeds, the studies, and the skipped work.
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
    text += &speeds::tables(record);
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
    rows.extend([Copier::Kernel, Copier::Command].into_iter().filter_map(|by| speeds::copy(record, by)));
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
    text += &format!(
        "| | scenes | frame / {baseline}: median | least | most | passes alone: median | least | most | worst RMSE |\n{}\n",
        "|---|---|---|---|---|---|---|---|---|"
    );
    for ConfigRecord { config, scenes, time_over_baseline, passes_over_baseline, worst_rmse } in &study.configs {
        let [frames, passes] = [time_over_baseline, passes_over_baseline].map(|ratio| {
            ratio.map_or("- | - | -".to_owned(), |Summary { median, min, max, .. }| {
                format!("{median:.2} | {min:.2} | {max:.2}")
            })
        });
        let error = worst_rmse.map_or("-".to_owned(), |rmse| format!("{rmse:.1e}"));
        text += &format!("| {config} | {scenes} | {frames} | {passes} | {error} |\n");
    }
    text
}
