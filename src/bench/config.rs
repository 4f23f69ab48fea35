//! A configuration of a study: one way to render.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use super::definition::{named, parsed, yes};
use crate::error::Error;
use crate::plan::{
    Accumulator, BackendName, BlendFormat, Optimisation, Organisation, Raster, RasterDepth, RenderOptions,
};
use crate::scene::{
    Blend, Composite, Cull, Detail, DetailMeasure, Epsilon, Facing, Join, Kernel, LowPass, Map, Maps, Outline,
    PointShape, Samples, Shading, ShadingAt, Tail,
};

/// One way to render. What it does not say is as for `epsplat render`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Its name.
    pub name: String,
    /// Who renders.
    #[serde(deserialize_with = "named")]
    pub backend: BackendName,
    /// How the compute kernels keep sums.
    #[serde(default, deserialize_with = "parsed")]
    pub accumulator: Option<Accumulator>,
    /// How the compute kernels draw splats.
    #[serde(default, deserialize_with = "parsed")]
    pub organisation: Option<Organisation>,
    /// What is left out that makes frames of the compute kernels faster.
    #[serde(default, deserialize_with = "all_parsed")]
    pub without: Vec<Optimisation>,
    /// Depth tolerance.
    #[serde(default, deserialize_with = "parsed")]
    pub epsilon: Option<Epsilon>,
    /// Blending kernel.
    #[serde(default, deserialize_with = "parsed")]
    pub kernel: Option<Kernel>,
    /// Low-pass filter.
    pub lowpass: Option<LowPass>,
    /// Which surfels are left out by the side that they show.
    #[serde(default, deserialize_with = "parsed")]
    pub cull: Option<Cull>,
    /// The size of a node that is drawn in place of what is below it, as `epsplat render --lod` takes it: scenes get levels of detail.
    #[serde(default, deserialize_with = "parsed")]
    pub lod: Option<Detail>,
    /// How that is measured: area or extent.
    #[serde(default, deserialize_with = "parsed")]
    pub lod_measure: Option<DetailMeasure>,
    /// Nodes curve as what is below them does, which they do unless this is false.
    pub lod_caps: Option<bool>,
    /// Coarser and finer cuts fade into each other.
    #[serde(default)]
    pub lod_fade: bool,
    /// Samples of a pixel: 1, 4, 8 or 16.
    #[serde(default, deserialize_with = "parsed")]
    pub samples: Option<Samples>,
    /// Surfels are points of this shape that face the camera: square, circle, sphere, cone or paraboloid; unlit unless the configuration says
    /// otherwise.
    #[serde(default, deserialize_with = "parsed")]
    pub facing: Option<PointShape>,
    /// Their least and largest diameter, pixels; else the paper's.
    pub pixels: Option<[f64; 2]>,
    /// Polygons of so many sides instead of disks.
    pub outline: Option<Outline>,
    /// Whether fragments are blended; unlit if they are not, unless the configuration says otherwise.
    #[serde(default, deserialize_with = "parsed")]
    pub blend: Option<Blend>,
    /// What shows of the surfaces behind the nearest one.
    #[serde(default, deserialize_with = "parsed")]
    pub composite: Option<Composite>,
    /// What all alphas are multiplied with.
    pub opacity: Option<f32>,
    /// What becomes of the surfaces behind the last layer.
    #[serde(default, deserialize_with = "parsed")]
    pub tail: Option<Tail>,
    /// What shows where splats and triangles meet.
    #[serde(default, deserialize_with = "parsed")]
    pub join: Option<Join>,
    /// Inputs are kept apart.
    #[serde(default)]
    pub separate: bool,
    /// The rasteriser's targets.
    #[serde(default, deserialize_with = "parsed")]
    pub blend_format: Option<BlendFormat>,
    /// How the rasteriser tells the visible surface.
    #[serde(default, deserialize_with = "parsed")]
    pub raster_depth: Option<RasterDepth>,
    /// Shading; else the scene's, else Lambert.
    pub shading: Option<Shading>,
    /// What is lit: pixel or splat.
    #[serde(default)]
    pub shading_at: ShadingAt,
    /// Maps that are rendered too.
    #[serde(default, deserialize_with = "all_parsed")]
    pub maps: Vec<Map>,
    /// The configuration that it approximates, by name: what it errs by against that one's f64 twin is told as `apart_rmse` and
    /// `apart_psnr_db`, on scenes that have both.
    pub approximates: Option<String>,
    /// The largest RMSE against the f64 reference that is allowed.
    pub error_limit: Option<f64>,
    /// Whether a quick run has it.
    #[serde(default = "yes")]
    pub quick: bool,
}

