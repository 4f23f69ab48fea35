//! What one input file holds, before it becomes surfels.

use crate::scene::Colors;
pub use crate::scene::Up;

/// Points as a file gives them: f64 world coordinates and whatever attributes exist.
///
/// A reader reports what it found and, but for deleted points, all of it, and repairs nothing: a non-finite coordinate, a zero normal or a radius that is
/// not positive stay as they are, and [`crate::surfels::build`] drops or estimates them, and counts them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// World coordinates.
    pub positions: Vec<[f64; 3]>,
    /// One normal each, any length; zero or non-finite means missing.
    pub normals: Option<Vec<[f32; 3]>>,
    /// One disk radius each, world units; not positive or not finite means missing.
    pub radii: Option<Vec<f32>>,
    /// Half-axes s and t of one elliptical disk each, world units, with the normal s x t; they stand in for normal and radius
    /// where they span an ellipse. Zero, parallel or non-finite ones mean missing.
    pub axes: Option<Vec<[[f32; 3]; 2]>>,
    /// Colours, [`Colors::Srgb8`] or [`Colors::Linear`].
    pub colors: Option<Colors>,
    /// Texture coordinates (u, v), origin bottom left as in OBJ.
    pub texture: Option<Vec<[f32; 2]>>,
    /// The direction that the format, by convention, calls up.
    pub up: Option<Up>,
    /// Radii are those with which disks at the vertices cover the triangles of a mesh.
    pub of_mesh: bool,
    /// Points that the file holds and that were left out, as it marks them as withheld, which is deleted.
    pub withheld: u64,
    /// The numbers, in order, of all points that the file holds and that were left out; they start at 0.
    pub left_out: Vec<u64>,
}
