//! `epsplat lod`: builds an octree of surfels with levels of detail.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use epsplat::io::{atomic, ply};
use epsplat::low_level::scene::Cut;
use epsplat::low_level::surfels::{self, hierarchy};
use epsplat::options::parse::memory;
use epsplat::options::{InputOptions, LimitOptions};
use epsplat::{Files, Result};
use serde::Serialize;

use super::inputs::help_of_all;
use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print, write_json};

/// Build levels of detail for `render --lod`, written as PLY with the surfels.
///
/// Points are divided at their mean into octants until eight or fewer are left (Pajarola 2003).
/// Each node of this octree is a surfel with the mean colour and normal of the disks below it. Its
/// ellipse has the shape of the points' covariance, and is the smallest that bounds these disks.
/// The surfels are written as the file's points, in the order of the tree, so other programs read
/// the file as a cloud.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  epsplat lod scan.ply -o scan.lod.ply\n  epsplat render scan.lod.ply -o scan.png --lod 4px\n  epsplat lod scan.ply --cut 0.05 -o coarse.ply\n  epsplat lod tiles/*.ply -o city.lod.ply --memory 4GiB"
)]
pub struct Arguments {
    #[arg(required = true, help = help_of_all("Surfels, point clouds or meshes"))]
    inputs: Vec<PathBuf>,
    /// Output file: .ply
    #[arg(short, long)]
    output: PathBuf,
    /// Write a cut of the tree in place of the tree: nodes of up to this radius, world units
    ///
    /// A node replaces the surfels below it if all of them fit into a ball of this radius. A node
    /// counts as up to twice as large if its surfels deviate from its curved disk
    #[arg(long, value_name = "LENGTH", value_parser = parse_length)]
    cut: Option<f64>,
    /// Limit the memory to a size such as 4GiB, by sorting the points in temporary files
    ///
    /// Inputs must be binary PLY files with normals and radii, or half-axes. The temporary files
    /// are beside the output and up to twice its size. The output is the same as without the option
    #[arg(long, value_name = "SIZE", value_parser = memory, conflicts_with_all = ["cut", "outliers", "max_radius", "flat", "class_opacity", "filter", "classes"])]
    memory: Option<u64>,
    /// Write the tree's counts and times as JSON to a file, or to stdout for -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    #[command(flatten)]
    reading: InputOptions,
    #[command(flatten)]
    limits: LimitOptions,
}

/// Counts and times of the tree, as text or JSON.
#[derive(Serialize)]
struct Report {
    surfels: u64,
    nodes: u64,
    levels: u64,
    /// Number of surfels in the cut that was written; None without `--cut`.
    #[serde(skip_serializing_if = "Option::is_none")]
    cut: Option<u64>,
    /// Number of subtrees that were built one after the other; None without `--memory`.
    #[serde(skip_serializing_if = "Option::is_none")]
    subtrees: Option<u64>,
    /// Seconds to read, to make surfels, to build the tree, and to write; with `--memory` only
    /// their sum.
    seconds: Vec<f64>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    ply::check_extension(&arguments.output)?;
    let files = Files::new(&arguments.inputs, &arguments.reading)?;
    let written = [&arguments.output].into_iter().chain(&arguments.json);
    outputs::check(Source::of(&files), written)?;
    let bars = Bars::new();
    let report = match arguments.memory {
        Some(memory) => out_of_core(arguments, &files, memory, &bars)?,
        None => in_memory(arguments, &files, &bars)?,
    };
    match &arguments.json {
        Some(path) => write_json(path, &report),
        None => print(&summary(&report)),
    }
}

fn in_memory(arguments: &Arguments, files: &Files, bars: &Bars) -> Result<Report> {
    let mut started = Instant::now();
    let mut seconds = || std::mem::replace(&mut started, Instant::now()).elapsed().as_secs_f64();
    let inputs = files.read(bars)?;
    let beside = outputs::beside(&inputs, &arguments.output)?;
    if inputs.iter().any(|points| points.texture.is_some()) {
        note("warning: texture coordinates are left out, as levels of detail do not support them");
    }
    let read = seconds();
    let (scene, preparation) = surfels::build_within(inputs, Vec::new(), &arguments.limits.limits(), bars)
        .map_err(|error| files.named(error))?;
    preparation.notes().iter().for_each(|line| note(line));
    let made = seconds();
    let (scene, tree) = match scene.hierarchy.clone() {
        Some(known) => (scene, known),
        None => hierarchy::build(scene, bars)?,
    };
    let divided = seconds();
    let surfels = scene.surfels.len() as u64;
    let cut = arguments.cut.map(|length| Cut::by_length(&tree, length).scene(&scene, &tree, true));
    let written = cut.as_ref().unwrap_or(&scene);
    ply::write_scene(&arguments.output, written, beside.as_deref(), bars)?;
    Ok(Report {
        surfels,
        cut: cut.map(|cut| cut.surfels.len() as u64),
        nodes: tree.nodes.len() as u64,
        levels: tree.levels() as u64,
        subtrees: None,
        seconds: vec![read, made, divided, seconds()],
    })
}

/// Builds the tree within `memory` bytes from points that are read piece by piece.
fn out_of_core(arguments: &Arguments, files: &Files, memory: u64, bars: &Bars) -> Result<Report> {
    let started = Instant::now();
    let files = files.rows(bars)?;
    let place = atomic::place_of(&arguments.output);
    let folder = place.as_deref().and_then(Path::parent).map_or_else(std::env::temp_dir, Path::to_owned);
    let made = hierarchy::out_of_core::write_levels(&files, memory, (&arguments.output, &folder), bars)?;
    made.preparation.notes().iter().for_each(|line| note(line));
    Ok(Report {
        surfels: made.surfels,
        nodes: made.nodes,
        levels: made.levels,
        cut: None,
        subtrees: Some(made.subtrees),
        seconds: vec![started.elapsed().as_secs_f64()],
    })
}

/// Parses a positive length, world units.
fn parse_length(text: &str) -> std::result::Result<f64, String> {
    let length: Option<f64> = text.parse().ok().filter(|length: &f64| length.is_finite() && *length > 0.0);
    length.ok_or_else(|| format!("'{text}' is not a length: give a positive number of world units"))
}

fn summary(report: &Report) -> String {
    let cut = report.cut.map_or_else(String::new, |cut| format!(", a cut of {cut}"));
    let times = match (&report.seconds[..], report.subtrees) {
        ([read, made, divided, written], _) => {
            format!("read in {read:.2} s, made in {made:.2} s, divided in {divided:.2} s, written in {written:.2} s")
        }
        (seconds, subtrees) => {
            let trees = subtrees.filter(|trees| *trees > 1);
            let trees = trees.map_or_else(String::new, |trees| format!("of {trees} subtrees, one after the other, "));
            format!("{trees}in {:.2} s", seconds.iter().sum::<f64>())
        }
    };
    format!("{} surfels, {} nodes in {} levels{cut}: {times}\n", report.surfels, report.nodes, report.levels)
}
