//! Options and scenes that go together: one rule for the command line, for studies and for callers
//! of the library.

mod adapter;

pub use self::adapter::{on_adapter, sums};
use super::{Accumulator, BlendFormat, ColorNeed, Facts, Organisation, RasterDepth, Settings, composited};
use crate::error::{Error, Result};
use crate::passes::peel::MOST_LAYERS;
use crate::scene::composite::ALL_LAYERS;
use crate::scene::light::MAX_LIGHTS;
use crate::scene::{Blend, Composite, Cull, Join, KernelShape, LowPass, Map, Shading, Tail, options::SHININESS_RANGE};

fn usage(what: impl Into<String>) -> Result<()> {
    Err(Error::Usage(what.into()))
}

/// Fails for options that no adapter can combine. The `reference` ignores choices that only a
/// device has.
///
/// # Errors
/// [`Error::Usage`].
pub fn options(options: &Settings, reference: bool) -> Result<()> {
    let (least, most) = SHININESS_RANGE;
    if options.lights.len() > MAX_LIGHTS {
        return usage(format!("a render has at most {MAX_LIGHTS} lights, not {}", options.lights.len()));
    }
    if options.shading == Shading::Phong && !(least..=most).contains(&options.shininess) {
        return usage(format!("the shininess is {least} to {most}, not {}", options.shininess));
    }
    if options.facing.is_some() {
        facing(options)?;
    }
    if options.outline.is_some() {
        outline(options)?;
    }
    if options.blend == Blend::Nearest {
        nearest(options, reference)?;
    }
    if options.low_pass == LowPass::Gaussians && options.kernel.shape() != KernelShape::Gaussian {
        return usage("the low-pass gaussians stands beside a kernel gaussian: take that, or another low-pass");
    }
    if !(0.0..=1.0).contains(&options.opacity) {
        return usage(format!("the opacity is 0 to 1, not {}", options.opacity));
    }
    if options.composite != Composite::Opaque {
        composite(options, reference)?;
    }
    if !options.detail.is_finest() {
        levels(options)?;
    }
    let cut = matches!(options.composite, Composite::Layers(most) if most < ALL_LAYERS);
    if options.separate {
        separate(options, reference)?;
    }
    if options.maps.has(Map::Tail) && !(cut && options.tail == Tail::Sum) {
        return usage("a tail lies behind a last layer: take the map tail with --composite layers:L, and --tail sum");
    }
    if reference {
        return Ok(());
    }
    for map in options.maps.iter().map(Map::row) {
        if map.image_word.is_none() {
            return usage(format!("the {} map is made by the reference backend only", map.name));
        }
        if options.raster.is_some() && !map.raster {
            return usage(format!("the rasteriser makes no {} map: leave it out, or render by compute", map.name));
        }
    }
    match options.raster {
        Some(raster) if raster.format == BlendFormat::Rgba8Unorm && options.maps.has(Map::Count) => {
            usage("an 8-bit target cannot count fragments: leave count out, or take rgba16float")
        }
        _ => Ok(()),
    }
}

/// Fails for options that no tiles draw, where tiles are asked for: a study measures what it names.
///
/// # Errors
/// [`Error::Usage`].
pub fn by_tiles(options: &Settings) -> Result<()> {
    match options {
        _ if options.organisation != Organisation::Tile || options.raster.is_some() => Ok(()),
        _ if options.composite != Composite::Opaque => {
            usage("the organisation tile shows the nearest surface alone: leave it out with --composite")
        }
        _ if options.blend == Blend::Nearest => usage("the organisation tile sums: leave it out with --blend nearest"),
        _ if options.accumulator != Accumulator::Fixed => {
            usage("the organisation tile needs the accumulator fixed: leave one of them out")
        }
        _ => Ok(()),
    }
}

/// Nodes of levels of detail are disks, of all inputs together.
fn levels(options: &Settings) -> Result<()> {
    match options {
        _ if options.facing.is_some() => {
            usage("points that face the camera have a size each and no levels of detail: leave --lod and --splats out")
        }
        _ if options.separate => usage(
            "levels of detail are of all inputs together: leave --separate out, or --lod and --splats; or make a picture of each \
                 input with a depth map and keep the nearer pixel",
        ),
        _ if options.maps.has(Map::Index) => {
            usage("the map index names points, and nodes are none: leave the map out, or --lod and --splats")
        }
        _ if options.detail_fades => fades(options),
        _ => Ok(()),
    }
}

/// Fails for options with which cuts cannot fade into each other. Fades need weighted sums of the
/// nearest surface.
///
/// # Errors
/// [`Error::Usage`].
pub fn fades(options: &Settings) -> Result<()> {
    match options {
        _ if options.composite != Composite::Opaque => {
            usage("cuts fade into each other on the nearest surface alone: take --lod-fade off with --composite")
        }
        _ if options.blend == Blend::Nearest => {
            usage("--blend nearest sums nothing that could fade: take --lod-fade off with it")
        }
        _ if options.raster.is_some() => {
            usage("the rasteriser's depths are of one cut: take --lod-fade off, or render by compute")
        }
        _ => Ok(()),
    }
}

