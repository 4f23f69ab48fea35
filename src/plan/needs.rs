//! The needs of a scene and its options, computed once: the only variant key of the kernels.

use super::{
    Accumulator, ColorNeed, Facts, Lists, MeshNeeds, Oit, Optimisation, RasterDepth, Settings, Splats, Surface, Winner,
    composited, in_view, tuning,
};
use crate::gpu::adapter::AdapterDescription;
use crate::scene::{
    Blend, Camera, Composite, Cull, Epsilon, Form, Join, KernelShape, LowPass, Map, Maps, PointShape, Projection,
    Samples, Shading,
};

/// The needs of a render. They select the WGSL files that are joined, and with them the bindings,
/// buffers and sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SceneNeeds {
    /// How the fragments of a pixel become its colour.
    pub surface: Surface,
    /// The camera model.
    pub projection: Projection,
    /// The form of a lens that is no pinhole.
    pub lens: Option<Form>,
    /// The format of sums on the device.
    pub accumulator: Accumulator,
    /// The accumulator is `fixed` and terms may be small. Either alphas differ, so that means may
    /// be divided by a small mean alpha. Or a fragment's weight may be less than [`SMALL_WEIGHT`],
    /// for example far away in an order-free composite. Terms then have the fraction bits of
    /// [`wide_bits`](super::wide_bits).
    pub wide_sums: bool,
    /// The accumulator is `fixed` and the adapter has 64-bit atomics, which make the same sums in
    /// half the additions.
    pub atomics_u64: bool,
    /// The fragments of a workgroup's splats are spread over its invocations and summed in its
    /// memory first, on graphics cards (`wgsl/accumulate/accumulate_spread.wgsl`).
    pub spreads: bool,
    /// Records are read and written 64 bits at a time, on adapters with 64-bit integers: the same
    /// bits in half the accesses.
    pub long_words: bool,
    /// The f32 centres of surfels omit visible digits, so their low parts are stored too.
    pub doubled: bool,
    /// A cut of levels of detail is drawn.
    pub levels: bool,
    /// Octree nodes in the cut are drawn with curvature (caps).
    pub node_caps: bool,
    /// Cuts fade into each other, so a surfel may belong to only some of them.
    pub fades: bool,
    /// Batches of surfels that are out of view or hidden are culled. This requires many surfels for
    /// the number of pixels, because the search for hidden batches visits every pixel
    /// ([`tuning::PIXELS_A_CULLED_SURFEL`], [`tuning::PIXELS_A_CULLED_CHOICE`]).
    pub cull: bool,
    /// The invocation that projects a small splat also draws its nearest depths. This requires that
    /// every band is drawn from a projection of its own.
    pub draws_projected: bool,
    /// The needs of the triangles drawn with the splats.
    pub mesh: Option<MeshNeeds>,
    /// The formula of the blending kernel.
    pub kernel: KernelShape,
    /// The filter for small splats.
    pub low_pass: LowPass,
    /// The quantity that epsilon depends on.
    pub epsilon: EpsilonForm,
    /// The source of colours.
    pub color: ColorNeed,
    /// Surfels differ in alpha.
    pub alpha: bool,
    /// Normals are accumulated: pixels are lit, or a normal map is written.
    pub normal: bool,
    /// The visible sides of surfels with oriented normals.
    pub sides: Sides,
    /// Surfels have normals other than those of their disks' planes, and these normals are summed.
    pub own_normals: bool,
    /// Surfels that face away are culled.
    pub cull_back: bool,
    /// Disks are clipped by lines in their planes or by a polygon's sides.
    pub clips: bool,
    /// Polygons are drawn instead of disks.
    pub outline: bool,
    /// Disks are curved; neither the rasteriser nor the ellipse of `ewa` supports that.
    pub curved: bool,
    /// Surfels are 3D Gaussians, drawn as their images.
    pub solid: bool,
    /// Surfels are drawn as points of this shape that face the camera.
    pub facing: Option<PointShape>,
    /// Samples per pixel. The pixels of kernels are samples, except those of the resolved image.
    pub samples: Samples,
    /// The shading of pixels or splats.
    pub shading: Shading,
    /// Splats are lit, not pixels.
    pub lit_splats: bool,
    /// The maps to write. Some need further sums: depth sums depths, count counts fragments.
    pub maps: Maps,
}

