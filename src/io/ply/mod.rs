//! PLY: a streaming reader for clouds of tens of millions of vertices and for meshes, and a writer of surfels.
//!
//! Written files are binary little-endian; each vertex has those of these properties that are known, in this order:
//!
//! | properties | type | what |
//! |---|---|---|
//! | `x y z` | `float`, or `double` where an f32 would lose digits | centre p, world units |
//! | `nx ny nz` | `float` | normal, outward |
//! | `radius` | `float` | radius of the disk, world units; of an ellipse its longer half-axis |
//! | `sx sy sz tx ty tz` | `float` | half-axes s and t of the ellipse p + u s + v t, u² + v² <= 1, world units; its normal is s x t |
//! | `red green blue` | `uchar`: 8-bit sRGB; `float`: linear light | colour |
//! | `alpha` | as the colour | opacity, straight |
//! | `texture_u texture_v` | `float` | texture coordinates, origin bottom left |
//! | `texnumber` | `int` | which of several textures these coordinates are in, -1 of none |
//! | `texture_u_x texture_u_y texture_u_z texture_v_x texture_v_y texture_v_z` | `float` | what they gain for a world unit along x, y and z |
//!
//! Levels of detail are another element `node` after the vertices, which are in the order of the tree: `x y z`, `radius` of a sphere around what is
//! below, larger where that does not lie on the node's cap, half-axes, caps and colour as above, `cone`, the smallest cosine of the angle between a
//! normal below and its own (-1: normals have no side), and `first`, `count` and `leaf`, which nodes, or of a leaf which vertices, are below it ([`Hierarchy`](crate::scene::Hierarchy)). A third
//! element `scene` says of all vertices together what one who reads a part must know: origin, bounds, ranges ([`Whole`](crate::scene::Whole)).
//!
//! The header has a comment `up y` or `up z` where that is known, `closed` for surfels that cover a closed surface, `unsided` where normals tell no sides, and `triangles NAME`
//! for those that are drawn beside a mesh in the same folder, which has the comment `hybrid`: no
//! other program says it in a PLY file, and none stumbles over it.
//!
//! Files of Gaussians, whose vertices have other names, are read too ([`read`]), and SuperSplat's
//! compressed ones.
//!
//! The names of normals, colours and texture coordinates are those of MeshLab, which ignores the half-axes, as do
//! CloudCompare and Open3D: to them such a file is a cloud with normals and colours.

mod ascii;
mod binary;
mod contents;
mod face_colors;
mod faces;
mod gaussian;
mod header;
mod kept_nodes;
mod levels;
mod packed;
mod read;
mod rows;
mod tint;
mod vertex;
mod whole;
mod write;
mod write_gaussians;
mod write_mesh;
mod write_scene;

pub(crate) use kept_nodes::KeptNodes;
pub use levels::Levels;
pub(super) use read::companions;
pub use read::{read, read_mesh, textures_of_hybrid};
pub use rows::Rows;
pub(crate) use rows::position;
pub use write::{Color, ColorProperties, Properties, Vertex, check_extension, write, write_points};
pub use write_mesh::write_mesh;
pub use write_scene::write_scene;
pub(crate) use write_scene::{Nodes, needs_double, write_kept};
