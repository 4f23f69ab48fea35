//! Meshes that are drawn as their triangles.

use std::path::PathBuf;

/// Meshes that are drawn as their triangles.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Triangles"))]
pub struct TriangleOptions {
    /// Meshes drawn as triangles, beside the surfels of the inputs or alone: .obj or .ply
    #[cfg_attr(feature = "cli", arg(long = "triangles", id = "triangles", value_name = "MESH", num_args = 1..))]
    pub meshes: Vec<PathBuf>,
    /// Image for the triangles of meshes whose materials have no image: .png, .jpg, .bmp or .tga
    #[cfg_attr(feature = "cli", arg(long = "triangle-texture", value_name = "IMAGE", hide_short_help = true))]
    pub texture: Option<PathBuf>,
}