/// The quantity that epsilon depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EpsilonForm {
    /// The nearest depth, or nothing.
    Depth,
    /// The surfel's radius.
    Radius,
    /// The slope of the pixel's ray.
    Ray,
    /// There is no epsilon: fragments of every depth are accepted.
    All,
}

impl EpsilonForm {
    fn of(epsilon: Epsilon, camera: &Camera) -> Self {
        match epsilon {
            Epsilon::Radius(_) | Epsilon::Bounded { .. } => Self::Radius,
            Epsilon::Ray(_) if camera.projection == Projection::Pinhole => Self::Ray,
            Epsilon::Ray(_) | Epsilon::Relative(_) | Epsilon::Absolute(_) => Self::Depth,
        }
    }
}

/// Returns the needs of the scene's triangles, or `None` if the view shows none. Without splats, or
/// with fragment lists, the join is [`Join::Nearest`], which needs no sums of depths.
fn mesh(facts: &Facts, camera: &Camera, options: &Settings) -> Option<MeshNeeds> {
    let of = facts.mesh;
    let shows = of.triangles > 0 && in_view(&of.bounds, facts.origin, camera);
    let blends = facts.surfels > 0 && Lists::of(facts, options).is_none();
    let join = if blends { options.join } else { Join::Nearest };
    shows.then_some(MeshNeeds {
        join,
        normals: of.normals,
        colored: of.colored,
        textured: of.textured,
        cut: of.cut,
        doubled: of.doubled,
        cull_back: options.cull == Cull::Back,
        once: false,
        coded: facts.encoded,
    })
}

/// Terms of at least this weight keep 23 of the 32 fraction bits of `fixed`, like f32. If cuts fade
/// into each other, a term may be multiplied by 1/64 and then keeps 17.
pub const SMALL_WEIGHT: f64 = 1.0 / 512.0;

fn may_be_small(options: &Settings) -> bool {
    // A user-written kernel may have small weights anywhere.
    if options.own_kernel.is_some() {
        return true;
    }
    // The corners of squares lie at sqrt(2) radii. The convolution of `ewa` with the pixel lowers
    // the weight of splats smaller than a pixel.
    let square = options.facing.is_some_and(|facing| facing.shape == PointShape::Square);
    let farthest = if square { 2.0 } else { 1.0 };
    options.weight(farthest) < SMALL_WEIGHT || options.low_pass == LowPass::Ewa
}

/// Whether surfels that face away are culled.
pub fn culls_back(facts: &Facts, camera: &Camera, options: &Settings) -> bool {
    match options.cull {
        _ if options.facing.is_some() || facts.solid => false,
        Cull::None | Cull::Cones => false,
        Cull::Back => facts.oriented,
        // Back faces show through the surfaces in front of them.
        Cull::Auto if composited(facts, options) != Composite::Opaque => false,
        Cull::Auto => {
            let relative = camera.eye - facts.origin;
            let reach = f64::from(facts.largest_radius);
            let outside = relative.cmplt(facts.bounds.min - reach) | relative.cmpgt(facts.bounds.max + reach);
            facts.closed && (outside.any() || camera.projection == Projection::Orthographic)
        }
    }
}

/// The visible sides of surfels with oriented normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sides {
    /// No normals are oriented, or all drawn surfels face the viewer.
    None,
    /// A pixel shows the side of its nearest fragment only. At outlines and in thin parts the back
    /// lies within epsilon of the front.
    Nearest,
    /// Both sides, with normals blended as given, because the nearest fragment is not known: with
    /// the rasteriser's own depth test, and in order-free composites.
    Both,
}

