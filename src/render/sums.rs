//! Reads the sums of an image back from the device and resolves them again. Machines that share a
//! scene exchange sums in this form, which does not depend on the layout on the device. Sums that
//! were read back resolve to the same picture, bit for bit.

use super::kernels::Kernels;
use super::run::Run;
use super::sequence;
use super::store::Store;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::layout::View;
use crate::gpu::{Gpu, Sources};
use crate::passes::source::Source;
use crate::passes::upload::{Uploaded, shared, upload};
use crate::passes::{MAP_PASSES, accumulate, covered, resolve as resolve_pass, visibility};
use crate::plan::known::MOST_TRIES;
use crate::plan::steps::{Part, Stage, Step, Twin};
use crate::plan::{Accumulator, Facts, Known, Optimisation, PixelLayout, Plan, Settings, check};
use crate::scene::{Blend, Camera, Composite};

/// The result of the attribute pass over an image, with the accumulator `fixed`.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    /// Columns and rows of the image.
    pub size: [u32; 2],
    /// The nearest depth of each pixel, in device units, stored as bits(+inf) - bits(depth).
    pub nearest: Vec<u32>,
    /// [`PixelLayout::channels`] integer sums per pixel, in units of `1 / one`. Sums of different
    /// splats at one pixel can be added.
    pub sums: Vec<u64>,
    /// The channel of each sum.
    pub pixel: PixelLayout,
    /// The weight 1 in units of the sums.
    pub one: u64,
    /// The view uniform. Lights and background are zeroed, because sums do not depend on them.
    pub view: View,
}

impl Sums {
    /// Creates empty sums for an image of `plan`.
    pub(super) fn new(camera: &Camera, plan: &Plan, view: &View) -> Self {
        let view = View { lights: Default::default(), background: [0.0; 4], ..*view };
        Self {
            size: [camera.width, camera.height],
            nearest: Vec::new(),
            sums: Vec::new(),
            pixel: plan.pixel,
            one: plan.one,
            view,
        }
    }

    /// The sum of `channel` at `pixel`, in units of `1 / one`; `None` past the end.
    pub fn sum(&self, pixel: usize, channel: u32) -> Option<u64> {
        let at = pixel.checked_mul(self.pixel.channels as usize)?.checked_add(channel as usize)?;
        self.sums.get(at).copied()
    }

    /// The sum of `channel` at `pixel`, scaled so that a weight of 1 is 1; `None` past the end.
    pub fn value(&self, pixel: usize, channel: u32) -> Option<f64> {
        Some(self.sum(pixel, channel)? as f64 / self.one as f64)
    }

    /// The number of fragments accepted at `pixel`; `None` if they were not counted.
    pub fn count(&self, pixel: usize) -> Option<u64> {
        (self.pixel.count_channel < self.pixel.channels).then(|| self.sum(pixel, self.pixel.count_channel))?
    }

    /// Reads the depths and sums of `band` from the device and appends them.
    pub(super) fn take(&mut self, gpu: &Gpu, plan: &Plan, store: &Store, band: usize) -> Result<()> {
        let pixels = plan.bands[band].pixels;
        let words = |name: &str, len: u64| match store.buffer(name) {
            Some(buffer) => buffer.read(gpu, len),
            None => Ok(Vec::new()),
        };
        self.nearest.extend(words("nearest", pixels)?);
        let kept = words("sums", pixels * u64::from(plan.sum_words))?;
        let first = self.sums.len();
        self.sums.resize(first + kept.len() / 2, 0);
        accumulate::canonical(Some(&plan.needs), &kept, &mut self.sums[first..]);
        Ok(())
    }

    /// Writes the depths and sums of `band` to the device.
    fn put(&self, gpu: &Gpu, plan: &Plan, store: &Store, band: usize) -> Result<()> {
        let first = plan.bands[band].first as usize * self.size[0] as usize;
        let pixels = first..first + plan.bands[band].pixels as usize;
        let channels = self.pixel.channels as usize;
        let sums = &self.sums[pixels.start * channels..pixels.end * channels];
        let kept = accumulate::kept(Some(&plan.needs), sums);
        for (name, words) in [("nearest", &self.nearest[pixels]), ("sums", &*kept)] {
            if let Some(buffer) = store.buffer(name) {
                buffer.write(gpu, words.len(), |range| words[range].into(), &())?;
            }
        }
        Ok(())
    }
}

/// Checks that the scene has no triangles, which keep no sums.
pub(super) fn of_surfels_alone(facts: &Facts) -> Result<()> {
    match facts.mesh.triangles {
        0 => Ok(()),
        _ => Err(Error::Usage("triangles leave no sums: leave them out, or render".into())),
    }
}

