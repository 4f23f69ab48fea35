//! What a study is: scenes, configurations, and what is asked of them.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use super::config::Config;
use crate::error::{Error, Result};
use crate::io::ClassOpacities;
use crate::plan::{BackendName, RenderOptions};
use crate::scene::Shading;
use crate::surfels::analytic::Shape;
use crate::surfels::sampling::Priority;
use crate::surfels::simplify::Tolerance;
use crate::truth::DEFAULT_GRID;

/// A study: every configuration on every scene.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// A short name.
    pub name: String,
    /// One sentence that says what the study shows.
    pub about: String,
    /// Width and height of the images, pixels.
    #[serde(default = "default_size")]
    pub size: [u32; 2],
    /// Timed runs of each configuration, after one to warm up.
    #[serde(default = "default_runs")]
    pub runs: u32,
    /// The configuration that the others' times are given relative to.
    pub baseline: Option<String>,
    /// Rays of ground truth across a pixel: their square is cast through each.
    #[serde(default = "default_rays")]
    pub rays: u32,
    /// Linear RGBA behind the scene, straight alpha; else what a render has.
    pub background: Option<[f32; 4]>,
    /// What a quick run takes instead.
    #[serde(default)]
    pub quick: Quick,
    /// What is rendered.
    #[serde(rename = "scene", default)]
    pub scenes: Vec<SceneEntry>,
    /// How.
    #[serde(rename = "config", default)]
    pub configs: Vec<Config>,
    /// Where the scenes' files are: the folder of the definition.
    #[serde(skip)]
    pub(super) folder: PathBuf,
}

/// What a quick run takes instead; see [`Definition::quick_form`].
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quick {
    /// Timed runs.
    pub runs: Option<u32>,
    /// Width and height of the images, pixels.
    pub size: Option<[u32; 2]>,
}

/// One scene, or a sweep: each `count` with each `footprint_px`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneEntry {
    /// Its name.
    pub name: String,
    /// A point cloud or mesh, relative to the definition's folder. Either this or a shape.
    pub file: Option<PathBuf>,
    /// Where to get the file, for who lacks it.
    pub source: Option<String>,
    /// How surfels are made of the file; as `epsplat render` reads it by default.
    #[serde(default)]
    pub surfels: Making,
    /// By what samples of a mesh are handed out, as `epsplat sample` takes it.
    #[serde(default, deserialize_with = "parsed")]
    pub priority: Option<Priority>,
    /// What is kept of how they end; all by default.
    #[serde(default)]
    pub rims: Rims,
    /// An image for the mesh of the file, relative to the definition's folder.
    pub texture: Option<PathBuf>,
    /// The image is looked up once a pixel; else surfels have its colours.
    #[serde(default)]
    pub lookup: bool,
    /// Surfels are those that `epsplat simplify --shape cap` leaves, within this tolerance.
    #[serde(default, deserialize_with = "parsed")]
    pub simplify: Option<Tolerance>,
    /// A generated surface: sphere, torus, plane, checkerboard, text, shells or crossing.
    #[serde(default, deserialize_with = "parsed")]
    pub shape: Option<Shape>,
    /// Triangles beside the surfels: a shape, with a number of them after a colon if it is to be another than 200,000, or a mesh, relative to
    /// the definition's folder. Where rays tell the truth, what shows beside the curve at which they meet is measured too.
    #[serde(default, deserialize_with = "parsed")]
    pub triangles: Option<Beside>,
    /// Surfels of the shape, or to be made of the mesh.
    pub count: Option<OneOrMany<u64>>,
    /// Disk radius of a shape's surfels in units of their mean spacing; the generator's by default.
    pub radius: Option<f64>,
    /// How far a shape's points lie off it, along its normals: the standard deviation in units of their mean spacing.
    pub noise: Option<f64>,
    /// The same points once more, as another input, so far out along their normals, world units. What share of the pixels show a mean of
    /// both is measured.
    pub shirt: Option<f64>,
    /// The mean radius of the splats, pixels, as if seen face-on: disks are enlarged or shrunk to it.
    pub footprint_px: Option<OneOrMany<f64>>,
    /// Leaves out what of a sweep would cover more pixels than this, counting `surfels * pi * footprint_px^2`.
    pub most_fragments: Option<f64>,
    /// Camera position, world units; else the scene is framed.
    pub eye: Option<[f64; 3]>,
    /// What the camera looks at, world units; else the scene's centre.
    pub target: Option<[f64; 3]>,
    /// Which way is up in the image.
    pub up: Option<[f64; 3]>,
    /// Vertical field of view, degrees.
    pub fov: Option<f64>,
    /// Orthographic: world units from the image's top to its bottom.
    pub ortho: Option<f64>,
    /// Width and height of this scene's images, pixels, in quick runs too; else the study's.
    pub size: Option<[u32; 2]>,
    /// How large the scene is seen, of what it would be: 0.5 takes the camera twice as far away.
    pub fill: Option<f64>,
    /// Cameras on a circle around the scene's centre, the first of which is the one above.
    #[serde(default = "one")]
    pub views: u32,
    /// The configurations that render it, by name; else all.
    pub configs: Option<Vec<String>>,
    /// Compare with ground truth by rays: of the shape, or of the triangles of a mesh.
    #[serde(default)]
    pub truth: bool,
    /// The shading of configurations that choose none.
    pub shading: Option<Shading>,
    /// The opacity of configurations that choose none.
    pub opacity: Option<f32>,
    /// Opacities of the classes of the file's points, as `epsplat render --class-opacity` takes them.
    #[serde(default, deserialize_with = "parsed")]
    pub classes: Option<ClassOpacities>,
    /// Surfels in a quick run.
    pub quick_count: Option<OneOrMany<u64>>,
    /// Splats' mean radius in a quick run, pixels.
    pub quick_footprint_px: Option<OneOrMany<f64>>,
    /// Whether a quick run has it.
    #[serde(default = "yes")]
    pub quick: bool,
}

