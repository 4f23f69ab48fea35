//! `epsplat render`: files in, a picture and its maps out, or one for each of many cameras.

mod levels;
mod memory;
mod octrees;
mod options;
mod output;
mod parts;
mod scene;
mod tree;
mod view;
mod views;

use std::num::NonZeroU64;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use epsplat::gpu::Gpu;
use epsplat::passes::unseen::{Unseen, is_empty};
use epsplat::plan::{Accumulator, BackendName, BlendFormat, Organisation, RasterDepth, RenderOptions};
use epsplat::render::{Backend, Report, render};
use epsplat::scene::{
    Blend, Camera, Composite, Cull, Detail, Epsilon, Join, Kernel, Light, MAPS, Map, Outline, PointShape, PointSize,
    Samples, Tail,
};
use epsplat::surfels::Size;
use epsplat::{Error, Result};
use glam::DVec3;
use serde::Serialize;

use self::levels::MeasureName;
use self::options::{for_scene, options};
use self::output::{Format, note_cut, note_overflows, summary};
use self::parts::{Part, Parts, Read};
use self::scene::{Made, scene};
use self::view::{Seen, ToldView, View};
use super::outputs::Source;
use super::parse::{
    parse_color, parse_intrinsics, parse_memory, parse_pixels, parse_scale, parse_size, parse_up, parse_vector,
};
use super::progress::Bars;
use super::reading::{LimitArguments, Reading, help_of_all};
use super::{note, outputs, write_json};

