//! A configuration of a study: a backend and its render options.

use std::fmt;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::definition::named;
use crate::options::{RenderOptions, Suggested};
use crate::plan::{Accumulator, BackendName, Settings};
use crate::scene::{Samples, Shading};

/// A backend and its render options, under a name.
///
/// Options that are not given have the defaults of `epsplat render`, except that there is one
/// sample per pixel.
#[derive(Clone, Debug)]
pub struct Config {
    /// The name, unique in the study.
    pub name: String,
    /// The backend that renders.
    pub backend: BackendName,
    /// The render options, keyed by their command-line names with `_` for `-`.
    pub options: RenderOptions,
    /// The name of the configuration that this one approximates.
    ///
    /// The error against the f64 reference of that configuration is reported as `apart_rmse` and
    /// `apart_psnr_db`, on scenes that both render.
    pub approximates: Option<String>,
    /// The largest allowed RMSE against the f64 reference; a larger one is a failure.
    pub error_limit: Option<f64>,
    /// Whether a quick run includes this configuration.
    pub quick: bool,
}

impl<'de> Deserialize<'de> for Config {
    fn deserialize<D: Deserializer<'de>>(table: D) -> Result<Self, D::Error> {
        table.deserialize_map(Table)
    }
}

/// Reads the TOML table of a configuration: keys of [`Config`] and names of options.
struct Table;

impl<'de> Visitor<'de> for Table {
    type Value = Config;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a configuration")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut table: A) -> Result<Config, A::Error> {
        let (mut name, mut backend, mut approximates, mut error_limit, mut quick) = (None, None, None, None, true);
        let mut options = RenderOptions::default();
        options.look.samples = Some(Samples::ONE);
        while let Some(key) = table.next_key::<String>()? {
            match key.as_str() {
                "name" => name = Some(table.next_value()?),
                "backend" => backend = Some(table.next_value::<Named>()?.0),
                "approximates" => approximates = Some(table.next_value()?),
                "error_limit" => error_limit = Some(table.next_value()?),
                "quick" => quick = table.next_value()?,
                option => table.next_value_seed(options.value_of(option))?,
            }
        }
        let name = name.ok_or_else(|| A::Error::missing_field("name"))?;
        let backend = backend.ok_or_else(|| A::Error::missing_field("backend"))?;
        Ok(Config { name, backend, options, approximates, error_limit, quick })
    }
}

/// A backend that is read by its name.
struct Named(BackendName);

impl<'de> Deserialize<'de> for Named {
    fn deserialize<D: Deserializer<'de>>(name: D) -> Result<Self, D::Error> {
        named(name).map(Self)
    }
}

impl Config {
    /// Returns the render settings; `shading` is the scene's, used if the configuration gives none.
    pub fn settings(&self, shading: Option<Shading>) -> Settings {
        self.options.settle(Some(self.backend), Suggested { shading, ..Suggested::default() })
    }

    /// Whether the configuration draws a cut of the levels of detail.
    pub fn cuts(&self) -> bool {
        self.options.levels.lod.is_some_and(|detail| !detail.is_finest())
    }

    /// The accumulator of the compute kernels; `None` for the other backends.
    pub fn accumulator(&self) -> Option<Accumulator> {
        (self.backend == BackendName::Gpu).then(|| self.options.research.accumulator.unwrap_or_default())
    }

    /// The name of the accumulator or of the blend format; empty for the reference.
    pub fn sums(&self) -> &'static str {
        match self.backend {
            BackendName::Gpu => self.accumulator().map_or("", Accumulator::name),
            BackendName::Raster => self.options.raster().format.name(),
            BackendName::Reference => "",
        }
    }

    /// Whether frames are bit-identical from run to run. The rasteriser blends in no fixed order.
    pub fn deterministic(&self) -> bool {
        match self.backend {
            BackendName::Gpu => self.accumulator().is_some_and(|sums| sums.row().deterministic),
            BackendName::Raster => false,
            BackendName::Reference => true,
        }
    }
}
