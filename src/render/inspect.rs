//! Reads intermediate results back from the device: splats, nearest depths and sums ([`stages`]).
//! [`evaluate`] runs one function of a kernel over an array. Both are for study and for tests; a
//! render keeps intermediate results on the device.

use bytemuck::{Pod, Zeroable};

use super::kernels::Kernels;
use super::run::Run;
use super::sequence;
use super::store::Store;
use super::sums::Sums;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::buffers::Buffer;
use crate::gpu::interface::reflect;
use crate::gpu::kernel::{Grid, grid};
use crate::gpu::layout::{Splat, View};
use crate::gpu::program::Program;
use crate::gpu::sources::Text;
use crate::gpu::{Gpu, Sources};
use crate::passes::upload::upload;
use crate::plan::steps::{Stage, Step, Twin};
use crate::plan::{Accumulator, Facts, Known, Optimisation, Organisation, Plan, SceneNeeds, Settings, splat_words};
use crate::scene::{Camera, Composite, Scene};

/// The results of project, visibility and accumulate.
#[derive(Clone, Debug)]
pub struct Stages {
    /// The splat record of each surfel, in scene order.
    pub splats: Vec<Splat>,
    /// Nearest depths (see [`nearest_depth`](Self::nearest_depth)) and sums.
    pub sums: Sums,
    /// The view uniform of the kernels.
    pub view: View,
}

impl Stages {
    /// The nearest depth of `pixel` in world units: +inf if no splat covers it, `None` past the
    /// image.
    pub fn nearest_depth(&self, pixel: usize) -> Option<f64> {
        let bits = f32::INFINITY.to_bits().wrapping_sub(*self.sums.nearest.get(pixel)?);
        Some(f64::from(f32::from_bits(bits)) * f64::from(self.view.world))
    }
}

/// Runs project, visibility and accumulate on `gpu` and reads back their results.
///
/// # Errors
/// [`Error::Usage`] for options whose stages cannot be read back, or if the image's sums need more
/// than one buffer; and any error of a render.
pub fn stages(scene: &Scene, camera: &Camera, options: &Settings, gpu: &Gpu, sources: &Sources) -> Result<Stages> {
    if options.accumulator != Accumulator::Fixed {
        return Err(Error::Usage("sums can be read back only with the accumulator fixed: use it".into()));
    }
    super::parts::one_alone(options)?;
    if options.composite != Composite::Opaque {
        return Err(Error::Usage("stages can be read back only of opaque pictures: leave composite out".into()));
    }
    if options.separate {
        return Err(Error::Usage("stages can be read back only if all inputs blend: leave separate out".into()));
    }
    // Each surfel needs a slot, and sums must be in storage.
    let mut without = options.without.clone();
    without.extend([Optimisation::Culling, Optimisation::Copies]);
    let options = &Settings { organisation: Organisation::Scatter, raster: None, without, ..options.clone() };
    let facts = Facts::of(scene);
    super::sums::of_surfels_alone(&facts)?;
    let mut known = Known::default();
    let plan = Plan::of(&facts, &gpu.adapter, camera, options, &known)?;
    if plan.bands.len() > 1 {
        return Err(Error::Usage(format!(
            "an image of {}x{} pixels needs {} bands on {}, and stages can be read back only from one: choose a \
             smaller image",
            camera.width,
            camera.height,
            plan.bands.len(),
            gpu.adapter.name
        )));
    }
    let kernels = Kernels::new(sources, &plan, options, facts.surfels);
    let uploaded = upload(gpu, scene, &plan.needs, (&facts, true), &())?;
    let order: Vec<u32> = uploaded.pages.iter().flat_map(|page| page.numbers.clone()).collect();
    let mut store = Store::new(gpu, uploaded, &plan.needs)?;
    store.fit(gpu, &plan, &known)?;
    let view = View::new(&facts, camera, options);
    store.set_view(gpu, &view);
    let mut run = Run::new(gpu, &plan, &kernels, &mut store, &mut known);
    let resolves = |step: &Step| matches!(step, Step::Stage(Stage { twin: Some(Twin::Resolve), .. }));
    let steps: Vec<_> = sequence::steps(&plan).into_iter().take_while(|step| !resolves(step)).collect();
    run.steps(&steps, &mut Frame::empty(camera, options.maps), &())?;
    run.timing.flush(gpu)?;
    let mut sums = Sums::new(camera, &plan, &view);
    sums.take(gpu, &plan, &store, 0)?;
    Ok(Stages { splats: splats(gpu, &plan.needs, &order, &store)?, sums, view })
}