/// Render point clouds and meshes to a PNG or EXR image.
///
/// Without a camera the scene is framed from its bounds. Several inputs make one scene. With --cameras there is a picture for each
/// camera of a file, in a folder; those that are written stay if a later one fails.
#[derive(Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
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
    pub(super) inputs: Vec<PathBuf>,
    /// Meshes whose triangles are drawn as they are, beside the surfels, whose files come before, or alone: .obj or .ply
    #[arg(long, value_name = "MESH", num_args = 1.., help_heading = "Triangles")]
    triangles: Vec<PathBuf>,
    /// An image to paint the meshes with none of whose materials has one, by their texture
    /// coordinates: .png, .jpg, .bmp or .tga
    #[arg(long, value_name = "IMAGE", help_heading = "Triangles")]
    triangle_texture: Option<PathBuf>,
    /// What shows where surfels meet triangles: corrected (the nearer one, surfels by the depth that they blend to), nearest (the nearer
    /// one, surfels by their nearest fragment, as a depth buffer has it) or blended (both, within epsilon) [default: corrected]
    #[arg(long, value_name = "HOW", help_heading = "Triangles")]
    join: Option<Join>,
    /// Keep the inputs apart: surfels of different files do not blend, however near they are, and where they meet the nearer one shows, by
    /// the depth that it blends to
    #[arg(long)]
    separate: bool,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    limits: LimitArguments,
    /// Measure the surfels anew, as `epsplat surfels --size HOW` does: knn, ellipse, bsp, qsplat
    /// and others
    #[arg(long, value_name = "HOW", conflicts_with_all = ["facing", "separate", "textures"])]
    surfel_size: Option<Size>,
    /// The image: .png (8-bit sRGB) or .exr (linear f32, every map a layer); with --cameras the folder of the images
    #[arg(short, long)]
    output: PathBuf,
    /// Image size in pixels [default: 1024x1024, or the camera file's]
    #[arg(long, value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Who renders: gpu (compute kernels on an adapter), raster (the adapter's rasteriser and blender, for comparison), reference
    /// (the kernels' f64 twins on the processor) or auto (gpu on the best adapter, or the reference where there is none)
    /// [default: auto]
    #[arg(long, value_parser = backend_parser(), default_value = "auto", hide_default_value = true)]
    backend: Chosen,
    /// An API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists them
    #[arg(long)]
    adapter: Option<String>,
    /// Camera position, world coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    eye: Option<DVec3>,
    /// What the camera looks at [default: the scene's centre]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, requires = "eye")]
    target: Option<DVec3>,
    /// Which way is up in the image: x, y, z, -x, -y, -z or a direction [default: what the file says, as LAS does and PLY of epsplat;
    /// else z for flat clouds, y for others]
    #[arg(long, value_name = "AXIS|X,Y,Z", value_parser = parse_up, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// Vertical field of view [default: 45]
    #[arg(long, value_name = "DEG", conflicts_with_all = ["ortho", "intrinsics"])]
    fov: Option<f64>,
    /// Orthographic view of this height
    #[arg(long, value_name = "WORLD_HEIGHT", conflicts_with = "intrinsics")]
    ortho: Option<f64>,
    /// Focal lengths and principal point in pixels
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse_intrinsics, allow_hyphen_values = true)]
    intrinsics: Option<[f64; 4]>,
    /// A camera file (see the README); takes the place of all other camera arguments but --size
    #[arg(long, value_name = "CAMERA.json", conflicts_with_all = ["eye", "target", "up", "fov", "ortho", "intrinsics"])]
    camera: Option<PathBuf>,
    /// Many cameras: a transforms.json (NeRF, instant-ngp, nerfstudio), or a folder with COLMAP's cameras.txt and images.txt.
    /// Each names its image, folders included
    #[arg(long, value_name = "PATH", conflicts_with_all = ["camera", "eye", "target", "up", "fov", "ortho", "intrinsics"])]
    cameras: Option<PathBuf>,
    /// What --cameras writes [default: png; exr with --aov]
    #[arg(long, value_enum, requires = "cameras")]
    format: Option<Format>,
    /// So many times the pixels of --cameras, a side; intrinsics are scaled too
    #[arg(long, value_name = "FACTOR", value_parser = parse_scale, requires = "cameras")]
    scale: Option<f64>,
    /// Leave the lens distortion of --cameras out; else a distorted camera is refused
    #[arg(long, requires = "cameras")]
    ignore_distortion: bool,
    /// Smallest depth drawn, world units [default: a millionth of the scene]
    #[arg(long)]
    near: Option<f64>,
    /// Depth tolerance: rel:E (fraction of the depth), abs:E (world units along the camera's axis), ray:E (along the view ray), radius:K (times the
    /// surfel's own shorter half-axis), or radius:K,rel:E (the lesser of the two)
    /// [default: radius:1,rel:0.01]
    #[arg(long)]
    epsilon: Option<Epsilon>,
    /// Draw points as shapes that face the camera, without a look at normals or neighbours: square, circle, sphere, cone or paraboloid
    #[arg(long, value_name = "SHAPE", help_heading = "Points")]
    facing: Option<PointShape>,
    /// Their size: radius:F (times a point's own radius, or, where points have none, one for all by their spacing), abs:R (the radius
    /// in world units) or pixels:D (the diameter)
    #[arg(long, value_name = "SIZE", default_value = "radius:1", requires = "facing", help_heading = "Points")]
    point_size: PointSize,
    /// Their smallest and largest diameter in the image
    #[arg(long, value_name = "MIN,MAX", default_value = "1,50", value_parser = parse_pixels, requires = "facing", help_heading = "Points")]
    pixels: [f64; 2],
    /// Draw a polygon of N sides, 3 to 16, in each disk instead of the disk
    #[arg(long, value_name = "N", help_heading = "Surface")]
    outline: Option<Outline>,
    /// Blending kernel over the disk: gaussian[:SIGMA], ellipse:A,N[,smooth] (exp(-A rho^N)), plateau:MID,SLOPE (the ellipse that is 1/2
    /// at MID with that slope), cone:P ((1-rho)^P), hat (cone:1) or constant
    /// [default: ellipse:6,3]
    #[arg(long)]
    kernel: Option<Kernel>,
    /// What a pixel shows: weighted (the mean of the fragments within epsilon of the nearest) or nearest (the colour of the nearest
    /// alone, as with a depth test: unlit, and faster for points of a few pixels) [default: weighted]
    #[arg(long, value_name = "HOW")]
    blend: Option<Blend>,
    /// What shows of the surfaces behind a pixel's nearest one: opaque (nothing; its alpha shows the background), layers (all of
    /// them, from front to back, by the alpha of each), layers:L (the nearest L), sorted (every fragment, in the order of depths, by
    /// its alpha times its weight) or gaussians (the same by the rules of 2D Gaussian splatting); to compare with, weighted or moments
    /// (about sorted, by sums in any order; splats are lit) [default: opaque, of Gaussians gaussians]
    #[arg(long, value_name = "HOW", help_heading = "Transparency")]
    composite: Option<Composite>,
    /// What all alphas are multiplied with, 0 to 1
    #[arg(long, value_name = "A", default_value = "1", help_heading = "Transparency")]
    opacity: f32,
    /// What becomes of the surfaces behind the last of layers:L: sum (they are blended, as one more) or none [default: sum]
    #[arg(long, value_name = "HOW", requires = "composite", help_heading = "Transparency")]
    tail: Option<Tail>,
    /// Filter for splats near a pixel in size or below [default: none, of Gaussians gaussians]
    #[arg(long, value_enum)]
    lowpass: Option<LowPassName>,
    /// Samples of a pixel: 1, 4, 8 or 16. Edges are as smooth as they are many; maps are of the
    /// pixel's centre. They are averaged in linear light, those of Gaussians as the codes that
    /// their files are trained to [default: 4, of Gaussians 1]
    #[arg(long, value_name = "N", help_heading = "Surface")]
    samples: Option<Samples>,
    /// auto: surfels that face away from the eye are left out where the scene is a closed mesh seen from outside, as nobody
    /// sees them but past its outline; back: they are left out of any scene whose normals have a side; none: a pixel shows
    /// the side that is nearest
    #[arg(long, value_name = "auto|none|back", default_value = "auto", help_heading = "Surface")]
    cull: Cull,
    /// How sums are kept on the device: fixed, fixed32, fixed64, packed64, float or cas (see the README)
    #[arg(long, value_name = "NAME")]
    accumulator: Option<Accumulator>,
    /// How the device draws splats, to the same image: scatter (one by one), tile (by tiles of the image) or auto (large
    /// ones by tiles, and on software adapters all but tiny ones) [default: auto]
    #[arg(long, value_name = "HOW")]
    organisation: Option<Organisation>,
    /// What --backend raster blends into: rgba8unorm, rgba16float or rgba32float [default: rgba16float]
    #[arg(long, value_name = "FORMAT")]
    blend_format: Option<BlendFormat>,
    /// How --backend raster tests depth: exact (in the shader, as compute does) or offset (by the rasteriser) [default: exact]
    #[arg(long, value_name = "HOW")]
    raster_depth: Option<RasterDepth>,
    /// Shading of the blended colour [default: lambert; unlit with --facing, --blend nearest, and of Gaussians]
    #[arg(long, value_enum)]
    shading: Option<ShadingName>,
    /// What is lit: each pixel, at its blended normal, or each splat, at its centre, whose lit colours are blended
    #[arg(long, value_enum, value_name = "WHAT", default_value_t = ShadingAtName::Pixel)]
    shading_at: ShadingAtName,
    /// Exponent of the highlights of --shading phong, 1 to 1000: the higher, the smaller they are [default: 32]
    #[arg(long, value_name = "EXPONENT")]
    shininess: Option<f32>,
    /// An image to paint the surfels with, by their texture coordinates (`epsplat sample` writes
    /// them), in place of their own colours: .png, .jpg, .bmp or .tga. Given again it is the next
    /// input's, or that of the next number (texnumber) of an input's points
    #[arg(long = "texture", value_name = "IMAGE")]
    textures: Vec<PathBuf>,
    /// Draw a cut of levels of detail: nodes that are seen smaller than this in place of the surfels below them. Square pixels, 16px, or a part of
    /// the image, 0.01%; 0 draws all surfels. `epsplat lod` keeps the levels in a file, else they are made first; of COPC files, and of files of `epsplat lod` with 500,000 surfels or more, only what it takes is read
    #[arg(long, value_name = "SIZE", group = "cut")]
    lod: Option<Detail>,
    /// Draw a cut of no more surfels and nodes than this, and hardly fewer: --lod by a size that is found for each view. What reaches the
    /// camera's plane is always drawn by its surfels, and at the outline of a closed mesh nodes are
    /// divided at any size, which is told; of COPC files whole nodes are read, the root at least
    #[arg(long, value_name = "N", group = "cut")]
    splats: Option<NonZeroU64>,
    /// How nodes are measured: extent, by the balls around them and all below them, and as larger where these lie off their caps, or area, by their images, as in Pajarola 2003
    #[arg(long, value_enum, default_value_t = MeasureName::Extent, requires = "cut")]
    lod_measure: MeasureName,
    /// What nodes are: cap (curved as the surface is below them, or but for that of the rasteriser and of --lowpass ewa) or disk (in their planes)
    #[arg(long, value_enum, default_value_t = NodeShape::Cap, requires = "cut")]
    lod_shape: NodeShape,
    /// Whether coarser and finer cuts fade into each other from view to view, so that nothing pops [default: on with --cameras, else off; never of COPC files]
    #[arg(long, value_name = "on|off", value_parser = on_off_parser(), requires = "cut")]
    lod_fade: Option<bool>,
    /// The most memory that host and device may take together, 2GiB: of one file of `epsplat lod` what the picture takes is read, and it ends with an error where that is
    /// more than fits
    #[arg(long, value_name = "SIZE", value_parser = parse_memory, requires = "cut")]
    memory: Option<u64>,
    /// A light, instead of the headlight: headlight[:INTENSITY] or the direction toward it, x,y,z[:INTENSITY]
    #[arg(long = "light", value_name = "LIGHT", allow_hyphen_values = true)]
    lights: Vec<Light>,
    /// What lies behind the scene, linear [default: transparent]
    #[arg(long, value_name = "R,G,B[,A]", value_parser = parse_color)]
    background: Option<[f32; 4]>,
    /// Maps beside the colour, in an EXR; index names the input and the point that show most, transmittance is what all surfaces of a pixel
    /// let through and layers how many they are, tail what is behind --composite layers:L, surfaces depth and alpha of the nearest eight,
    /// decision is the reference's distance to the nearest yes-or-no
    #[arg(long, value_name = "MAPS", value_delimiter = ',', value_parser = map_parser())]
    aov: Vec<Map>,
    /// Times, counts and adapter as JSON, to a file or - for stdout
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

