//! Compiles kernels before the scene is there.

use super::kept::Kept;
use super::{Backend, encoded, own, parts, without_optimisations};
use crate::error::Result;
use crate::plan::{Facts, Settings};
use crate::scene::{Camera, Scene};

/// Compiles the kernels for a first frame of `surfels` surfels that are like those of `scene`.
///
/// # Errors
/// The errors of a frame, which meets them again.
pub(crate) fn warm(scene: &Scene, surfels: u64, camera: &Camera, options: &Settings, backend: &Backend) -> Result<()> {
    let Backend::Gpu { gpu, .. } = backend else { return Ok(()) };
    let (sources, options) = own::settled(backend, options)?;
    let facts = Facts { surfels, ..Facts::of(scene) };
    for options in parts::parts(&facts, &encoded::of(&facts, &options)) {
        let (sources, camera) = (without_optimisations(&sources, &options), camera.sampled(options.samples)?);
        Kept::new(facts.clone(), options.clone()).warm((gpu, &sources), &camera)?;
    }
    Ok(())
}
