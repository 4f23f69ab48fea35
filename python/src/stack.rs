//! The pictures of many views, joined to one array for the colour and one for each map.

use std::collections::BTreeMap;

use epsplat::{Camera, Frame, Map, Picture, Report, Result, Survey};
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::check_memory;
use crate::view::{View, arrays};

/// Pictures of one size.
#[derive(Default)]
pub struct Stack {
    /// The number of pictures that are to come.
    count: usize,
    /// The number of their pixels.
    pixels: usize,
    width: u32,
    height: u32,
    color: Vec<f32>,
    maps: BTreeMap<Map, Vec<f32>>,
    cameras: Vec<Camera>,
    /// The reports as JSON.
    reports: Vec<String>,
    /// Sentences about pictures in which nothing shows.
    unseen: Vec<Option<String>>,
}

impl Stack {
    /// A stack for this many pictures of a size, with these maps.
    ///
    /// # Errors
    ///
    /// [`Error::NoMemory`](epsplat::Error::NoMemory) if the system has less memory than they need.
    pub fn of(count: usize, [width, height]: [u64; 2], maps: impl IntoIterator<Item = Map>) -> Result<Self> {
        let pixels = (count as u64).saturating_mul(width.saturating_mul(height));
        let values = 4 + maps.into_iter().map(|map| map.width() as u64).sum::<u64>();
        let what = if count == 1 { "a picture".into() } else { format!("{count} pictures") };
        check_memory(&format!("{what} of {width}x{height}"), pixels.saturating_mul(4 * values))?;
        Ok(Self { count, pixels: usize::try_from(pixels).unwrap_or(usize::MAX), ..Self::default() })
    }

    /// Adds a picture.
    pub fn push(&mut self, picture: Picture) {
        let Picture { frame, report, camera, unseen, .. } = picture;
        let height = frame.height;
        self.append(frame);
        self.height = height;
        self.cameras.push(camera);
        self.reports.push(serde_json::to_string(&report).unwrap_or_default());
        self.unseen.push(unseen.map(|unseen| unseen.sentence()));
    }

    /// Adds a picture that parts make.
    pub fn merged(&mut self, frame: Frame, report: &Report, camera: Camera) {
        self.append(frame);
        self.cameras.push(camera);
        self.reports.push(serde_json::to_string(report).unwrap_or_default());
        self.unseen.push(None);
    }

    /// Adds the rows of a frame.
    pub fn append(&mut self, frame: Frame) {
        (self.width, self.height) = (frame.width, self.height + frame.height);
        let (color, maps) = frame.into_values();
        joined(&mut self.color, color.into_flattened(), 4 * self.pixels);
        for (map, values) in maps {
            joined(self.maps.entry(map).or_default(), values, map.width() * self.pixels);
        }
    }

    /// Adds the report of a map, and its camera if there is one.
    pub fn surveyed(&mut self, survey: &Survey, camera: Option<Camera>) {
        self.cameras.extend(camera);
        self.reports.push(serde_json::to_string(&survey.report).unwrap_or_default());
        self.unseen.push(survey.unseen.as_ref().map(|unseen| unseen.sentence()));
    }

    /// Returns `color` (C, H, W, 4) and the maps (C, H, W) or (C, H, W, K) as arrays, with the
    /// cameras' matrices, the reports and the sentences about empty pictures.
    pub fn into_arrays(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let Self { count, width, height, color, maps, cameras, reports, unseen, .. } = self;
        let size = [count, height as usize, width as usize];
        let result = PyDict::new(py);
        result.set_item("color", shaped(py, color, size, 4)?)?;
        let arrays_of_maps = PyDict::new(py);
        for (map, values) in maps {
            let row = map.row();
            let array = match row.numbers {
                // The numbers are stored in the bits of the values.
                true => shaped(py, values.into_iter().map(f32::to_bits).collect(), size, map.width())?,
                false => shaped(py, values, size, map.width())?,
            };
            arrays_of_maps.set_item(row.name, array)?;
        }
        let (poses, intrinsics) = arrays(py, &cameras)?;
        result.set_item("maps", arrays_of_maps)?;
        result.set_item("viewmats", poses)?;
        let views = cameras.into_iter().enumerate();
        let views = views.map(|(index, camera)| View::known(camera.into(), format!("of picture {index}")));
        result.set_item("views", views.collect::<Vec<_>>())?;
        result.set_item("Ks", intrinsics)?;
        result.set_item("reports", reports)?;
        result.set_item("unseen", unseen)?;
        Ok(result)
    }
}

/// Appends values to those that will be `count`, without a copy if these are all.
fn joined(all: &mut Vec<f32>, values: Vec<f32>, count: usize) {
    if all.is_empty() {
        *all = values;
        all.reserve_exact(count.saturating_sub(all.len()));
    } else {
        all.extend(values);
    }
}

/// Returns an array of the values, with `each` values a pixel.
fn shaped<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    [count, height, width]: [usize; 3],
    each: usize,
) -> PyResult<Bound<'_, PyAny>> {
    let array = PyArray1::from_vec(py, values);
    Ok(match each {
        1 => array.reshape([count, height, width])?.into_any(),
        _ => array.reshape([count, height, width, each])?.into_any(),
    })
}