/// Checks that `options` allow sums to be read back, and returns them with gathering off.
fn stored(options: &Settings) -> Result<Settings> {
    super::parts::one_alone(options)?;
    check::options(options, false)?;
    if options.accumulator != Accumulator::Fixed || options.raster.is_some() {
        return Err(Error::Usage("sums can be read back only with the accumulator fixed: use it".into()));
    }
    if options.composite != Composite::Opaque {
        return Err(Error::Usage(
            "surfaces that show through each other leave no sums: render, or leave composite out".into(),
        ));
    }
    if options.separate {
        return Err(Error::Usage("inputs that are kept apart leave no sums: leave separate out, or render".into()));
    }
    if options.blend == Blend::Nearest {
        return Err(Error::Usage("--blend nearest sums nothing: leave it out, or render".into()));
    }
    if let Some(own) = MAP_PASSES.iter().find(|own| options.maps.has(own.map)) {
        let map = own.map.row().name;
        return Err(Error::Usage(format!("the map {map} cannot be made from sums: leave it out, or render")));
    }
    // Tiles that gather keep sums in registers and store none.
    let mut without = options.without.clone();
    without.push(Optimisation::Gathering);
    Ok(Settings { without, ..options.clone() })
}

/// Renders `source` up to its sums and returns them.
///
/// # Errors
/// [`Error::Usage`] for an accumulator other than `fixed` or options that leave no sums, and any
/// error of a render.
pub fn sums(source: &dyn Source, camera: &Camera, options: &Settings, gpu: &Gpu, sources: &Sources) -> Result<Sums> {
    let options = &stored(options)?;
    let facts = source.facts();
    of_surfels_alone(&facts)?;
    let mut known = Known::default();
    let plan = Plan::of(&facts, &gpu.adapter, camera, options, &known)?;
    let mut store = Store::new(gpu, upload(gpu, source, &plan.needs, (&facts, true), &())?, &plan.needs)?;
    for _ in 0..MOST_TRIES {
        let plan = Plan::of(&facts, &gpu.adapter, camera, options, &known)?;
        let kernels = Kernels::new(sources, &plan, options, facts.surfels);
        store.fit(gpu, &plan, &known)?;
        let view = View::new(&facts, camera, options);
        store.set_view(gpu, &view);
        let mut run = Run::new(gpu, &plan, &kernels, &mut store, &mut known);
        let mut sums = Sums::new(camera, &plan, &view);
        let mut nothing = Frame::empty(camera, options.maps);
        for step in sequence::steps(&plan) {
            match step {
                Step::Stage(Stage { twin: Some(Twin::Resolve), band, .. }) => {
                    run.timing.flush(gpu)?;
                    sums.take(gpu, &plan, run.store, band)?;
                }
                Step::ReadBack(band) => run.end_band(band)?,
                step => drop(run.steps(&[step], &mut nothing, &())?),
            }
        }
        if run.tally().complete {
            return Ok(sums);
        }
    }
    Err(Run::never_fits(gpu))
}

/// Resolves `sums` of a render of `source` to an image, wherever they were made.
///
/// # Errors
/// [`Error::Usage`] if the sums belong to another render, and any error of a render.
pub fn resolve(
    sums: &Sums,
    source: &dyn Source,
    camera: &Camera,
    options: &Settings,
    gpu: &Gpu,
    sources: &Sources,
) -> Result<Frame> {
    let options = &stored(options)?;
    let facts = source.facts();
    of_surfels_alone(&facts)?;
    let mut known = Known::default();
    let plan = Plan::of(&facts, &gpu.adapter, camera, options, &known)?;
    let view = View::new(&facts, camera, options);
    let expected = Sums::new(camera, &plan, &view);
    let pixels = camera.pixels();
    let whole = sums.nearest.len() == pixels && sums.sums.len() == pixels * plan.pixel.channels as usize;
    let of = |sums: &Sums| (sums.size, sums.pixel, sums.one, sums.view);
    if !whole || of(sums) != of(&expected) {
        return Err(Error::Usage("the sums belong to another scene, view or options: pass the same ones".into()));
    }
    let kernels = Kernels::new(sources, &plan, options, facts.surfels);
    let scene_wide =
        Uploaded { pages: Vec::new(), first: 0, branches: Vec::new(), shared: shared(gpu, source, &plan.needs)? };
    let mut store = Store::new(gpu, scene_wide, &plan.needs)?;
    store.fit(gpu, &plan, &known)?;
    store.set_view(gpu, &view);
    let mut frame = Frame::empty(camera, options.maps);
    let mut run = Run::new(gpu, &plan, &kernels, &mut store, &mut known);
    for band in 0..plan.bands.len() {
        sums.put(gpu, &plan, run.store, band)?;
        // The nearest depths tell which tiles are covered.
        let lists = visibility::occlude(band, Part::All).after(vec![covered::restart(&plan, band)]);
        let stages = [lists, resolve_pass::steps(&plan, band)];
        let steps = stages.into_iter().map(Step::Stage).chain([Step::ReadBack(band)]);
        run.steps(&steps.collect::<Vec<_>>(), &mut frame, &())?;
    }
    Ok(frame)
}
