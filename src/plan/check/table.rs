//! The rows of rejected combinations, each with what to do instead.

use super::{Clash, LensClash, SceneClash};
use crate::plan::{Accumulator, BlendFormat, ColorNeed, Facts, Organisation, RasterDepth, Settings};
use crate::scene::composite::ALL_LAYERS;
use crate::scene::{Blend, Composite, Cull, Form, Join, KernelShape, LowPass, Map, Shading, Tail};

/// The largest number of layers that the rasteriser peels.
const MOST_PEELED: u32 = 64;

fn is_lit(options: &Settings) -> bool {
    options.shading != Shading::Unlit
}

fn is_composited(options: &Settings) -> bool {
    options.composite != Composite::Opaque
}

/// Whether nearest fragments are found by exact depths: always, except with the rasteriser's own
/// depth test.
fn has_exact_depths(options: &Settings) -> bool {
    options.raster.is_none_or(|raster| raster.depth == RasterDepth::Exact)
}

/// Whether the rasteriser draws surfaces behind the nearest one.
fn peels(options: &Settings, device: bool) -> bool {
    device && options.raster.is_some() && is_composited(options) && !options.composite.is_order_free()
}

fn has_tail(options: &Settings) -> bool {
    let last = matches!(options.composite, Composite::Layers(most) if most < ALL_LAYERS);
    last && options.tail == Tail::Sum
}

/// Whether the scene has triangles.
fn has_triangles(facts: &Facts) -> bool {
    facts.mesh.triangles > 0
}

