//! What is rendered: surfels, camera, lights, options. Knows no GPU and no file.

pub mod color;
pub mod surfel;

pub use color::Colors;
pub use surfel::Surfel;
