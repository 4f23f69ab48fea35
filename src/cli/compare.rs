//! `epsplat compare`: the error of one image against another.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::frame::Frame;
use epsplat::metrics::{Comparison, DECISION_MARGIN, compare};
use epsplat::{Result, io};

use super::{outputs, print, write_json};

/// The error of image A against image B, over linear RGBA and every map they share.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat compare gpu.exr reference.exr --json -\n\n\
    If B has a `decision` map (--backend reference --aov decision), pixels in which a fragment lies within 1e-6 of a\n\
    yes-or-no decision are excused in a second maximum, and their share is printed.")]
pub struct Arguments {
    /// The image in question: .png or .exr
    a: PathBuf,
    /// What it should be
    b: PathBuf,
    /// The measures as JSON, to a file or - for stdout
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    outputs::check([&arguments.a, &arguments.b], &arguments.json)?;
    let comparison = compare(&read(&arguments.a)?, &read(&arguments.b)?)?;
    match &arguments.json {
        Some(path) => write_json(path, &comparison),
        None => print(&table(&comparison)),
    }
}

fn read(path: &Path) -> Result<Frame> {
    let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    if is_exr { io::exr::read(path) } else { io::png::read(path) }
}

fn table(c: &Comparison) -> String {
    let mut text = String::new();
    let psnr = c.psnr_db.map_or("equal images".to_owned(), |db| format!("{db:.2} dB"));
    // Writing to a string cannot fail.
    let _ = writeln!(text, "max abs            {:.3e}", c.max_abs);
    let _ = writeln!(text, "99.9th percentile  {:.3e}", c.percentile_99_9);
    let _ = writeln!(text, "rmse               {:.3e}", c.rmse);
    let _ = writeln!(text, "psnr               {psnr}");
    let _ = writeln!(text, "coverage mismatch  {:.4} %", 100.0 * c.coverage_mismatch);
    if let Some(excused) = c.excused {
        let _ = writeln!(
            text,
            "excused pixels     {:.4} % (a fragment within {DECISION_MARGIN:.0e} of a decision)",
            100.0 * excused
        );
    }
    let decided = if c.excused.is_some() { "  not excused" } else { "" };
    let _ = writeln!(text, "\nmap        range        max abs    max / range{decided}");
    for map in &c.maps {
        let decided = map.max_of_range_decided.map_or(String::new(), |e| format!("    {e:.3e}"));
        let _ = writeln!(
            text,
            "{:<8} {:>9.4e}    {:.3e}    {:.3e}{decided}",
            map.map, map.range, map.max_abs, map.max_of_range
        );
    }
    text
}
