//! The definition of a study: its scenes, its configurations, and how they are measured.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use super::config::Config;
use crate::error::{Error, Result};
use crate::io::ClassOpacities;
use crate::plan::{BackendName, Settings};
use crate::scene::Shading;
use crate::surfels::analytic::Shape;
use crate::surfels::hierarchy::NodeBounds;
use crate::surfels::sampling::Priority;
use crate::surfels::simplify::Tolerance;
use crate::truth::DEFAULT_GRID;

/// A study: a set of configurations, rendered on a set of scenes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// A short name; it also names the folder of the study's report.
    pub name: String,
    /// One sentence that says what the study shows.
    pub about: String,
    /// Width and height of the images, pixels.
    #[serde(default = "default_size")]
    pub size: [u32; 2],
    /// Number of timed runs of each configuration, after one run to warm up.
    #[serde(default = "default_runs")]
    pub runs: u32,
    /// The name of the configuration whose time is the unit of relative times.
    pub baseline: Option<String>,
    /// Rays of ground truth along one side of a pixel: `rays` x `rays` are cast per pixel.
    #[serde(default = "default_rays")]
    pub rays: u32,
    /// Background colour as linear RGBA, straight alpha; by default that of the configuration.
    pub background: Option<[f32; 4]>,
    /// The settings of a quick run.
    #[serde(default)]
    pub quick: Quick,
    /// The scenes, `[[scene]]` in the file.
    #[serde(rename = "scene", default)]
    pub scenes: Vec<SceneEntry>,
    /// The configurations, `[[config]]` in the file.
    #[serde(rename = "config", default)]
    pub configs: Vec<Config>,
    /// The folder of the definition's file. Paths in the definition are relative to this folder.
    #[serde(skip)]
    pub(super) folder: PathBuf,
}

/// Settings of a quick run in place of the study's; see [`Definition::quick_form`].
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quick {
    /// Number of timed runs of each configuration.
    pub runs: Option<u32>,
    /// Width and height of the images, pixels.
    pub size: Option<[u32; 2]>,
}

/// One scene, or a sweep over each `count` combined with each `footprint_px`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneEntry {
    /// The name, unique in the study.
    pub name: String,
    /// The path of a point cloud or mesh, relative to the definition's folder; excludes `shape`.
    pub file: Option<PathBuf>,
    /// The place to download the file from, shown if the file is missing.
    pub source: Option<String>,
    /// How surfels are made from the file; by default as `epsplat render` does.
    #[serde(default)]
    pub surfels: Making,
    /// Which voxels get more samples of a mesh: the priority of `epsplat sample`.
    #[serde(default, deserialize_with = "parsed")]
    pub priority: Option<Priority>,
    /// Whether surfels keep their clip lines and curvature; by default both.
    #[serde(default)]
    pub rims: Rims,
    /// Parts of the disks below that nodes of levels of detail bound; by default rims.
    #[serde(default, deserialize_with = "parsed")]
    pub bounds: Option<NodeBounds>,
    /// The texture of the mesh in `file`, relative to the definition's folder.
    pub texture: Option<PathBuf>,
    /// Whether the texture is looked up per pixel. Otherwise each surfel has one colour from it.
    #[serde(default)]
    pub lookup: bool,
    /// Simplifies the surfels as `epsplat simplify --shape cap` does, within this tolerance.
    #[serde(default, deserialize_with = "parsed")]
    pub simplify: Option<Tolerance>,
    /// With `simplify`: selects disks as `epsplat simplify --cover thesis:R` does, with this R.
    pub cover: Option<f64>,
    /// A generated surface in place of a file.
    ///
    /// Sphere, torus, plane, checkerboard, text, shells or crossing.
    #[serde(default, deserialize_with = "parsed")]
    pub shape: Option<Shape>,
    /// Triangles that are drawn together with the surfels: a shape or a mesh file.
    ///
    /// A shape may be followed by a colon and the number of triangles (default 200,000); a file is
    /// relative to the definition's folder. With `truth`, the visible curve where surfels and
    /// triangles meet is compared with the true one.
    #[serde(default, deserialize_with = "parsed")]
    pub triangles: Option<Beside>,
    /// Number of surfels of the shape, or of samples of the mesh.
    pub count: Option<OneOrMany<u64>>,
    /// Disk radius of a shape's surfels in mean spacings; by default as in `epsplat generate`.
    pub radius: Option<f64>,
    /// Noise of a shape's points along their normals: the standard deviation in mean spacings.
    pub noise: Option<f64>,
    /// Adds a copy of the points as a second input, moved along their normals by this distance.
    ///
    /// In world units. The share of pixels that blend both inputs is measured (`mixed_rate`).
    pub shirt: Option<f64>,
    /// Mean splat radius in pixels, as if seen face-on: disks are scaled to it.
    pub footprint_px: Option<OneOrMany<f64>>,
    /// Skips points of a sweep where `surfels * pi * footprint_px^2` exceeds this number of pixels.
    pub most_fragments: Option<f64>,
    /// Camera position, world units; by default the camera frames the scene.
    pub eye: Option<[f64; 3]>,
    /// Target of the camera, world units; by default the scene's centre.
    pub target: Option<[f64; 3]>,
    /// Up direction in the image; by default the scene's.
    pub up: Option<[f64; 3]>,
    /// Vertical field of view, degrees.
    pub fov: Option<f64>,
    /// Selects an orthographic camera and gives the height of its image, world units.
    pub ortho: Option<f64>,
    /// Width and height in pixels, also in quick runs; by default the study's.
    pub size: Option<[u32; 2]>,
    /// Scale of the scene in the image. 0.5 moves a pinhole camera twice as far away, or halves the
    /// scale of an orthographic one.
    pub fill: Option<f64>,
    /// Number of cameras on a circle around the scene's centre; the first is the one defined above.
    #[serde(default = "one")]
    pub views: u32,
    /// The names of the configurations that render the scene; by default all.
    pub configs: Option<Vec<String>>,
    /// Whether images are compared with ray-cast ground truth: the shape, or the mesh's triangles.
    #[serde(default)]
    pub truth: bool,
    /// Shading for configurations that set none.
    pub shading: Option<Shading>,
    /// Opacity for configurations that set none.
    pub opacity: Option<f32>,
    /// Opacity by class of the file's points, as for `epsplat render --class-opacity`.
    #[serde(default, deserialize_with = "parsed")]
    pub classes: Option<ClassOpacities>,
    /// Number of surfels in a quick run.
    pub quick_count: Option<OneOrMany<u64>>,
    /// Mean splat radius in a quick run, pixels.
    pub quick_footprint_px: Option<OneOrMany<f64>>,
    /// Whether a quick run includes this scene.
    #[serde(default = "yes")]
    pub quick: bool,
}