/// Combinations of options that are rejected for every scene.
pub(super) const OPTIONS: [Clash; 30] = [
    Clash {
        applies: |options, _| options.facing.is_some() && (is_lit(options) || options.maps.has(Map::Normal)),
        sentence: "points that face the camera have no normals: take --shading unlit and no normal map",
    },
    Clash {
        applies: |options, _| options.facing.is_some() && options.low_pass != LowPass::None,
        sentence: "points that face the camera have no low-pass, as each shows at its own pixel: leave --lowpass out",
    },
    Clash {
        applies: |options, _| options.facing.is_some_and(|facing| facing.shape.rises()) && !has_exact_depths(options),
        sentence: "the rasteriser's own depth test knows flat points only: take --raster-depth exact for other shapes",
    },
    Clash {
        applies: |options, _| options.facing.is_some() && options.cull == Cull::Back,
        sentence: "points that face the camera have no backs: leave --cull back out",
    },
    Clash {
        applies: |options, _| options.cull == Cull::Cones && options.detail.is_finest(),
        sentence: "cones of normals are those of levels of detail: take --lod or --splats with --cull cones",
    },
    Clash {
        applies: |options, _| options.facing.is_some() && options.outline.is_some(),
        sentence: "points that face the camera have shapes of their own: leave --outline out",
    },
    Clash {
        applies: |options, _| options.facing.is_some() && !options.detail.is_finest(),
        sentence: "points that face the camera have no levels of detail: leave --lod and --splats out",
    },
    Clash {
        applies: |options, _| options.outline.is_some() && options.low_pass != LowPass::None,
        sentence: "a low-pass shows splats past their outlines: leave it out with --outline",
    },
    Clash {
        applies: |options, _| options.blend == Blend::Nearest && is_lit(options),
        sentence: "--blend nearest keeps a colour and no normal: take --shading unlit with it",
    },
    Clash {
        applies: |options, _| options.blend == Blend::Nearest && options.low_pass != LowPass::None,
        sentence: "a low-pass blends: leave it out with --blend nearest",
    },
    Clash {
        applies: |options, device| {
            device && options.blend == Blend::Nearest && options.accumulator != Accumulator::Fixed
        },
        sentence: "--blend nearest sums nothing: leave the accumulator out",
    },
    Clash {
        applies: |options, device| {
            let depth = options.maps.has(Map::Depth) && !has_exact_depths(options);
            device && options.blend == Blend::Nearest && depth
        },
        sentence: "the rasteriser reports nearest depths with --raster-depth exact only: take it, or leave the depth map out",
    },
    Clash {
        applies: |options, _| options.blend == Blend::Nearest && is_composited(options),
        sentence: "--blend nearest shows one fragment and nothing behind it: leave --composite out",
    },
    Clash {
        applies: |options, _| options.blend == Blend::Nearest && options.separate,
        sentence: "--blend nearest blends nothing, and so keeps all inputs separate: leave --separate out",
    },
    Clash {
        applies: |options, _| options.low_pass == LowPass::Gaussians && options.kernel.shape() != KernelShape::Gaussian,
        sentence: "the low-pass gaussians needs a Gaussian kernel: take --kernel gaussian, or another --lowpass",
    },
    Clash {
        applies: |options, _| options.composite.is_order_free() && options.maps.has(Map::Layers),
        sentence: "--composite weighted and moments sum all fragments and find no layers: leave the map layers out",
    },
    Clash {
        applies: |options, device| device && options.composite.is_order_free() && options.raster.is_some(),
        sentence: "the rasteriser sums one surface: take --composite layers:L, or --backend gpu",
    },
    Clash {
        applies: |options, device| {
            let few_digits = matches!(options.accumulator, Accumulator::Fixed32 | Accumulator::Packed64);
            device && options.composite.is_order_free() && few_digits
        },
        sentence: "far fragments weigh too little for sums of 32 bits: take --accumulator fixed, fixed64, float or cas",
    },
    Clash {
        applies: |options, device| peels(options, device) && !matches!(options.composite, Composite::Layers(_)),
        sentence: "the rasteriser sorts no fragments: take --composite layers:L, or --backend gpu",
    },
    Clash {
        applies: |options, device| {
            let few = matches!(options.composite, Composite::Layers(1..=MOST_PEELED));
            peels(options, device) && !few
        },
        sentence: "the rasteriser peels 1 to 64 layers, one after the other: take --composite layers:L with so many, or \
                   --backend gpu",
    },
    Clash {
        applies: |options, device| peels(options, device) && (options.tail != Tail::None || !has_exact_depths(options)),
        sentence: "the rasteriser peels layers by exact depths and draws nothing behind the last one: take --tail none and \
                   --raster-depth exact",
    },
    Clash {
        applies: |options, device| {
            let by_lists = is_composited(options) && !options.composite.is_order_free() && options.raster.is_none();
            device && by_lists && options.accumulator != Accumulator::Fixed
        },
        sentence: "lists of fragments have sums of the accumulator fixed: leave --accumulator out with --composite",
    },
    Clash {
        applies: |options, _| options.separate && !options.detail.is_finest(),
        sentence: "levels of detail blend all inputs: leave --separate out, or --lod and --splats; or make a picture of each \
                   input with a depth map and keep the nearer pixel",
    },
    Clash {
        applies: |options, _| options.maps.has(Map::Index) && !options.detail.is_finest(),
        sentence: "the map index names points, and nodes are none: leave the map out, or --lod and --splats",
    },
    Clash {
        applies: |options, _| options.separate && is_composited(options),
        sentence: "--separate keeps the nearest surface only: leave --composite or --separate out",
    },
    Clash {
        applies: |options, _| options.separate && options.maps.has(Map::Index),
        sentence: "the map index names the strongest point of all inputs: leave it out, or --separate",
    },
    Clash {
        applies: |options, device| device && options.separate && options.raster.is_some(),
        sentence: "the rasteriser blends all splats: leave --separate out, or take --backend gpu",
    },
    Clash {
        applies: |options, _| options.maps.has(Map::Tail) && !has_tail(options),
        sentence: "a tail lies behind a last layer: take the map tail with --composite layers:L, and --tail sum",
    },
    Clash {
        applies: |options, device| {
            let eight_bits = options.raster.is_some_and(|raster| raster.format == BlendFormat::Rgba8Unorm);
            device && eight_bits && options.maps.has(Map::Count)
        },
        sentence: "an 8-bit target cannot count fragments: leave the count map out, or take --blend-format rgba16float",
    },
    Clash {
        applies: |options, device| device && options.fetch.is_some() && !may_draw_tiles(options),
        sentence: "tiles fetch splats for the accumulator fixed, on the nearest surface only: leave --fetch out with \
                   --organisation scatter, another --accumulator, --composite, --blend nearest or --backend raster",
    },
];