/// How surfels are made of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Making {
    /// By all that it says, as `epsplat render` does.
    #[default]
    File,
    /// By its points alone, as `epsplat render` does: ellipses that hold their cells, normals turned to the viewer.
    Points,
    /// By its points and the normals that its triangles have there: what a scanner's software exports.
    Normals,
    /// By its points alone, as `epsplat surfels` does: normals that agree, ellipses that hold their cells.
    Knn,
    /// The same with ellipses that bound neighbours.
    Ellipse,
    /// The same with disks from clusters of three.
    Bsp,
    /// The same with one radius for all.
    #[serde(rename = "bsp:global")]
    BspGlobal,
    /// The same with disks as large as the triangles at a mesh's vertices.
    Qsplat,
    /// As `epsplat sample` does: `count` of a mesh, with ellipses that cover it.
    Sample,
    /// The same, where Tien 2008 places them.
    Projected,
    /// As `epsplat sample` does, curved as the mesh is around them.
    Caps,
    /// Samples of a mesh, or of a shape, `count` of them, with its normals alone, as `epsplat render` draws them.
    Scanned,
    /// Independent random points of a mesh, `count` of them, with its normals, and ellipses that hold their cells.
    Uniform,
    /// As `epsplat hybrid` does: samples of a mesh whose diagonal is seen as long as `count` pixels, and the triangles that stay.
    Hybrid,
    /// Those that the cuts of the scene's configurations take of a file of `epsplat lod`, and nodes: it is not read whole.
    Levels,
    /// Of a shape none: `count` triangles stand for it, and the orthographic camera comes so near that a disk of their mean area has a radius of
    /// `footprint_px`.
    Triangles,
    /// Of a shape Gaussians, as `epsplat generate --gaussians` makes them.
    Gaussians,
}

/// Triangles beside surfels.
#[derive(Clone, Debug, PartialEq)]
pub enum Beside {
    /// About so many that stand for a shape.
    Shape(Shape, u64),
    /// A mesh.
    File(PathBuf),
}

/// Triangles of a shape whose number nobody says: in most images their edges are too short to see.
const TRIANGLES: u64 = 200_000;

impl FromStr for Beside {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if Path::new(text).extension().is_some() {
            return Ok(Self::File(text.into()));
        }
        let (name, count) = match text.split_once(':') {
            None => (text, TRIANGLES),
            Some((name, count)) => {
                let wrong = || Error::Usage(format!("a number of triangles is 1 to 2^32 - 1, not {count:?}"));
                let count = count.parse::<u32>().ok().filter(|count| *count > 0).ok_or_else(wrong)?;
                (name, count.into())
            }
        };
        Ok(Self::Shape(name.parse()?, count))
    }
}