/// Points that face the camera have no normals, and no plane.
fn facing(options: &Settings) -> Result<()> {
    let normal = options.shading != Shading::Unlit || options.maps.has(Map::Normal);
    match options {
        _ if normal => usage("points that face the camera have no normals: take --shading unlit and no normal map"),
        _ if options.low_pass != LowPass::None => {
            usage("points that face the camera have no low-pass: each shows at its own pixel anyway")
        }
        Settings { raster: Some(raster), facing: Some(facing), .. }
            if facing.shape.rises() && raster.depth != RasterDepth::Exact =>
        {
            usage("the rasteriser tests the depths of flat points by itself, of others with raster-depth exact alone")
        }
        _ if options.cull == Cull::Back => usage("points that face the camera have no backs: leave --cull back out"),
        _ => Ok(()),
    }
}

/// Surfaces that show through are drawn from lists of fragments, or of sums of all.
fn composite(options: &Settings, reference: bool) -> Result<()> {
    match options {
        _ if options.blend == Blend::Nearest => {
            usage("--blend nearest shows one fragment, behind which nothing shows: leave --composite out")
        }
        _ if options.composite.is_order_free() => order_free(options, reference),
        _ if reference => Ok(()),
        Settings { raster: Some(raster), .. } => peeled(options, raster.depth),
        _ if options.accumulator != Accumulator::Fixed => {
            usage("surfaces are composited of sums of the accumulator fixed: leave the accumulator out")
        }
        _ => Ok(()),
    }
}

/// Fragments summed in any order are scattered, by weights that may be small.
fn order_free(options: &Settings, reference: bool) -> Result<()> {
    match options {
        _ if options.maps.has(Map::Layers) => {
            usage("of what is summed in any order no layers are told: leave the map layers out")
        }
        _ if reference => Ok(()),
        Settings { raster: Some(_), .. } => {
            usage("the rasteriser sums one surface: take --composite layers:L, or render by compute")
        }
        Settings { accumulator: Accumulator::Fixed32 | Accumulator::Packed64, .. } => usage(
            "far fragments weigh too little for sums of 32 bits: take the accumulator fixed, fixed64, float or cas",
        ),
        _ => Ok(()),
    }
}

/// The rasteriser draws layers one after the other.
fn peeled(options: &Settings, depth: RasterDepth) -> Result<()> {
    match options.composite {
        Composite::Layers(1..=MOST_LAYERS) if options.tail == Tail::None && depth == RasterDepth::Exact => Ok(()),
        Composite::Layers(1..=MOST_LAYERS) => usage(
            "the rasteriser peels layers with exact depths, and what lies behind the last one is left out: take --tail none and \
             --raster-depth exact",
        ),
        Composite::Layers(_) => usage(format!(
            "the rasteriser peels 1 to {MOST_LAYERS} layers, one after the other: take --composite layers:L with so many, or render by compute"
        )),
        _ => usage("the rasteriser sorts no fragments: take --composite layers:L, or render by compute"),
    }
}

/// A polygon is part of a disk.
fn outline(options: &Settings) -> Result<()> {
    match options.facing {
        Some(_) => usage("points that face the camera have shapes of their own: leave --outline out"),
        None if options.low_pass != LowPass::None => {
            usage("a low-pass shows splats past their outlines: leave it out with --outline")
        }
        None => Ok(()),
    }
}

/// The nearest fragment alone has a colour and a depth.
fn nearest(options: &Settings, reference: bool) -> Result<()> {
    // The reference's only fragment has weight 1 and count 1.
    let others = if reference { &[Map::Normal][..] } else { &[Map::Normal, Map::Weight, Map::Count, Map::Index] };
    let map = others.iter().map(|map| map.row()).find(|row| options.maps.has(row.map));
    let exact = options.raster.is_none_or(|raster| raster.depth == RasterDepth::Exact);
    match (options.shading, map) {
        (Shading::Lambert | Shading::Phong, _) => usage(
            "of the nearest fragment alone the colour is kept and no normal: take --shading unlit with --blend nearest",
        ),
        (_, Some(row)) => usage(format!("--blend nearest keeps colour and depth: leave the {} map out", row.name)),
        _ if options.low_pass != LowPass::None => usage("a low-pass blends: leave it out with --blend nearest"),
        _ if reference => Ok(()),
        _ if options.accumulator != Accumulator::Fixed => {
            usage("--blend nearest sums nothing: leave the accumulator out")
        }
        _ if options.maps.has(Map::Depth) && !exact => {
            usage("the rasteriser tells depths with raster-depth exact alone: take that, or leave the depth map out")
        }
        _ => Ok(()),
    }
}