/// How surfels are made from the file or the shape of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Making {
    /// From everything in the file, as `epsplat render` does.
    #[default]
    File,
    /// From the points alone, as `epsplat render` does.
    ///
    /// Ellipses contain the points' cells, and normals are turned to the viewer.
    Points,
    /// From the points and the vertex normals of the triangles: what a scanner's software exports.
    Normals,
    /// From the points alone, as `epsplat surfels` does.
    ///
    /// Normals are consistent, and ellipses contain the points' cells.
    Knn,
    /// As [`Knn`](Self::Knn), with ellipses that bound the neighbours.
    Ellipse,
    /// As [`Knn`](Self::Knn), with disks from clusters of three points.
    Bsp,
    /// As [`Bsp`](Self::Bsp), with one radius for all surfels.
    #[serde(rename = "bsp:global")]
    BspGlobal,
    /// As [`Bsp`](Self::Bsp), by the circumspheres of the clusters.
    #[serde(rename = "bsp:circumsphere")]
    BspCircumsphere,
    /// As [`BspGlobal`](Self::BspGlobal), by the circumspheres of the clusters.
    #[serde(rename = "bsp:global-circumsphere")]
    BspGlobalCircumsphere,
    /// As [`Knn`](Self::Knn), with disks as large as the triangles at a mesh's vertices.
    Qsplat,
    /// As `epsplat sample` does: `count` samples of a mesh, with ellipses that cover it.
    Sample,
    /// As [`Sample`](Self::Sample), with the positions of Tien 2008.
    Projected,
    /// As [`Sample`](Self::Sample), with the mesh's curvature around each sample.
    Caps,
    /// From positions and normals of `count` samples of a mesh or shape, as `epsplat render` does.
    Scanned,
    /// From `count` random points on a mesh and the mesh's normals; ellipses contain the points'
    /// cells.
    Uniform,
    /// As `epsplat hybrid` does: samples of a mesh, and the triangles that remain.
    ///
    /// The pixel size is chosen so that the mesh's diagonal is `count` pixels long.
    Hybrid,
    /// From a file of `epsplat lod`: only surfels and nodes in the configurations' cuts are read.
    Levels,
    /// No surfels: `count` triangles approximate a shape.
    ///
    /// The orthographic scale is set so that a disk of the mean triangle area has a radius of
    /// `footprint_px`.
    Triangles,
    /// Gaussians of a shape, as `epsplat generate --gaussians` makes them.
    Gaussians,
}

