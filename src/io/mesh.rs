//! The triangles of one input file, as they are.

use crate::scene::Colors;

/// A triangle mesh as a file gives it: f64 world coordinates and whatever attributes exist.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// World coordinates of the vertices.
    pub positions: Vec<[f64; 3]>,
    /// The vertices of each triangle, by their index in `positions`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// One normal for each corner of each triangle, any length; zero or non-finite means missing. Without them the mesh is
    /// faceted: a triangle (a, b, c) has the normal `(b - a) x (c - a)`.
    pub normals: Option<Vec<[[f32; 3]; 3]>>,
    /// One colour for each vertex.
    pub colors: Option<Colors>,
}
