//! `epsplat render --lod` of COPC files: a picture reads those of their nodes that it takes.

use epsplat::io::Points;
use epsplat::io::las::Copc;
use epsplat::plan::RenderOptions;
use epsplat::scene::octree::{PointOctree, taken};
use epsplat::scene::{Camera, Detail, Scene};
use epsplat::{Error, Result, surfels};
use serde::Serialize;

use super::super::progress::Bars;
use super::super::reading::named;
use super::Arguments;
use super::scene::{Made, scene_of};

/// COPC files that are one scene, and what tells where it is.
pub(super) struct Octrees {
    files: Vec<Copc>,
    octrees: Vec<PointOctree>,
    /// Of the coarsest nodes.
    pub overview: Scene,
}

/// What a picture read of what there is: of all files together.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Read {
    nodes: [u64; 2],
    points: [u64; 2],
    /// Of compressed points.
    bytes: [u64; 2],
}

impl Octrees {
    /// The inputs, if a picture with `options` takes parts of them: if levels of detail are asked for, all are COPC files, and nothing is asked that
    /// only all of their points tell: which of them are outliers, or where they are beside triangles.
    pub fn of(arguments: &Arguments, options: &RenderOptions, bars: &Bars) -> Result<Option<Self>> {
        let all = arguments.limits.limits().outliers.is_some() || !arguments.triangles.is_empty();
        if options.detail.is_finest() || arguments.inputs.is_empty() || all {
            return Ok(None);
        }
        let Some(mut files) = arguments.reading.octrees(&arguments.inputs)? else { return Ok(None) };
        if arguments.lod_fade == Some(true) {
            return Err(Error::Usage(
                "the nodes of COPC files do not fade into each other: take --lod-fade off".into(),
            ));
        }
        let octrees: Vec<PointOctree> = files.iter().map(|file| file.octree.clone()).collect();
        let nodes: Vec<Vec<usize>> = octrees.iter().map(PointOctree::overview).collect();
        let points = read(arguments, &mut files, &nodes, bars)?;
        let built = surfels::build_within(points, Vec::new(), &arguments.limits.limits(), bars);
        let (overview, _) = built.map_err(|error| named(error, &arguments.inputs))?;
        Ok(Some(Self { files, octrees, overview }))
    }

    /// What the picture of `camera` takes, or where that is nothing the overview; and what that was of all.
    pub fn scene(
        &mut self,
        arguments: &Arguments,
        camera: &Camera,
        detail: Detail,
        bars: &Bars,
    ) -> Result<(Made, Read)> {
        let mut nodes = taken(&self.octrees, camera, detail);
        if self.octrees.iter().zip(&nodes).all(|(octree, nodes)| octree.points(nodes) == 0) {
            nodes = self.octrees.iter().map(PointOctree::overview).collect();
        }
        let made = scene_of(arguments, read(arguments, &mut self.files, &nodes, bars)?, bars)?;
        Ok((made, Read::of(&self.files, &nodes)))
    }
}

impl Read {
    /// These nodes of each file.
    fn of(files: &[Copc], nodes: &[Vec<usize>]) -> Self {
        let mut sum = Self { nodes: [0; 2], points: [0; 2], bytes: [0; 2] };
        for (file, taken) in files.iter().zip(nodes) {
            let all: Vec<usize> = (0..file.octree.nodes.len()).collect();
            for (at, nodes) in [taken, &all].into_iter().enumerate() {
                sum.nodes[at] += nodes.len() as u64;
                sum.points[at] += file.octree.points(nodes);
                sum.bytes[at] += file.bytes(nodes);
            }
        }
        sum
    }

    /// One line.
    pub fn sentence(&self) -> String {
        let Self { nodes: [nodes, all_nodes], points: [points, all_points], bytes } = self;
        let [bytes, all_bytes] = bytes.map(|bytes| bytes as f64 / 1e6);
        format!(
            "read {nodes} of {all_nodes} nodes of the octree, {points} of {all_points} points: {bytes:.1} of {all_bytes:.1} MB"
        )
    }
}

/// The points of these nodes of each file.
fn read(arguments: &Arguments, files: &mut [Copc], nodes: &[Vec<usize>], bars: &Bars) -> Result<Vec<Points>> {
    arguments.reading.nodes(files.iter_mut().zip(nodes), bars)
}
