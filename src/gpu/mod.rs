//! The device: adapter and limits, paged buffers, joined kernels, timing, and the layout shared with WGSL.

pub mod buffers;
pub mod device;
pub mod kernel;
pub mod layout;
mod loops;
pub mod timing;

pub use device::{AdapterDescription, Gpu, adapters};
pub use kernel::Sources;
