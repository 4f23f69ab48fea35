//! Renderers, which keep surfels, buffers and kernels from call to call.

use std::num::NonZeroU32;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::Duration;

use epsplat::io::place::Place;
use epsplat::{
    Camera, CameraOptions, DeviceOptions, Error, Map, Progress, RenderOptions, Renderer as Kept, Result, Share,
};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};

use crate::error::exception;
use crate::machines::one;
use crate::options::{Scope, arguments, parsed, replace};
use crate::scene::Scene;
use crate::stack::Stack;
use crate::task::run;
use crate::view::View;

/// The place of a map on the earth, for files of it.
#[pyclass(frozen, module = "epsplat._epsplat")]
pub struct OfMap(pub Place);

/// A renderer of one scene with one set of options.
#[pyclass(frozen, module = "epsplat._epsplat")]
pub struct Renderer {
    scene: epsplat::Scene,
    options: RenderOptions,
    device: DeviceOptions,
    /// Size and near depth of views that have none.
    camera: CameraOptions,
    /// The library's renderer. None after a call that was stopped or failed: the next call makes
    /// it anew.
    kept: Mutex<Option<Kept>>,
}

#[pymethods]
impl Renderer {
    /// Returns a renderer and the notes of making it.
    #[staticmethod]
    fn of(
        py: Python<'_>,
        scene: &Scene,
        keywords: &Bound<'_, PyDict>,
        wgsl: Option<&Bound<'_, PyDict>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Self, Vec<String>)> {
        // Some options exclude options of the scene.
        let all: Vec<String> = scene.arguments.iter().cloned().chain(arguments(Scope::Renderer, keywords)?).collect();
        let mut parsed = parsed(py, &all)?;
        replace(&mut parsed.render, wgsl)?;
        let made = Self {
            scene: scene.scene.clone(),
            options: parsed.render,
            device: parsed.device,
            camera: parsed.camera,
            kept: Mutex::new(None),
        };
        let ((), notes) = run(py, progress, |progress| made.with(progress, |_| Ok(())))?;
        Ok((made, notes))
    }

    /// Renders views, which have to be of one size. No views stand for that of the whole scene.
    fn render<'py>(
        &self,
        py: Python<'py>,
        views: Vec<PyRef<'py, View>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let of_all = || epsplat::View::new(&self.camera);
        let views = match views.is_empty() {
            true => of_all().map(|view| vec![view]),
            false => views.iter().map(|view| view.with(&self.camera)).collect::<Result<Vec<_>>>(),
        };
        let views = views.map_err(|error| exception(py, &error))?;
        let (stack, notes) = run(py, progress, |progress| {
            self.with(progress, |kept| {
                let views = of_one_size(kept, views)?;
                let size = views.first().map_or(Ok([0; 2]), |view| kept.camera(view).map(|camera| size(&camera)))?;
                let mut stack = Stack::of(views.len(), size, self.maps())?;
                for view in &views {
                    stack.push(kept.frame(view, progress)?);
                }
                Ok(stack)
            })
        })?;
        let result = stack.into_arrays(py)?;
        result.set_item("notes", notes)?;
        Ok(result)
    }

    /// Returns views on a circle around the scene.
    fn turntable(&self, py: Python<'_>, count: NonZeroU32, keywords: &Bound<'_, PyDict>) -> PyResult<Vec<View>> {
        let given = parsed(py, &arguments(Scope::View, keywords)?)?.camera;
        let options =
            CameraOptions { size: given.size.or(self.camera.size), near: given.near.or(self.camera.near), ..given };
        let (views, _) = run(py, None, |progress| self.with(progress, |kept| kept.turntable(&options, count)))?;
        let named = views.into_iter().enumerate();
        Ok(named.map(|(step, view)| View::known(view, format!("step {step} of {count}"))).collect())
    }

    /// Renders a map from straight above. Returns its arrays, and its grid as JSON.
    fn map<'py>(
        &self,
        py: Python<'py>,
        keywords: &Bound<'py, PyDict>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let options = parsed(py, &arguments(Scope::View, keywords)?)?.camera;
        let (made, notes) = run(py, progress, |progress| {
            self.with(progress, |kept| {
                let grid = kept.grid(&options)?;
                let mut stack = Stack::of(1, [grid.columns.into(), grid.rows.into()], self.maps())?;
                let survey = kept.map(&grid, progress, |band| {
                    stack.append(band);
                    Ok(())
                })?;
                // Maps may be larger than any camera's image.
                stack.surveyed(&survey, grid.camera(0..grid.columns, 0..grid.rows).ok());
                let keys = self.scene.files().geo_keys()?;
                Ok((stack, Place { left: grid.left, top: grid.top, pixel: grid.pixel, keys: keys.unwrap_or_default() }))
            })
        })?;
        let (stack, place) = made;
        let result = stack.into_arrays(py)?;
        result.set_item("notes", notes)?;
        result.set_item("left", place.left)?;
        result.set_item("top", place.top)?;
        result.set_item("pixel", place.pixel)?;
        result.set_item("place", OfMap(place))?;
        Ok(result)
    }

    /// Draws the share (number, of how many) of a view, within the nearest depths of all shares if
    /// they are given. Returns the bytes of a part.
    fn part<'py>(
        &self,
        py: Python<'py>,
        view: Option<PyRef<'py, View>>,
        share: (u32, u32),
        within: Option<Vec<PyBackedBytes>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let view = view.map_or_else(|| epsplat::View::new(&self.camera), |view| view.with(&self.camera));
        let view = view.map_err(|error| exception(py, &error))?;
        let (bytes, _) = run(py, progress, |progress| {
            let share = Share::new(share.0, share.1)?;
            let within = within.map(|parts| one("within", &parts)).transpose()?;
            self.with(progress, |kept| Ok(kept.part(&view, share, within.as_ref(), progress)?.bytes()))
        })?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// The box of the scene's centres, world coordinates: its least and its greatest corner.
    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<([f64; 3], [f64; 3])> {
        let (bounds, _) = run(py, None, |progress| self.with(progress, |kept| Ok(kept.bounds())))?;
        Ok((bounds.min.to_array(), bounds.max.to_array()))
    }
}

