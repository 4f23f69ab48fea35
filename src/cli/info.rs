//! `epsplat info`: describes a file and the surfels that the renderer would make of it.

mod gaussians;
mod ranges;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use epsplat::io::{About, Points, Span, class_name};
use epsplat::low_level::scene::{Colors, Scene};
use epsplat::low_level::surfels::{self, ASLANT, Coverage, Preparation, Sample};
use epsplat::options::InputOptions;
use epsplat::{Files, Result};
use serde::Serialize;

use super::inputs::help_of;
use super::outputs::Source;
use super::progress::Bars;
use super::{outputs, print, write_json};
use gaussians::Gaussians;

/// Describe a file: its points, attributes, bounding box, coverage, and how they are rendered.
///
/// A cloud of more than a million points is read as a whole, but spacing, coverage and radii are
/// those of some places in it, which a line of the output tells.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat info scan.laz")]
pub struct Arguments {
    #[arg(help = help_of("A point cloud or mesh"))]
    input: PathBuf,
    /// Write the description as JSON to a file, or to stdout for -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Examine all points of a large cloud: takes many times as long
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    reading: InputOptions,
}

/// A surface counts as closed if at least this share of its surfels has no open gap to their
/// neighbours.
const COVERED: f64 = 0.9;

#[derive(Serialize)]
struct Info {
    /// Description in the file's header.
    file: About,
    points: u64,
    normals: bool,
    radii: bool,
    /// Number of points with a usable normal, if only some have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    points_with_normals: Option<u64>,
    /// Number of points with a usable radius, if only some have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    points_with_radii: Option<u64>,
    colors: &'static str,
    /// Attributes for --color-by and --where, with their ranges.
    attributes: Vec<Span>,
    /// Statistics of a file of Gaussians; None for other files.
    gaussians: Option<Gaussians>,
    /// Number of points of each class of a laser scan.
    classes: BTreeMap<u8, u64>,
    /// Size of the octree; None for files without levels of detail.
    levels_of_detail: Option<LevelsOfDetail>,
    /// True if points have texture coordinates, which `render --texture` needs.
    texture: bool,
    /// Number of images that the texture coordinates refer to.
    images: u64,
    /// Mesh whose triangles are drawn together with the surfels (`epsplat hybrid`).
    #[serde(skip_serializing_if = "Option::is_none")]
    triangles: Option<PathBuf>,
    /// True if the file has faces.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    is_mesh: bool,
    up: &'static str,
    /// Corners of the bounding box, world coordinates.
    min: [f64; 3],
    max: [f64; 3],
    /// World coordinates that are subtracted before coordinates are converted to f32.
    origin: [f64; 3],
    largest_radius: f64,
    /// Places of a large cloud that were examined for spacing, coverage and radii; None if all of
    /// it was.
    sample: Option<Sample>,
    /// Coverage of the surface; None for Gaussians and if all points are at one position.
    coverage: Option<Coverage>,
    /// Attributes that are missing in the file, so that they are estimated or not used.
    lacks: Vec<&'static str>,
    /// Command that writes a file with the missing attributes, except colours.
    supplied_by: Option<String>,
    preparation: Preparation,
}

/// A file that `epsplat hybrid` wrote for a mesh without small triangles: it has no points.
#[derive(Serialize)]
struct TrianglesAlone {
    points: u64,
    triangles: PathBuf,
}

/// Size of the octree of a file with levels of detail.
#[derive(Serialize)]
struct LevelsOfDetail {
    nodes: u64,
    levels: u64,
}

