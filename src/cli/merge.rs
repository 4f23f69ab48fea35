//! `epsplat merge`: joins the parts of a picture.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use epsplat::options::{BackendName, Chosen, DeviceOptions};
use epsplat::{Error, Merged, Part, Report, Result, merge_files};
use serde::Serialize;

use super::outputs::{self, Source};
use super::progress::Bars;
use super::render::arguments::FileArguments;
use super::render::target::{STANDARD, Target};
use super::{note, write_json};

/// Merge the parts of `render --part`: depths to one file, sums to the picture.
///
/// The picture has the bits of `render` without --part, and all of its formats. The parts may be
/// merged in any order, and some of them first: an output that ends in .part is a file of parts
/// again. Neither the scene nor its options are needed.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  epsplat render scan.laz --part 1/2 -o depth-1.part\n  epsplat render scan.laz --part 2/2 -o depth-2.part\n  epsplat merge depth-1.part depth-2.part -o depth.part\n  epsplat render scan.laz --part 1/2 --within depth.part -o sums-1.part\n  epsplat render scan.laz --part 2/2 --within depth.part -o sums-2.part\n  epsplat merge sums-1.part sums-2.part -o scan.png"
)]
pub struct Arguments {
    /// Files of render --part, or of merge
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    /// The picture of sums: .png, .exr (linear, with maps), .jpg, .tif, .npy or .npz, and - is
    /// standard output; or .part
    #[arg(short, long)]
    output: PathBuf,
    /// API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists
    /// them; twin: the kernels on the processor, without a driver, slowly
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    #[command(flatten)]
    file: FileArguments,
}

/// The JSON report of a merge.
#[derive(Serialize)]
struct Outcome<'a> {
    #[serde(flatten)]
    report: &'a Report,
    /// Number of parts of the picture.
    parts: u32,
    /// A hash of the colour's and of each map's bits ([`Frame::hashes`](epsplat::Frame::hashes)).
    bits: BTreeMap<&'static str, String>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let Arguments { parts, output, adapter, file } = arguments;
    outputs::check(parts.iter().map(Source::other), [output].into_iter().chain(&file.json))?;
    let is_part = output.extension().is_some_and(|extension| extension == "part");
    if is_part && (file.format.is_some() || file.depth_scale.is_some() || file.json.is_some()) {
        let what = "a file of parts is no picture: leave --format, --depth-scale and --json out, or name an image";
        return Err(Error::Usage(what.into()));
    }
    let part = merge_files(parts)?;
    if part.adapters().len() > 1 {
        let adapters = part.adapters().join(", ");
        note(&format!("several adapters drew the parts, and their bits may differ: {adapters}"));
    }
    if is_part {
        part.write(output)?;
        let ((shares, of), kind) = (part.shares(), if part.holds_depths() { "nearest depths" } else { "sums" });
        note(&format!("{}: {kind} of {} of {of} parts", output.display(), shares.len()));
        return Ok(());
    }
    part.check_picture()?;
    let target = Target::of_picture(output, file, part.maps())?;
    let backend = Chosen(Some(BackendName::Gpu));
    let device = &DeviceOptions { backend, adapter: adapter.clone(), ..DeviceOptions::default() };
    target.closed_is_done(picture(&part, device, (&target, output), file.json.as_deref()))
}

/// Writes the picture of all parts.
fn picture(part: &Part, device: &DeviceOptions, (target, output): (&Target, &Path), json: Option<&Path>) -> Result<()> {
    let Merged { frame, report, .. } = part.picture(device, &Bars::new())?;
    target.write(output, &frame)?;
    let (_, of) = part.shares();
    match json {
        Some(path) => write_json(path, &Outcome { report: &report, parts: of, bits: frame.hashes() }),
        None => {
            let output =
                if output == Path::new(STANDARD) { "standard output".into() } else { output.display().to_string() };
            note(&format!("{output}: {of} parts merged, {} surfels, {:.1} ms", report.surfels, report.total_ms));
            Ok(())
        }
    }
}