/// A backend, or none for the best that there is.
#[derive(Clone, Copy, PartialEq)]
struct Chosen(Option<BackendName>);

/// What nodes of levels of detail are drawn as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum NodeShape {
    Cap,
    Disk,
}

fn on_off_parser() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|name| name == "on")
}

fn backend_parser() -> impl TypedValueParser<Value = Chosen> {
    PossibleValuesParser::new(["auto", "gpu", "raster", "reference"]).map(|name| Chosen(name.parse().ok()))
}

fn map_parser() -> impl TypedValueParser<Value = Map> {
    PossibleValuesParser::new(MAPS.each_ref().map(|row| row.name)).try_map(|name| name.parse::<Map>())
}

#[derive(Clone, Copy, ValueEnum)]
enum LowPassName {
    /// A pixel's centre lies in a disk or not
    None,
    /// Every splat reaches a pixel, however small it is: gaps between splats stay
    Max,
    /// Convolved with the pixel: no aliasing either
    Ewa,
    /// As 2D Gaussian splatting does it: a Gaussian of a pixel beside that of the splat
    Gaussians,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum ShadingName {
    /// The colour as it is
    Unlit,
    /// Colour times the lights' cosines
    Lambert,
    /// Colour times the lights' cosines, and white highlights
    Phong,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum ShadingAtName {
    Pixel,
    Splat,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.cameras {
        Some(path) => views::run(arguments, path),
        None => one(arguments),
    }
}

impl Arguments {
    /// The files that are read, but those of `--cameras`.
    fn files(&self) -> impl Iterator<Item = Source<'_>> {
        let others = self.triangle_texture.iter().chain(&self.camera).chain(&self.textures);
        let meshes = self.triangles.iter().map(Source::cloud);
        self.reading.sources(&self.inputs).chain(meshes).chain(others.map(Source::other))
    }
}

/// A single picture.
fn one(arguments: &Arguments) -> Result<()> {
    let format = Format::of(&arguments.output)?;
    let options = options(arguments, format)?;
    outputs::check(arguments.files(), [&arguments.output].into_iter().chain(&arguments.json))?;
    let view = View::of(arguments)?;
    let backend = backend(arguments)?;

    let bars = Bars::new();
    let Staged { made: (scene, preparation), options, camera, seen, read } = staged(arguments, options, &view, &bars)?;
    let view = ToldView::new(&camera, &seen, &scene, preparation.guessed_up);
    note(&view.sentence());
    view.warning().iter().for_each(|warning| note(warning));
    read.iter().for_each(|read| note(&read.sentence()));
    let (frame, report) = render(&scene, &camera, &options, &backend, &bars)?;
    note_overflows(&report);
    note_cut([&report], arguments.splats);
    if is_empty(&frame, &options) {
        note(&Unseen::of(&scene, &camera, &options).sentence());
    }
    format.write(&arguments.output, &frame)?;
    match &arguments.json {
        Some(path) => write_json(path, &Outcome { report: &report, view, read }),
        None => {
            note(&summary(&report, &arguments.output));
            Ok(())
        }
    }
}

/// What a single picture leaves as JSON.
#[derive(Serialize)]
struct Outcome<'a> {
    #[serde(flatten)]
    report: &'a Report,
    view: ToldView,
    /// None where the inputs were not read in parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    read: Option<Read>,
}

