//! What is rendered: surfels, camera, lights, options. Knows no GPU and no file.

mod apart;
mod atlas;
mod body;
pub mod camera;
pub mod cap;
pub mod clip;
pub mod color;
pub mod composite;
mod copies;
pub mod cut;
pub(crate) mod detail;
pub mod facing;
pub mod fade;
pub mod framing;
pub mod gaussian;
pub mod harmonics;
pub mod hierarchy;
mod join;
pub mod kernel;
pub mod light;
pub mod maps;
pub mod mipmap;
pub mod octree;
pub mod options;
pub mod outline;
mod provenance;
mod reordered;
#[expect(clippy::module_inception, reason = "the file is named for the type it holds")]
pub mod scene;
mod srgb;
pub mod surfel;
pub mod texture;
pub mod triangles;
pub mod whole;

pub use atlas::Atlas;
pub(crate) use body::{
    Listed, Places, SMALLEST_SCENE, Sample, body, body_and_framed, body_within, framed, framed_within,
};
pub use camera::{Camera, Lens, Projection};
pub use cap::Cap;
pub use clip::Clip;
pub use color::Colors;
pub use composite::{Composite, Tail};
pub(crate) use copies::{by_content, copies, has_copies};
pub use cut::Cut;
pub use detail::{Detail, DetailMeasure};
pub use facing::{Facing, PointShape, PointSize};
pub use fade::Fade;
pub use harmonics::Harmonics;
pub use hierarchy::Hierarchy;
pub use join::Join;
pub use kernel::{Kernel, KernelShape};
pub use light::Light;
pub use maps::{MAPS, Map, Maps};
pub use mipmap::Mipmap;
pub use options::{Blend, Cull, Epsilon, LowPass, Samples, Shading, ShadingAt};
pub use outline::Outline;
pub use provenance::Provenance;
pub use scene::{Bounds, Scene, Up};
pub use surfel::Surfel;
pub use texture::{Place, Texture, Textured};
pub use triangles::{Triangle, Triangles};
pub use whole::{LevelFacts, Whole};
