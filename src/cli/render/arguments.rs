//! The arguments of `epsplat render`: inputs, views and the options of a picture.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use epsplat::io::images::ImageFormat;
use epsplat::{Files, Share};

use epsplat::options::parse::{scale, turns};
use epsplat::options::{CameraOptions, DeviceOptions, RenderOptions, SceneOptions};

use super::super::cameras::LensArguments;
use super::super::inputs::help_of_all;
use super::super::outputs::Source;

/// Render point clouds and meshes to images: PNG, EXR, JPEG, GeoTIFF or NumPy arrays.
///
/// Without a camera the scene is framed from its bounds. Several inputs make one scene. With
/// --cameras there is a picture for each camera of a file, and with --turntable one for each step
/// around the scene, in a folder; pictures that are already written stay if a later one fails.
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
    epsplat render scan.laz -o ortho.tif --pixel-size 0.5\n  \
    epsplat render scan.laz -o height.tif --pixel-size 0.5 --aov height\n  \
    epsplat render scan.laz -o views --cameras transforms.json\n  \
    epsplat render https://example.org/city.copc.laz -o city.png --lod 4px\n  \
    epsplat render scan.laz -o depth.png --aov depth --depth-scale 100\n  \
    epsplat render scan.laz -o depth-1.part --part 1/4\n  \
    epsplat render scan.laz -o - --turntable 90 --format raw --size 640x480 |\n    \
    ffmpeg -f rawvideo -pix_fmt rgba -s 640x480 -r 30 -i - turntable.mp4"
)]
pub struct Arguments {
    #[arg(required_unless_present = "triangles", help = help_of_all("Point clouds, drawn as surfels, or meshes, drawn as triangles"))]
    pub(super) inputs: Vec<PathBuf>,
    /// The image: .png, .exr (linear, with maps), .jpg, .tif, .npy or .npz; - is standard output;
    /// with --cameras or --turntable a folder of images
    ///
    /// .png: 8-bit sRGB, straight alpha; with --depth-scale 16-bit depths. .exr: linear f32, with
    /// the maps of --aov as channels. .jpg: 8-bit sRGB over white, or over an opaque --background.
    /// .tif: 8-bit sRGB, or the only map of --aov; GeoTIFF with --pixel-size. .npy: linear f32 (H,
    /// W, 4), or the only map of --aov. .npz: an array for the colour and for each map. Standard
    /// output has to be a pipe or a file; all notes go to stderr
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
    #[command(flatten)]
    pub(super) file: FileArguments,
    #[command(flatten)]
    pub(super) part: PartArguments,
}

/// A picture that several processes draw.
#[derive(Args)]
#[command(next_help_heading = "Many machines")]
pub(super) struct PartArguments {
    /// Draw part I of N of the picture, for `epsplat merge`: its nearest depths, or with --within
    /// its sums
    ///
    /// The output is a file of parts, such as depth-1.part. Draw the depths of all parts, then the
    /// sums of all parts with --within, and merge the sums to the picture, which has the bits of a
    /// picture without --part. Parts are runs of the surfels; every process reads all inputs, and
    /// all need the same inputs and options
    #[arg(long, value_name = "I/N", hide_short_help = true)]
    pub(super) part: Option<Share>,
    /// The depths of all parts: their files, or the file that `epsplat merge` made of them
    #[arg(long, value_name = "PART", requires = "part", num_args = 1.., hide_short_help = true)]
    pub(super) within: Vec<PathBuf>,
}

/// The files that are written.
#[derive(Args)]
#[command(next_help_heading = "Output")]
pub(in super::super) struct FileArguments {
    /// Format of images in a folder or on standard output [default: png; exr in a folder with
    /// --aov]
    ///
    /// The format of a single file follows from its extension. raw: four bytes a pixel (red, green,
    /// blue, alpha as in a PNG) without a header, for pipes to video encoders
    #[arg(long, value_parser = formats(), hide_short_help = true)]
    pub(in super::super) format: Option<ImageFormat>,
    /// Write --aov depth as 16-bit PNG: each value is depth times SCALE, and 0 is nothing
    ///
    /// Depths are rounded to the nearest integer. With coordinates in metres, 1000 makes the
    /// millimetres of ScanNet and others, and 5000 the unit of TUM's files. A depth above
    /// 65535/SCALE is an error
    #[arg(long, value_name = "SCALE", value_parser = scale, hide_short_help = true)]
    pub(in super::super) depth_scale: Option<f64>,
    /// Write times, counts and adapter as JSON, to a file or - for standard output
    #[arg(long, value_name = "FILE|-")]
    pub(in super::super) json: Option<PathBuf>,
}

/// Parses the names of the image formats that this build writes.
fn formats() -> impl TypedValueParser<Value = ImageFormat> {
    PossibleValuesParser::new(ImageFormat::names()).try_map(|name| name.parse::<ImageFormat>())
}

/// The cameras of many pictures.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
pub(super) struct ViewArguments {
    /// Many cameras: transforms.json, camera_path.json, cameras.json, a list, or COLMAP's folder
    ///
    /// transforms.json is that of NeRF, instant-ngp or nerfstudio, camera_path.json that of
    /// nerfstudio, cameras.json that of 3D Gaussian Splatting. COLMAP's model is binary or text, in
    /// the folder itself or in its sparse/0. Each picture is named after its camera's image,
    /// folders included
    #[arg(long, value_name = "PATH", conflicts_with_all = ["file", "eye", "from", "azimuth", "elevation", "target", "up", "fov", "projection", "ortho", "intrinsics", "pixel_size"])]
    pub(super) cameras: Option<PathBuf>,
    /// N pictures around the scene, from the elevation of the default view or the side of --from
    ///
    /// The camera moves counter-clockwise, seen from above, in N equal steps around the up axis
    /// through the scene's centre, at one distance from which the whole scene stays in view. The
    /// pictures are named 0000.png and so on
    #[arg(long, value_name = "N", value_parser = turns, conflicts_with_all = ["cameras", "file", "eye", "target", "intrinsics", "pixel_size"], hide_short_help = true)]
    pub(super) turntable: Option<NonZeroU32>,
    #[command(flatten)]
    pub(super) lens: LensArguments,
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
