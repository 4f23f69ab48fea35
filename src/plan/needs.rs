//! What a scene and its options need, computed once: the only variant key of the kernels.

use super::{
    Accumulator, ColorNeed, Facts, Lists, MeshNeeds, Oit, Optimisation, Organisation, Raster, RasterDepth,
    RenderOptions, composited, in_view, tuning,
};
use crate::gpu::adapter::AdapterDescription;
use crate::passes::peel;
use crate::scene::{
    Blend, Camera, Composite, Cull, Epsilon, Join, KernelShape, LowPass, Map, Maps, PointShape, Projection, Samples,
    Shading,
};

/// What exists in this render: it chooses the WGSL files that are joined, and so the bindings, buffers and sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SceneNeeds {
    /// The camera model.
    pub projection: Projection,
    /// How sums are kept on the device.
    pub accumulator: Accumulator,
    /// The accumulator is `fixed` and terms may be small: alphas differ, so that means are divided by a small mean alpha;
    /// or a fragment's weight may be less than [`SMALL_WEIGHT`], as that of a far one among all of a pixel is. Then terms keep 40 bits or
    /// more ([`wide_bits`](super::wide_bits)).
    pub wide_sums: bool,
    /// The accumulator is `fixed` and the adapter has 64-bit atomics, which make the same sums in half the additions.
    pub atomics_u64: bool,
    /// Records are read and written 64 bits at a time, as the adapter has such integers: the same bits in half the accesses.
    pub long_words: bool,
    /// The f32 centres of surfels leave out digits that show, so trailing parts are stored too.
    pub doubled: bool,
    /// A surfel stands for all that are the same: the accumulator is `fixed`, one has many copies, there is no texture, and no inputs are kept apart.
    pub copies: bool,
    /// A cut of levels of detail is drawn.
    pub levels: bool,
    /// Nodes of the cut curve.
    pub node_caps: bool,
    /// There is less than all of some surfel, as cuts fade into each other.
    pub fades: bool,
    /// Batches of surfels that are out of view or hidden are left out: no cut is drawn, and there are enough surfels for the image's pixels, all of which are looked at for what hides ([`tuning::PIXELS_A_CULLED_SURFEL`]).
    pub cull: bool,
    /// Large splats, at least, are drawn by tiles: the accumulator is `fixed`, and the options do not say scatter.
    pub tiles: bool,
    /// Tiles sum all splats, large and small, and resolve their pixels at once, or keep what an input shows: no sum is stored.
    pub gather: bool,
    /// A splat's record is read by a subgroup together, as the adapter's processor would else read it for each of its
    /// invocations.
    pub subgroups: bool,
    /// Sums are the rasteriser's.
    pub raster: Option<Raster>,
    /// The nearest fragment alone shows, and how it is found.
    pub winner: Option<Winner>,
    /// There are triangles beside the splats.
    pub mesh: Option<MeshNeeds>,
    /// Inputs are kept apart ([`individuals`](crate::passes::individuals)).
    pub separate: bool,
    /// Pixels have lists of their fragments, and what becomes of these.
    pub lists: Option<Lists>,
    /// Every fragment is summed, by what is before it as far as sums in any order tell.
    pub oit: Option<Oit>,
    /// The layers that it peels, one after the other.
    pub peels: Option<u32>,
    /// Lists end where nothing more shows: without that some would be too long.
    pub veils: bool,
    /// Some lists are sorted and composited in rounds: one invocation's loops would not last for them.
    pub long_lists: bool,
    /// It draws a triangle a splat instead of a quad ([`tuning::PIXELS_A_TRIANGLE`]).
    pub triangles: bool,
    /// The kernel's formula.
    pub kernel: KernelShape,
    /// The filter for small splats.
    pub low_pass: LowPass,
    /// What epsilon depends on.
    pub epsilon: EpsilonForm,
    /// The colour source.
    pub color: ColorNeed,
    /// Surfels differ in alpha.
    pub alpha: bool,
    /// Normals are accumulated: pixels are lit, or a normal map is written.
    pub normal: bool,
    /// What is seen of surfels whose normals have a side.
    pub sides: Sides,
    /// Normals are summed that are others than those of the disks' planes.
    pub own_normals: bool,
    /// Surfels that face away are left out.
    pub cull_back: bool,
    /// Disks end at lines in their planes, or at a polygon's sides.
    pub clips: bool,
    /// Polygons are drawn instead of disks.
    pub outline: bool,
    /// Disks curve: neither the rasteriser nor the ellipse of `ewa` does that.
    pub curved: bool,
    /// Surfels are points of this shape that face the camera.
    pub facing: Option<PointShape>,
    /// Samples of a pixel. The kernels' pixels are samples, but for those that they are resolved to.
    pub samples: Samples,
    /// How pixels, or splats, are lit.
    pub shading: Shading,
    /// It is splats that are lit.
    pub lit_splats: bool,
    /// Maps that are written; depths are accumulated for theirs, and fragments counted.
    pub maps: Maps,
}