/// All that a single picture is made of.
struct Staged {
    made: Made,
    options: RenderOptions,
    camera: Camera,
    seen: Seen,
    /// Of files that were read in parts.
    read: Option<Read>,
}

/// The scene of a single picture, for which files with levels of detail are read as far as it takes them.
fn staged(arguments: &Arguments, options: RenderOptions, view: &View, bars: &Bars) -> Result<Staged> {
    let told = |(_, preparation): &Made| preparation.notes().iter().for_each(|line| note(line));
    if let Some(mut parts) = Parts::of(arguments, &options, bars)? {
        let (camera, seen) = view.camera(parts.overview(), Camera::default_near(parts.overview()))?;
        let Part { made, options, read } = parts.scene(arguments, (&camera, 1), &options, bars)?;
        told(&made);
        return Ok(Staged { made, options, camera, seen, read: Some(read) });
    }
    let made = scene(arguments, bars)?;
    told(&made);
    let (scene, preparation) = made;
    let options = for_scene(arguments, options, &scene)?;
    let scene = levels::made(scene, &options, bars)?;
    let (camera, seen) = view.camera(&scene, Camera::default_near(&scene))?;
    Ok(Staged { made: (scene, preparation), options, camera, seen, read: None })
}

fn backend(arguments: &Arguments) -> Result<Backend> {
    if arguments.backend.0 == Some(BackendName::Reference) {
        if arguments.adapter.is_some() {
            return Err(Error::Usage("--backend reference uses no adapter: leave --adapter out".into()));
        }
        return Ok(Backend::Reference);
    }
    match Gpu::open(arguments.adapter.as_deref()) {
        Ok(gpu) => {
            note(&format!("rendering on {} ({}, {})", gpu.adapter.name, gpu.adapter.api, gpu.adapter.kind));
            let gpu = if arguments.memory.is_some() { gpu.with_buffer_limit(memory::BUFFER) } else { gpu };
            Ok(Backend::gpu(gpu))
        }
        Err(Error::NoAdapter(why)) if arguments.backend.0.is_none() && arguments.adapter.is_none() => {
            note(&format!("rendering with the f64 reference on the processor: {why}"));
            Ok(Backend::Reference)
        }
        Err(error) => Err(error),
    }
}
