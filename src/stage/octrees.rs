//! COPC files: only the octree nodes that a picture needs are read.

use super::Request;
use super::coloring::Coloring;
use super::in_part::{Part, ReadReport};
use super::tiles::Tiles;
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
    /// The files. Tiles of a virtual point cloud are None until a picture shows them.
    files: Vec<Option<Copc>>,
    /// The octree of each file. Those of tiles that are not open have a bounding box and no nodes.
    octrees: Vec<PointOctree>,
    /// How colour values are interpreted, as decided by the coarsest nodes.
    rules: ColorRules,
    /// The values at the ends of the colour map, as decided by the coarsest nodes.
    ends: Option<[f64; 2]>,
    /// Surfels of the coarsest nodes, or the corners of tiles, from which the camera is framed.
    pub overview: Scene,
    /// The tiles, if files are opened only for pictures that show them.
    tiles: Option<Tiles>,
}

impl Octrees {
    /// Opens the inputs if they can be read in part, that is, if all of them are COPC files.
    ///
    /// Tiles of virtual point clouds are opened when a picture shows them. Returns None if an
    /// option needs all points: `--outliers`, `--surfel-size`, `--triangles` or `--color-by
    /// density`.
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
        if let Some(tiles) = Tiles::of(request.files()) {
            check_fade(request)?;
            let overview = tiles.overview(request, progress)?;
            let (octrees, files) = (tiles.octrees(), tiles.octrees().iter().map(|_| None).collect());
            let rules = ColorRules::default();
            return Ok(Some(Self { files, octrees, rules, ends: None, overview, tiles: Some(tiles) }));
        }
        let Some(files) = request.files().octrees(progress)? else { return Ok(None) };
        check_fade(request)?;
        let octrees: Vec<PointOctree> = files.iter().map(|file| file.octree.clone()).collect();
        let files = files.into_iter().map(Some).collect();
        let (rules, overview) = (ColorRules::default(), Scene::default());
        let mut made = Self { files, octrees, rules, ends: None, overview, tiles: None };
        let all: Vec<usize> = (0..made.files.len()).collect();
        let points = made.coarsest(request, &all, progress)?;
        // A filter may leave points of finer nodes alone, so the files are read whole.
        if are_empty(&points) {
            return Ok(None);
        }
        made.overview = overview_of(request, points, progress)?;
        Ok(Some(made))
    }

    /// Reads the coarsest nodes of the files with these indices. The first ones that are read
    /// decide what colours mean in all nodes.
    fn coarsest(&mut self, request: &Request<'_>, of: &[usize], progress: &dyn Progress) -> Result<Vec<Points>> {
        let mut nodes = vec![Vec::new(); self.files.len()];
        of.iter().for_each(|&index| nodes[index] = self.octrees[index].overview());
        let mut points = read(request, (&mut self.files, &mut self.rules), &nodes, progress)?;
        let mut coloring = Coloring::of(&request.scene.options.colors, self.ends);
        if !are_empty(&points) {
            coloring.settle(&mut points)?;
            self.ends = coloring.ends();
        }
        Ok(points)
    }

    /// Opens the tiles that a picture of `camera` shows. A tile is opened once.
    fn open(&mut self, request: &Request<'_>, camera: &Camera, progress: &dyn Progress) -> Result<()> {
        let Some(tiles) = &self.tiles else { return Ok(()) };
        let opened = tiles.seen(&self.files, camera);
        if opened.is_empty() {
            return Ok(());
        }
        let is_first = self.files.iter().all(Option::is_none);
        for (index, file) in opened.iter().copied().zip(tiles.open(&opened, request, progress)?) {
            self.octrees[index] = file.octree.clone();
            self.files[index] = Some(file);
        }
        let left_out = self.files.iter().filter(|file| file.is_none()).count();
        if is_first && left_out > 0 {
            progress.note(&tiles.note(left_out));
        }
        self.coarsest(request, &opened, progress).map(drop)
    }

    /// Reads the nodes that the picture of `camera` needs, or the overview's if they have no point.
    pub fn scene(
        &mut self,
        request: &Request<'_>,
        camera: &Camera,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Part> {
        self.open(request, camera, progress)?;
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
        // Tiles that a flight has passed would fill the memory.
        let passed = self.files.iter().zip(&nodes).filter(|(_, nodes)| nodes.is_empty());
        passed.filter_map(|(file, _)| file.as_ref()).for_each(Copc::forget);
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
        let read = self.octrees.iter().zip(nodes).filter(|(_, nodes)| !nodes.is_empty());
        let thinned = read.map(|(octree, nodes)| Thinned::new(octree, nodes));
        let thinned: Vec<Thinned> = thinned.collect();
        // Where files overlap, their points are interleaved, so the largest fraction is used.
        let part = |place| thinned.iter().filter_map(|octree| octree.part_of_size(place)).reduce(f64::max);
        borders::end_at(scene, &bounds, |place| part(place).unwrap_or(1.0));
    }
}

/// Fails if levels of detail are to fade into each other.
fn check_fade(request: &Request<'_>) -> Result<()> {
    if request.options.levels.lod_fade == Some(Switch(true)) {
        return Err(Error::Usage("the nodes of COPC files cannot fade into each other: set --lod-fade to off".into()));
    }
    Ok(())
}

/// The surfels of the coarsest nodes.
fn overview_of(request: &Request<'_>, points: Vec<Points>, progress: &dyn Progress) -> Result<Scene> {
    let built = surfels::build_within(points, Vec::new(), &request.surfels().limits.limits(), progress);
    built.map(|(overview, _)| overview).map_err(|error| request.files().named(error))
}

fn are_empty(inputs: &[Points]) -> bool {
    inputs.iter().all(|points| points.positions.is_empty())
}

/// Counts these nodes, their points and bytes, and the totals of the open files.
fn read_of(files: &[Option<Copc>], nodes: &[Vec<usize>]) -> ReadReport {
    let mut sum = ReadReport { nodes: [0; 2], points: [0; 2], bytes: [0; 2] };
    let open = files.iter().zip(nodes).filter_map(|(file, taken)| Some((file.as_ref()?, taken)));
    for (file, taken) in open {
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

/// Reads the points of these nodes of each file; none of a tile that is not open.
fn read(
    request: &Request<'_>,
    (files, rules): (&mut [Option<Copc>], &mut ColorRules),
    nodes: &[Vec<usize>],
    progress: &dyn Progress,
) -> Result<Vec<Points>> {
    let column = request.scene.options.colors.column();
    request.files().nodes(files.iter_mut().map(Option::as_mut).zip(nodes), (rules, column), progress)
}
