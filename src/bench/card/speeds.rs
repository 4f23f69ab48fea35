//! Formats what a record measured of speed: copies, clocks, frames, passes, and changes of the hot
//! path.

use super::{Clocks, PassRecord, Record, Throughput, Trial};
use crate::bench::bandwidth::Copier;

/// The passes with a column in the table, in the order of a frame.
const PASSES: [&str; 5] = ["project", "bin", "visibility", "accumulate", "resolve"];

/// Formats all tables of speed for which there are measurements.
pub(super) fn tables(record: &Record) -> String {
    [clocks(record), frames(record), passes(record), changes(record)].concat()
}

/// Formats the rows of a table below its heading and an explanation.
fn table(heading: &str, about: &str, heads: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let heads: Vec<String> = heads.iter().map(|head| (*head).to_owned()).collect();
    let rule = format!("|{}\n", "---|".repeat(heads.len()));
    let rows: String = rows.iter().map(|row| line(row)).collect();
    format!("\n## {heading}\n\n{about}\n\n{}{rule}{rows}", line(&heads))
}

/// Returns the head and the cell of the overview's row of copies by `by`, if they were measured.
pub(super) fn copy(record: &Record, by: Copier) -> Option<(&'static str, String)> {
    let copy = record.copy_of_memory(by)?;
    let (runs, copies, clock) = (copy.runs, copy.copies, copy.clock);
    let how = format!("best of {runs} runs of {copies} copies of {}, by {clock}", mib(copy.buffer_bytes));
    let others = record.copies.iter().filter(|other| other.by == by && other.buffer_bytes != copy.buffer_bytes);
    let others: String =
        others.map(|other| format!("; {}: {:.1}", mib(other.buffer_bytes), other.gb_per_second.max)).collect();
    let head = match by {
        Copier::Kernel => "copy by a kernel",
        Copier::Command => "copy command",
    };
    Some((head, format!("**{:.1} GB/s** read and written ({how}{others})", copy.gb_per_second.max)))
}

