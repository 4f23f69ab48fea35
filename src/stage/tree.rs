//! A file that `epsplat lod` wrote: a picture reads only the nodes and surfels that its cut may
//! reach.

use super::Request;
use super::in_part::{Part, ReadReport};
use super::memory::Memory;
use crate::error::{Error, Result};
use crate::io::ply::Levels;
use crate::plan::Settings;
use crate::progress::Progress;
use crate::render::taken;
use crate::scene::hierarchy::Node;
use crate::scene::{Camera, Scene, Surfel};
use crate::surfels::part::{Taken, nothing};
use crate::surfels::{Limits, Preparation};

/// Files with fewer surfels are read whole, as that takes little time.
const FEWEST: u32 = 500_000;

/// Number of the coarsest nodes that are read to frame the camera.
const OVERVIEW: u32 = 50_000;

/// A file of `epsplat lod` that is the only input.
pub(super) struct Tree {
    levels: Levels,
    /// Points at the centres of the file's coarsest nodes.
    pub overview: Scene,
}

impl Tree {
    /// Opens the input if it can be read in part: one file with levels of detail.
    ///
    /// Without `--memory` it must have at least 500,000 surfels. Returns None if an option needs
    /// all surfels, other inputs or triangles.
    ///
    /// # Errors
    /// [`Error::Usage`] if `--memory` is given and the input cannot be read in part.
    pub fn of(request: &Request<'_>) -> Result<Option<Self>> {
        let bounded = request.device.memory.is_some();
        let levels = match asks_for_all(request) {
            Some(option) if bounded => {
                return Err(Error::Usage(format!(
                    "--memory reads a part of the file, and {option} needs all of it: leave one of them out"
                )));
            }
            Some(_) => None,
            None => request.files().levels()?,
        };
        if bounded && levels.is_none() {
            return Err(Error::Usage(
                "--memory needs one file of `epsplat lod` as the only input: make one, or leave --memory out".into(),
            ));
        }
        let Some(levels) = levels.filter(|levels| bounded || levels.whole.surfels >= FEWEST) else {
            return Ok(None);
        };
        let coarsest = 0..levels.whole.nodes.min(OVERVIEW);
        let mut rows = Vec::new();
        levels.read_nodes(std::slice::from_ref(&coarsest), &mut rows)?;
        let nodes: Vec<Node> = levels.nodes(&rows, |part| part.nodes)?.concat();
        // Leaves, and nodes whose children are not among the read ones.
        let lowest = nodes.iter().filter(|node| node.leaf || node.first as usize >= nodes.len());
        // Points instead of disks, as the ellipses of nodes reach past the surfels below them. Few
        // surfels reach past these points by more than the margin of the framed view.
        let points = lowest.map(|node| Surfel { s: [0.0; 3], t: [0.0; 3], ..node.surfel }).collect();
        let overview = Scene { surfels: points, ..nothing(&levels) };
        Ok(Some(Self { levels, overview }))
    }

    /// Reads the nodes and surfels that the picture of `camera` with `settings` needs.
    ///
    /// # Errors
    /// [`Error::Usage`] if they do not fit into `memory`, or an error of reading.
    pub fn scene(
        &self,
        memory: Option<Memory>,
        camera: &Camera,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Part> {
        let fits = |taken: &Taken| memory.as_ref().map_or(Ok(()), |memory| memory.fits(taken));
        let (scene, read) = taken(&self.levels, &[(camera, settings)], fits, progress)?;
        let (nodes, surfels) = (self.levels.whole.nodes.into(), self.levels.whole.surfels.into());
        let preparation = Preparation { points: surfels, surfels, ..Preparation::default() };
        let read = ReadReport {
            nodes: [read.nodes, nodes],
            points: [read.surfels, surfels],
            bytes: [read.bytes, self.levels.bytes(surfels, nodes)],
        };
        Ok(Part { made: (scene, preparation), settings: settings.clone(), read, key: None })
    }
}

/// Returns the first given option that needs all surfels of a file, other inputs or triangles.
pub(super) fn asks_for_all(request: &Request<'_>) -> Option<&'static str> {
    let (limits, read) = (request.surfels().limits.limits(), request.files().options());
    let all = [
        (limits.outliers.is_some(), "--outliers"),
        (limits.largest_ratio != Limits::default().largest_ratio, "--max-radius"),
        (request.surfels().size.is_some(), "--surfel-size"),
        (read.class_opacity.is_some(), "--class-opacity"),
        (!read.filter().is_empty(), "--where or --classes"),
        (request.scene.options.colors.is_given(), "--color-by"),
        (read.file.ignore_alpha, "--ignore-alpha"),
        (!request.triangles().meshes.is_empty(), "--triangles"),
        (request.triangles().texture.is_some(), "--triangle-texture"),
        (request.options.surface.join.is_some(), "--join"),
        (!request.surfels().textures.is_empty(), "--texture"),
        (request.options.points.facing.is_some(), "--facing"),
        (request.options.surface.separate, "--separate"),
    ];
    all.into_iter().find_map(|(given, option)| given.then_some(option))
}