/// Whether tiles may draw splats.
fn may_draw_tiles(options: &Settings) -> bool {
    let sums = options.blend != Blend::Nearest && !is_composited(options) && options.raster.is_none();
    sums && options.accumulator == Accumulator::Fixed && options.organisation != Organisation::Scatter
}

/// Options that tiles cannot draw.
pub(super) const TILES: [Clash; 3] = [
    Clash {
        applies: |options, _| tiles_asked(options) && is_composited(options),
        sentence: "the organisation tile draws the nearest surface only: leave it out with --composite",
    },
    Clash {
        applies: |options, _| tiles_asked(options) && options.blend == Blend::Nearest,
        sentence: "the organisation tile sums: leave it out with --blend nearest",
    },
    Clash {
        applies: |options, _| tiles_asked(options) && options.accumulator != Accumulator::Fixed,
        sentence: "the organisation tile needs the accumulator fixed: leave one of them out",
    },
];

fn tiles_asked(options: &Settings) -> bool {
    options.organisation == Organisation::Tile && options.raster.is_none()
}

/// Options with which cuts cannot fade into each other.
pub(super) const FADES: [Clash; 3] = [
    Clash {
        applies: |options, _| is_composited(options),
        sentence: "cuts fade into each other on the nearest surface only: take --lod-fade off with --composite",
    },
    Clash {
        applies: |options, _| options.blend == Blend::Nearest,
        sentence: "--blend nearest sums nothing that could fade: take --lod-fade off with it",
    },
    Clash {
        applies: |options, _| options.raster.is_some(),
        sentence: "the rasteriser draws one cut: take --lod-fade off, or --backend gpu",
    },
];

/// Options that cannot be combined with a texture.
pub(super) const TEXTURES: [Clash; 3] = [
    Clash {
        applies: |options, _| is_composited(options),
        sentence: "textures are drawn on the nearest surface only: leave --composite out",
    },
    Clash {
        applies: |options, _| options.lights_splats(),
        sentence: "a texture has many colours in a splat, so its pixels are lit: leave --shading-at splat out",
    },
    Clash {
        applies: |options, device| device && options.raster.is_some(),
        sentence: "the rasteriser blends no texture coordinates: leave the texture out, or take --backend gpu",
    },
];