/// How surfels end and curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rims {
    /// They curve, and end at lines.
    #[default]
    Curved,
    /// They end at lines.
    Clipped,
    /// Whole ellipses.
    Flat,
}

impl Making {
    /// What a shape may become.
    pub const OF_SHAPES: [Self; 4] = [Self::File, Self::Scanned, Self::Gaussians, Self::Triangles];

    /// Whether the mesh is sampled at a number of points.
    pub fn samples(self) -> bool {
        matches!(self, Self::Sample | Self::Projected | Self::Caps | Self::Scanned | Self::Uniform | Self::Hybrid)
    }
}

/// A value, or the values of a sweep.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number or a list of numbers is needed")]
pub enum OneOrMany<T> {
    /// One.
    One(T),
    /// A sweep.
    Many(Vec<T>),
}

impl<T: Copy> OneOrMany<T> {
    /// The values in order.
    pub fn values(&self) -> Vec<T> {
        match self {
            Self::One(value) => vec![*value],
            Self::Many(values) => values.clone(),
        }
    }
}

fn default_size() -> [u32; 2] {
    [1024, 1024]
}

fn default_runs() -> u32 {
    7
}

fn default_rays() -> u32 {
    DEFAULT_GRID
}

fn one() -> u32 {
    1
}

pub(super) fn yes() -> bool {
    true
}

pub(super) fn named<'de, D: Deserializer<'de>, T: FromStr<Err = Error>>(text: D) -> Result<T, D::Error> {
    String::deserialize(text)?.parse().map_err(D::Error::custom)
}

pub(super) fn parsed<'de, D: Deserializer<'de>, T: FromStr<Err = Error>>(text: D) -> Result<Option<T>, D::Error> {
    named(text).map(Some)
}

impl Definition {
    /// The quick form: what `quick`, `quick_count` and `quick_footprint_px` say.
    pub fn quick_form(mut self) -> Self {
        self.runs = self.quick.runs.unwrap_or(self.runs);
        self.size = self.quick.size.unwrap_or(self.size);
        self.scenes.retain(|scene| scene.quick);
        self.configs.retain(|config| config.quick);
        for scene in &mut self.scenes {
            scene.count = scene.quick_count.clone().or(scene.count.take());
            scene.footprint_px = scene.quick_footprint_px.clone().or(scene.footprint_px.take());
        }
        self
    }

    /// The configurations that render the scene of `entry`.
    pub(super) fn configs_of<'a>(&'a self, entry: &'a SceneEntry) -> impl Iterator<Item = &'a Config> {
        let wants = |config: &&Config| entry.configs.as_ref().is_none_or(|names| names.contains(&config.name));
        self.configs.iter().filter(wants)
    }

    /// The settings of `config` on the scene of `entry`.
    pub fn settings(&self, config: &Config, entry: &SceneEntry) -> RenderOptions {
        let settings = config.settings(entry.shading);
        let opacity = config.options.transparency.opacity.or(entry.opacity).unwrap_or(settings.opacity);
        let background = self.background.or(config.options.look.background.map(|color| color.0));
        RenderOptions { opacity, background: background.unwrap_or(settings.background), ..settings }
    }

    /// Whether a configuration renders on an adapter.
    pub fn needs_gpu(&self) -> bool {
        self.configs.iter().any(|config| config.backend != BackendName::Reference)
    }

    /// The files of all scenes.
    pub fn files(&self) -> Vec<PathBuf> {
        let beside = |scene: &'_ SceneEntry| match &scene.triangles {
            Some(Beside::File(file)) => Some(file.clone()),
            _ => None,
        };
        let files =
            self.scenes.iter().flat_map(|scene| scene.file.iter().chain(&scene.texture).cloned().chain(beside(scene)));
        files.map(|file| self.path_of(&file)).collect()
    }

    /// Where a scene's file is.
    pub(super) fn path_of(&self, file: &Path) -> PathBuf {
        self.folder.join(file)
    }
}