/// What epsilon depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EpsilonForm {
    /// The nearest depth, if anything.
    Depth,
    /// The surfel's radius.
    Radius,
    /// The slope of the pixel's ray.
    Ray,
    /// There is none, and every depth counts.
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

/// How the fragment is found that alone shows at a pixel ([`winner`](crate::passes::winner)).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Winner {
    /// All surfels have one colour: the nearest depth says all.
    Depth,
    /// Depth and colour in one number, by 64-bit atomics.
    Once,
    /// The nearest depth first, and its colour in a second pass.
    Second,
    /// By the rasteriser's depth test.
    Rasterised,
}

/// The needs of a scene's triangles, if the view may show any: beside some, depths of splats are
/// weighted differently. Without splats nothing is joined.
fn mesh(facts: &Facts, camera: &Camera, options: &RenderOptions) -> Option<MeshNeeds> {
    let of = facts.mesh;
    let shows = of.triangles > 0 && in_view(&of.bounds, facts.origin, camera);
    let join = if facts.surfels > 0 { options.join } else { Join::Nearest };
    shows.then_some(MeshNeeds {
        join,
        normals: of.normals,
        colored: of.colored,
        textured: of.textured,
        doubled: of.doubled,
        once: false,
        coded: facts.encoded,
    })
}

/// Terms of at least this weight keep 23 of the 32 bits that `fixed` has, as f32 would; where cuts fade into each other, of those that a 64th of a splat alone
/// has, 17.
pub const SMALL_WEIGHT: f64 = 1.0 / 512.0;

fn may_be_small(options: &RenderOptions) -> bool {
    // Squares have corners at sqrt(2) radii. The convolution with the pixel lowers the weight of splats below it.
    let square = options.facing.is_some_and(|facing| facing.shape == PointShape::Square);
    let farthest = if square { 2.0 } else { 1.0 };
    options.kernel.weight(farthest) < SMALL_WEIGHT || options.low_pass == LowPass::Ewa
}

/// Whether surfels that face away are left out.
pub fn culls_back(facts: &Facts, camera: &Camera, options: &RenderOptions) -> bool {
    match options.cull {
        _ if options.facing.is_some() => false,
        Cull::None => false,
        Cull::Back => facts.oriented,
        // They are seen through what is before them.
        Cull::Auto if composited(facts, options) != Composite::Opaque => false,
        Cull::Auto => {
            let relative = camera.eye - facts.origin;
            let reach = f64::from(facts.largest_radius);
            let outside = relative.cmplt(facts.bounds.min - reach) | relative.cmpgt(facts.bounds.max + reach);
            facts.closed && (outside.any() || camera.projection == Projection::Orthographic)
        }
    }
}

/// What is seen of surfels whose normals have a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sides {
    /// None has one, or all that are drawn face the viewer.
    None,
    /// A pixel shows one side: that of its nearest fragment. At outlines and in thin parts the back lies within epsilon of the front.
    Nearest,
    /// Both, and normals are blended as they are given: the rasteriser's own depth test does not say what is nearest.
    Both,
}

impl Sides {
    /// Those in a picture.
    pub fn of(facts: &Facts, camera: &Camera, options: &RenderOptions) -> Self {
        let tells_nearest = options.raster.is_none_or(|raster| raster.depth == RasterDepth::Exact);
        let both = options.facing.is_none() && !culls_back(facts, camera, options);
        let of_one_surface = tells_nearest && Oit::of(options).is_none();
        match facts.oriented && both && options.blend == Blend::Weighted {
            true if of_one_surface => Self::Nearest,
            true => Self::Both,
            false => Self::None,
        }
    }
}

