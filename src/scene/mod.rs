//! What is rendered: surfels, camera, lights, options. Knows no GPU and no file.

mod apart;
mod body;
pub mod camera;
pub mod cap;
pub mod clip;
pub mod color;
pub mod composite;
mod copies;
pub mod facing;
pub mod framing;
pub mod gaussian;
pub mod harmonics;
mod join;
pub mod kernel;
pub mod light;
pub mod maps;
pub mod options;
pub mod outline;
mod provenance;
#[expect(clippy::module_inception, reason = "the file is named for the type it holds")]
pub mod scene;
mod srgb;
pub mod surfel;
pub mod texture;
pub mod triangles;

pub(crate) use body::{SMALLEST_SCENE, body, framed};
pub use camera::{Camera, Lens, Projection};
pub use cap::Cap;
pub use clip::Clip;
pub use color::Colors;
pub use composite::{Composite, Tail};
pub(crate) use copies::{copies, has_copies};
pub use facing::{Facing, PointShape, PointSize};
pub use harmonics::Harmonics;
pub use join::Join;
pub use kernel::{Kernel, KernelShape};
pub use light::Light;
pub use maps::{MAPS, Map, Maps};
pub use options::{Blend, Cull, Epsilon, LowPass, Samples, Shading, ShadingAt};
pub use outline::Outline;
pub use provenance::Provenance;
pub use scene::{Bounds, Scene, Up};
pub use surfel::Surfel;
pub use texture::{Place, Texture, Textured};
pub use triangles::{Triangle, Triangles};
