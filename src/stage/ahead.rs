//! Compiles the kernels of a view while the surfels of the scene are made.
//!
//! The surfels of a few points tell which kernels the whole scene most likely needs. A wrong guess
//! costs only the time that it takes.

use std::thread;

use super::extent::Extent;
use super::whole::surfels_of;
use super::{Request, View};
use crate::error::Result;
use crate::gpu::kernel::COMPILER_STACK;
use crate::io::Points;
use crate::plan::Settings;
use crate::render::{self, Backend};
use crate::scene::Colors;

/// Number of points whose surfels are made for a guess.
const SAMPLED: usize = 1024;

/// Fewest points of a scene for which kernels are compiled ahead. Two cores read 110,000 points and
/// make their surfels in 0.37 s, about as long as they compile. With far fewer points there is
/// little time to gain, and a wrong guess would delay the frame.
const FEWEST: usize = 20_000;

/// A function that gets the points of all inputs once they are read.
pub(super) type Read<'a> = dyn Fn(&[Points]) + Sync + 'a;

/// A few points of a scene.
pub(super) struct Guess {
    points: Vec<Points>,
    /// The number of all points.
    count: usize,
    /// The ratio of the distance between all points to that between those of the guess.
    spacing: f32,
}

impl Guess {
    /// Returns every n-th point of `inputs`. `None` if there are too few, or if some are of a mesh
    /// or of levels of detail, a few of which would not be like all.
    pub fn of(inputs: &[Points]) -> Option<Self> {
        let plain = |points: &Points| {
            let of_mesh = points.faces.is_some() || points.of_mesh || points.beside.is_some();
            !of_mesh && points.tree.is_none() && points.texture.is_none() && points.raw.is_none()
        };
        let count = inputs.iter().map(|points| points.positions.len()).sum();
        let step = usize::div_ceil(count, SAMPLED);
        let sampled = || inputs.iter().map(|points| sampled(points, step)).collect();
        let worth = count >= FEWEST && inputs.iter().all(plain);
        worth.then(|| Self { points: sampled(), count, spacing: (1.0 / step as f32).sqrt() })
    }

    /// Compiles the kernels of `view`. Leaves errors to the frame, which meets them again.
    pub fn compile(self, request: &Request<'_>, settings: &Settings, (view, backend): (&View, &Backend)) {
        let _ = self.compiled(request, settings, (view, backend));
    }

    fn compiled(self, request: &Request<'_>, settings: &Settings, (view, backend): (&View, &Backend)) -> Result<()> {
        // The threads of the common pool are busy with the surfels of the scene.
        let Ok(alone) = rayon::ThreadPoolBuilder::new().num_threads(1).build() else { return Ok(()) };
        let given = self.points.iter().all(|points| points.radii.is_some() || points.axes.is_some());
        let (mut scene, _) = alone.install(|| surfels_of(request, self.points, &()))?;
        if !given {
            for surfel in &mut scene.surfels {
                (surfel.s, surfel.t) = (surfel.s.map(|s| s * self.spacing), surfel.t.map(|t| t * self.spacing));
            }
        }
        let settings = request.for_scene(settings.clone(), &scene, &())?;
        let camera = view.camera(&scene, &Extent::default(), &())?.0;
        render::warm(&scene, self.count as u64, &camera, &settings, backend)
    }
}

