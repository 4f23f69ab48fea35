//! COPC files: only the octree nodes that a picture needs are read.

use super::Request;
use super::coloring::Coloring;
use super::in_part::{Part, ReadReport};
use super::whole::scene_of;
use crate::error::{Error, Result};
use crate::io::las::Copc;
use crate::io::{ColorBy, ColorRules, Points};
use crate::options::values::Switch;
use crate::plan::Settings;
use crate::progress::Progress;
use crate::scene::octree::{PointOctree, Thinned, taken};
use crate::scene::{Bounds, Camera, Detail, Scene};
use crate::surfels::{self, borders};

/// COPC files, together one scene, and a coarse overview of it.
pub(super) struct Octrees {
    files: Vec<Copc>,
    octrees: Vec<PointOctree>,
    /// How colour values are interpreted, as decided by the coarsest nodes.
    rules: ColorRules,
    /// The values at the ends of the colour map, as decided by the coarsest nodes.
    ends: Option<[f64; 2]>,
    /// Surfels of the coarsest nodes, from which the camera is framed.
    pub overview: Scene,
}

impl Octrees {
    /// Opens the inputs if they can be read in part, that is, if all of them are COPC files.
    ///
    /// Returns None if an option needs all points: `--outliers`, `--surfel-size`, `--triangles` or
    /// `--color-by density`.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if `--lod-fade on` is given, or an error of reading.
    pub fn of(request: &Request<'_>, progress: &dyn Progress) -> Result<Option<Self>> {
        let all = request.surfels().limits.outliers.is_some()
            || request.surfels().size.is_some()
            || !request.triangles().meshes.is_empty()
            || request.scene.options.colors.color_by == Some(ColorBy::Density);
        if request.files().paths().is_empty() || all {
            return Ok(None);
        }
        let Some(mut files) = request.files().octrees(progress)? else { return Ok(None) };
        if request.options.levels.lod_fade == Some(Switch(true)) {
            return Err(Error::Usage(
                "the nodes of COPC files cannot fade into each other: set --lod-fade to off".into(),
            ));
        }
        let octrees: Vec<PointOctree> = files.iter().map(|file| file.octree.clone()).collect();
        let nodes: Vec<Vec<usize>> = octrees.iter().map(PointOctree::overview).collect();
        let mut rules = ColorRules::default();
        let mut points = read(request, (&mut files, &mut rules), &nodes, progress)?;
        // A filter may leave points of finer nodes alone, so the files are read whole.
        if are_empty(&points) {
            return Ok(None);
        }
        let mut coloring = Coloring::of(&request.scene.options.colors, None);
        coloring.settle(&mut points)?;
        let ends = coloring.ends();
        let built = surfels::build_within(points, Vec::new(), &request.surfels().limits.limits(), progress);
        let (overview, _) = built.map_err(|error| request.files().named(error))?;
        Ok(Some(Self { files, octrees, rules, ends, overview }))
    }

    /// Reads the nodes that the picture of `camera` needs, or the overview's if they have no point.
    pub fn scene(
        &mut self,
        request: &Request<'_>,
        camera: &Camera,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Part> {
        let mut nodes = taken(&self.octrees, camera, settings.detail);
        if self.octrees.iter().zip(&nodes).all(|(octree, nodes)| octree.points(nodes) == 0) {
            nodes = self.octrees.iter().map(PointOctree::overview).collect();
        }
        let mut points = read(request, (&mut self.files, &mut self.rules), &nodes, progress)?;
        // A filter may leave none of these points. Those of the overview lie outside the picture.
        if are_empty(&points) {
            nodes = self.octrees.iter().map(PointOctree::overview).collect();
            points = read(request, (&mut self.files, &mut self.rules), &nodes, progress)?;
        }
        let key = Coloring::of(&request.scene.options.colors, self.ends).settle(&mut points)?;
        let mut made = scene_of(request, points, progress)?;
        self.end(&mut made.0, &nodes);
        // All read points are drawn.
        let settings = Settings { detail: Detail::FINEST, ..settings.clone() };
        Ok(Part { made, settings, read: read_of(&self.files, &nodes), key })
    }

    /// The bounding box of all points; None if a file states none.
    pub fn bounds(&self) -> Option<Bounds> {
        let stated = self.octrees.iter().all(|octree| !octree.bounds.is_empty());
        stated.then(|| self.octrees.iter().fold(Bounds::EMPTY, |all, octree| all.union(octree.bounds)))
    }

    /// Makes surfels of these nodes end at the bounding box of all points.
    ///
    /// Surfels of coarse nodes are large and would reach beyond it. Does nothing if a file states
    /// no bounding box.
    fn end(&self, scene: &mut Scene, nodes: &[Vec<usize>]) {
        let Some(bounds) = self.bounds() else { return };
        let thinned = self.octrees.iter().zip(nodes).map(|(octree, nodes)| Thinned::new(octree, nodes));
        let thinned: Vec<Thinned> = thinned.collect();
        // Where files overlap, their points are interleaved, so the largest fraction is used.
        let part = |place| thinned.iter().filter_map(|octree| octree.part_of_size(place)).reduce(f64::max);
        borders::end_at(scene, &bounds, |place| part(place).unwrap_or(1.0));
    }
}

fn are_empty(inputs: &[Points]) -> bool {
    inputs.iter().all(|points| points.positions.is_empty())
}

/// Counts these nodes, their points and bytes, and the totals of the files.
fn read_of(files: &[Copc], nodes: &[Vec<usize>]) -> ReadReport {
    let mut sum = ReadReport { nodes: [0; 2], points: [0; 2], bytes: [0; 2] };
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

/// Reads the points of these nodes of each file.
fn read(
    request: &Request<'_>,
    (files, rules): (&mut [Copc], &mut ColorRules),
    nodes: &[Vec<usize>],
    progress: &dyn Progress,
) -> Result<Vec<Points>> {
    let column = request.scene.options.colors.column();
    request.files().nodes(files.iter_mut().zip(nodes), (rules, column), progress)
}