impl SceneNeeds {
    /// What the picture needs of the scene that `facts` are of, whoever renders it.
    pub fn of_picture(facts: &Facts, camera: &Camera, options: &RenderOptions) -> Self {
        let (low, high) = facts.color;
        let lit = options.shading != Shading::Unlit;
        let blends = options.blend == Blend::Weighted;
        let fixed = options.accumulator == Accumulator::Fixed && options.raster.is_none() && blends;
        let lists = Lists::of(facts, options);
        let peels = lists.and(peel::layers(options));
        let oit = Oit::of(options);
        let separate = options.separate && facts.individuals.len() > 1;
        let node_caps = options.draws_node_caps() && facts.nodes_of(options).is_some_and(|nodes| nodes.caps);
        let unblended = if options.raster.is_some() { Winner::Rasterised } else { Winner::Second };
        Self {
            projection: camera.projection,
            accumulator: options.accumulator,
            wide_sums: fixed && (low[3] != high[3] || may_be_small(options) || oit.is_some()),
            atomics_u64: false,
            long_words: false,
            doubled: facts.doubled,
            copies: false,
            levels: facts.nodes_of(options).is_some(),
            node_caps,
            fades: if facts.nodes_of(options).is_some() { options.detail_fades } else { facts.fades },
            cull: false,
            tiles: fixed && lists.is_none() && oit.is_none() && options.organisation != Organisation::Scatter,
            gather: false,
            subgroups: false,
            raster: options.raster,
            winner: (!blends).then_some(unblended),
            mesh: mesh(facts, camera, options),
            separate,
            lists: if options.raster.is_some() { None } else { lists },
            oit,
            peels,
            veils: false,
            long_lists: false,
            triangles: options.raster.is_some() && tuning::PIXELS_A_TRIANGLE * facts.surfels > camera.pixels() as u64,
            kernel: if blends { options.kernel.shape() } else { KernelShape::Constant },
            low_pass: options.low_pass,
            epsilon: match oit {
                Some(_) => EpsilonForm::All,
                None if blends => EpsilonForm::of(options.epsilon, camera),
                None => EpsilonForm::Depth,
            },
            // Surfels of one colour differ once they are lit.
            color: match facts.colors {
                ColorNeed::Constant if options.lights_splats() => ColorNeed::Linear,
                // Where nothing is blended colours are words.
                ColorNeed::Linear if !blends => ColorNeed::Srgb8,
                colors => colors,
            },
            alpha: low[3] != high[3],
            normal: (lit && !options.lights_splats()) || options.maps.has(Map::Normal),
            sides: Sides::of(facts, camera, options),
            own_normals: facts.own_normals && (lit || options.maps.has(Map::Normal)),
            cull_back: culls_back(facts, camera, options),
            clips: (facts.clips || options.outline.is_some()) && options.facing.is_none(),
            outline: options.outline.is_some(),
            curved: node_caps || (facts.caps && options.draws_caps()),
            facing: options.facing.map(|facing| facing.shape),
            samples: options.samples,
            shading: options.shading,
            lit_splats: options.lights_splats(),
            maps: options.maps,
        }
    }

    /// What a render on `adapter` needs, before the image is cut into bands.
    pub fn of(facts: &Facts, adapter: &AdapterDescription, camera: &Camera, options: &RenderOptions) -> Self {
        let picture = Self::of_picture(facts, camera, options);
        let blends = picture.winner.is_none();
        // Lists sum in registers.
        let stored = blends && picture.lists.is_none();
        let fixed = picture.accumulator == Accumulator::Fixed && picture.raster.is_none() && stored;
        let long_atomics = adapter.atomics_u64 && options.has(Optimisation::Pairs);
        let winner = picture.winner.map(|winner| match winner {
            Winner::Second if picture.color == ColorNeed::Constant => Winner::Depth,
            Winner::Second if long_atomics => Winner::Once,
            other => other,
        });
        let copies = facts.copies
            && options.draws_copies_once()
            && fixed
            && picture.oit.is_none()
            && !picture.separate
            && !picture.levels
            && !picture.fades
            && picture.color != ColorNeed::Textured;
        // Of copies tiles would make long lists.
        let tiles = picture.tiles && !copies;
        Self {
            copies,
            tiles,
            winner,
            mesh: picture.mesh.map(|mesh| MeshNeeds { once: long_atomics && picture.raster.is_none(), ..mesh }),
            atomics_u64: long_atomics && fixed && !copies,
            long_words: adapter.integers_u64 && options.has(Optimisation::LongWords),
            subgroups: tiles && tuning::shares(adapter) && options.has(Optimisation::Sharing),
            ..picture
        }
    }

    /// Weighted sums are kept by compute kernels, in storage or in a tile's registers.
    pub fn sums_by_compute(&self) -> bool {
        self.raster.is_none() && self.winner.is_none() && self.lists.is_none()
    }

