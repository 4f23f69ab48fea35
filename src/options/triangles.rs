//! Meshes that are drawn as their triangles.

use std::path::PathBuf;
use std::str::FromStr;

use super::{LimitOptions, RenderOptions, SceneOptions};
use crate::error::Error;
use crate::io::ColorBy;

/// How the meshes of the inputs are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshAs {
    /// As their triangles.
    Triangles,
    /// As surfels that cover their triangles.
    Surfels,
}

impl FromStr for MeshAs {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "triangles" => Ok(Self::Triangles),
            "surfels" => Ok(Self::Surfels),
            _ => Err(Error::Usage(format!("a mesh is drawn as triangles or surfels, not {text:?}"))),
        }
    }
}

/// The largest angle between the normals of triangles that a smooth mesh joins, degrees: 0 to 180.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreaseAngle(pub f64);

impl FromStr for CreaseAngle {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let angle = text.parse().ok().filter(|angle| (0.0..=180.0).contains(angle));
        angle.map(Self).ok_or_else(|| {
            Error::Usage(format!("an angle of creases lies between 0 and 180 degrees, {text:?} does not"))
        })
    }
}

/// Meshes that are drawn as their triangles.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Meshes"))]
// Brackets in help texts hold defaults, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct TriangleOptions {
    /// Draw the meshes of the inputs as triangles or as surfels [default: triangles]
    ///
    /// Without this option a mesh is drawn as surfels if another option needs them, such as
    /// --facing, --kernel, --lod or --surfel-size
    #[cfg_attr(feature = "cli", arg(long, value_name = "AS"))]
    pub mesh: Option<MeshAs>,
    /// Give meshes smooth normals: those of triangles that meet at no more than ANGLE degrees are
    /// blended
    ///
    /// 30 keeps the edges of machine parts, 180 makes everything smooth. The option replaces the
    /// normals of the file
    #[cfg_attr(feature = "cli", arg(long, value_name = "ANGLE"))]
    pub smooth: Option<CreaseAngle>,
    /// Meshes drawn as triangles, beside surfels of the inputs or alone: .obj, .ply, .stl,
    /// .off, .glb or .gltf
    #[cfg_attr(feature = "cli", arg(long = "triangles", id = "triangles", value_name = "MESH", num_args = 1.., hide_short_help = true))]
    pub meshes: Vec<PathBuf>,
    /// Image for the triangles of meshes whose materials have no image: .png, .jpg, .bmp or .tga
    #[cfg_attr(feature = "cli", arg(long = "triangle-texture", value_name = "IMAGE", hide_short_help = true))]
    pub texture: Option<PathBuf>,
}

impl SceneOptions {
    /// Returns how the meshes of the inputs are drawn, and an option that needs surfels if one is
    /// given.
    pub fn mesh(&self, options: &RenderOptions) -> (MeshAs, Option<&'static str>) {
        let needed = self.option_of_surfels(options);
        let own = if needed.is_some() { MeshAs::Surfels } else { MeshAs::Triangles };
        (self.triangles.mesh.unwrap_or(own), needed)
    }

    /// Returns the name of a given option that has no meaning without surfels.
    fn option_of_surfels(&self, options: &RenderOptions) -> Option<&'static str> {
        let RenderOptions { surface, transparency, points, levels, maps, research, .. } = options;
        let given = [
            ("--outliers, --max-radius and --flat", self.surfels.limits != LimitOptions::default()),
            ("--color-by normal", self.colors.color_by == Some(ColorBy::Normal)),
            ("--texture with several images", self.surfels.textures.len() > 1),
            ("--surfel-size", self.surfels.size.is_some()),
            ("--facing", points.facing.is_some()),
            ("--lod", levels.lod.is_some()),
            ("--splats", levels.splats.is_some()),
            ("--epsilon", surface.epsilon.is_some()),
            ("--kernel", surface.kernel.is_some()),
            ("--blend", surface.blend.is_some()),
            ("--lowpass", surface.lowpass.is_some()),
            ("an order-free --composite", transparency.composite.is_some_and(|how| how.is_order_free())),
            ("--opacity", transparency.opacity.is_some()),
            ("--aov", maps.aov.iter().any(|map| map.row().of_surfels)),
            ("--source", !research.sources.is_empty()),
            ("--accumulator", research.accumulator.is_some()),
            ("--organisation", research.organisation.is_some()),
            ("--fetch", research.fetch.is_some()),
            ("--large", research.large.is_some()),
            ("--outline", research.outline.is_some()),
            ("--shading-at", research.shading_at.is_some()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(name, _)| name)
    }
}
