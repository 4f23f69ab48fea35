//! `epsplat compare`: measures the error of one image against another.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::low_level::frame::Frame;
use epsplat::low_level::metrics::{BYTES_PER_PIXEL, Comparison, DECISION_MARGIN, compare};
use epsplat::{Error, Result, io};

use super::{outputs, print, write_json};

/// Measure the error of image A against image B, in linear colour and every map they share.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat compare gpu.exr reference.exr --json -\n\n\
    If B has a `decision` map (--backend reference --aov decision), pixels in which a fragment lies within 1e-6 of a\n\
    yes-or-no decision are excused in a second maximum, and their share is printed. Exits with 1 if a value is not\n\
    finite and differs between the images, so that no error can be measured.")]
pub struct Arguments {
    /// Image to measure: .png or .exr
    a: PathBuf,
    /// Image to compare A with, which counts as exact: .png or .exr
    b: PathBuf,
    /// Write the measures as JSON to a file, or to stdout for -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    outputs::check([&arguments.a, &arguments.b].map(outputs::Source::other), &arguments.json)?;
    let (a, b) = (read(&arguments.a)?, read(&arguments.b)?);
    io::image::check_room(&arguments.b, a.color.len() as u64 * BYTES_PER_PIXEL)?;
    let comparison = compare(&a, &b)?;
    match &arguments.json {
        Some(path) => write_json(path, &comparison)?,
        None => print(&(table(&comparison) + &unshared(arguments, &comparison)))?,
    }
    if comparison.is_finite() {
        return Ok(());
    }
    let maps = comparison.maps.iter().filter(|map| map.not_finite > 0);
    let maps = maps.map(|map| format!("{} of {}", map.not_finite, map.map)).collect::<Vec<_>>().join(", ");
    let what = format!(
        "it has pixels with a value that is not finite in one image and differs in the other, so that their error cannot be measured: {maps}"
    );
    Err(Error::malformed(&arguments.a, what))
}

/// Text in place of an error, if a value is not finite in one image and differs in the other.
const NOT_FINITE: &str = "not finite";

fn read(path: &Path) -> Result<Frame> {
    let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    if is_exr { io::exr::read(path) } else { io::png::read(path) }
}

fn table(c: &Comparison) -> String {
    let mut text = String::new();
    // RGB and alpha are the first two maps. The measures above the table are of these two only.
    let finite = c.maps.iter().take(2).all(|map| map.not_finite == 0);
    let measure = |value: f64| if finite { format!("{value:.3e}") } else { NOT_FINITE.to_owned() };
    let psnr = match c.psnr_db {
        None => "equal images".to_owned(),
        Some(db) if finite => format!("{db:.2} dB"),
        Some(_) => NOT_FINITE.to_owned(),
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "max abs            {}", measure(c.max_abs));
    let _ = writeln!(text, "99.9th percentile  {}", measure(c.percentile_99_9));
    let _ = writeln!(text, "rmse               {}", measure(c.rmse));
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
        let of_range = |error: f64| if map.range > 0.0 { format!("{error:.3e}") } else { "-".to_owned() };
        let range = format!("{:.4e}", map.range);
        let in_one = if map.in_one > 0 {
            format!("  ({} pixels have a value in one image only)", map.in_one)
        } else {
            String::new()
        };
        let [max, of_range, decided] = match map.not_finite {
            0 => [
                format!("{:.3e}", map.max_abs),
                of_range(map.max_of_range),
                map.max_of_range_decided.map_or(String::new(), of_range),
            ],
            pixels => [NOT_FINITE.to_owned(), format!("({pixels} pixels)"), String::new()],
        };
        let line = format!("{:<8} {range:>11}    {max:<9}    {of_range:<9}    {decided}{in_one}", map.map);
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

/// Returns a line for each image that names the maps that only it has.
fn unshared(arguments: &Arguments, c: &Comparison) -> String {
    let sides = [(&arguments.a, &c.only_in_a), (&arguments.b, &c.only_in_b)];
    let only = sides.into_iter().filter(|(_, maps)| !maps.is_empty());
    only.map(|(path, maps)| format!("only {} has: {}\n", path.display(), maps.join(", "))).collect()
}