/// Combinations of scenes and options that are rejected.
pub(super) const SCENES: [SceneClash; 20] = [
    SceneClash {
        applies: |facts, options, device| facts.solid && device && options.raster.is_some(),
        sentence: "the rasteriser sorts no 3D Gaussians: take --backend gpu, or --flatten to make surfels of them",
    },
    SceneClash {
        applies: |facts, options, _| facts.solid && !options.detail.is_finest(),
        sentence: "3D Gaussians have no levels of detail: leave --lod and --splats out, or take --flatten and epsplat lod",
    },
    SceneClash {
        applies: |facts, options, _| {
            facts.solid && !matches!(options.composite, Composite::Gaussians | Composite::Sorted)
        },
        sentence: "3D Gaussians have no surface: leave --composite, --blend and --separate out, or take --flatten to make \
                   surfels of them",
    },
    SceneClash {
        applies: |facts, options, _| facts.solid && options.kernel.shape() != KernelShape::Gaussian,
        sentence: "3D Gaussians have a kernel of their own: leave --kernel out, or take --flatten to make surfels of them",
    },
    SceneClash {
        applies: |facts, options, _| {
            let known = matches!(options.low_pass, LowPass::None | LowPass::Gaussians);
            facts.solid && (!known || options.outline.is_some())
        },
        sentence: "3D Gaussians have no rims: leave --outline out and take --lowpass gaussians or none, or take --flatten to \
                   make surfels of them",
    },
    SceneClash {
        applies: |facts, options, _| facts.solid && options.facing.is_some(),
        sentence: "3D Gaussians have sizes of their own: leave --facing out, or take --flatten to make surfels of them",
    },
    SceneClash {
        applies: |facts, options, _| facts.solid && options.maps.has(Map::Normal),
        sentence: "3D Gaussians have no normals: leave the map normal out, or take --flatten to make surfels of them",
    },
    SceneClash {
        applies: |facts, options, _| {
            matches!(options.cull, Cull::Back | Cull::Cones) && !facts.oriented && facts.surfels > 0
        },
        sentence: "only surfels whose normals have a side face away, and not all of these do: leave --cull out, or give \
                   normals a side with epsplat surfels",
    },
    SceneClash {
        applies: |facts, options, _| !options.detail.is_finest() && facts.levels.is_none(),
        sentence: "the scene has no levels of detail: leave --lod and --splats out, or make some with epsplat lod",
    },
    SceneClash {
        // The default composite depends on the scene, so this is checked when the scene is known.
        applies: |_, options, _| {
            options.maps.has(Map::Surfaces) && (!is_composited(options) || options.composite.is_order_free())
        },
        sentence: "the map surfaces counts surfaces behind each other: take --composite layers, sorted or gaussians with it",
    },
    SceneClash {
        applies: |facts, options, _| has_triangles(facts) && options.composite.is_order_free(),
        sentence: "order-free sums cannot leave out what lies behind a triangle: take --composite layers or sorted, or leave \
                   the triangles out",
    },
    SceneClash {
        applies: |facts, options, device| has_triangles(facts) && peels(options, device),
        sentence: "the rasteriser peels splats and no triangles: take --backend gpu, or leave the triangles out",
    },
    SceneClash {
        applies: |facts, options, _| {
            has_triangles(facts) && options.join == Join::Blended && options.blend == Blend::Nearest
        },
        sentence: "--blend nearest has no tolerance within which triangles blend: take another --join",
    },
    SceneClash {
        applies: |facts, options, device| {
            device && has_triangles(facts) && options.maps.has(Map::Index) && options.raster.is_some()
        },
        sentence: "the rasteriser names no triangles: leave the map index out, or take --backend gpu",
    },
    SceneClash {
        applies: |facts, options, device| {
            device && has_triangles(facts) && options.raster.is_some() && options.cull == Cull::Back
        },
        sentence: "the rasteriser draws both sides of triangles: leave --cull back out, or take --backend gpu",
    },
    SceneClash {
        applies: |facts, options, device| {
            let unable = !has_exact_depths(options) || options.blend == Blend::Nearest;
            device && has_triangles(facts) && options.raster.is_some() && unable
        },
        sentence: "the rasteriser draws triangles beside splats that are blended by exact depths: leave --raster-depth and \
                   --blend out, or the triangles",
    },
    SceneClash {
        applies: |facts, options, _| facts.encoded && is_lit(options),
        sentence: "Gaussians have the colours that pictures of them show, light included: take --shading unlit",
    },
    SceneClash {
        applies: |facts, options, _| options.facing.is_some() && facts.colors == ColorNeed::Textured,
        sentence: "points that face the camera have no plane to paint: leave the texture out",
    },
    SceneClash {
        applies: |facts, options, _| {
            let several = matches!(facts.colors, ColorNeed::Textured | ColorNeed::Harmonics(_));
            several && options.blend == Blend::Nearest
        },
        sentence: "--blend nearest keeps one colour a surfel, and these have more: take --epsilon abs:0 --kernel constant, \
                   which averages what lies at one depth",
    },
    SceneClash {
        applies: |facts, options, _| facts.colors != ColorNeed::Textured && options.maps.has(Map::TexZ),
        sentence: "the map texz holds texture coordinates of painted surfels, on the nearest surface only: paint them by \
                   --texture and leave --composite out, or leave the map out",
    },
];

/// Combinations that a camera does not show if its lens is no pinhole.
pub(super) const LENSES: [LensClash; 5] = [
    LensClash {
        applies: |_, facts, _, _| facts.solid,
        sentence: "3D Gaussians are drawn by pinholes: take --flatten with a lens",
    },
    LensClash {
        applies: |_, _, options, device| device && options.raster.is_some(),
        sentence: "the rasteriser draws by pinholes: take --backend gpu with a lens",
    },
    LensClash {
        applies: |_, facts, options, _| facts.nodes_of(options).is_some(),
        sentence: "levels of detail are chosen by pinholes: leave --lod and --splats out with a lens",
    },
    LensClash {
        applies: |_, _, options, _| options.facing.is_some(),
        sentence: "points that face the camera are drawn by pinholes: leave --facing out with a lens",
    },
    LensClash {
        applies: |form, facts, _, _| form == Form::Equirectangular && has_triangles(facts),
        sentence: "triangles across the border of an equirectangular image are not drawn: take --mesh surfels",
    },
];
