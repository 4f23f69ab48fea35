//! Resolves options that leave a choice to the scene.

use super::RenderOptions;
use super::values::{Diameters, Rgba, Switch};
use crate::plan::{BackendName, Raster, Settings, check};
use crate::scene::{
    Blend, Composite, Detail, Facing, Kernel, LowPass, Maps, NodeShape, PointSize, Samples, Shading, gaussian,
};

/// Facts of the scene and its use that decide what the options leave open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Suggested {
    /// The scene has Gaussians, which are drawn by the rules of their training.
    pub gaussians: bool,
    /// The shading that the scene suggests.
    pub shading: Option<Shading>,
    /// There are many views. Levels of detail then fade from view to view, if the other settings
    /// allow it.
    pub views: bool,
    /// There is only one input, so inputs cannot be kept separate.
    pub one_input: bool,
}

impl RenderOptions {
    /// Returns the settings of a picture drawn by `backend`; None is the best available one.
    pub fn settle(&self, backend: Option<BackendName>, suggested: Suggested) -> Settings {
        let Self { look, surface, transparency, levels, research, maps, .. } = self;
        let default = Settings::default();
        let facing = self.facing();
        let raster = (backend == Some(BackendName::Raster)).then(|| self.raster());
        let blend = surface.blend.unwrap_or_default();
        let trained = suggested.gaussians && facing.is_none() && raster.is_none() && blend != Blend::Nearest;
        let kernel = surface.kernel.unwrap_or(match surface.lowpass {
            // This filter requires a Gaussian kernel.
            Some(LowPass::Gaussians) => gaussian::KERNEL,
            _ if trained => gaussian::KERNEL,
            _ => default.kernel,
        });
        let filtered = trained && research.outline.is_none() && matches!(kernel, Kernel::Gaussian { .. });
        let unlit = facing.is_some() || blend == Blend::Nearest || suggested.gaussians;
        let settings = Settings {
            epsilon: surface.epsilon.unwrap_or(default.epsilon),
            kernel,
            blend,
            low_pass: surface.lowpass.unwrap_or(if filtered { LowPass::Gaussians } else { LowPass::None }),
            cull: surface.cull.unwrap_or_default(),
            separate: surface.separate && !suggested.one_input,
            join: surface.join.unwrap_or_default(),
            composite: transparency.composite.unwrap_or(match trained {
                true => Composite::Gaussians,
                false => Composite::Opaque,
            }),
            opacity: transparency.opacity.unwrap_or(default.opacity),
            tail: transparency.tail.unwrap_or_default(),
            detail: levels.splats.map(|splats| Detail::Splats(splats.get())).or(levels.lod).unwrap_or(default.detail),
            detail_measure: research.lod_measure.unwrap_or_default(),
            detail_caps: research.lod_shape.unwrap_or_default() == NodeShape::Cap,
            detail_fades: levels.lod_fade == Some(Switch(true)),
            // A Gaussian has no edge that more samples would smooth.
            samples: look.samples.unwrap_or(if trained { Samples::ONE } else { Samples::FOUR }),
            facing,
            outline: research.outline,
            accumulator: research.accumulator.unwrap_or_default(),
            organisation: research.organisation.unwrap_or_default(),
            fetch: research.fetch,
            large: research.large,
            raster,
            edl: look.edl,
            shading: look.shading.or(unlit.then_some(Shading::Unlit)).or(suggested.shading).unwrap_or(default.shading),
            shading_at: research.shading_at.unwrap_or_default(),
            shininess: look.shininess.unwrap_or(default.shininess),
            lights: if look.lights.is_empty() { default.lights } else { look.lights.clone() },
            background: look.background.map_or(default.background, |Rgba(color)| color),
            maps: Maps::of(&maps.aov).rendered(),
            without: research.without.clone(),
            sources: research.sources.clone(),
            own_kernel: None,
        };
        let fades = suggested.views && levels.lod_fade.is_none() && check::fades(&settings).is_ok();
        Settings { detail_fades: settings.detail_fades || fades, ..settings }
    }

    /// Whether the options replace the kernel that Gaussians are trained with.
    pub fn replaces_gaussians(&self) -> bool {
        let is_own = |sigma: f64| (sigma * gaussian::EXTENT - 1.0).abs() < 1e-6;
        self.surface.kernel.is_some_and(|kernel| !matches!(kernel, Kernel::Gaussian { sigma } if is_own(sigma)))
    }

    /// Returns the shape of points that face the camera, with its limits in pixels.
    fn facing(&self) -> Option<Facing> {
        let pixels = match (self.points.point_size, self.points.pixels) {
            (Some(PointSize::Pixels(diameter)), _) => [diameter; 2],
            (_, Some(Diameters(pixels))) => pixels,
            (_, None) => Facing::LIMITS,
        };
        self.points.facing.map(|shape| Facing { shape, pixels })
    }

    /// Returns the rasteriser's target format and depth test.
    pub(crate) fn raster(&self) -> Raster {
        let default = Raster::default();
        Raster {
            format: self.research.blend_format.unwrap_or(default.format),
            depth: self.research.raster_depth.unwrap_or(default.depth),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn options_that_say_nothing_are_the_default_settings_but_for_samples() {
        let settings = RenderOptions::default().settle(None, Suggested::default());
        assert_eq!(settings, Settings { samples: Samples::FOUR, ..Settings::default() });
    }

    #[test]
    fn gaussians_are_drawn_as_trained_unless_the_options_say_otherwise() {
        let suggested = Suggested { gaussians: true, ..Suggested::default() };
        let mut options = RenderOptions::default();
        let settings = options.settle(None, suggested);
        assert_eq!((settings.kernel, settings.low_pass), (gaussian::KERNEL, LowPass::Gaussians));
        assert_eq!((settings.composite, settings.samples), (Composite::Gaussians, Samples::ONE));
        assert_eq!(settings.shading, Shading::Unlit);
        assert_eq!(options.settle(Some(BackendName::Raster), suggested).composite, Composite::Opaque);
        options.surface.kernel = Some("constant".parse().unwrap());
        options.transparency.composite = Some(Composite::Opaque);
        let settings = options.settle(None, suggested);
        assert_eq!((settings.low_pass, settings.composite), (LowPass::None, Composite::Opaque));
        assert!(options.replaces_gaussians());
    }

    #[test]
    fn cuts_fade_between_many_views_where_they_can() {
        let suggested = Suggested { views: true, ..Suggested::default() };
        let mut options = RenderOptions::default();
        assert!(options.settle(None, suggested).detail_fades);
        assert!(!options.settle(Some(BackendName::Raster), suggested).detail_fades);
        options.levels.lod_fade = Some(Switch(false));
        assert!(!options.settle(None, suggested).detail_fades);
    }
}
