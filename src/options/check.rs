//! Combinations of options that are refused: one row each, with a sentence that says what to do
//! instead.

use super::RenderOptions;
use crate::error::{Error, Result};
use crate::plan::{Accumulator, BackendName, Organisation, Settings, check};
use crate::scene::composite::ALL_LAYERS;
use crate::scene::{Blend, Composite, Shading, ShadingAt, Tail};

/// A combination of options that is refused.
struct Clash {
    /// Whether a picture has this combination. The settings are those that all options resolve to.
    applies: fn(&RenderOptions, Option<BackendName>, &Settings) -> bool,
    /// The fault and its remedy.
    sentence: &'static str,
}

/// All refused combinations that do not depend on the scene.
const CLASHES: [Clash; 10] = [
    Clash {
        applies: |options, _, settings| settings.blend == Blend::Nearest && options.surface.epsilon.is_some(),
        sentence: "--blend nearest has no tolerance: leave --epsilon out",
    },
    Clash {
        applies: |options, _, settings| settings.blend == Blend::Nearest && options.surface.kernel.is_some(),
        sentence: "--blend nearest has no weights: leave --kernel out",
    },
    Clash {
        applies: |options, _, settings| settings.composite.is_order_free() && options.surface.epsilon.is_some(),
        sentence: "all fragments are summed, near and far: leave --epsilon out with --composite weighted or moments",
    },
    Clash {
        // Without a last layer there is no tail. The default tail is never refused.
        applies: |_, _, settings| {
            let layered = matches!(settings.composite, Composite::Layers(most) if most < ALL_LAYERS);
            settings.tail != Tail::default() && !layered
        },
        sentence: "a tail lies behind a last layer: give --tail with --composite layers:L",
    },
    Clash {
        applies: |_, _, settings| settings.shading_at == ShadingAt::Splat && settings.shading == Shading::Unlit,
        sentence: "nothing is lit: give --shading-at splat with --shading lambert or phong",
    },
    Clash {
        applies: |options, _, settings| options.look.shininess.is_some() && settings.shading != Shading::Phong,
        sentence: "--shininess is of highlights: give it with --shading phong",
    },
    Clash {
        applies: |_, backend, settings| settings.accumulator != Accumulator::default() && !is_gpu(backend),
        sentence: "the accumulator is of the backend gpu alone: leave it out",
    },
    Clash {
        applies: |_, backend, settings| {
            (settings.organisation != Organisation::default() || !settings.without.is_empty()) && !is_gpu(backend)
        },
        sentence: "the organisation, and what is left out of it, are of the backend gpu alone: leave them out",
    },
    Clash {
        applies: |_, backend, settings| (settings.fetch.is_some() || settings.large.is_some()) && !is_gpu(backend),
        sentence: "--fetch and --large are of the backend gpu alone: leave them out",
    },
    Clash {
        applies: |options, backend, _| {
            let chosen = options.research.blend_format.is_some() || options.research.raster_depth.is_some();
            chosen && backend != Some(BackendName::Raster)
        },
        sentence: "--blend-format and --raster-depth are of the backend raster alone: leave them out",
    },
];

/// Whether the compute kernels may render. None stands for the best available backend, which is
/// never the rasteriser.
fn is_gpu(backend: Option<BackendName>) -> bool {
    matches!(backend, None | Some(BackendName::Gpu))
}

impl RenderOptions {
    /// Rejects combinations of options that cannot be rendered. `settings` are those that the
    /// options resolve to.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self, backend: Option<BackendName>, settings: &Settings) -> Result<()> {
        match CLASHES.iter().find(|clash| (clash.applies)(self, backend, settings)) {
            Some(clash) => Err(Error::Usage(clash.sentence.into())),
            None => check::options(settings, backend == Some(BackendName::Reference)),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::options::Suggested;

    /// Sets options by name and returns the error for this backend, or None if they can be
    /// combined.
    fn refusal(backend: &str, set: &[(&str, &str)]) -> Option<String> {
        let mut options = RenderOptions::default();
        set.iter().for_each(|(name, text)| options.set(name, &[(*text).to_owned()]).unwrap());
        let backend = backend.parse().ok();
        let settings = options.settle(backend, Suggested::default());
        options.check(backend, &settings).err().map(|error| error.to_string())
    }

    #[test]
    fn every_clash_is_refused_and_says_what_to_do() {
        let clashes: [(&str, &[(&str, &str)]); 15] = [
            ("auto", &[("blend", "nearest"), ("epsilon", "abs:1")]),
            ("auto", &[("blend", "nearest"), ("kernel", "hat")]),
            ("auto", &[("composite", "weighted"), ("epsilon", "abs:1")]),
            ("auto", &[("composite", "layers"), ("tail", "none")]),
            ("auto", &[("shading", "unlit"), ("shading_at", "splat")]),
            ("auto", &[("shininess", "8")]),
            ("reference", &[("accumulator", "float")]),
            ("raster", &[("organisation", "tile")]),
            ("reference", &[("without", "order")]),
            ("raster", &[("large", "64")]),
            ("reference", &[("fetch", "staged")]),
            ("gpu", &[("fetch", "staged"), ("organisation", "scatter")]),
            ("gpu", &[("large", "4097")]),
            ("gpu", &[("blend_format", "rgba8unorm")]),
            ("auto", &[("opacity", "2")]),
        ];
        for (backend, set) in clashes {
            assert!(refusal(backend, set).is_some(), "{backend} {set:?}");
        }
        // Accepted: defaults that are given explicitly, and options with the backend or shading
        // that they need.
        let fine: [(&str, &[(&str, &str)]); 5] = [
            ("reference", &[("accumulator", "fixed"), ("organisation", "auto")]),
            ("auto", &[("tail", "sum")]),
            ("gpu", &[("fetch", "alone"), ("organisation", "tile"), ("large", "4096")]),
            ("raster", &[("raster_depth", "offset")]),
            ("auto", &[("shading", "phong"), ("shininess", "8")]),
        ];
        for (backend, set) in fine {
            assert_eq!(refusal(backend, set), None, "{backend} {set:?}");
        }
    }
}
