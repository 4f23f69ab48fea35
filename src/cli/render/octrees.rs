//! `epsplat render --lod` of COPC files: a picture reads those of their nodes that it takes.

use epsplat::io::las::Copc;
use epsplat::io::{ColorRules, Points};
use epsplat::options::values::Switch;
use epsplat::plan::RenderOptions as Settings;
use epsplat::scene::octree::{PointOctree, Thinned, taken};
use epsplat::scene::{Bounds, Camera, Detail, Scene};
use epsplat::surfels::borders;
use epsplat::{Error, Progress, Result, surfels};

use super::super::progress::Bars;
use super::super::reading::named;
use super::Arguments;
use super::parts::{Part, Read};
use super::scene::scene_of;

/// COPC files that are one scene, and what tells where it is.
pub(super) struct Octrees {
    files: Vec<Copc>,
    octrees: Vec<PointOctree>,
    /// The meaning of colours' numbers, as the coarsest nodes say.
    rules: ColorRules,
    /// Of the coarsest nodes.
    pub overview: Scene,
}

impl Octrees {
    /// The inputs, if a picture that asks for levels of detail takes parts of them: if all are COPC files, and nothing is asked that
    /// only all of their points tell: which of them are outliers, or where they are beside triangles.
    pub fn of(arguments: &Arguments, bars: &Bars) -> Result<Option<Self>> {
        let all = arguments.limits.limits().outliers.is_some()
            || arguments.surfels.size.is_some()
            || !arguments.triangles.meshes.is_empty();
        if arguments.inputs.is_empty() || all {
            return Ok(None);
        }
        let Some(mut files) = arguments.reading.octrees(&arguments.inputs)? else { return Ok(None) };
        if arguments.options.levels.lod_fade == Some(Switch(true)) {
            return Err(Error::Usage(
                "the nodes of COPC files do not fade into each other: take --lod-fade off".into(),
            ));
        }
        let octrees: Vec<PointOctree> = files.iter().map(|file| file.octree.clone()).collect();
        let nodes: Vec<Vec<usize>> = octrees.iter().map(PointOctree::overview).collect();
        let mut rules = ColorRules::default();
        let points = read(arguments, (&mut files, &mut rules), &nodes, bars)?;
        let built = surfels::build_within(points, Vec::new(), &arguments.limits.limits(), bars);
        let (overview, _) = built.map_err(|error| named(error, &arguments.inputs))?;
        Ok(Some(Self { files, octrees, rules, overview }))
    }

    /// What the picture of `camera` takes, or where that is nothing the overview; and what that was of all.
    pub fn scene(
        &mut self,
        arguments: &Arguments,
        camera: &Camera,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Part> {
        let mut nodes = taken(&self.octrees, camera, settings.detail);
        if self.octrees.iter().zip(&nodes).all(|(octree, nodes)| octree.points(nodes) == 0) {
            nodes = self.octrees.iter().map(PointOctree::overview).collect();
        }
        let points = read(arguments, (&mut self.files, &mut self.rules), &nodes, progress)?;
        let mut made = scene_of(arguments, points, progress)?;
        self.end(&mut made.0, &nodes);
        // What was read is drawn whole.
        let settings = Settings { detail: Detail::FINEST, ..settings.clone() };
        Ok(Part { made, settings, read: read_of(&self.files, &nodes) })
    }

    /// Lets a scene of these nodes end where all points do: at the box of all files, where each tells its own.
    fn end(&self, scene: &mut Scene, nodes: &[Vec<usize>]) {
        if self.octrees.iter().any(|octree| octree.bounds.is_empty()) {
            return;
        }
        let bounds = self.octrees.iter().fold(Bounds::EMPTY, |all, octree| all.union(octree.bounds));
        let thinned = self.octrees.iter().zip(nodes).map(|(octree, nodes)| Thinned::new(octree, nodes));
        let thinned: Vec<Thinned> = thinned.collect();
        // Where several files have a place their points lie between each other's.
        let part = |place| thinned.iter().filter_map(|octree| octree.part_of_size(place)).reduce(f64::max);
        borders::end_at(scene, &bounds, |place| part(place).unwrap_or(1.0));
    }
}

/// What these nodes of each file are of all.
fn read_of(files: &[Copc], nodes: &[Vec<usize>]) -> Read {
    let mut sum = Read { nodes: [0; 2], points: [0; 2], bytes: [0; 2] };
    for (file, taken) in files.iter().zip(nodes) {
        let all = [file.octree.nodes.len() as u64, file.count(), file.bytes()];
        let taken = [taken.len() as u64, file.octree.points(taken), file.bytes_read(taken)];
        for (at, [nodes, points, bytes]) in [taken, all].into_iter().enumerate() {
            sum.nodes[at] += nodes;
            sum.points[at] += points;
            sum.bytes[at] += bytes;
        }
    }
    sum
}

/// The points of these nodes of each file.
fn read(
    arguments: &Arguments,
    (files, rules): (&mut [Copc], &mut ColorRules),
    nodes: &[Vec<usize>],
    progress: &dyn Progress,
) -> Result<Vec<Points>> {
    arguments.reading.nodes(files.iter_mut().zip(nodes), rules, progress)
}