fn mib(bytes: u64) -> String {
    format!("{} MiB", bytes >> 20)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

fn clocks(record: &Record) -> String {
    let known: Vec<&Clocks> = record.clocks.iter().filter(|clocks| clocks.core_mhz.is_some()).collect();
    if record.clocks.is_empty() {
        return String::new();
    }
    if known.is_empty() {
        return "\n## Clocks\n\nThe clocks of this adapter are not known.\n".to_owned();
    }
    let row = |clocks: &&Clocks| {
        let Clocks { when, core_mhz, memory_mhz, celsius, watts, .. } = clocks;
        let values = [core_mhz, memory_mhz, celsius, watts].map(|value| optional(*value, 0));
        [vec![when.clone()], values.to_vec()].concat()
    };
    let about = format!("Read by {}. A card at rest lowers its clocks.", known[0].source);
    let heads = ["when", "core, MHz", "memory, MHz", "°C", "W"];
    table("Clocks", &about, &heads, &known.iter().map(row).collect::<Vec<_>>())
}

/// Formats the times of frames: a row per number of surfels.
fn frames(record: &Record) -> String {
    let Some(first) = record.throughput.first() else { return String::new() };
    let row = |of: &Throughput| {
        let rates = |ms: f64| [of.surfels, of.splats_drawn].map(|count| format!("{:.2}", count as f64 * 1e-3 / ms));
        let mut cells = vec![of.surfels.to_string(), format!("{:.1}", of.footprint_px), of.splats_drawn.to_string()];
        cells.push(format!("{:.2} ± {:.2}", of.wait_ms.median, of.wait_ms.mad));
        cells.extend(rates(of.wait_ms.median));
        match of.in_flight {
            Some(flown) => cells.extend([vec![format!("{:.2}", flown.ms)], rates(flown.ms).to_vec()].concat()),
            None => cells.extend(["-"; 3].map(str::to_owned)),
        }
        cells.push(format!("{}{}", of.warm_up.frames, if of.warm_up.settled { "" } else { ", not settled" }));
        cells
    };
    let depth = record.throughput.iter().find_map(|of| of.in_flight).map_or(0, |flown| flown.depth);
    let about = format!(
        "A frame that waits ends when the caller has its last byte. Of frames in flight, {depth} at a time stay on the\n\
         device. Rates are in millions a second: of all surfels of the scene (processed), and of the splats that were\n\
         neither culled nor out of view (drawn). Warm-up frames come first, until their time settles."
    );
    let heads = [
        "surfels",
        "px",
        "drawn",
        "waits, ms",
        "processed/s",
        "drawn/s",
        "in flight, ms",
        "processed/s",
        "drawn/s",
        "warm-up",
    ];
    let [width, height] = first.size;
    let heading = format!("Frames of a lit sphere, {width}x{height}");
    table(&heading, &about, &heads, &record.throughput.iter().map(row).collect::<Vec<_>>())
}

/// Formats the times of the passes alone: a row per number of surfels, a column per pass that ran.
fn passes(record: &Record) -> String {
    let Some(first) = record.throughput.first() else { return String::new() };
    let there = |pass: &&&str| record.throughput.iter().any(|row| row.passes.contains_key(**pass));
    let passes: Vec<&str> = PASSES.iter().filter(there).copied().collect();
    let row = |of: &Throughput| {
        let each = passes.iter().map(|pass| cell(of.passes.get(*pass)));
        let ends = [format!("{:.3}", of.passes_ms()), format!("{:.3}", of.rest_ms)];
        [of.surfels.to_string()].into_iter().chain(each).chain(ends).collect()
    };
    let about = format!(
        "Medians in ms by {}, of the frames that wait. In brackets: the least bytes that a pass moves, in GB/s and as a\n\
         share of what a kernel copies; caches make shares above 100 % possible. The rest is recording, submission, gaps\n\
         between passes, clears and read-back together.",
        first.clock
    );
    let heads = [&["surfels"], &passes[..], &["passes", "rest"]].concat();
    table("Passes alone", &about, &heads, &record.throughput.iter().map(row).collect::<Vec<_>>())
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

/// Formats the changes of the hot path: a row per number of surfels and change.
fn changes(record: &Record) -> String {
    if record.changes.is_empty() {
        return String::new();
    }
    let row = |trial: &Trial| {
        let named = |(name, [before, after]): (&str, [f64; 2])| format!("{name} {before:.3} to {after:.3}");
        let Trial { surfels, change, ratio, .. } = trial;
        vec![
            surfels.to_string(),
            change.clone(),
            format!("{:.3}", trial.default_ms.median),
            format!("{:.3}", trial.ms.median),
            format!("{:.3} ± {:.3}", ratio.median, ratio.mad),
            format!("{:.2} to {:.2}", ratio.min, ratio.max),
            optional(trial.passes_ratio, 3),
            trial.changed().into_iter().map(named).collect::<Vec<_>>().join(", "),
            if trial.equal { "equal" } else { "**DIFFER**" }.to_owned(),
            if trial.same_kernels { "the same" } else { "" }.to_owned(),
        ]
    };
    let about = "Each change alone: frames with it and frames of the default took turns, and the ratio is the median of the\n\
        pairs, with its median deviation. Times are in ms until the caller has the last byte; frames in flight are not read\n\
        back. Passes alone are without submission and read-back, which both share. Where the kernels are the same, only the\n\
        host's work can differ.";
    let heads = [
        "surfels",
        "change",
        "default, ms",
        "changed, ms",
        "ratio",
        "from, to",
        "passes alone",
        "passes that changed, ms",
        "bits",
        "kernels",
    ];
    table("Changes of the hot path", about, &heads, &record.changes.iter().map(row).collect::<Vec<_>>())
}