/// Triangles that are drawn together with surfels.
#[derive(Clone, Debug, PartialEq)]
pub enum Beside {
    /// A shape, and its approximate number of triangles.
    Shape(Shape, u64),
    /// A mesh file.
    File(PathBuf),
}

/// Default number of triangles of a shape: in most images their edges are too short to see.
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

/// Whether surfels have clip lines and curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rims {
    /// Clip lines and curvature.
    #[default]
    Curved,
    /// Clip lines only.
    Clipped,
    /// Neither: flat, whole ellipses.
    Flat,
}

impl Making {
    /// The kinds of surfels that a shape can have.
    pub const OF_SHAPES: [Self; 4] = [Self::File, Self::Scanned, Self::Gaussians, Self::Triangles];

    /// Whether surfels are samples of a mesh, which need a `count`.
    pub fn samples(self) -> bool {
        matches!(self, Self::Sample | Self::Projected | Self::Caps | Self::Scanned | Self::Uniform | Self::Hybrid)
    }
}

/// A value, or the list of values of a sweep.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number or a list of numbers is needed")]
pub enum OneOrMany<T> {
    /// A single value.
    One(T),
    /// The values of a sweep.
    Many(Vec<T>),
}

impl<T: Copy> OneOrMany<T> {
    /// Returns the values in order.
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
    /// Returns the study with its quick settings, without entries that have `quick = false`.
    ///
    /// # Errors
    /// [`Error::Usage`] if no setting of the study makes a quick run shorter.
    pub fn quick_form(mut self) -> Result<Self> {
        let shorter =
            |scene: &SceneEntry| !scene.quick || scene.quick_count.is_some() || scene.quick_footprint_px.is_some();
        let whole = self.quick.runs.is_none() && self.quick.size.is_none();
        if whole && !self.scenes.iter().any(shorter) && self.configs.iter().all(|config| config.quick) {
            return Err(Error::Usage(
                "this study has no quick form: leave --quick out, or give it [quick] with runs or size".into(),
            ));
        }
        self.runs = self.quick.runs.unwrap_or(self.runs);
        self.size = self.quick.size.unwrap_or(self.size);
        self.scenes.retain(|scene| scene.quick);
        self.configs.retain(|config| config.quick);
        for scene in &mut self.scenes {
            scene.count = scene.quick_count.clone().or(scene.count.take());
            scene.footprint_px = scene.quick_footprint_px.clone().or(scene.footprint_px.take());
        }
        Ok(self)
    }

    /// Returns the configurations that render the scene of `entry`.
    pub(super) fn configs_of<'a>(&'a self, entry: &'a SceneEntry) -> impl Iterator<Item = &'a Config> {
        let wants = |config: &&Config| entry.configs.as_ref().is_none_or(|names| names.contains(&config.name));
        self.configs.iter().filter(wants)
    }

    /// Returns the render settings of `config` for the scene of `entry`.
    pub fn settings(&self, config: &Config, entry: &SceneEntry) -> Settings {
        let settings = config.settings(entry.shading);
        let opacity = config.options.transparency.opacity.or(entry.opacity).unwrap_or(settings.opacity);
        let background = self.background.or(config.options.look.background.map(|color| color.0));
        Settings { opacity, background: background.unwrap_or(settings.background), ..settings }
    }

    /// Whether any configuration needs an adapter.
    pub fn needs_gpu(&self) -> bool {
        self.configs.iter().any(|config| config.backend != BackendName::Reference)
    }

    /// Returns the paths of all files that the scenes read.
    pub fn files(&self) -> Vec<PathBuf> {
        let beside = |scene: &'_ SceneEntry| match &scene.triangles {
            Some(Beside::File(file)) => Some(file.clone()),
            _ => None,
        };
        let files =
            self.scenes.iter().flat_map(|scene| scene.file.iter().chain(&scene.texture).cloned().chain(beside(scene)));
        let kernels = self.configs.iter().flat_map(|config| &config.options.research.sources);
        let kernels = kernels.filter_map(|source| source.path().map(Path::to_owned));
        files.map(|file| self.path_of(&file)).chain(kernels).collect()
    }

    /// Returns the path of a scene's file, which is relative to the definition's folder.
    pub(super) fn path_of(&self, file: &Path) -> PathBuf {
        self.folder.join(file)
    }
}