impl Sides {
    /// Returns which sides of surfels a picture can show.
    pub fn of(facts: &Facts, camera: &Camera, options: &Settings) -> Self {
        let tells_nearest = options.raster.is_none_or(|raster| raster.depth == RasterDepth::Exact);
        let both = options.facing.is_none() && !facts.solid && !culls_back(facts, camera, options);
        let of_one_surface = tells_nearest && Oit::of(options).is_none();
        match facts.oriented && both && options.blend == Blend::Weighted {
            true if of_one_surface => Self::Nearest,
            true => Self::Both,
            false => Self::None,
        }
    }
}

impl SceneNeeds {
    /// Returns the needs of a picture of the scene that `facts` describe, for any renderer.
    pub fn of_picture(facts: &Facts, camera: &Camera, options: &Settings) -> Self {
        let surface = Surface::of_picture(facts, options);
        let (low, high) = facts.color;
        let lit = options.shading != Shading::Unlit;
        let blends = !surface.shows_nearest();
        let fixed = options.accumulator == Accumulator::Fixed && surface.raster().is_none() && blends;
        let order_free = surface.oit().is_some();
        let node_caps = options.draws_node_caps() && facts.nodes_of(options).is_some_and(|nodes| nodes.caps);
        Self {
            surface,
            projection: camera.projection,
            lens: camera.optics.map(|optics| optics.form),
            accumulator: options.accumulator,
            wide_sums: fixed && (low[3] != high[3] || may_be_small(options) || order_free),
            atomics_u64: false,
            spreads: false,
            long_words: false,
            doubled: facts.doubled,
            levels: facts.nodes_of(options).is_some(),
            node_caps,
            fades: if facts.nodes_of(options).is_some() { options.detail_fades } else { facts.fades },
            cull: false,
            draws_projected: false,
            mesh: mesh(facts, camera, options),
            kernel: if blends { options.kernel.shape() } else { KernelShape::Constant },
            // 3D Gaussians are convolved with the pixel when they are projected.
            low_pass: if facts.solid { LowPass::None } else { options.low_pass },
            epsilon: match blends {
                _ if order_free => EpsilonForm::All,
                true => EpsilonForm::of(options.epsilon, camera),
                false => EpsilonForm::Depth,
            },
            // Lit splats differ in colour even if all surfels have one colour.
            color: match facts.colors {
                ColorNeed::Constant if options.lights_splats() => ColorNeed::Linear,
                // Without blending each colour is one word.
                ColorNeed::Linear if !blends => ColorNeed::Srgb8,
                colors => colors,
            },
            alpha: low[3] != high[3],
            normal: (lit && !options.lights_splats()) || options.maps.has(Map::Normal),
            sides: Sides::of(facts, camera, options),
            own_normals: facts.own_normals && !facts.solid && (lit || options.maps.has(Map::Normal)),
            cull_back: culls_back(facts, camera, options),
            clips: (facts.clips || options.outline.is_some()) && options.facing.is_none() && !facts.solid,
            outline: options.outline.is_some(),
            curved: node_caps || (facts.caps && options.draws_caps() && !facts.solid),
            solid: facts.solid,
            facing: options.facing.map(|facing| facing.shape),
            samples: options.samples,
            shading: options.shading,
            lit_splats: options.lights_splats(),
            maps: options.maps,
        }
    }

