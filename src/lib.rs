//! x
pub mod error;
pub mod io;
pub mod progress;
pub mod scene;
pub mod surfels;

pub use error::{Error, Result};
pub use progress::Progress;