/// Fails for options that cannot be combined with a texture. The `reference` ignores choices that
/// only a device has.
///
/// # Errors
/// [`Error::Usage`].
pub fn textured(options: &Settings, reference: bool) -> Result<()> {
    if options.composite != Composite::Opaque {
        return usage("textures are drawn on the nearest surface alone: leave --composite out");
    }
    if options.lights_splats() {
        return usage(
            "a texture has many colours in a splat, which are lit pixel by pixel: leave --shading-at splat out",
        );
    }
    if options.raster.is_some() && !reference {
        return usage("the rasteriser blends no texture coordinates: leave the texture out, or render by compute");
    }
    Ok(())
}

/// Fails for options that do not go with the scene that `facts` are of.
///
/// # Errors
/// [`Error::Usage`].
pub fn scene(facts: &Facts, options: &Settings, reference: bool) -> Result<()> {
    if u32::try_from(facts.surfels).is_err() {
        return usage(format!("a scene has at most 2^32 - 1 surfels, not {}", facts.surfels));
    }
    if options.cull == Cull::Back && !facts.oriented {
        return usage(
            "only surfels whose normals have a side face away, and not all of these do: leave --cull back out, or give \
             normals a side with epsplat surfels",
        );
    }
    if !options.detail.is_finest() && facts.levels.is_none() {
        return usage(
            "the scene has no levels of detail to take: leave --lod and --splats out, or make some with epsplat lod",
        );
    }
    if facts.fades && facts.nodes_of(options).is_none() {
        fades(options)?;
    }
    // A scene may say how it is composited, so that this is asked where both are known.
    let told_apart = options.composite != Composite::Opaque && !options.composite.is_order_free();
    if options.maps.has(Map::Surfaces) && !told_apart {
        return usage(
            "the map surfaces is of surfaces that are told apart: take --composite layers, sorted or gaussians with it",
        );
    }
    if facts.mesh.triangles > 0 && facts.encoded && options.composite != Composite::Opaque {
        return usage(
            "Gaussians show through each other, and triangles are drawn on the nearest surface alone: take --composite opaque, or \
             leave the triangles out",
        );
    }
    if facts.mesh.triangles > 0 {
        triangles(options, reference)?;
    }
    if options.separate && facts.encoded && options.composite != Composite::Opaque {
        return usage(
            "Gaussians show through each other, and inputs are kept apart on the nearest surface alone: take --composite opaque, or \
             leave --separate out",
        );
    }
    if facts.encoded && options.shading != Shading::Unlit {
        return usage("Gaussians have the colours that pictures of them show, light and all: take --shading unlit");
    }
    if options.facing.is_some() && facts.colors == ColorNeed::Textured {
        return usage("points that face the camera have no plane to paint: leave the texture out");
    }
    match facts.colors {
        ColorNeed::Textured | ColorNeed::Harmonics(_) if options.blend == Blend::Nearest => {
            return usage(
                "--blend nearest keeps one colour a surfel, and these have more: take --epsilon abs:0 --kernel constant, which \
                 averages what lies at one depth",
            );
        }
        _ => {}
    }
    if facts.colors == ColorNeed::Textured {
        // Opaque surfaces are drawn as if nothing was composited.
        return textured(&Settings { composite: composited(facts, options), ..options.clone() }, reference);
    }
    match options.maps.has(Map::TexZ) {
        true => usage(
            "the map texz holds texture coordinates of painted surfels, on the nearest surface alone: paint them by --texture and \
                 leave --composite out, or leave the map out",
        ),
        false => Ok(()),
    }
}

/// Inputs are kept apart by what each blends to.
fn separate(options: &Settings, reference: bool) -> Result<()> {
    match options {
        _ if options.blend == Blend::Nearest => {
            usage("--blend nearest blends nothing, and so keeps all inputs apart: leave --separate out")
        }
        _ if options.composite != Composite::Opaque => {
            usage("inputs are kept apart on the nearest surface alone: leave --composite or --separate out")
        }
        _ if options.maps.has(Map::Index) => {
            usage("the map index names the strongest point of all inputs: leave it out, or --separate")
        }
        _ if reference => Ok(()),
        Settings { raster: Some(_), .. } => {
            usage("the rasteriser blends all splats: leave --separate out, or render by compute")
        }
        _ => Ok(()),
    }
}

/// Fails for options that triangles do not go with.
fn triangles(options: &Settings, reference: bool) -> Result<()> {
    match options {
        _ if options.composite != Composite::Opaque => {
            usage("triangles are drawn on the nearest surface alone: leave --composite out, or the triangles")
        }
        _ if options.join == Join::Blended && options.blend == Blend::Nearest => {
            usage("--blend nearest has no tolerance within which triangles blend: take another --join")
        }
        _ if options.maps.has(Map::Index) => usage("triangles have no points to name: leave the map index out"),
        _ if reference => Ok(()),
        Settings { raster: Some(raster), .. }
            if raster.depth != RasterDepth::Exact || options.blend == Blend::Nearest =>
        {
            usage(
                "the rasteriser draws triangles beside splats that are blended by exact depths: leave --raster-depth and --blend \
                 out, or the triangles",
            )
        }
        _ => Ok(()),
    }
}