    /// Returns the needs of a render on `adapter`, before the image is cut into bands.
    pub fn of(facts: &Facts, adapter: &AdapterDescription, camera: &Camera, options: &Settings) -> Self {
        let picture = Self::of_picture(facts, camera, options);
        let long_atomics = adapter.atomics_u64 && options.has(Optimisation::Pairs);
        let surface = match picture.surface {
            Surface::Nearest(_) if picture.color == ColorNeed::Constant => Surface::Nearest(Winner::Depth),
            Surface::Nearest(_) if long_atomics => Surface::Nearest(Winner::Once),
            Surface::Blended { separate: false, .. } if picture.may_draw_copies(facts, options) => {
                // Copies would make the lists of tiles long.
                Surface::Blended { splats: Splats::Copies, separate: false }
            }
            Surface::Blended { splats: Splats::Tiles { gather, .. }, separate } => {
                let fetch = tuning::fetch(adapter, options);
                Surface::Blended { splats: Splats::Tiles { gather, fetch }, separate }
            }
            Surface::Raster { raster, shown, .. } => {
                let triangles = tuning::PIXELS_A_TRIANGLE * facts.surfels > camera.pixels() as u64;
                Surface::Raster { raster, shown, triangles }
            }
            other => other,
        };
        // Fragment lists are summed in registers.
        let fixed = picture.accumulator == Accumulator::Fixed && surface.sums_by_compute();
        let once = long_atomics && surface.raster().is_none();
        let spreads = tuning::spreads(adapter) && options.has(Optimisation::Spreading);
        let needs = Self {
            surface,
            mesh: picture.mesh.map(|mesh| MeshNeeds { once, ..mesh }),
            atomics_u64: long_atomics && fixed && !surface.copies(),
            long_words: adapter.integers_u64 && options.has(Optimisation::LongWords),
            ..picture
        };
        Self { spreads: spreads && needs.may_spread(), ..needs }
    }

    /// Whether a term of the accumulator `fixed` fits in one word.
    pub fn terms_fit(&self) -> bool {
        !self.wide_sums && !self.surface.copies()
    }

    /// Whether a kernel can sum fragments in workgroup memory first. With textures a pixel has too
    /// many sums.
    fn may_spread(&self) -> bool {
        let blends = matches!(self.surface, Surface::Blended { .. }) && self.color != ColorNeed::Textured;
        blends && self.accumulator == Accumulator::Fixed && self.terms_fit()
    }

    /// Whether identical surfels may be drawn once.
    fn may_draw_copies(&self, facts: &Facts, options: &Settings) -> bool {
        let plain = !self.levels && !self.fades && self.color != ColorNeed::Textured;
        facts.copies && options.draws_copies_once() && self.accumulator == Accumulator::Fixed && plain
    }

    /// Whether tiles may sum all splats. With textures and triangles they would bind more buffers
    /// than core WebGPU allows.
    pub fn may_gather(&self) -> bool {
        self.surface.tiles() && !(self.color == ColorNeed::Textured && self.mesh.is_some())
    }

    /// Returns these needs without those that depend on the number of drawn surfels.
    pub fn before_cut(&self) -> Self {
        Self { cull: false, draws_projected: false, surface: self.surface.before_cut(), ..*self }
    }

    /// Whether records store the surfels' places in the octree, which decide the order of sorted
    /// fragments at one depth.
    pub fn numbers_surfels(&self) -> bool {
        self.levels && self.surface.lists() == Some(Lists::Sorted)
    }

    /// Whether surfaces are compared by their blended depths.
    pub fn compares_depth(&self) -> bool {
        self.surface.separate() || self.mesh.is_some_and(|mesh| mesh.join != Join::Nearest)
    }

    /// Whether each surfel has two splats: a whole sphere shows those at its border on both sides.
    pub fn twice(&self) -> bool {
        self.lens == Some(Form::Equirectangular)
    }

    /// Whether depths are summed.
    pub fn sums_depth(&self) -> bool {
        let among_layers = self.mesh.is_some() && self.surface.lists() == Some(Lists::Layers);
        self.compares_depth()
            || among_layers
            || [Map::Depth, Map::Surfaces, Map::TexZ].into_iter().any(|map| self.maps.has(map))
    }

