//! PLY: a streaming reader for meshes and clouds of tens of millions of vertices, and writers.
//!
//! Written files are binary little-endian. A vertex has the following properties as far as they are
//! known, in this order:
//!
//! | properties | type | content |
//! |---|---|---|
//! | `x y z` | `float`, or `double` where an f32 would lose digits | centre p, world units |
//! | `nx ny nz` | `float` | normal, outward |
//! | `radius` | `float` | radius, or longer half-axis of an ellipse, world units |
//! | `sx sy sz tx ty tz` | `float` | half-axes s and t, world units |
//! | `clip1_u` to `clip2_w` | `float` | lines that cut the disk ([`Clip`](crate::scene::Clip)) |
//! | `cap_uu cap_uv cap_vv` | `float` | curvature, world units ([`Cap`](crate::scene::Cap)) |
//! | `red green blue` | `uchar`: 8-bit sRGB; `float`: linear light | colour |
//! | `alpha` | as the colour | opacity, straight |
//! | `texture_u texture_v` | `float` | texture coordinates, origin bottom left |
//! | `texnumber` | `int` | index of the texture, or -1 for none |
//! | `texture_u_x` to `texture_v_z` | `float` | change of u and v per world unit along x, y, z |
//!
//! The ellipse is p + u s + v t with u² + v² <= 1, and its normal is s x t.
//!
//! Levels of detail are a tree of nodes: the element `node`, after the vertices. The vertices are
//! in the order of the tree. A node has `x y z`, `radius`, half-axes, cap and colour as above, and
//! `cone first count leaf`:
//!
//! - `radius` is that of a sphere around everything below the node. It is larger than necessary
//!   where surfels lie off the node's cap.
//! - `cone` is the smallest cosine of the angle between the node's normal and a normal of the
//!   surfels below it; -1 if normals have no side.
//! - `first` and `count` are the range of the node's children, or of the vertices of a leaf; `leaf`
//!   says which ([`Hierarchy`](crate::scene::Hierarchy)).
//!
//! An element `scene` then holds facts of all vertices together, for programs that read only a part
//! of the file: origin, bounds and ranges ([`Whole`](crate::scene::Whole)).
//!
//! The header may have these comments, which no other program writes or reads: `up y` or `up z`;
//! `closed` for surfels that cover a closed surface; `unsided` if normals have no side;
//! `triangles NAME` for surfels that are drawn together with a mesh in the same folder, and
//! `hybrid` in the file of that mesh.
//!
//! Files of Gaussians, whose vertices have other properties, are read too ([`read`]), and so are
//! SuperSplat's compressed Gaussians.
//!
//! Normals, colours and texture coordinates have MeshLab's names. MeshLab, CloudCompare and Open3D
//! ignore the half-axes, and show such a file as a cloud with normals and colours.

mod ascii;
mod binary;
mod column;
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
mod table;
mod tint;
mod vertex;
mod whole;
mod write;
mod write_gaussians;
mod write_mesh;
mod write_scene;

pub use column::Column;
pub(crate) use kept_nodes::KeptNodes;
pub use levels::Levels;
pub(super) use read::companions;
pub use read::{read, read_mesh, textures_of_hybrid};
pub use rows::Rows;
pub(crate) use rows::position;
pub(super) use table::Table;
pub use write::{Color, ColorProperties, Properties, Vertex, check_extension, write, write_points, write_points_with};
pub use write_mesh::write_mesh;
pub use write_scene::write_scene;
pub(crate) use write_scene::{Nodes, needs_double, write_kept};
