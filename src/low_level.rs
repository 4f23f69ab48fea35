//! The parts that the [crate root](crate) is built from: stages, data and measurements.
//!
//! These modules are for research and for tests: a kernel, a plan or a pass can be looked at and
//! replaced. They change from version to version without notice. Programs that want pictures use
//! the crate root.

#[path = "annotate/mod.rs"]
pub mod annotate;
#[cfg(feature = "bench")]
#[path = "bench/mod.rs"]
pub mod bench;
#[path = "frame.rs"]
pub mod frame;
#[path = "gpu/mod.rs"]
pub mod gpu;
#[cfg(feature = "bench")]
#[path = "hardcases/mod.rs"]
pub mod hardcases;
#[cfg(feature = "bench")]
#[path = "metrics/mod.rs"]
pub mod metrics;
#[path = "network/mod.rs"]
pub mod network;
#[path = "passes/mod.rs"]
pub mod passes;
#[path = "plan/mod.rs"]
pub mod plan;
#[path = "render/mod.rs"]
pub mod render;
#[cfg(feature = "bench")]
#[path = "report/mod.rs"]
pub mod report;
#[path = "scene/mod.rs"]
pub mod scene;
#[path = "surfels/mod.rs"]
pub mod surfels;
#[path = "truth/mod.rs"]
pub mod truth;

pub use render::inspect;
