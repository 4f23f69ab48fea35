//! `epsplat render --lod` of a file that `epsplat lod` wrote: a picture reads the nodes and surfels that it may come to.

use epsplat::io::ply::Levels;
use epsplat::plan::RenderOptions as Settings;
use epsplat::render::taken;
use epsplat::scene::hierarchy::Node;
use epsplat::scene::{Camera, Scene, Surfel};
use epsplat::surfels::part::{Taken, nothing};
use epsplat::surfels::{Limits, Preparation};
use epsplat::{Error, Progress, Result};

use super::Arguments;
use super::memory::Memory;
use super::parts::{Part, Read};

/// Files of fewer surfels are read whole: that is soon done.
const FEWEST: u32 = 500_000;

/// The coarsest nodes, which tell where a scene is.
const OVERVIEW: u32 = 50_000;

/// A file that is a scene.
pub(super) struct Tree {
    levels: Levels,
    /// The places of its coarsest nodes.
    pub overview: Scene,
}

impl Tree {
    /// The input, if it is one large file with levels of detail, and nothing is asked that is of all of its surfels, of other inputs or of triangles.
    pub fn of(arguments: &Arguments) -> Result<Option<Self>> {
        let bounded = arguments.device.memory.is_some();
        let levels = match (&arguments.inputs[..], asks_for_all(arguments)) {
            (_, Some(option)) if bounded => {
                return Err(Error::Usage(format!(
                    "--memory is of pictures that take a part of a file, and {option} is of all: leave one of them out"
                )));
            }
            ([input], None) => arguments.reading.levels(input)?,
            _ => None,
        };
        if bounded && levels.is_none() {
            return Err(Error::Usage(
                "--memory is of pictures that take a part of one file of `epsplat lod`: leave it out, or make one"
                    .into(),
            ));
        }
        let Some(levels) = levels.filter(|levels| bounded || levels.whole.surfels >= FEWEST) else {
            return Ok(None);
        };
        let coarsest = 0..levels.whole.nodes.min(OVERVIEW);
        let mut rows = Vec::new();
        levels.read_nodes(std::slice::from_ref(&coarsest), &mut rows)?;
        let nodes: Vec<Node> = levels.nodes(&rows, |part| part.nodes)?.concat();
        // Those that stand for what is not here.
        let lowest = nodes.iter().filter(|node| node.leaf || node.first as usize >= nodes.len());
        // Nodes reach past what is below them, and few of them farther than a margin of the view.
        let surfels = lowest.map(|node| Surfel { s: [0.0; 3], t: [0.0; 3], ..node.surfel }).collect();
        let overview = Scene { surfels, ..nothing(&levels) };
        Ok(Some(Self { levels, overview }))
    }

    /// What the picture of `camera` with `settings` takes, within `memory` if there is a bound.
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
        let read = Read {
            nodes: [read.nodes, nodes],
            points: [read.surfels, surfels],
            bytes: [read.bytes, self.levels.bytes(surfels, nodes)],
        };
        Ok(Part { made: (scene, preparation), settings: settings.clone(), read })
    }
}

/// An option that is of all surfels of a file, or of more than these, if one is given.
fn asks_for_all(arguments: &Arguments) -> Option<&'static str> {
    let limits = arguments.limits.limits();
    let all = [
        (limits.outliers.is_some(), "--outliers"),
        (limits.largest_ratio != Limits::default().largest_ratio, "--max-radius"),
        (arguments.surfels.size.is_some(), "--surfel-size"),
        (arguments.reading.class_opacity.is_some(), "--class-opacity"),
        (arguments.reading.ignores_alpha(), "--ignore-alpha"),
        (!arguments.triangles.meshes.is_empty(), "--triangles"),
        (arguments.triangles.texture.is_some(), "--triangle-texture"),
        (arguments.options.surface.join.is_some(), "--join"),
        (!arguments.surfels.textures.is_empty(), "--texture"),
        (arguments.options.points.facing.is_some(), "--facing"),
        (arguments.options.surface.separate, "--separate"),
    ];
    all.into_iter().find_map(|(given, option)| given.then_some(option))
}