impl LevelsOfDetail {
    fn of(scene: &Scene) -> Option<Self> {
        let hierarchy = scene.hierarchy.as_ref()?;
        Some(Self { nodes: hierarchy.nodes.len() as u64, levels: hierarchy.levels() as u64 })
    }
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let source = Source::Cloud(&arguments.input, arguments.reading.file.input_format);
    outputs::check([source], &arguments.json)?;
    let bars = Bars::new();
    let mut points = Files::described(&arguments.input, &arguments.reading, &bars)?;
    let about = points.about.take().map(|about| *about).unwrap_or_default();
    let beside = points.beside.clone();
    if let Some(triangles) = beside.clone().filter(|_| points.positions.is_empty()) {
        return tell_triangles(arguments, triangles);
    }
    let attributes = std::mem::take(&mut points.spans);
    let bounds = surfels::bounds(&points);
    let is_mesh = points.faces.is_some();
    let (texture, classes) = (points.texture.is_some(), points.classes.clone());
    let numbers = points.texture_numbers.iter().flatten().filter(|number| **number != u32::MAX);
    let images = numbers.max().map_or(u64::from(texture), |last| u64::from(*last) + 1);
    // The greys made from intensities do not count as colours.
    let of_colors = if about.intensities.is_some() { "none" } else { colors(&points) };
    let held = (points.positions.len() as u64, points.normals.is_some(), points.radii.is_some(), of_colors);
    let surveyed = surfels::survey(points, arguments.all, &bars);
    let surveyed = surveyed.map_err(|error| error.of_inputs(std::slice::from_ref(&arguments.input)))?;
    let surfels::Survey { scene, preparation, origin, largest_radius, coverage, sample } = surveyed;
    let gaussians = Gaussians::of(&scene);
    let lacking = [
        (preparation.estimated_normals > 0, if held.1 { "some normals" } else { "normals" }),
        (!scene.oriented && gaussians.is_none(), "a side for its normals"),
        (preparation.estimated_radii > 0, if held.2 { "some radii" } else { "radii" }),
        (coverage.is_some_and(|coverage| coverage.covered < COVERED), "surfels that close the surface"),
    ];
    let mut lacks: Vec<_> = lacking.into_iter().filter(|(lacks, _)| *lacks).map(|(_, what)| what).collect();
    let supplied_by = (!lacks.is_empty()).then(|| supplied_by(arguments));
    lacks.extend((held.3 == "none").then_some("colours"));
    let with = |given: bool, lacking: u64| (given && lacking > 0).then(|| preparation.surfels.saturating_sub(lacking));
    let info = Info {
        points_with_normals: with(held.1, preparation.estimated_normals),
        points_with_radii: with(held.2, preparation.estimated_radii),
        file: about,
        points: held.0,
        normals: held.1,
        radii: held.2,
        colors: held.3,
        attributes,
        gaussians,
        classes,
        levels_of_detail: LevelsOfDetail::of(&scene),
        texture,
        images,
        triangles: beside,
        is_mesh,
        up: scene.up.name(),
        min: bounds.min.to_array(),
        max: bounds.max.to_array(),
        origin: origin.to_array(),
        largest_radius: largest_radius.into(),
        sample,
        coverage,
        lacks,
        supplied_by,
        preparation,
    };
    match &arguments.json {
        Some(path) => write_json(path, &info),
        None => print(&table(&arguments.input, &info)),
    }
}

/// Writes that the input has no points, but names a mesh.
fn tell_triangles(arguments: &Arguments, triangles: PathBuf) -> Result<()> {
    match &arguments.json {
        Some(path) => write_json(path, &TrianglesAlone { points: 0, triangles }),
        None => print(&format!(
            "{}\n  points    none: `epsplat render` draws only the triangles of {}\n",
            epsplat::io::shown(&arguments.input).display(),
            triangles.display()
        )),
    }
}

/// Returns the command that makes surfels of the input.
fn supplied_by(arguments: &Arguments) -> String {
    let Arguments { input, reading, .. } = arguments;
    // The folder of a pipe is no place for the output.
    let output = if input.is_file() { input.with_extension("surfels.ply") } else { PathBuf::from("surfels.ply") };
    format!("epsplat surfels {}{} -o {}", epsplat::io::shown(input).display(), reading.arguments(), output.display())
}

