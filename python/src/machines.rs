//! Pictures that several processes draw: parts as bytes.

use epsplat::{Camera, DeviceOptions, Frame, Part, Report, merge};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};

use crate::options::{Scope, arguments, parsed};
use crate::stack::Stack;
use crate::task::run;

/// Reads parts; errors call them by their places in the list.
fn read(parts: &[PyBackedBytes]) -> epsplat::Result<Vec<Part>> {
    parts.iter().enumerate().map(|(index, bytes)| Part::of_bytes(format!("parts[{index}]"), bytes)).collect()
}

/// Reads a part, and joins it if it is several ones.
pub fn one(name: &str, parts: &[PyBackedBytes]) -> epsplat::Result<Part> {
    match parts {
        [bytes] => Part::of_bytes(name, bytes),
        _ => merge(&read(parts)?),
    }
}

/// Joins parts of one picture. Returns the bytes of a part.
#[pyfunction]
pub fn merge_parts(py: Python<'_>, parts: Vec<PyBackedBytes>) -> PyResult<Bound<'_, PyBytes>> {
    let (bytes, _) = run(py, None, |_| Ok(merge(&read(&parts)?)?.bytes()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// Makes the picture of all parts.
#[pyfunction]
pub fn picture<'py>(
    py: Python<'py>,
    parts: Vec<PyBackedBytes>,
    keywords: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let device: DeviceOptions = parsed(py, &arguments(Scope::Renderer, keywords)?)?.device;
    let (stack, notes) = run(py, progress, |progress| {
        let part = one("the part", &parts)?;
        part.check_picture()?;
        let merged = part.picture(&device, progress)?;
        let (frame, report, camera): (Frame, Report, Camera) = (merged.frame, merged.report, merged.camera);
        let mut stack = Stack::of(1, [camera.width.into(), camera.height.into()], part.maps().iter())?;
        stack.merged(frame, &report, camera);
        Ok(stack)
    })?;
    let result = stack.into_arrays(py)?;
    result.set_item("notes", notes)?;
    Ok(result)
}