    /// Whether fragments have weights: they are summed, or drawn by the rasteriser, whose targets
    /// hold terms even of a single fragment.
    pub fn weighs(&self) -> bool {
        self.surface.winner().is_none()
    }

    /// Returns the names of the needs, for people and JSON.
    pub fn names(&self) -> Vec<&'static str> {
        let projection = match (self.lens, self.projection) {
            (Some(form), _) => form.need(),
            (None, Projection::Pinhole) => "pinhole",
            (None, Projection::Orthographic) => "orthographic",
        };
        let color = match self.color {
            ColorNeed::Constant => "color-constant",
            ColorNeed::Srgb8 => "color-srgb8",
            ColorNeed::Linear => "color-linear",
            ColorNeed::Textured => "color-textured",
            ColorNeed::Harmonics(_) => "color-harmonics",
        };
        let raster = self.surface.raster().map(|raster| match raster.depth {
            RasterDepth::Exact => "raster-exact",
            RasterDepth::Offset => "raster-offset",
        });
        let oit = self.surface.oit().map(Oit::need);
        let lists = self.surface.lists().map(Lists::need);
        [projection, self.kernel.need(), color]
            .into_iter()
            .chain(raster.into_iter().chain(oit).chain(lists))
            .chain(self.flags().into_iter().filter(|(on, _)| *on).map(|(_, name)| name))
            .chain(self.maps.iter().map(|map| map.row().need))
            .collect()
    }

    /// The optional needs, each with whether it is set and its name.
    pub fn flags(&self) -> Vec<(bool, &'static str)> {
        let joins = |join| self.mesh.is_some_and(|mesh| mesh.join == join);
        vec![
            (self.low_pass == LowPass::Max, "lowpass-max"),
            (self.low_pass == LowPass::Ewa, "lowpass-ewa"),
            (self.low_pass == LowPass::Gaussians, "lowpass-gaussians"),
            (self.wide_sums, "wide-sums"),
            (self.atomics_u64, "atomics-u64"),
            (self.spreads, "spreads"),
            (self.long_words, "long-words"),
            (self.doubled, "doubled"),
            (self.surface.copies(), "copies"),
            (self.levels, "levels"),
            (self.node_caps, "node-caps"),
            (self.fades, "fades"),
            (self.cull, "cull"),
            (self.draws_projected, "draws-projected"),
            (self.surface.tiles(), "tiles"),
            (self.surface.gathers(), "gather"),
            (self.epsilon == EpsilonForm::Radius, "epsilon-radius"),
            (self.epsilon == EpsilonForm::Ray, "epsilon-ray"),
            (self.alpha, "alpha"),
            (self.normal, "normal"),
            (self.sides == Sides::Nearest, "sides"),
            (self.own_normals, "own-normals"),
            (self.cull_back, "cull-back"),
            (self.clips, "clips"),
            (self.outline, "outline"),
            (self.curved, "curved"),
            (self.solid, "solid"),
            (self.facing.is_some(), "facing"),
            (self.surface.shows_nearest(), "nearest"),
            (self.surface.peels().is_some(), "peels"),
            (self.mesh.is_some(), "triangles"),
            (self.mesh.is_some_and(|mesh| mesh.textured), "painted-triangles"),
            (self.mesh.is_some_and(|mesh| mesh.cut), "cut-triangles"),
            (self.mesh.is_some_and(|mesh| mesh.doubled), "doubled-triangles"),
            (self.surface.separate(), "separate"),
            (joins(Join::Corrected), "join-corrected"),
            (joins(Join::Blended), "join-blended"),
            (self.surface.veils(), "veils"),
            (self.surface.long_lists(), "long-lists"),
            (self.samples != Samples::ONE, "samples"),
            (self.shading == Shading::Lambert, "lambert"),
            (self.shading == Shading::Phong, "phong"),
            (self.lit_splats, "lit-splats"),
        ]
    }
}