fn colors(points: &Points) -> &'static str {
    let paint = points.faces.as_ref().and_then(|faces| faces.paint.as_ref());
    match points.colors {
        None if paint.is_some_and(|paint| paint.has_images()) => "by images of materials",
        None if paint.is_some_and(|paint| !paint.colors.is_empty()) => "of faces or materials",
        None => "none",
        Some(Colors::Srgb8(_)) => "8-bit sRGB",
        Some(Colors::Harmonics(_)) => "spherical harmonics",
        Some(_) => "float",
    }
}

fn table(input: &std::path::Path, info: &Info) -> String {
    let mut text = String::new();
    let vector = |v: [f64; 3]| v.map(|c| c.to_string()).join(", ");
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}", epsplat::io::shown(input).display());
    let _ = writeln!(text, "  points    {}", info.points);
    told(&mut text, &info.file);
    held(&mut text, info);
    ranges::write(&mut text, &info.attributes);
    let _ = writeln!(text, "  box       {} to {}", vector(info.min), vector(info.max));
    let _ = writeln!(text, "  up        {}{}", info.up, if info.preparation.guessed_up { " (a guess)" } else { "" });
    if let Some(Sample { points, places }) = info.sample {
        let what = "spacing, coverage, radii and counts below are estimates";
        let _ = writeln!(text, "  sample    {what} from {points} points in {places} places (--all examines all)");
    }
    if let Some(Coverage { spacing, covered, open, lone, covered_aslant }) = info.coverage {
        let _ = writeln!(text, "  spacing   {spacing:.4} (median distance to the nearest other point)");
        // Rounded down, so that 100 % means all.
        let percent = |share: f64| (1e4 * share).floor() / 100.0;
        let open = if open > 0 { format!("; {open} have one") } else { String::new() };
        let _ = writeln!(
            text,
            "  coverage  {} % of the surfels have no open gap to their neighbours{open}",
            percent(covered)
        );
        // Not for meshes: where facets meet at an angle, flat disks leave gaps when seen aslant.
        if !info.is_mesh {
            let aslant = percent(covered_aslant);
            let _ =
                writeln!(text, "            {aslant} % have none when seen from {ASLANT} degrees above their plane");
        }
        if lone > 0 {
            let _ = writeln!(text, "            {lone} more have no surface around them");
        }
    }
    if !info.lacks.is_empty() {
        let _ = writeln!(text, "  lacks     {}", info.lacks.join(", "));
    }
    let among = if info.sample.is_some() { " among those examined" } else { "" };
    let _ = writeln!(
        text,
        "A renderer makes {} surfels of it, radius up to {:.4}{among},",
        info.preparation.surfels, info.largest_radius
    );
    let _ = writeln!(text, "in f32 relative to the origin {}.", vector(info.origin));
    if let Some(command) = &info.supplied_by {
        let colors = if info.colors == "none" { " (but colours)" } else { "" };
        let _ = writeln!(text, "What it lacks{colors} is estimated at each reading; to store it, run {command}");
    }
    if info.is_mesh {
        let _ = writeln!(text, "It is drawn as its triangles; --mesh surfels draws surfels that cover them.");
    }
    for note in info.preparation.notes() {
        let _ = writeln!(text, "{note}");
    }
    text
}

/// Writes the lines of the file's own description: format, scanner, attributes.
fn told(text: &mut String, about: &About) {
    let mut line = |name: &str, what: &str| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {name:<9} {what}");
    };
    if !about.format.is_empty() {
        line("format", &about.format);
    }
    if let Some(system) = &about.coordinate_system {
        line("system", system);
    }
    if let Some(scans) = about.scans {
        line("scans", &scans.to_string());
    }
    if !about.scanners.is_empty() {
        line("scanner", &listed(&about.scanners));
    }
    if let Some(software) = &about.software {
        line("software", software);
    }
    let names = |used: bool| {
        let names = about.attributes.iter().filter(|attribute| attribute.used == used);
        listed(&names.map(|attribute| shown(&attribute.name)).collect::<Vec<_>>())
    };
    for (used, name) in [(true, "used"), (false, "not used")] {
        if about.attributes.iter().any(|attribute| attribute.used == used) {
            line(name, &names(used));
        }
    }
}

