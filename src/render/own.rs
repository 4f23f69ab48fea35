//! WGSL files that a user puts in the place of built-in ones, and their twins.

use super::Backend;
use crate::error::{Error, Result};
use crate::gpu::Sources;
use crate::gpu::evaluate::{Evaluated, Fault};
use crate::passes::footprint::kernel_file;
use crate::plan::RenderOptions;
use crate::scene::own_kernel::{Endless, OwnKernel};

/// Returns the WGSL files of a render, and its options with the twin of a blending kernel that the
/// user wrote.
///
/// # Errors
/// [`Error::Usage`] for a file that does not exist, a kernel that the picture does not use, or a
/// kernel that cannot be evaluated in f64; and errors of reading.
pub(super) fn settled(backend: &Backend, options: &RenderOptions) -> Result<(Sources, RenderOptions)> {
    let given = match backend {
        Backend::Gpu { sources, .. } => sources.clone(),
        Backend::Reference => Sources::default(),
    };
    if options.sources.is_empty() {
        return Ok((given, options.clone()));
    }
    let sources = given.with(&options.sources)?;
    let (used, overrides) = kernel_file(options.kernel);
    let is_kernel = |file: &str| file.starts_with("kernel_");
    if let Some(other) = options.sources.iter().map(|own| own.file()).find(|file| is_kernel(file) && *file != used) {
        return Err(Error::Usage(format!("the picture is drawn by {used} and not by {other}: choose its kernel")));
    }
    let mut options = options.clone();
    if let (None, Some((text, name))) = (&options.own_kernel, sources.replaced(used)) {
        options.own_kernel = Some(evaluated(text, name, &overrides)?);
    }
    Ok((sources, options))
}

/// Returns the twin of the kernel whose WGSL is `text`, in the file `name`.
fn evaluated(text: &str, name: &str, overrides: &[(&'static str, f64)]) -> Result<OwnKernel> {
    let refused =
        |fault: Fault| Error::Usage(format!("the kernel {name} cannot be evaluated in f64 for the reference: {fault}"));
    let function = Evaluated::new(text, "kernel_weight", overrides).map_err(refused)?;
    // Each branch may use something else: distances over the whole disk show most of them.
    for k in 0..=64 {
        match function.at((f64::from(k) / 64.0).powi(2)) {
            Err(fault @ Fault::Unsupported(_)) => return Err(refused(fault)),
            Ok(_) | Err(Fault::Endless) => {}
        }
    }
    Ok(OwnKernel::fallible(name, move |rho2| function.at(rho2).map_err(|_| Endless)))
}