/// Returns every `step`-th point.
fn sampled(points: &Points, step: usize) -> Points {
    fn each<T: Copy>(values: &[T], step: usize) -> Vec<T> {
        values.iter().step_by(step).copied().collect()
    }
    let colors = points.colors.as_ref().map(|colors| match colors {
        Colors::Srgb8(codes) => Colors::Srgb8(each(codes, step)),
        Colors::Linear(colors) => Colors::Linear(each(colors, step)),
        Colors::Harmonics(all) => {
            Colors::Harmonics(all.taken(&Vec::from_iter((0..points.positions.len()).step_by(step))))
        }
        Colors::Constant(_) | Colors::Textured(_) => colors.clone(),
    });
    Points {
        positions: each(&points.positions, step),
        normals: points.normals.as_ref().map(|all| each(all, step)),
        radii: points.radii.as_ref().map(|all| each(all, step)),
        axes: points.axes.as_ref().map(|all| each(all, step)),
        clips: points.clips.as_ref().map(|all| each(all, step)),
        caps: points.caps.as_ref().map(|all| each(all, step)),
        thirds: points.thirds.as_ref().map(|all| each(all, step)),
        colors,
        encoded: points.encoded,
        up: points.up,
        unsided: points.unsided,
        closed: points.closed,
        ..Points::default()
    }
}

/// Runs `make`, which gets a function to call with the points of the scene once they are read. That
/// function compiles the kernels of `view` on a thread of its own; this function waits for it.
pub(super) fn compiling<T>(
    request: &Request<'_>,
    settings: &Settings,
    view: Option<&View>,
    backend: &Backend,
    make: impl FnOnce(&Read<'_>) -> T,
) -> T {
    thread::scope(|scope| {
        make(&|points| {
            // A cut of levels of detail, which are not built yet, has other kernels.
            let view = view.filter(|_| settings.detail.is_finest());
            if let (Some(view), Backend::Gpu { .. }, Some(guess)) = (view, backend, Guess::of(points)) {
                let compile = move || guess.compile(request, settings, (view, backend));
                // Without a thread, the frame compiles all.
                let _ = thread::Builder::new().stack_size(COMPILER_STACK).spawn_scoped(scope, compile);
            }
        })
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;
    use crate::gpu::{Gpu, Replacement};
    use crate::options::{DeviceOptions, RenderOptions, SceneOptions};
    use crate::stage::{Renderer, Scene};

    /// Makes a renderer of a scan, and returns it with its device and its view; `None` without
    /// Vulkan, as only kernels in SPIR-V are cached one by one.
    fn made(options: &RenderOptions) -> Option<(Renderer, Gpu, View)> {
        let scene = Scene::open([concat!(env!("CARGO_MANIFEST_DIR"), "/data/autzen.laz")], &SceneOptions::default());
        let (device, view) = (DeviceOptions::default(), View::default());
        let renderer = Renderer::ahead(&scene.unwrap(), options, &device, &view, &()).unwrap();
        let Backend::Gpu { gpu, .. } = renderer.backend() else { return None };
        let gpu = Gpu::clone(gpu);
        (gpu.adapter.api == "vulkan").then_some((renderer, gpu, view))
    }

    #[test]
    fn the_kernels_of_a_scan_are_compiled_before_its_frame() {
        let Some((mut renderer, gpu, view)) = made(&RenderOptions::default()) else { return };
        let ahead = gpu.compiled.count_pipelines();
        let report = renderer.frame(&view, &()).unwrap().report;
        assert!(ahead > 10 && gpu.compiled.count_pipelines() == ahead, "{ahead} {}", gpu.compiled.count_pipelines());
        // The report has the time of the guess; the next frame compiles nothing.
        assert!(report.compile_ms > 0.0);
        assert_eq!(renderer.frame(&view, &()).unwrap().report.compile_ms, 0.0);
    }

    /// A guess tells no error, and the frame tells it once.
    #[test]
    fn an_error_of_a_kernel_is_left_to_the_frame() {
        let mut options = RenderOptions::default();
        options.research.sources = vec![Replacement::new("visibility.wgsl", "fn no_kernel(")];
        let Some((mut renderer, gpu, view)) = made(&options) else { return };
        assert_eq!(gpu.compiled.count_pipelines(), 0);
        let error = renderer.frame(&view, &()).unwrap_err().to_string();
        assert!(error.contains("a kernel is not valid WGSL"), "{error}");
        gpu.check().unwrap();
    }
}