/// Joins names with commas, at most the first 24.
fn listed(names: &[String]) -> String {
    let more = names.len().saturating_sub(ranges::MOST);
    let first = names[..names.len() - more].join(", ");
    if more > 0 { format!("{first} and {more} more") } else { first }
}

/// Returns an attribute's name in one line: at most 40 characters, control characters replaced.
fn shown(name: &str) -> String {
    name.chars().take(40).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

/// Writes the lines of the points' attributes, classes, levels of detail, texture and triangles.
fn held(text: &mut String, info: &Info) {
    let all = info.points;
    let given = |on: bool, with: Option<u64>| match with {
        Some(0) => "given, but none is usable: estimated from neighbours".to_owned(),
        Some(with) => format!("given for {with} of {all}, the others estimated from neighbours"),
        None if on => "given".to_owned(),
        None => "none, estimated from neighbours".to_owned(),
    };
    // Writing to a string cannot fail.
    if let Some(Gaussians { degree, opacities: [least, median, greatest], deviations, thickness }) = info.gaussians {
        let [longer, shorter] = deviations;
        let changes = match degree {
            0 => "colours the same from every side".to_owned(),
            _ => format!("colours change with the view by harmonics of degree {degree}"),
        };
        let kind = if thickness.is_some() { "3D Gaussians" } else { "Gaussian surfels" };
        let _ = writeln!(text, "  kind      {kind}: {changes}");
        let _ = writeln!(text, "  opacity   {least:.3} to {greatest:.3}, half of them below {median:.3}");
        let _ = match thickness {
            None => writeln!(text, "  sizes     standard deviations of {longer:.4} and {shorter:.4} (medians)"),
            Some(least) => {
                writeln!(text, "  sizes     standard deviations of {longer:.4}, {shorter:.4} and {least:.4} (medians)")
            }
        };
    } else {
        let _ = writeln!(text, "  normals   {}", given(info.normals, info.points_with_normals));
        let _ = writeln!(text, "  radii     {}", given(info.radii, info.points_with_radii));
        let _ = match (&info.file.colors, info.file.intensities) {
            (_, Some([black, white])) => {
                writeln!(
                    text,
                    "  colours   none; intensities are drawn as grey, from {black} (black) to {white} (white)"
                )
            }
            (Some(numbers), _) => writeln!(text, "  colours   {numbers}"),
            _ => writeln!(text, "  colours   {}", info.colors),
        };
    }
    // A single class is usually just the default value.
    if info.classes.len() > 1 {
        let named = |(class, count): (&u8, &u64)| match class_name(*class) {
            Some(name) => format!("{class} ({name}): {count}"),
            None => format!("{class}: {count}"),
        };
        let _ = writeln!(text, "  classes   {}", info.classes.iter().map(named).collect::<Vec<_>>().join(", "));
    }
    if let Some(LevelsOfDetail { nodes, levels }) = &info.levels_of_detail {
        let _ = writeln!(text, "  detail    {nodes} nodes in {levels} levels");
    }
    if info.texture {
        let images = match info.images {
            0 | 1 => "--texture IMAGE.png".to_owned(),
            several => format!("--texture IMAGE.png {several} times, an image each,"),
        };
        let _ = writeln!(text, "  texture   coordinates given: `epsplat render` with {images} paints by them");
    }
    if let Some(triangles) = &info.triangles {
        let _ = writeln!(text, "  triangles those of {} are drawn beside them", triangles.display());
    }
}
