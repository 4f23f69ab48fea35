//! The settings of a render.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Accumulator, Fetch, Optimisation, Raster};
use crate::error::Error;
use crate::gpu::Replacement;
use crate::scene::{
    Blend, Composite, Cull, Detail, DetailMeasure, Epsilon, EyeDome, Facing, Join, Kernel, Light, LowPass, Maps,
    Outline, OwnKernel, Samples, Shading, ShadingAt, Tail,
};

/// The renderer of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendName {
    /// Compute kernels on an adapter.
    Gpu,
    /// The adapter's rasteriser and blender, for comparison.
    Raster,
    /// The kernels' f64 twins on the processor.
    Reference,
}

impl BackendName {
    /// The name in options, studies and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Raster => "raster",
            Self::Reference => "reference",
        }
    }
}

impl FromStr for BackendName {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let named = [Self::Gpu, Self::Raster, Self::Reference].into_iter().find(|backend| backend.name() == text);
        named.ok_or_else(|| Error::Usage(format!("there is no backend {text:?}: take gpu, raster or reference")))
    }
}

/// How the compute kernels draw splats. The image is the same to the bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Organisation {
    /// Small splats one by one, large ones by tiles of the image. A software adapter sums all
    /// splats by tiles, unless they are tiny.
    #[default]
    Auto,
    /// All splats one by one, large ones by a workgroup each.
    Scatter,
    /// All splats by tiles, if the nearest surface is summed by the accumulator `fixed`; otherwise
    /// as `Auto`.
    Tile,
}

impl FromStr for Organisation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "auto" => Ok(Self::Auto),
            "scatter" => Ok(Self::Scatter),
            "tile" => Ok(Self::Tile),
            _ => Err(Error::Usage(format!("there is no organisation {text:?}: take auto, scatter or tile"))),
        }
    }
}

/// Everything a caller may choose, except scene and camera.
///
/// Parts of a picture store the settings without the accumulator, which is `fixed` there, and
/// without kernels of the user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Depth tolerance.
    pub epsilon: Epsilon,
    /// Which surfels are left out because of the side that they show.
    pub cull: Cull,
    /// The size in the image below which a node is drawn instead of its descendants, in a scene
    /// with levels of detail.
    pub detail: Detail,
    /// How the size of nodes is measured.
    pub detail_measure: DetailMeasure,
    /// Nodes are drawn curved like the surfels below them, instead of flat.
    pub detail_caps: bool,
    /// Coarser and finer cuts fade into each other from view to view, instead of switching.
    pub detail_fades: bool,
    /// Samples per pixel for the colour. Maps are taken at the pixel's centre, as the mean depth of
    /// two surfaces belongs to neither.
    pub samples: Samples,
    /// Surfels are points that face the camera; else each lies in its own plane.
    pub facing: Option<Facing>,
    /// Polygons are drawn instead of disks.
    pub outline: Option<Outline>,
    /// Whether fragments are blended.
    pub blend: Blend,
    /// How surfaces behind the nearest one show.
    pub composite: Composite,
    /// Factor of all alphas, 0 to 1.
    pub opacity: f32,
    /// How surfaces behind the last layer are drawn.
    pub tail: Tail,
    /// How splats and triangles join where they meet.
    pub join: Join,
    /// The surfels of different inputs do not blend, however near they are.
    pub separate: bool,
    /// Blending kernel.
    pub kernel: Kernel,
    /// Low-pass filter.
    pub low_pass: LowPass,
    /// How the device keeps sums.
    #[serde(skip)]
    pub accumulator: Accumulator,
    /// How the device draws splats; with other accumulators than `fixed` they are scattered.
    pub organisation: Organisation,
    /// How tiles get splats; None chooses by the adapter ([`tuning::fetch`](super::tuning::fetch)).
    /// No image depends on it.
    pub fetch: Option<Fetch>,
    /// The number of pixels above which the bounds of a splat make it large, at most
    /// [`MOST_LARGE`](super::tuning::MOST_LARGE). Large splats are drawn by tiles, or where there
    /// are none by a workgroup each. None is the measured threshold
    /// ([`tuning::large`](super::tuning::large)). No image depends on it.
    pub large: Option<u32>,
    /// The rasteriser makes the sums, instead of compute kernels.
    pub raster: Option<Raster>,
    /// Eye-dome lighting of the finished picture ([`eye_dome`](crate::passes::eye_dome)).
    pub edl: Option<EyeDome>,
    /// Shading model.
    pub shading: Shading,
    /// Where shading is computed: at pixels or at splats.
    pub shading_at: ShadingAt,
    /// Exponent of [`Shading::Phong`], in
    /// [`SHININESS_RANGE`](crate::scene::options::SHININESS_RANGE): the higher, the smaller a
    /// highlight is.
    pub shininess: f32,
    /// Lights of the shading models; unlit pixels have none.
    pub lights: Vec<Light>,
    /// Colour behind the scene: linear RGB and straight alpha.
    pub background: [f32; 4],
    /// Maps wanted beside the colour.
    pub maps: Maps,
    /// Optimisations that are left out; none changes a bit of the image.
    pub without: Vec<Optimisation>,
    /// User-written WGSL files that replace built-in ones.
    #[serde(skip)]
    pub sources: Vec<Replacement>,
    /// The f64 twin of a blending kernel among `sources`. If it is None, the WGSL text is evaluated
    /// in f64.
    #[serde(skip)]
    pub own_kernel: Option<OwnKernel>,
}

