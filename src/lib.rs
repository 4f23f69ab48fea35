//! x
pub mod error;
pub mod frame;
pub mod gpu;
pub mod inspect;
pub mod io;
pub mod passes;
pub mod progress;
pub mod render;
pub mod scene;
pub mod surfels;

pub use error::{Error, Result};
pub use progress::Progress;
