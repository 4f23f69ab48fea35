//! Runs a study. The configurations of a scene take turns, so that a slowdown affects all alike.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use super::case::{Case, Timed};
use super::config::Config;
use super::definition::{Definition, SceneEntry};
use super::judge;
use super::machine::machine;
use super::staging::{Point, points, stage};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::BackendName;
use crate::plan::{Facts, SceneNeeds, Settings, check};
use crate::progress::Progress;
use crate::render::{Backend, Renderer};
use crate::report::{Measurement, Study, Summary};
use crate::scene::{Camera, KernelFaults, Scene};

/// The outcome of a study.
#[derive(Debug)]
pub struct Outcome {
    /// The measurements. The caller sets the command and the date.
    pub study: Study,
    /// One sentence for each configuration that was skipped or rendered twice, with the reason.
    pub notes: Vec<String>,
    /// One sentence for each configuration that missed its error limit or was not reproducible.
    pub failures: Vec<String>,
}

/// Renders every configuration on every scene.
///
/// Times are of whole frames, from the uploaded scene to the frame in host memory. Errors are those
/// against the f64 reference with the same options, the worst over the cameras. Pixels that the
/// reference excuses do not count
/// ([`Comparison::rmse_decided`](crate::metrics::Comparison::rmse_decided)).
///
/// All configurations of a scene hold their device buffers at the same time. Configurations that
/// the adapter cannot run are skipped with a note.
///
/// # Errors
///
/// [`Error::NoAdapter`] if a configuration needs an adapter and `gpu` is `None`, and any error of
/// reading and rendering.
pub fn run(definition: &Definition, gpu: Option<&Backend>, progress: &dyn Progress) -> Result<Outcome> {
    let mut outcome = begin(definition, gpu)?;
    for entry in &definition.scenes {
        for point in points(entry) {
            measure(definition, (entry, point), gpu, &mut outcome, progress)?;
        }
    }
    Ok(outcome)
}

/// Starts the outcome of a study, without measurements.
pub(super) fn begin(definition: &Definition, gpu: Option<&Backend>) -> Result<Outcome> {
    if definition.needs_gpu() && gpu.is_none() {
        return Err(Error::NoAdapter(format!("the study {} has configurations that need an adapter", definition.name)));
    }
    Ok(Outcome {
        study: Study {
            name: definition.name.clone(),
            about: definition.about.clone(),
            command: String::new(),
            date: String::new(),
            machine: machine(gpu),
            runs: definition.runs,
            measurements: Vec::new(),
            images: Vec::new(),
        },
        notes: Vec::new(),
        failures: Vec::new(),
    })
}

/// Measures the configurations on one point of a scene's sweep and adds the results to `outcome`.
pub(super) fn measure(
    definition: &Definition,
    (entry, point): (&SceneEntry, Point),
    gpu: Option<&Backend>,
    outcome: &mut Outcome,
    progress: &dyn Progress,
) -> Result<()> {
    let staged = stage(definition, entry, point, progress)?;
    Case { definition, entry, staged: &staged, gpu }.run(outcome, progress)
}

impl<'a> Case<'a> {
    /// Number of surfels of the scene; if it is read in parts, of the whole file.
    fn surfels(&self) -> u64 {
        let scene = &self.staged.scene;
        scene.part_of.as_ref().map_or(scene.surfels.len() as u64, |whole| whole.surfels.into())
    }

    /// Number of surfels on the device, plus octree nodes if the scene is read in parts.
    fn held(&self) -> u64 {
        let Scene { surfels, hierarchy, part_of, .. } = &self.staged.scene;
        let nodes = hierarchy.as_ref().filter(|_| part_of.is_some()).map_or(0, |tree| tree.nodes.len());
        (surfels.len() + nodes) as u64
    }

