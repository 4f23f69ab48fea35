//! What is rendered: surfels, camera, lights, options. Knows no GPU and no file.

pub mod color;
#[expect(clippy::module_inception, reason = "the file is named for the type it holds")]
pub mod scene;
pub mod surfel;

pub use color::Colors;
pub use scene::{Bounds, Scene, Up};
pub use surfel::Surfel;
