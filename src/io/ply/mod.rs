//! PLY: a streaming reader for clouds of tens of millions of vertices, and a writer of surfels.

mod header;
mod read;
mod vertex;
mod write;

pub use read::read;
pub use write::{Properties, Vertex, write};
