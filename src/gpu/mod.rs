//! The graphics device: adapters and limits, paged buffers, kernels, timing, and the layout shared
//! with WGSL.

pub mod adapter;
pub mod ahead;
pub mod buffers;
pub mod device;
pub(crate) mod evaluate;
pub mod exact;
mod given;
pub mod interface;
pub mod kernel;
pub mod layout;
mod loops;
mod module;
pub mod program;
mod recent;
mod replacement;
pub(crate) mod runs;
pub mod sources;
mod spare;
mod spirv;
mod stored;
pub mod timing;
mod traffic;
mod twin;

pub use adapter::AdapterDescription;
pub use device::{Gpu, adapters};
pub use replacement::Replacement;
pub use sources::Sources;
pub use traffic::Traffic;
pub use twin::{Calls, KernelTally, Tally};
