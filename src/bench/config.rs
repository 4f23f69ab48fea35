//! A configuration of a study: one way to render.

use std::fmt;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::definition::named;
use crate::options::{RenderOptions, Suggested};
use crate::plan::{Accumulator, BackendName, RenderOptions as Settings};
use crate::scene::{Samples, Shading};

/// One way to render. What it does not say is as for `epsplat render`, but for one sample a pixel.
#[derive(Clone, Debug)]
pub struct Config {
    /// Its name.
    pub name: String,
    /// Who renders.
    pub backend: BackendName,
    /// The options of its pictures, by the names of the command line with `_` for `-`.
    pub options: RenderOptions,
    /// The configuration that it approximates, by name: its error against that one's f64 twin is reported as `apart_rmse` and
    /// `apart_psnr_db`, on scenes that have both.
    pub approximates: Option<String>,
    /// The largest RMSE against the f64 reference that is allowed.
    pub error_limit: Option<f64>,
    /// Whether a quick run has it.
    pub quick: bool,
}

impl<'de> Deserialize<'de> for Config {
    fn deserialize<D: Deserializer<'de>>(table: D) -> Result<Self, D::Error> {
        table.deserialize_map(Table)
    }
}

/// Reads the table of a configuration, whose keys are its own and the names of options.
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

/// A backend by its name.
struct Named(BackendName);

impl<'de> Deserialize<'de> for Named {
    fn deserialize<D: Deserializer<'de>>(name: D) -> Result<Self, D::Error> {
        named(name).map(Self)
    }
}

impl Config {
    /// The settings of a render, on a scene whose own shading is `shading`.
    pub fn settings(&self, shading: Option<Shading>) -> Settings {
        self.options.settle(Some(self.backend), Suggested { shading, ..Suggested::default() })
    }

    /// Whether a cut of levels of detail is drawn.
    pub fn cuts(&self) -> bool {
        self.options.levels.lod.is_some_and(|detail| !detail.is_finest())
    }

    /// How the compute kernels keep sums; none if others render.
    pub fn accumulator(&self) -> Option<Accumulator> {
        (self.backend == BackendName::Gpu).then(|| self.options.research.accumulator.unwrap_or_default())
    }

    /// How sums are kept, by name; empty for the reference.
    pub fn sums(&self) -> &'static str {
        match self.backend {
            BackendName::Gpu => self.accumulator().map_or("", Accumulator::name),
            BackendName::Raster => self.options.raster().format.name(),
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
