//! WGSL files that a user puts in the place of built-in ones, and their twins.

use super::Backend;
use crate::error::{Error, Result};
use crate::gpu::Sources;
use crate::gpu::evaluate::{Evaluated, Fault};
use crate::passes::footprint::kernel_file;
use crate::plan::Settings;
use crate::scene::own_kernel::{Endless, KernelFaults, OwnKernel};
use crate::scene::{Blend, PointShape};

/// Distances from a disk's centre at which a kernel's text is evaluated before it is used.
const TRIED: u32 = 1024;

/// Returns the WGSL files of a render, and its options with the twin of a blending kernel that the
/// user wrote.
///
/// # Errors
/// [`Error::Usage`] for a file that does not exist, a kernel that the picture does not use, or a
/// kernel that is not valid or cannot be evaluated in f64; and errors of reading.
pub(super) fn settled(backend: &Backend, options: &Settings) -> Result<(Sources, Settings)> {
    let given = match backend {
        Backend::Gpu { sources, .. } => sources.clone(),
        Backend::Reference => Sources::default(),
    };
    if options.sources.is_empty() {
        return Ok((given, options.clone()));
    }
    let sources = given.with(&options.sources)?;
    let (used, overrides) = kernel_file(options.kernel);
    let mut kernels = options.sources.iter().map(|own| own.file()).filter(|file| file.starts_with("kernel_"));
    if let (Blend::Nearest, Some(kernel)) = (options.blend, kernels.clone().next()) {
        return Err(Error::Usage(format!("--blend nearest has no weights: leave the kernel {kernel} out")));
    }
    if let Some(other) = kernels.find(|file| *file != used) {
        return Err(Error::Usage(format!("the picture is drawn by {used} and not by {other}: choose its kernel")));
    }
    let mut options = options.clone();
    if let (None, Some((text, name))) = (&options.own_kernel, sources.replaced(used)) {
        options.own_kernel = Some(evaluated(text, name, &overrides)?);
    }
    Ok((sources, options))
}

/// Counts the wrong weights of a kernel that the user wrote, over all distances that are drawn.
pub(super) fn faults(options: &Settings) -> Option<KernelFaults> {
    let square = options.facing.is_some_and(|facing| facing.shape == PointShape::Square);
    options.own_kernel.as_ref().map(|own| own.faults(if square { 2f64.sqrt() } else { 1.0 }))
}

/// Returns the twin of the kernel whose WGSL is `text`, in the file `name`.
fn evaluated(text: &str, name: &str, overrides: &[(&'static str, f64)]) -> Result<OwnKernel> {
    let refused = |fault: Fault| {
        Error::Usage(match fault {
            Fault::Invalid(Some((line, column)), what) => {
                format!("the kernel {name}:{line}:{column}: {what} (a blending kernel uses no other file)")
            }
            Fault::Endless => format!("the kernel {name} has a loop that does not end"),
            fault => format!("the kernel {name} cannot be evaluated in f64 for the reference: {fault}"),
        })
    };
    let function = Evaluated::new(text, "kernel_weight", overrides).map_err(refused)?;
    // Each branch of the text may fail in its own way. Distances over the whole disk reach most
    // branches.
    for k in 0..=TRIED {
        function.at((f64::from(k) / f64::from(TRIED)).powi(2)).map_err(refused)?;
    }
    Ok(OwnKernel::fallible(name, move |rho2| function.at(rho2).map_err(|_| Endless)))
}