    /// Tiles may sum all splats: with textures and triangles they would bind more buffers than core WebGPU has.
    pub fn may_gather(&self) -> bool {
        self.tiles && !(self.color == ColorNeed::Textured && self.mesh.is_some())
    }

    /// These, but for what follows from how much is drawn.
    pub fn before_cut(&self) -> Self {
        Self { cull: false, gather: false, veils: false, long_lists: false, ..*self }
    }

    /// Surfels of a cut are told apart by their places in the tree, as what is sorted goes by them at one depth.
    pub fn numbers_surfels(&self) -> bool {
        self.levels && self.lists == Some(Lists::Sorted)
    }

    /// Surfaces are told apart by the depth that they blend to.
    pub fn compares_depth(&self) -> bool {
        self.separate || self.mesh.is_some_and(|mesh| mesh.join != Join::Nearest)
    }

    /// Depths are summed.
    pub fn sums_depth(&self) -> bool {
        self.compares_depth() || [Map::Depth, Map::Surfaces, Map::TexZ].into_iter().any(|map| self.maps.has(map))
    }

    /// Fragments have weights: they are summed, or they are the rasteriser's, whose targets hold terms even of one fragment.
    pub fn weighs(&self) -> bool {
        matches!(self.winner, None | Some(Winner::Rasterised))
    }

    /// The needs by name, for people and JSON.
    pub fn names(&self) -> Vec<&'static str> {
        let projection = match self.projection {
            Projection::Pinhole => "pinhole",
            Projection::Orthographic => "orthographic",
        };
        let color = match self.color {
            ColorNeed::Constant => "color-constant",
            ColorNeed::Srgb8 => "color-srgb8",
            ColorNeed::Linear => "color-linear",
            ColorNeed::Textured => "color-textured",
            ColorNeed::Harmonics(_) => "color-harmonics",
        };
        let kernel = match self.kernel {
            KernelShape::Gaussian => "kernel-gaussian",
            KernelShape::Ellipse => "kernel-ellipse",
            KernelShape::Cone => "kernel-cone",
            KernelShape::Constant => "kernel-constant",
        };
        let raster = self.raster.map(|raster| match raster.depth {
            RasterDepth::Exact => "raster-exact",
            RasterDepth::Offset => "raster-offset",
        });
        [projection, kernel, color]
            .into_iter()
            .chain(raster)
            .chain(self.flags().into_iter().filter(|(on, _)| *on).map(|(_, name)| name))
            .chain(self.maps.iter().map(|map| map.row().need))
            .collect()
    }

    /// What may be there and has a name.
    fn flags(&self) -> Vec<(bool, &'static str)> {
        let joins = |join| self.mesh.is_some_and(|mesh| mesh.join == join);
        vec![
            (self.low_pass == LowPass::Max, "lowpass-max"),
            (self.low_pass == LowPass::Ewa, "lowpass-ewa"),
            (self.low_pass == LowPass::Gaussians, "lowpass-gaussians"),
            (self.wide_sums, "wide-sums"),
            (self.atomics_u64, "atomics-u64"),
            (self.long_words, "long-words"),
            (self.doubled, "doubled"),
            (self.copies, "copies"),
            (self.levels, "levels"),
            (self.node_caps, "node-caps"),
            (self.fades, "fades"),
            (self.cull, "cull"),
            (self.tiles, "tiles"),
            (self.gather, "gather"),
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
            (self.facing.is_some(), "facing"),
            (self.winner.is_some(), "nearest"),
            (self.lists == Some(Lists::Layers), "lists-layers"),
            (self.lists == Some(Lists::Sorted), "lists-sorted"),
            (self.oit == Some(Oit::Weighted), "oit-weighted"),
            (self.oit == Some(Oit::Moments), "oit-moments"),
            (self.peels.is_some(), "peels"),
            (self.mesh.is_some(), "triangles"),
            (self.mesh.is_some_and(|mesh| mesh.textured), "painted-triangles"),
            (self.mesh.is_some_and(|mesh| mesh.doubled), "doubled-triangles"),
            (self.separate, "separate"),
            (joins(Join::Corrected), "join-corrected"),
            (joins(Join::Blended), "join-blended"),
            (self.veils, "veils"),
            (self.long_lists, "long-lists"),
            (self.samples != Samples::ONE, "samples"),
            (self.shading == Shading::Lambert, "lambert"),
            (self.shading == Shading::Phong, "phong"),
            (self.lit_splats, "lit-splats"),
        ]
    }
}
