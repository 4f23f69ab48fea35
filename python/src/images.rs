//! Images of arrays, in the formats that the command line writes.

use std::io::Write;
use std::path::{Path, PathBuf};

use epsplat::io::atomic::write_whole;
use epsplat::io::images::{Content, Image, ImageFormat};
use epsplat::low_level::scene::MAPS;
use epsplat::{Error, Frame, Result};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::narrow;
use crate::error::{exception, usage};
use crate::renderer::OfMap;

/// Makes a frame of a colour (H, W, 4) and of maps (H, W) or (H, W, K), which are contiguous arrays
/// of f32, or of u32 for maps of numbers.
pub fn frame(color: &Bound<'_, PyAny>, maps: Option<&Bound<'_, PyDict>>) -> PyResult<Frame> {
    let py = color.py();
    let shape: Vec<usize> = color.getattr("shape")?.extract()?;
    let [height, width, 4] = shape[..] else { return Err(usage(py, "an image has the shape (H, W, 4)")) };
    let pixels = color.call_method1("reshape", ((height * width, 4),))?;
    let colors = narrow::<4>("color", &pixels, height * width, &[4]).map_err(|error| exception(py, &error))?;
    let side = |side: usize| u32::try_from(side).map_err(|_| usage(py, "the image is too large"));
    let mut frame = Frame::of_colors(side(width)?, side(height)?, colors);
    for (name, values) in maps.into_iter().flatten() {
        let name: String = name.extract()?;
        let row =
            MAPS.iter().find(|row| row.name == name).ok_or_else(|| usage(py, &format!("there is no map {name}")))?;
        let values: Vec<f32> = match values.cast::<PyArrayDyn<u32>>() {
            Ok(numbers) => numbers.try_readonly()?.as_array().iter().map(|number| f32::from_bits(*number)).collect(),
            Err(_) => values.cast::<PyArrayDyn<f32>>()?.try_readonly()?.as_array().iter().copied().collect(),
        };
        if values.len() != height * width * row.map.width() {
            return Err(usage(py, &format!("{name}: the map has another number of pixels than the colour")));
        }
        frame = frame.with(row.map, values);
    }
    Ok(frame)
}

/// Encodes a colour (H, W, 4), linear with straight alpha, in a format such as png.
#[pyfunction]
pub fn encode<'py>(py: Python<'py>, color: &Bound<'py, PyAny>, format: &str) -> PyResult<Bound<'py, PyBytes>> {
    let frame = frame(color, None)?;
    let encoded = py.detach(|| {
        let image = Image { frame: &frame, content: Content::Color, place: None };
        format.parse::<ImageFormat>()?.encoded(Path::new("the image"), &image)
    });
    Ok(PyBytes::new(py, &encoded.map_err(|error| exception(py, &error))?))
}

/// Writes a colour and maps to a file, whose extension says the format.
#[pyfunction]
#[pyo3(signature = (path, color, maps, depth_scale=None, place=None))]
pub fn save(
    py: Python<'_>,
    path: PathBuf,
    color: &Bound<'_, PyAny>,
    maps: &Bound<'_, PyDict>,
    depth_scale: Option<f64>,
    place: Option<PyRef<'_, OfMap>>,
) -> PyResult<()> {
    let frame = frame(color, Some(maps))?;
    let place = place.map(|place| place.0.clone());
    let written: Result<(), Error> = py.detach(|| {
        let format = ImageFormat::of_path(&path)?;
        let content = format.content(frame.maps(), depth_scale)?;
        format.write(&path, &Image { frame: &frame, content, place: place.as_ref() })?;
        match (&place, format.world()) {
            (Some(place), Some(extension)) => {
                let text = place.world_file();
                write_whole(&path.with_extension(extension), |file| file.write_all(text.as_bytes()))
            }
            _ => Ok(()),
        }
    });
    written.map_err(|error| exception(py, &error))
}
