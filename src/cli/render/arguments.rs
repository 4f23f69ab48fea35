//! The arguments of `epsplat render`: inputs, camera, device and the options of a picture.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use epsplat::options::RenderOptions;
use epsplat::plan::BackendName;
use epsplat::surfels::Size;
use glam::DVec3;

use super::super::outputs::Source;
use super::super::parse::{parse_intrinsics, parse_memory, parse_scale, parse_size, parse_up, parse_vector};
use super::super::reading::{LimitArguments, Reading, help_of_all};
use super::output::Format;

/// Render point clouds and meshes to a PNG or EXR image.
///
/// Without a camera the scene is framed from its bounds. Several inputs make one scene. With
/// --cameras there is a picture for each camera of a file, in a folder; those that are written stay
/// if a later one fails.
#[derive(Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    epsplat render scan.laz -o scan.png\n  \
    epsplat render scan.laz -o maps.exr --aov depth,normal --size 1920x1080\n  \
    epsplat render scan.laz -o top.png --eye 0,0,500 --target 0,0,0 --ortho 300\n\n\
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
    epsplat render scan.laz -o views --cameras transforms.json"
)]
pub struct Arguments {
    #[arg(required_unless_present = "triangles", help = help_of_all("Point clouds or meshes, which become surfels"))]
    pub(crate) inputs: Vec<PathBuf>,
    /// The image, .png (8-bit sRGB) or .exr (linear, with maps); with --cameras a folder of images
    #[arg(short, long)]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) camera: CameraArguments,
    #[command(flatten)]
    pub(super) options: RenderOptions,
    #[command(flatten)]
    pub(super) triangles: TriangleArguments,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(super) limits: LimitArguments,
    #[command(flatten)]
    pub(super) surfels: SurfelArguments,
    #[command(flatten)]
    pub(super) device: DeviceArguments,
    /// Write times, counts and adapter as JSON, to a file or - for standard output
    #[arg(long, value_name = "FILE|-", help_heading = "Output")]
    pub(super) json: Option<PathBuf>,
}

/// The view, or many views.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
pub(super) struct CameraArguments {
    /// Image size in pixels [default: 1024x1024, or the camera file's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(super) size: Option<(u32, u32)>,
    /// Position of the camera, world coordinates [default: a view of the whole scene]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(super) eye: Option<DVec3>,
    /// Point that the camera looks at [default: the scene's centre]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    pub(super) target: Option<DVec3>,
    /// Direction of up in the image: x, y, z, -x, -y, -z or X,Y,Z [default: as the file says]
    ///
    /// LAS files and the PLY files of epsplat say it; in others up is z for flat clouds, else y
    #[arg(long, value_name = "AXIS|X,Y,Z", value_parser = parse_up, allow_hyphen_values = true)]
    pub(super) up: Option<DVec3>,
    /// Vertical field of view [default: 45]
    #[arg(long, value_name = "DEGREES", conflicts_with_all = ["ortho", "intrinsics"])]
    pub(super) fov: Option<f64>,
    /// Orthographic view of this height in world units
    #[arg(long, value_name = "HEIGHT", conflicts_with = "intrinsics")]
    pub(super) ortho: Option<f64>,
    /// Focal lengths and principal point in pixels
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse_intrinsics, allow_hyphen_values = true, hide_short_help = true)]
    pub(super) intrinsics: Option<[f64; 4]>,
    /// Camera file (see the guide), in place of all other camera options except --size
    #[arg(long = "camera", value_name = "CAMERA.json", conflicts_with_all = ["eye", "target", "up", "fov", "ortho", "intrinsics"], hide_short_help = true)]
    pub(super) file: Option<PathBuf>,
    /// Many cameras: a transforms.json, or a folder with COLMAP's cameras.txt and images.txt
    ///
    /// A transforms.json is one of NeRF, instant-ngp or nerfstudio. Each camera names its image,
    /// folders included
    #[arg(long, value_name = "PATH", conflicts_with_all = ["file", "eye", "target", "up", "fov", "ortho", "intrinsics"])]
    pub(super) cameras: Option<PathBuf>,
    /// Format of the images of --cameras [default: png; exr with --aov]
    #[arg(long, value_enum, requires = "cameras", hide_short_help = true)]
    pub(super) format: Option<Format>,
    /// Factor of the width and height of --cameras' images; intrinsics are scaled too
    #[arg(long, value_name = "FACTOR", value_parser = parse_scale, requires = "cameras", hide_short_help = true)]
    pub(super) scale: Option<f64>,
    /// Ignore the lens distortion of --cameras; by default a distorted camera is an error
    #[arg(long, requires = "cameras", hide_short_help = true)]
    pub(super) ignore_distortion: bool,
    /// Smallest depth drawn, world units [default: a millionth of the scene]
    #[arg(long, value_name = "DEPTH", hide_short_help = true)]
    pub(super) near: Option<f64>,
}

