//! The device: adapter and limits, paged buffers, joined kernels, timing, and the layout shared with WGSL.

pub mod adapter;
pub mod buffers;
pub mod device;
pub mod kernel;
pub mod layout;
mod loops;
pub mod program;
pub mod sources;
pub mod timing;

pub use adapter::AdapterDescription;
pub use device::{Gpu, adapters};
pub use sources::Sources;