/// Reads the splat record of each surfel, in scene order.
fn splats(gpu: &Gpu, needs: &SceneNeeds, order: &[u32], store: &Store) -> Result<Vec<Splat>> {
    let mut splats = vec![Splat::zeroed(); order.len()];
    let mut order = order.iter();
    let words = splat_words(needs);
    for page in &store.pages {
        let Some(stored) = page.buffer("splats") else { continue };
        let stored = stored.read(gpu, page.slots * words)?;
        for (record, index) in stored.chunks_exact(words as usize).zip(&mut order) {
            // The words of the low-pass and of other extensions come last; they are left out.
            splats[*index as usize] = bytemuck::pod_read_unaligned(&bytemuck::cast_slice(record)[..size_of::<Splat>()]);
        }
    }
    Ok(splats)
}

/// Runs the entry point `evaluate` of the module `text`, one invocation per element of `inputs`.
///
/// The module may bind `view` (uniform), `inputs` (read-only storage) and `outputs` (`output_len`
/// elements, initially zero). Its workgroups have [`WORKGROUP`](crate::gpu::layout::WORKGROUP)
/// invocations, in a 2-D grid. The functions of `arithmetic.wgsl` are part of it.
///
/// # Errors
/// [`Error::Usage`] if the module is not valid or binds anything else; and any error of the device.
pub fn evaluate<I: Pod + Send + Sync, O: Pod>(
    gpu: &Gpu,
    text: &str,
    view: &View,
    inputs: &[I],
    output_len: u64,
) -> Result<Vec<O>> {
    const ENTRY: &str = "evaluate";
    const NAMES: [&str; 3] = ["view", "inputs", "outputs"];
    let text = Text::alone(text);
    let (_, bindings, _) =
        reflect(&text.joined).map_err(|e| Error::Usage(format!("the kernel is not valid WGSL: {e}")))?;
    let variables =
        bindings.get(ENTRY).ok_or_else(|| Error::Usage(format!("the kernel has no entry point {ENTRY}")))?;
    if let Some((name, _)) = variables.iter().find(|(name, _)| !NAMES.contains(&name.as_str())) {
        return Err(Error::Usage(format!("the kernel binds {name}, which is none of view, inputs, outputs")));
    }
    let program = Program::compile(gpu, text, &[ENTRY], &[], &[])?;
    let view = Buffer::uniform(gpu, "view", view)?;
    let source = Buffer::storage(gpu, "inputs", inputs.len() as u64)?;
    source.write(gpu, inputs.len(), |range| inputs[range].into(), &())?;
    let target = Buffer::<O>::storage(gpu, "outputs", output_len)?;
    let buffers = [("view", &view.raw), ("inputs", &source.raw), ("outputs", &target.raw)];
    let binding = |name: &str| {
        let (_, buffer) = buffers.iter().find(|(given, _)| *given == name)?;
        Some(buffer.as_entire_binding())
    };
    let mut encoder = gpu.encoder();
    let mut pass = encoder.begin_compute_pass(&Default::default());
    program.dispatch(gpu, &mut pass, ENTRY, &binding, Grid::Of(grid(gpu, inputs.len() as u64)?))?;
    drop(pass);
    gpu.submit(encoder);
    gpu.wait()?;
    target.read(gpu, output_len)
}