    pub fn backend(&self, config: &Config) -> &'a Backend {
        match (config.backend, self.gpu) {
            (BackendName::Gpu | BackendName::Raster, Some(gpu)) => gpu,
            _ => &Backend::Reference,
        }
    }

    /// Names a configuration with its scene, for messages.
    fn named(&self, config: &Config) -> String {
        let footprint = self.staged.footprint_px;
        format!("{} on {} ({} surfels of {footprint:.2} px)", config.name, self.entry.name, self.surfels())
    }

    fn run(&self, outcome: &mut Outcome, progress: &dyn Progress) -> Result<()> {
        let planned = |config| (config, self.definition.settings(config, self.entry));
        let plans: Vec<(&Config, Settings)> = self.definition.configs_of(self.entry).map(planned).collect();
        let timed = self.time(&plans, &mut outcome.notes, progress)?;
        let errors = judge::against_reference(self, &timed, progress)?;
        let mut truths = judge::against_truth(self, &timed, progress)?;
        for (measures, apart) in truths.iter_mut().zip(judge::against_approximated(self, &timed, progress)?) {
            measures.extend(apart);
        }
        for (timed, measures) in timed.iter().zip(&mut truths) {
            measures.extend(timed.cut.map(|cut| ("cut".to_owned(), cut)));
        }
        let mut measurements = Vec::new();
        for ((timed, error), reconstruction) in timed.iter().zip(errors).zip(truths) {
            let config = timed.config;
            let measurement = self.measurement(timed, &error, reconstruction);
            if !measurement.kept {
                let limit = config.error_limit.unwrap_or(0.0);
                let rmse = error.numeric.rmse;
                outcome
                    .failures
                    .push(format!("{}: RMSE {rmse:.2e} misses its limit of {limit:.2e}", self.named(config)));
            }
            if config.deterministic() && !timed.stable {
                outcome.failures.push(format!("{}: two runs gave different bits", self.named(config)));
            }
            measurements.push(measurement);
            outcome.study.images.push(error.picture);
        }
        judge::compare_with_raster(&mut measurements);
        outcome.study.measurements.append(&mut measurements);
        Ok(())
    }

    /// Renders one warm-up per configuration, then the timed runs, in which configurations take
    /// turns.
    fn time<'p>(
        &self,
        plans: &'p [(&'p Config, Settings)],
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Vec<Timed<'p>>> {
        progress
            .begin(&format!("timing {}", self.entry.name), plans.len() as u64 * u64::from(1 + self.definition.runs));
        let mut runners = Vec::new();
        for (config, options) in plans {
            // A configuration that the adapter cannot draw is skipped. With a kernel file of the
            // user, any error ends the study, as the file may be at fault.
            let unfit = |error| if options.sources.is_empty() { Unfit::Adapter(error) } else { Unfit::Failed(error) };
            let renderer = Renderer::new(&self.staged.scene, options, self.backend(config)).map_err(unfit);
            let warm_up = renderer.and_then(|mut renderer| {
                self.check(config, options)?;
                Ok((self.turn(&mut renderer)?, renderer))
            });
            progress.advance(1);
            let (lap, renderer) = match warm_up {
                Ok((lap, renderer)) => (lap, renderer),
                Err(Unfit::Adapter(why)) => {
                    notes.push(format!("{} was left out: {why}", self.named(config)));
                    continue;
                }
                Err(Unfit::Failed(error)) => return Err(self.failed(config, runners.len(), error)),
            };
            let wrong = renderer.kernel_faults().and_then(KernelFaults::sentence);
            notes.extend(wrong.map(|sentence| format!("{}: {sentence}", self.named(config))));
            if lap.overflows > 0 {
                let count = lap.overflows;
                notes.push(format!("{}: {count} sums overflowed, so frames were rendered twice", self.named(config)));
            }
            let first: Vec<u64> = lap.frames.iter().map(fingerprint).collect();
            let timed = Timed {
                config,
                options,
                total_ms: Vec::new(),
                passes: BTreeMap::new(),
                frames: Vec::new(),
                bytes: renderer.device_bytes(),
                cut: lap.cut,
                stable: true,
            };
            runners.push((renderer, first, timed));
        }
        let beside = runners.len().saturating_sub(1);
        for _ in 0..self.definition.runs {
            for (renderer, first, timed) in &mut runners {
                // Frees the frames of the previous run before the next.
                timed.frames.clear();
                let lap = self.turn(renderer).map_err(|unfit| self.failed(timed.config, beside, unfit.into()))?;
                timed.total_ms.push(lap.total_ms);
                for (pass, ms) in lap.passes {
                    timed.passes.entry(pass).or_default().push(ms);
                }
                timed.stable = lap.frames.iter().map(fingerprint).eq(first.iter().copied());
                timed.frames = lap.frames;
                progress.advance(1);
            }
        }
        progress.end();
        Ok(runners.into_iter().map(|(_, _, timed)| timed).collect())
    }

    /// Fails if the adapter lacks a feature or limit that the configuration needs.
    fn check(&self, config: &Config, options: &Settings) -> Result<(), Unfit> {
        let Backend::Gpu { gpu, .. } = self.backend(config) else { return Ok(()) };
        let facts = Facts::of(&self.staged.scene);
        let outcome = self.staged.cameras.iter().try_for_each(|camera| {
            let needs = SceneNeeds::of(&facts, &gpu.adapter, camera, options);
            check::on_adapter(&gpu.adapter, &needs, camera)
        });
        outcome.map_err(Unfit::Adapter)
    }

    /// Renders a frame from each camera.
    fn turn(&self, renderer: &mut Renderer<&Scene, &Backend>) -> Result<Lap, Unfit> {
        let cameras: &[Camera] = &self.staged.cameras;
        let mut lap = Lap::default();
        let share = 1.0 / cameras.len() as f64;
        for camera in cameras {
            let (frame, report) = renderer.frame(camera, &()).map_err(|error| match error {
                Error::Limit { .. } => Unfit::Adapter(error),
                other => Unfit::Failed(other),
            })?;
            lap.total_ms += share * report.total_ms;
            lap.overflows += report.overflows;
            if let Some(cut) = report.cut {
                *lap.cut.get_or_insert(0.0) += share * cut as f64;
            }
            for (pass, ms) in report.passes {
                *lap.passes.entry(pass.trim_end_matches("_ms").to_owned()).or_default() += share * ms;
            }
            lap.frames.push(frame);
        }
        Ok(lap)
    }

    /// Adds the configuration, and the number of others that hold device buffers, to a graphics
    /// error.
    fn failed(&self, config: &Config, beside: usize, error: Error) -> Error {
        match error {
            Error::Gpu { adapter, what } => {
                let others = format!("while {beside} other configurations held their buffers");
                Error::Gpu { adapter, what: format!("{what} ({}, {others})", self.named(config)) }
            }
            other => other,
        }
    }

    fn measurement(
        &self,
        timed: &Timed<'_>,
        error: &judge::Errors,
        reconstruction: BTreeMap<String, f64>,
    ) -> Measurement {
        let config = timed.config;
        // No default is used: there is at least one camera, and all have the same image size.
        let (width, height) = self.staged.cameras.first().map_or((0, 0), |camera| (camera.width, camera.height));
        // No default is used: there is at least one run.
        let total_ms = Summary::of(&timed.total_ms).unwrap_or_default();
        let passes = timed.passes.iter().filter_map(|(pass, ms)| Some((pass.clone(), Summary::of(ms)?)));
        let per_second = |count: f64| if total_ms.median > 0.0 { count / total_ms.median * 1e3 } else { 0.0 };
        Measurement {
            study: self.definition.name.clone(),
            scene: self.entry.name.clone(),
            config: config.name.clone(),
            backend: config.backend.name().to_owned(),
            accumulator: config.sums().to_owned(),
            surfels: self.surfels(),
            footprint_px: self.staged.footprint_px,
            width,
            height,
            total_ms,
            runs_ms: timed.total_ms.clone(),
            passes: passes.collect(),
            splats_per_second: per_second(self.surfels() as f64),
            fragments_per_second: Some(per_second(error.fragments)),
            bytes_per_splat: timed.bytes.splats as f64 / self.held().max(1) as f64,
            device_bytes: timed.bytes.splats + timed.bytes.pixels,
            numeric: Some(error.numeric),
            reconstruction,
            ratio_to_raster: None,
            error_limit: config.error_limit,
            kept: config.error_limit.is_none_or(|limit| error.numeric.rmse <= limit),
        }
    }
}

/// The times and frames of one turn of a configuration over all cameras.
#[derive(Default)]
struct Lap {
    total_ms: f64,
    passes: BTreeMap<String, f64>,
    frames: Vec<Frame>,
    overflows: u64,
    cut: Option<f64>,
}

/// The reason why a configuration does not run.
enum Unfit {
    /// The adapter lacks a feature, or its limits are too low: the configuration is skipped.
    Adapter(Error),
    /// Any other error, which ends the study.
    Failed(Error),
}

impl From<Unfit> for Error {
    fn from(unfit: Unfit) -> Self {
        match unfit {
            Unfit::Adapter(error) | Unfit::Failed(error) => error,
        }
    }
}

/// Returns a hash of all bits of a frame's colours and maps.
fn fingerprint(frame: &Frame) -> u64 {
    let mut hasher = DefaultHasher::new();
    let mut add = |values: &[f32]| bytemuck::cast_slice::<f32, u8>(values).hash(&mut hasher);
    add(bytemuck::cast_slice(&frame.color));
    frame.maps().iter().filter_map(|map| frame.map(map)).for_each(add);
    hasher.finish()
}