/// Columns and rows of a picture.
fn size(camera: &Camera) -> [u64; 2] {
    [camera.width.into(), camera.height.into()]
}

/// Returns the cameras of several views, so that their sizes can be compared before the first one
/// is rendered. A single view stays as it is, and describes itself in a note.
fn of_one_size(kept: &Kept, views: Vec<epsplat::View>) -> Result<Vec<epsplat::View>> {
    if views.len() < 2 {
        return Ok(views);
    }
    let cameras: Vec<Camera> = views.iter().map(|view| kept.camera(view)).collect::<Result<_>>()?;
    if let Some(other) = cameras.iter().find(|camera| size(camera) != size(&cameras[0])) {
        let ([w, h], [ow, oh]) = (size(&cameras[0]), size(other));
        return Err(Error::Usage(format!(
            "the views have different sizes, {w}x{h} and {ow}x{oh}: render those of one size together"
        )));
    }
    Ok(cameras.into_iter().map(epsplat::View::from).collect())
}

impl Renderer {
    /// The maps of each picture.
    fn maps(&self) -> impl Iterator<Item = Map> {
        self.options.maps.aov.iter().copied()
    }

    /// Waits until no other thread has the renderer, or until this call is stopped.
    fn locked(&self, progress: &dyn Progress) -> MutexGuard<'_, Option<Kept>> {
        loop {
            match self.kept.try_lock() {
                Ok(place) => return place,
                Err(TryLockError::Poisoned(error)) => return error.into_inner(),
                Err(TryLockError::WouldBlock) => {
                    progress.advance(0);
                    thread::sleep(Duration::from_millis(1));
                }
            }
        }
    }

    /// Calls `work` with the library's renderer, which is made if there is none. Other threads wait
    /// meanwhile.
    fn with<T>(&self, progress: &dyn Progress, work: impl FnOnce(&mut Kept) -> Result<T>) -> Result<T> {
        let mut place = self.locked(progress);
        // Work that is stopped unwinds from here, and leaves no renderer in an unknown state.
        let mut kept = match place.take() {
            Some(kept) => kept,
            None => Kept::new(&self.scene, &self.options, &self.device, progress)?,
        };
        let outcome = work(&mut kept);
        if !matches!(outcome, Err(Error::Gpu { .. })) {
            *place = Some(kept);
        }
        outcome
    }
}
