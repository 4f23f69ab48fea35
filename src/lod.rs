//! Levels of detail: a tree of surfels, whose cuts are coarser versions of a scene.
//!
//! ```no_run
//! use epsplat::{lod, low_level::surfels, Files};
//!
//! let files = Files::new(["scan.ply"], &Default::default())?;
//! let (scene, _) = surfels::build(files.read(&())?, &())?;
//! let (scene, tree) = lod::build(scene, &())?;
//! let coarse = lod::Cut::by_length(&tree, 0.05).scene(&scene, &tree, true);
//! epsplat::io::ply::write_scene("coarse.ply".as_ref(), &coarse, None, &())?;
//! # Ok::<(), epsplat::Error>(())
//! ```

pub use crate::scene::{Cut, Detail, Hierarchy};
pub use crate::surfels::hierarchy::build;
pub use crate::surfels::hierarchy::out_of_core::write_levels;
