//! The arguments of `epsplat render`: inputs, views and the options of a picture.

use std::path::PathBuf;

use clap::Args;
use epsplat::Files;
use epsplat::options::parse::scale;
use epsplat::options::{CameraOptions, DeviceOptions, RenderOptions, SceneOptions};

use super::super::inputs::help_of_all;
use super::super::outputs::Source;
use super::output::Format;

/// Render point clouds and meshes to a PNG or EXR image.
///
/// Without a camera the scene is framed from its bounds. Several inputs make one scene. With
/// --cameras there is a picture for each camera of a file, in a folder; pictures that are already
/// written stay if a later one fails.
#[derive(Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    epsplat render scan.laz -o scan.png\n  \
    epsplat render scan.laz -o maps.exr --aov depth,normal --size 1920x1080\n  \
    epsplat render scan.laz -o top.png --eye 0,0,500 --target 0,0,0 --ortho 300\n  \
    epsplat render scan.laz -o height.png --color-by z --legend\n\n\
    --help lists all options.",
    after_long_help = "Examples:\n  \
    epsplat render scan.laz -o scan.png\n  \
    epsplat render a.ply b.ply -o maps.exr --aov depth,normal --size 1920x1080\n  \
    epsplat render bunny.obj -o bunny.png --shading phong --light 1,1,1 --light headlight:0.3\n  \
    epsplat render surfels.ply -o painted.png --texture image.png\n  \
    epsplat render bunny.obj -o glass.png --composite layers --opacity 0.5\n  \
    epsplat render statue.ply -o hall.png --triangles hall.obj\n  \
    epsplat render skin.ply shirt.ply -o dressed.png --separate\n  \
    epsplat render scan.laz -o top.png --eye 0,0,500 --target 0,0,0 --ortho 300\n  \
    epsplat render scan.laz -o ground.png --color-by intensity --classes ground --legend\n  \
    epsplat render scan.laz -o views --cameras transforms.json"
)]
pub struct Arguments {
    #[arg(required_unless_present = "triangles", help = help_of_all("Point clouds or meshes, which become surfels"))]
    pub(super) inputs: Vec<PathBuf>,
    /// The image, .png (8-bit sRGB) or .exr (linear, with maps); with --cameras a folder of images
    #[arg(short, long)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) camera: CameraOptions,
    #[command(flatten)]
    pub(super) views: ViewArguments,
    #[command(flatten)]
    pub(super) options: RenderOptions,
    #[command(flatten)]
    pub(super) scene: SceneOptions,
    #[command(flatten)]
    pub(super) device: DeviceOptions,
    /// Write times, counts and adapter as JSON, to a file or - for standard output
    #[arg(long, value_name = "FILE|-", help_heading = "Output")]
    pub(super) json: Option<PathBuf>,
}

/// The cameras of many pictures.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
pub(super) struct ViewArguments {
    /// Many cameras: a transforms.json, a list of cameras, or a folder of COLMAP's text files
    ///
    /// A transforms.json has the format of NeRF, instant-ngp or nerfstudio. Each picture is named
    /// after its camera's image, folders included
    #[arg(long, value_name = "PATH", conflicts_with_all = ["file", "eye", "from", "target", "up", "fov", "ortho", "intrinsics"])]
    pub(super) cameras: Option<PathBuf>,
    /// Format of the images of --cameras [default: png; exr with --aov]
    #[arg(long, value_enum, requires = "cameras", hide_short_help = true)]
    pub(super) format: Option<Format>,
    /// Factor of the width and height of --cameras' images; intrinsics are scaled too
    #[arg(long, value_name = "FACTOR", value_parser = scale, requires = "cameras", hide_short_help = true)]
    pub(super) scale: Option<f64>,
    /// Ignore the lens distortion of --cameras; by default a distorted camera is an error
    #[arg(long, requires = "cameras", hide_short_help = true)]
    pub(super) ignore_distortion: bool,
}

impl Arguments {
    /// Lists all files that are read: `inputs` and the files of all options except `--cameras`.
    pub(super) fn files<'a>(&'a self, inputs: &'a Files) -> impl Iterator<Item = Source<'a>> {
        let SceneOptions { surfels, triangles, .. } = &self.scene;
        let others = triangles.texture.iter().chain(&self.camera.file).chain(&surfels.textures);
        let meshes = triangles.meshes.iter().map(Source::cloud);
        let kernels = self.options.research.sources.iter().filter_map(|source| source.path());
        Source::of(inputs).chain(meshes).chain(others.map(Source::other)).chain(kernels.map(Source::other))
    }
}
