//! What a frame is made of, before a device is asked for anything.

mod accumulator;
mod facts;
mod needs;
mod optimisation;
mod options;
mod pixel;
mod raster;

pub use accumulator::{ACCUMULATORS, Accumulator, AccumulatorRow, Features};
pub use facts::Facts;
pub use needs::{ColorNeed, SMALL_WEIGHT, SceneNeeds};
pub use optimisation::Optimisation;
pub use options::{Organisation, RenderOptions};
pub use pixel::{COLOR_CHANNEL, PixelLayout, color_channels};
pub use raster::{BlendFormat, Raster, RasterDepth};
