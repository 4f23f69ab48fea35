//! Arrays of numpy as the library's vectors. `epsplat/_arrays.py` has made f32, f64, u8 or i64 of
//! all other types.

use epsplat::{Error, Result};
use numpy::ndarray::ArrayView2;
use numpy::npyffi::NPY_ORDER;
use numpy::{Element, PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Rows that are converted before other threads may take the interpreter's lock.
const ROWS_AT_ONCE: usize = 1 << 20;

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

fn usage<T>(sentence: String) -> Result<T> {
    Err(Error::Usage(sentence))
}

/// Fails if `array` has another shape than `(rows, tail...)`. None stands for any number of rows.
pub fn check_shape(name: &str, array: &Bound<'_, PyAny>, rows: Option<usize>, tail: &[usize]) -> Result<()> {
    let Ok(array) = array.cast::<PyUntypedArray>() else { return usage(format!("{name}: an array is needed")) };
    let shape = array.shape();
    if shape.len() == tail.len() + 1 && shape[1..] == *tail && rows.is_none_or(|rows| rows == shape[0]) {
        return Ok(());
    }
    let first = rows.map_or("N".to_owned(), |rows| rows.to_string());
    let text = |all: &[String]| if all.len() == 1 { format!("({},)", all[0]) } else { format!("({})", all.join(", ")) };
    let wanted: Vec<String> = [first].into_iter().chain(tail.iter().map(ToString::to_string)).collect();
    let given: Vec<String> = shape.iter().map(ToString::to_string).collect();
    usage(format!("{name}: the shape is {}, and {} is needed", text(&given), text(&wanted)))
}

/// Fails if this many bytes are more than the system has free.
pub fn check_memory(what: &str, bytes: u64) -> Result<()> {
    let free = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    });
    let is_free = free.is_none_or(|free| bytes < free << 10);
    if is_free && Vec::<u8>::new().try_reserve_exact(usize::try_from(bytes).unwrap_or(usize::MAX)).is_ok() {
        return Ok(());
    }
    Err(Error::NoMemory { what: what.to_owned(), mebibytes: bytes.div_ceil(1 << 20) })
}

/// Reads rows of N numbers of the type T, in an array of shape `(rows, tail...)`; None if the array
/// is of another type.
fn rows<T: Element + Copy, U, const N: usize>(
    name: &str,
    array: &Bound<'_, PyAny>,
    (rows, tail): (Option<usize>, &[usize]),
    number: impl Fn(T) -> U,
) -> Result<Option<Vec<[U; N]>>> {
    let Ok(array) = array.cast::<PyArrayDyn<T>>() else { return Ok(None) };
    check_shape(name, array, rows, tail)?;
    let count = array.shape()[0];
    check_memory(&format!("a copy of {name}"), count as u64 * size_of::<[U; N]>() as u64)?;
    let size = size_of::<T>() as isize;
    if !(array.data() as usize).is_multiple_of(align_of::<T>())
        || array.strides().iter().any(|stride| stride % size != 0)
    {
        return usage(format!("{name}: the numbers are not aligned in memory: give a copy"));
    }
    let failed = |_| Error::Usage(format!("{name}: the array cannot be read as {count} rows of {N} numbers"));
    // Rows of one number have no axis of their own, half-axes have two.
    let flat = match array.cast::<PyArray2<T>>() {
        Ok(array) => array.clone(),
        Err(_) => array.reshape_with_order([count, N], NPY_ORDER::NPY_CORDER).map_err(failed)?,
    };
    let view = flat.try_readonly().map_err(|error| Error::Usage(format!("{name}: {error}")))?;
    Ok(Some(converted(array.py(), &view.as_array(), number)))
}

/// Converts each row. Between blocks of rows other threads may take the interpreter's lock, and
/// signals are handled.
fn converted<T: Element + Copy, U, const N: usize>(
    py: Python<'_>,
    array: &ArrayView2<'_, T>,
    number: impl Fn(T) -> U,
) -> Vec<[U; N]> {
    let mut all = Vec::with_capacity(array.nrows());
    for first in (0..array.nrows()).step_by(ROWS_AT_ONCE) {
        let end = array.nrows().min(first + ROWS_AT_ONCE);
        all.extend((first..end).map(|row| std::array::from_fn(|column| number(array[[row, column]]))));
        py.detach(|| {});
    }
    all
}

/// Reads f64 rows.
pub fn wide<const N: usize>(name: &str, array: &Bound<'_, PyAny>, count: Option<usize>) -> Result<Vec<[f64; N]>> {
    let shape: (_, &[usize]) = (count, &[N]);
    match rows(name, array, shape, |value: f32| value.wide())? {
        Some(all) => Ok(all),
        None => numbers(name, rows(name, array, shape, |value: f64| value.wide())?),
    }
}

/// Reads f32 rows of N numbers, in an array of shape `(count, tail...)`.
pub fn narrow<const N: usize>(
    name: &str,
    array: &Bound<'_, PyAny>,
    count: usize,
    tail: &[usize],
) -> Result<Vec<[f32; N]>> {
    match rows(name, array, (Some(count), tail), |value: f32| value.narrow())? {
        Some(all) => Ok(all),
        None => numbers(name, rows(name, array, (Some(count), tail), |value: f64| value.narrow())?),
    }
}

fn numbers<T>(name: &str, all: Option<T>) -> Result<T> {
    all.ok_or_else(|| Error::Usage(format!("{name}: an array of numbers is needed")))
}

/// Reads one f32 a row.
pub fn scalars(name: &str, array: &Bound<'_, PyAny>, count: usize) -> Result<Vec<f32>> {
    Ok(narrow::<1>(name, array, count, &[])?.into_flattened())
}

/// Reads one f64 a row.
pub fn wide_scalars(name: &str, array: &Bound<'_, PyAny>, count: usize) -> Result<Vec<f64>> {
    let shape: (_, &[usize]) = (Some(count), &[]);
    let all: Vec<[f64; 1]> = match rows(name, array, shape, |value: f32| value.wide())? {
        Some(all) => all,
        None => numbers(name, rows(name, array, shape, |value: f64| value.wide())?)?,
    };
    Ok(all.into_flattened())
}

/// Reads rows of N integers; None if the array is of another type.
pub fn integers<T: Element + Copy, const N: usize>(
    name: &str,
    array: &Bound<'_, PyAny>,
    count: Option<usize>,
) -> Result<Option<Vec<[T; N]>>> {
    rows(name, array, (count, &[N]), |value: T| value)
}

/// The numbers of the last axis of an array; 0 if it has no axis.
pub fn last_axis(array: &Bound<'_, PyAny>) -> usize {
    array.cast::<PyUntypedArray>().ok().and_then(|array| array.shape().last().copied()).unwrap_or(0)
}