/// Meshes that are drawn as their triangles.
#[derive(Args)]
#[command(next_help_heading = "Triangles")]
pub(super) struct TriangleArguments {
    /// Meshes drawn as triangles, beside the surfels of the inputs or alone: .obj or .ply
    #[arg(long = "triangles", id = "triangles", value_name = "MESH", num_args = 1..)]
    pub(super) meshes: Vec<PathBuf>,
    /// Image for the triangles of meshes whose materials have none: .png, .jpg, .bmp or .tga
    #[arg(long = "triangle-texture", value_name = "IMAGE", hide_short_help = true)]
    pub(super) texture: Option<PathBuf>,
}

/// How surfels are sized and painted.
#[derive(Args)]
#[command(next_help_heading = "Surfels from points")]
pub(super) struct SurfelArguments {
    /// Size the surfels anew, as `epsplat surfels --size HOW` does: knn, ellipse, bsp, qsplat, ...
    #[arg(long = "surfel-size", value_name = "HOW", conflicts_with_all = ["facing", "separate", "textures"], hide_short_help = true)]
    pub(super) size: Option<Size>,
    /// Image that paints the surfels by their texture coordinates: .png, .jpg, .bmp or .tga
    ///
    /// It replaces the surfels' own colours; `epsplat sample` writes texture coordinates. Given
    /// several times, the images are those of the inputs in order, or of the image numbers
    /// (texnumber) of one input's points
    #[arg(long = "texture", id = "textures", value_name = "IMAGE")]
    pub(super) textures: Vec<PathBuf>,
}

/// The backend, its adapter and its limit of memory.
#[derive(Args)]
#[command(next_help_heading = "Device")]
pub(super) struct DeviceArguments {
    /// Backend: auto, gpu, raster or reference [default: auto]
    ///
    /// gpu: compute kernels on an adapter; raster: the adapter's rasteriser and blender, for
    /// comparison; reference: the kernels' f64 twins on the processor; auto: gpu on the best
    /// adapter, or reference if there is none
    #[arg(long, value_parser = backend_parser(), default_value = "auto", hide_default_value = true, hide_possible_values = true)]
    pub(super) backend: Chosen,
    /// API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists them
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub(super) adapter: Option<String>,
    /// Limit the memory of host and device together, such as 2GiB
    ///
    /// Needs one file of `epsplat lod` with --lod or --splats, so that a part of it is read. A
    /// picture that needs more memory is an error
    #[arg(long, value_name = "SIZE", value_parser = parse_memory, requires = "cut", hide_short_help = true)]
    pub(super) memory: Option<u64>,
}

/// A backend, or None for `auto`.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Chosen(Option<BackendName>);

fn backend_parser() -> impl TypedValueParser<Value = Chosen> {
    PossibleValuesParser::new(["auto", "gpu", "raster", "reference"]).map(|name| Chosen(name.parse().ok()))
}

impl Arguments {
    /// Returns the files that are read, except those of `--cameras`.
    pub(super) fn files(&self) -> impl Iterator<Item = Source<'_>> {
        let others = self.triangles.texture.iter().chain(&self.camera.file).chain(&self.surfels.textures);
        let meshes = self.triangles.meshes.iter().map(Source::cloud);
        self.reading.sources(&self.inputs).chain(meshes).chain(others.map(Source::other))
    }

    /// Returns true if the surfels come from at most one file, and from no folder.
    pub(super) fn is_one_file(&self) -> bool {
        self.inputs.len() < 2 && self.inputs.iter().all(|path| !path.is_dir())
    }

    /// Returns the backend, or None for `auto`.
    pub(super) fn backend(&self) -> Option<BackendName> {
        self.device.backend.0
    }

    /// Returns true if the f64 twins render.
    pub(super) fn is_reference(&self) -> bool {
        self.backend() == Some(BackendName::Reference)
    }
}
