//! Tests the pixels of every mode and option against the f64 reference, formulas and cast rays.
//!
//! One test program, so that shared test code and kernels compile once.

mod adapters;
mod among_layers;
mod cameras;
mod clips;
#[path = "../common/mod.rs"]
mod common;
mod copies;
mod curved;
mod cutouts;
mod facing;
mod far;
mod frames;
mod gaussians;
mod hard_cases;
mod images;
mod invariance;
mod layers;
mod lenses;
mod machines;
mod materials;
mod matrix;
mod nearest;
mod oit;
mod on_device;
mod parts;
mod pictures;
mod points;
mod programs;
mod properties;
mod raster;
mod refusals;
mod samples;
mod separate;
mod solid;
mod texture;
mod traffic;
mod transparency;
mod triangles;
mod visible;
