//! Headless rendering of surfels and point clouds with compute kernels only.
//!
//! A surfel is an oriented elliptical disk. At each pixel, rendering blends the disks that make up
//! the nearest surface (Pajarola et al. 2003, Botsch et al. 2005). It has four stages. Each stage
//! is a file of [`low_level::passes`] with a kernel and an f64 twin:
//!
//! ```text
//! splats = project(surfels, camera)             (u, v, 1)/z = [s t p]^-1 K^-1 (x, y, 1)
//! depth  = visibility(splats)                   nearest(x, y) = min z over disks, u^2 + v^2 <= 1
//! sums   = accumulate(splats, depth, epsilon)   sums of w and w a where z <= nearest + epsilon
//! frame  = resolve(sums, lights)                attribute = (sum of w a) / (sum of w), shaded
//! ```
//!
//! Four rules make it one design:
//!
//! 1. Each fragment is quantised, then integers are added: the same scene gives the same bits,
//!    in any order of its surfels.
//! 2. Kernels contain only what a scene needs: [`low_level::plan::SceneNeeds`] chooses the WGSL
//!    files that are joined.
//! 3. WGSL defines each struct that host and device share, [`low_level::gpu::layout`] mirrors
//!    it, and a test compares the two.
//! 4. Every kernel has an f64 twin. Error figures are measured against the twins, which also
//!    render where there is no adapter.
//!
//! An option goes from a group in [`options`] through its `settle`, which decides what is left
//! open, to [`low_level::plan::Settings`]. `plan/view.rs` makes numbers of it for the kernels'
//! uniform `View`, and [`low_level::plan::SceneNeeds`] chooses WGSL files by it.
//!
//! ```
//! use epsplat::{DeviceOptions, Map, Points, Renderer, RenderOptions, Scene, SceneOptions, View};
//!
//! let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
//! let points = Points { positions, ..Points::default() };
//! // Scene::open reads files.
//! let scene = Scene::from_points(vec![points], &SceneOptions::default());
//! let mut options = RenderOptions::default();
//! options.maps.aov = vec![Map::Depth];
//! // The best adapter that there is, or the f64 reference where there is none.
//! let mut renderer = Renderer::new(&scene, &options, &DeviceOptions::default(), &())?;
//! let picture = renderer.frame(&View::default(), &())?;
//! assert!(picture.frame.color.iter().any(|pixel| pixel[3] > 0.0));
//! assert_eq!(picture.frame.map(Map::Depth).map(<[f32]>::len), Some(1024 * 1024));
//! assert_eq!(picture.report.surfels, 4);
//! # Ok::<(), epsplat::Error>(())
//! ```

mod address;
mod error;
pub mod guide;
mod hash;
pub mod io;
pub mod lod;
pub mod low_level;
mod memory;
mod morton;
pub mod options;
mod progress;
mod random;
mod sets;
mod stage;

pub use glam;
pub use wgpu;

pub use error::{Error, Result};
pub use io::{Mesh, Points, Texture};
pub use low_level::frame::Frame;
pub use low_level::gpu::Gpu;
pub use low_level::render::{FrameLayout, Plane, Receipt, Report, Target, Ticket};
pub use low_level::scene::{Bounds, Camera, Grid, Lens, Map, Maps, Share, Side, Up};
pub use options::{CameraOptions, DeviceOptions, RenderOptions, SceneOptions};
pub use progress::Progress;
pub use stage::{Files, Given, Picture, ReadReport, Renderer, Scene, Survey, View, ViewReport, Visible};
#[cfg(feature = "parts")]
pub use stage::{Merged, Part, Ranked, merge, merge_files};

// Modules inside the library import these as `crate::...`, without `low_level`.
use low_level::{annotate, frame, gpu, network, passes, plan, render, scene, surfels, truth};
#[cfg(feature = "bench")]
use low_level::{bench, hardcases, metrics, report};
