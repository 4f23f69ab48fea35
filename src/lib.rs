//! Headless rendering of surfels and point clouds with compute kernels only.
//!
//! A surfel is an oriented elliptical disk. Rendering blends the disks that make up the nearest surface at each pixel
//! (Pajarola et al. 2003, Botsch et al. 2005), in four stages, each a file of [`passes`] with a kernel and an f64 twin:
//!
//! ```text
//! splats = project(surfels, camera)             (u, v, 1)/z = [s t p]^-1 K^-1 (x, y, 1)
//! depth  = visibility(splats)                   nearest(x, y) = min z over the disks, u^2 + v^2 <= 1
//! sums   = accumulate(splats, depth, epsilon)   sum of w and of w a where z <= nearest + epsilon, w = exp(-a rho^n)
//! frame  = resolve(sums, lights)                attribute = (sum of w a) / (sum of w), shaded
//! ```
//!
//! Four rules make it one design:
//!
//! 1. Each fragment is quantised, then integers are added: the same scene gives the same bits, in any order.
//! 2. Only what a scene needs exists: [`plan::SceneNeeds`] chooses the files that are joined into a kernel.
//! 3. WGSL states a layout, [`gpu::layout`] mirrors it, a test decides.
//! 4. Every kernel has a twin in f64, which is the oracle of each error figure and the backend without an adapter.
//!
//! ```
//! use epsplat::render::{Backend, render};
//! use epsplat::plan::RenderOptions;
//! use epsplat::scene::{Camera, Lens};
//!
//! let points = epsplat::io::Points {
//!     positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
//!     ..Default::default()
//! };
//! let (scene, _) = epsplat::surfels::build(vec![points], &())?;
//! let camera = Camera::framing((64, 64), Lens::Fov(45.0), &scene, Camera::default_near(&scene))?;
//! let (frame, report) = render(&scene, &camera, &RenderOptions::default(), &Backend::Reference, &())?;
//! assert!(frame.color.iter().any(|pixel| pixel[3] > 0.0));
//! assert_eq!(report.surfels, 4);
//! # Ok::<(), epsplat::Error>(())
//! ```

#[cfg(feature = "bench")]
pub mod bench;
pub mod error;
pub mod frame;
pub mod gpu;
pub mod guide;
#[cfg(feature = "bench")]
pub mod hardcases;
pub mod io;
mod memory;
#[cfg(feature = "bench")]
pub mod metrics;
mod morton;
pub mod options;
pub mod passes;
pub mod plan;
pub mod progress;
mod random;
pub mod render;
#[cfg(feature = "bench")]
pub mod report;
pub mod scene;
mod sets;
pub mod surfels;
pub mod truth;

pub use error::{Error, Result};
pub use progress::Progress;
pub use render::inspect;