impl Settings {
    /// Whether identical surfels are drawn once. The organisation `tile` lists each of them
    /// instead.
    pub fn draws_copies_once(&self) -> bool {
        self.has(Optimisation::Copies) && self.organisation != Organisation::Tile
    }

    /// Whether curved surfels are drawn curved. The rasteriser and the ellipse of `ewa` draw flat
    /// disks, and points have no plane.
    pub fn draws_caps(&self) -> bool {
        self.low_pass != LowPass::Ewa && self.raster.is_none() && self.facing.is_none()
    }

    /// Whether curved nodes are drawn curved.
    pub fn draws_node_caps(&self) -> bool {
        self.detail_caps && self.draws_caps()
    }

    /// Whether splats are lit and their lit colours blended. Otherwise pixels are lit by their mean
    /// normals. Order-free composites light splats, as the mean normal of several surfaces belongs
    /// to none.
    pub fn lights_splats(&self) -> bool {
        let at_splats = self.shading_at == ShadingAt::Splat || self.composite.is_order_free();
        self.shading != Shading::Unlit && at_splats
    }

    /// Whether empty pixels differ from 0 in the image, because of a map or the background.
    pub fn shows_where_nothing_is(&self) -> bool {
        self.maps.iter().any(|map| !map.row().nothing.is_empty())
            || self.background.iter().any(|value| value.to_bits() != 0)
    }

    /// The weight of a fragment at the squared distance `rho2` from its disk's centre, in radii
    /// squared.
    pub fn weight(&self, rho2: f64) -> f64 {
        match &self.own_kernel {
            Some(own) => own.weight(rho2).max(self.kernel.floor()),
            None => self.kernel.weight(rho2),
        }
    }

    /// Whether an optimisation is on.
    pub fn has(&self, optimisation: Optimisation) -> bool {
        !self.without.contains(&optimisation)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            epsilon: Epsilon::Bounded { radius: 1.0, relative: 0.01 },
            cull: Cull::Auto,
            detail: Detail::FINEST,
            detail_measure: DetailMeasure::default(),
            detail_caps: true,
            detail_fades: false,
            samples: Samples::ONE,
            facing: None,
            outline: None,
            blend: Blend::Weighted,
            composite: Composite::Opaque,
            opacity: 1.0,
            tail: Tail::Sum,
            join: Join::Corrected,
            separate: false,
            kernel: Kernel::Ellipse { a: 6.0, n: 3.0, smooth: false },
            low_pass: LowPass::None,
            accumulator: Accumulator::Fixed,
            organisation: Organisation::Auto,
            fetch: None,
            large: None,
            raster: None,
            edl: None,
            shading: Shading::Lambert,
            shading_at: ShadingAt::Pixel,
            shininess: 32.0,
            lights: vec![Light::Headlight { intensity: 1.0 }],
            background: [0.0; 4],
            maps: Maps::NONE,
            without: Vec::new(),
            sources: Vec::new(),
            own_kernel: None,
        }
    }
}
