//! What pictures show. One program for many files of tests: what they share is compiled once, and so are kernels.

#[path = "../adapters.rs"]
mod adapters;
#[path = "../cameras.rs"]
mod cameras;
#[path = "../clips.rs"]
mod clips;
#[path = "../common/mod.rs"]
mod common;
#[path = "../copies.rs"]
mod copies;
#[path = "../curved.rs"]
mod curved;
#[path = "../facing.rs"]
mod facing;
#[path = "../far.rs"]
mod far;
#[path = "../frames.rs"]
mod frames;
#[path = "../gaussians.rs"]
mod gaussians;
#[path = "../hard_cases.rs"]
mod hard_cases;
#[path = "../images.rs"]
mod images;
#[path = "../invariance.rs"]
mod invariance;
#[path = "../layers.rs"]
mod layers;
#[path = "../materials.rs"]
mod materials;
#[path = "../matrix/main.rs"]
mod matrix;
#[path = "../nearest.rs"]
mod nearest;
#[path = "../oit.rs"]
mod oit;
#[path = "../pictures.rs"]
mod pictures;
#[path = "../points.rs"]
mod points;
#[path = "../properties.rs"]
mod properties;
#[path = "../raster.rs"]
mod raster;
#[path = "../refusals.rs"]
mod refusals;
#[path = "../samples.rs"]
mod samples;
#[path = "../separate.rs"]
mod separate;
#[path = "../texture/main.rs"]
mod texture;
#[path = "../transparency.rs"]
mod transparency;
#[path = "../triangles.rs"]
mod triangles;
