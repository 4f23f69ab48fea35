//! The settings of a picture, from the options and the scene.

use super::Request;
use crate::error::{Error, Result};
use crate::io::ColorBy;
use crate::options::Suggested;
use crate::plan::{Facts, Settings, check};
use crate::progress::Progress;
use crate::scene::composite::ALL_LAYERS;
use crate::scene::{Blend, Colors, Composite, Scene, Shading};

impl Request<'_> {
    /// Returns the settings before any input is read, as if the scene had no Gaussians.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that cannot be combined.
    pub fn settings(&self) -> Result<Settings> {
        let settings = self.settled(false)?;
        if self.options.marks.legend && !self.scene.options.colors.is_given() {
            let what = "--legend shows the values of --color-by: give an attribute there, or leave --legend out";
            return Err(Error::Usage(what.into()));
        }
        if self.options.points.facing.is_some() && self.scene.options.colors.color_by == Some(ColorBy::Normal) {
            return Err(Error::Usage("--facing leaves points no normals: leave it or --color-by normal out".into()));
        }
        if let Some(factor) = self.surfels().radius_scale {
            if !(1e-6..=1e6).contains(&factor) {
                return Err(Error::Usage(format!("--radius-scale is a factor from 1e-6 to 1e6, not {factor}")));
            }
            if !settings.detail.is_finest() {
                let what = "levels of detail have radii of their own: leave --radius-scale out, or --lod and --splats";
                return Err(Error::Usage(what.into()));
            }
        }
        if self.surfels().textures.is_empty() {
            return Ok(settings);
        }
        if self.scene.options.colors.is_given() {
            return Err(Error::Usage("--color-by replaces the colours of an image: leave it or --texture out".into()));
        }
        if self.options.points.facing.is_some() {
            return Err(Error::Usage("--facing leaves points no plane to paint: leave it or --texture out".into()));
        }
        // In transparent pictures each surfel takes its texture's mean colour (whole.rs), so the
        // check is made as if the picture were opaque.
        let opaque = Settings { composite: Composite::Opaque, ..settings.clone() };
        check::textured(&opaque, self.is_reference())?;
        Ok(settings)
    }

    /// Returns the settings for a scene. Gaussians are drawn by the rules of their training, unless
    /// the options say otherwise.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that cannot be used with Gaussians.
    pub fn for_scene(&self, settings: Settings, scene: &Scene, progress: &dyn Progress) -> Result<Settings> {
        if settings.blend == Blend::Nearest && matches!(scene.colors, Colors::Linear(_)) {
            progress.note(
                "--blend nearest stores 8-bit colours: finer ones are rounded, and values above white are clamped",
            );
        }
        if !scene.encoded {
            if self.hides_what_lies_behind(&settings, scene) {
                progress.note(
                    "some colours are translucent, and only the nearest surface shows: --composite layers also draws what \
                     lies behind",
                );
            }
            return Ok(settings);
        }
        let settings = self.settled(true)?;
        // --facing, the rasteriser and --blend nearest never draw the Gaussians' own kernel.
        let has_kernel = settings.facing.is_none() && settings.raster.is_none() && settings.blend != Blend::Nearest;
        if has_kernel && self.options.replaces_gaussians() {
            progress.note(
                "warning: --kernel takes the place of the Gaussians' own: leave it out for pictures as they were trained",
            );
        }
        Ok(settings)
    }

    /// Whether surfaces are translucent and nobody said how they are composited.
    fn hides_what_lies_behind(&self, settings: &Settings, scene: &Scene) -> bool {
        let chosen = self.options.transparency.composite.is_some() || settings.composite != Composite::Opaque;
        let layers_can_be_drawn = || {
            let layered = Settings { composite: Composite::Layers(ALL_LAYERS), ..settings.clone() };
            check::options(&layered, self.is_reference())
                .and_then(|()| check::scene(&Facts::of(scene), &layered, self.is_reference()))
                .is_ok()
        };
        // With layers, translucent meshes of the inputs are drawn as surfels.
        let turns_to_surfels = self.triangles().mesh.is_none() && self.triangles().meshes.is_empty();
        let of_triangles = scene.triangles.colors().as_flattened().iter().any(|[.., alpha]| *alpha < 1.0);
        let of_surfels = !scene.surfels.is_empty() && scene.color_range().0[3] < 1.0;
        let through_triangles = of_triangles || (settings.opacity < 1.0 && !scene.triangles.is_empty());
        let can = if through_triangles { turns_to_surfels } else { layers_can_be_drawn() };
        !chosen && (settings.opacity < 1.0 || of_surfels || of_triangles) && can
    }

    fn settled(&self, gaussians: bool) -> Result<Settings> {
        let one_input = self.scene.count() < 2;
        // Unlit, the colours of an attribute are those of its legend.
        let shading = self.scene.options.colors.is_given().then_some(Shading::Unlit);
        let suggested = Suggested { gaussians, shading, views: self.views, one_input };
        let settings = self.options.settle(self.backend(), suggested);
        self.options.check(self.backend(), &settings)?;
        Ok(settings)
    }
}
