//! Arrays of numpy as the library's vectors. `epsplat/_arrays.py` has made f32, f64, u8 or u32 of
//! all other types.

use epsplat::Error;
use numpy::ndarray::{ArrayView, Dimension, IxDyn};
use numpy::{Element, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::{exception, usage};

/// A number of an array.
pub trait Number: Element + Copy {
    fn wide(self) -> f64;
    fn narrow(self) -> f32;
}

impl Number for f32 {
    fn wide(self) -> f64 {
        self.into()
    }
    fn narrow(self) -> f32 {
        self
    }
}

impl Number for f64 {
    fn wide(self) -> f64 {
        self
    }
    fn narrow(self) -> f32 {
        self as f32
    }
}

/// An array of f32 or f64.
enum Floats<'py> {
    Single(PyReadonlyArrayDyn<'py, f32>),
    Double(PyReadonlyArrayDyn<'py, f64>),
}

/// Fails if `array` has another shape than `(rows, tail...)`. None stands for any number of rows.
fn check_shape(py: Python<'_>, name: &str, shape: &[usize], rows: Option<usize>, tail: &[usize]) -> PyResult<()> {
    if shape.len() == tail.len() + 1 && shape[1..] == *tail && rows.is_none_or(|rows| rows == shape[0]) {
        return Ok(());
    }
    let first = rows.map_or("N".to_owned(), |rows| rows.to_string());
    let text = |all: &[String]| if all.len() == 1 { format!("({},)", all[0]) } else { format!("({})", all.join(", ")) };
    let wanted: Vec<String> = [first].into_iter().chain(tail.iter().map(ToString::to_string)).collect();
    let given: Vec<String> = shape.iter().map(ToString::to_string).collect();
    Err(usage(py, &format!("{name}: the shape is {}, and {} is needed", text(&given), text(&wanted))))
}

/// Fails if this many bytes are more than the system has free.
fn check_memory(py: Python<'_>, name: &str, bytes: u64) -> PyResult<()> {
    let free = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    });
    let is_free = free.is_none_or(|free| bytes < free << 10);
    if is_free && Vec::<u8>::new().try_reserve_exact(usize::try_from(bytes).unwrap_or(usize::MAX)).is_ok() {
        return Ok(());
    }
    let error = Error::NoMemory { what: format!("a copy of {name}"), mebibytes: bytes.div_ceil(1 << 20) };
    Err(exception(py, &error))
}

impl<'py> Floats<'py> {
    fn new(name: &str, array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = array.cast::<PyArrayDyn<f32>>() {
            return Ok(Self::Single(array.try_readonly()?));
        }
        match array.cast::<PyArrayDyn<f64>>() {
            Ok(array) => Ok(Self::Double(array.try_readonly()?)),
            Err(_) => Err(usage(array.py(), &format!("{name}: an array of numbers is needed"))),
        }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::Single(array) => array.shape(),
            Self::Double(array) => array.shape(),
        }
    }
}

/// Converts each row of N numbers.
fn converted<T: Number, U: Copy + Default, const N: usize>(
    array: &ArrayView<'_, T, IxDyn>,
    number: impl Fn(T) -> U,
) -> Vec<[U; N]> {
    if let Some(all) = array.as_slice() {
        return all.chunks_exact(N).map(|row| std::array::from_fn(|i| number(row[i]))).collect();
    }
    let mut rows = Vec::with_capacity(array.shape()[0]);
    for row in array.outer_iter() {
        let mut values = [U::default(); N];
        values.iter_mut().zip(row.iter()).for_each(|(value, from)| *value = number(*from));
        rows.push(values);
    }
    rows
}

/// Reads f64 rows.
pub fn wide<const N: usize>(name: &str, array: &Bound<'_, PyAny>, rows: Option<usize>) -> PyResult<Vec<[f64; N]>> {
    let (py, floats) = (array.py(), Floats::new(name, array)?);
    check_shape(py, name, floats.shape(), rows, &[N])?;
    check_memory(py, name, floats.shape()[0] as u64 * N as u64 * 8)?;
    Ok(match &floats {
        Floats::Single(array) => converted(&array.as_array(), Number::wide),
        Floats::Double(array) => converted(&array.as_array(), Number::wide),
    })
}

/// Reads f32 rows of N numbers, in an array of shape `(rows, tail...)`.
pub fn narrow<const N: usize>(
    name: &str,
    array: &Bound<'_, PyAny>,
    rows: usize,
    tail: &[usize],
) -> PyResult<Vec<[f32; N]>> {
    let (py, floats) = (array.py(), Floats::new(name, array)?);
    check_shape(py, name, floats.shape(), Some(rows), tail)?;
    check_memory(py, name, rows as u64 * N as u64 * 4)?;
    Ok(match &floats {
        Floats::Single(array) => converted(&array.as_array(), Number::narrow),
        Floats::Double(array) => converted(&array.as_array(), Number::narrow),
    })
}

/// Reads one f32 a row.
pub fn scalars(name: &str, array: &Bound<'_, PyAny>, rows: usize) -> PyResult<Vec<f32>> {
    Ok(narrow::<1>(name, array, rows, &[])?.into_iter().flatten().collect())
}

/// Reads one f64 a row.
pub fn wide_scalars(name: &str, array: &Bound<'_, PyAny>, rows: usize) -> PyResult<Vec<f64>> {
    let (py, floats) = (array.py(), Floats::new(name, array)?);
    check_shape(py, name, floats.shape(), Some(rows), &[])?;
    Ok(match &floats {
        Floats::Single(array) => array.as_array().iter().map(|value| value.wide()).collect(),
        Floats::Double(array) => array.as_array().iter().copied().collect(),
    })
}

/// Reads rows of N integers; None if the array is of another type.
pub fn integers<T: Element + Copy + Default, const N: usize>(
    name: &str,
    array: &Bound<'_, PyAny>,
    rows: Option<usize>,
) -> PyResult<Option<Vec<[T; N]>>> {
    let Ok(array) = array.cast::<PyArrayDyn<T>>() else { return Ok(None) };
    check_shape(array.py(), name, array.shape(), rows, &[N])?;
    let array = array.try_readonly()?;
    let view = array.as_array();
    let row = |row: ArrayView<'_, T, _>| {
        let mut values = [T::default(); N];
        values.iter_mut().zip(row.iter()).for_each(|(value, from)| *value = *from);
        values
    };
    Ok(Some(view.outer_iter().map(row).collect()))
}

/// The numbers of the last axis of an array.
pub fn last_axis(array: &Bound<'_, PyAny>) -> PyResult<usize> {
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    Ok(if IxDyn(&shape).ndim() > 0 { shape[shape.len() - 1] } else { 0 })
}