fn all_parsed<'de, D: Deserializer<'de>, T: std::str::FromStr<Err = Error>>(texts: D) -> Result<Vec<T>, D::Error> {
    let texts = Vec::<String>::deserialize(texts)?;
    texts.iter().map(|text| text.parse().map_err(D::Error::custom)).collect()
}

impl Config {
    /// The options of a render, on a scene whose own shading is `shading`.
    pub fn options(&self, shading: Option<Shading>) -> RenderOptions {
        let default = RenderOptions::default();
        let raster = Raster::default();
        RenderOptions {
            epsilon: self.epsilon.unwrap_or(default.epsilon),
            cull: self.cull.unwrap_or(default.cull),
            detail: self.lod.unwrap_or(default.detail),
            detail_measure: self.lod_measure.unwrap_or_default(),
            detail_caps: self.lod_caps.unwrap_or(default.detail_caps),
            detail_fades: self.lod_fade,
            samples: self.samples.unwrap_or(default.samples),
            outline: self.outline,
            facing: self.facing.map(|shape| Facing { shape, pixels: self.pixels.unwrap_or(Facing::LIMITS) }),
            blend: self.blend.unwrap_or_default(),
            composite: self.composite.unwrap_or_default(),
            opacity: self.opacity.unwrap_or(default.opacity),
            tail: self.tail.unwrap_or_default(),
            join: self.join.unwrap_or_default(),
            separate: self.separate,
            kernel: self.kernel.unwrap_or(default.kernel),
            low_pass: self.lowpass.unwrap_or(default.low_pass),
            accumulator: self.accumulator().unwrap_or_default(),
            organisation: self.organisation.unwrap_or_default(),
            without: self.without.clone(),
            raster: (self.backend == BackendName::Raster).then(|| Raster {
                format: self.blend_format.unwrap_or(raster.format),
                depth: self.raster_depth.unwrap_or(raster.depth),
            }),
            shading: self.shading.or(self.unlit().then_some(Shading::Unlit)).or(shading).unwrap_or(default.shading),
            shading_at: self.shading_at,
            maps: Maps::of(&self.maps),
            ..default
        }
    }

    /// Whether a cut of levels of detail is drawn.
    pub fn cuts(&self) -> bool {
        self.lod.is_some_and(|detail| !detail.is_finest())
    }

    /// Whether normals are of no use: of points that face the camera there are none, and of what is not blended none is kept.
    fn unlit(&self) -> bool {
        self.facing.is_some() || self.blend == Some(Blend::Nearest)
    }

    /// How the compute kernels keep sums; none if others render.
    pub fn accumulator(&self) -> Option<Accumulator> {
        (self.backend == BackendName::Gpu).then(|| self.accumulator.unwrap_or_default())
    }

    /// How sums are kept, by name; empty for the reference.
    pub fn sums(&self) -> &'static str {
        match self.backend {
            BackendName::Gpu => self.accumulator().map_or("", Accumulator::name),
            BackendName::Raster => self.blend_format.unwrap_or(Raster::default().format).name(),
            BackendName::Reference => "",
        }
    }

    /// Whether two frames must have the same bits. The rasteriser blends in no fixed order.
    pub fn deterministic(&self) -> bool {
        match self.backend {
            BackendName::Gpu => self.accumulator().is_some_and(|sums| sums.row().deterministic),
            BackendName::Raster => false,
            BackendName::Reference => true,
        }
    }
}
