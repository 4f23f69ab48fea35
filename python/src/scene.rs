//! Scenes of files and of arrays.

use std::borrow::Cow;
use std::path::PathBuf;

use epsplat::io::ColorBy;
use epsplat::io::Column;
use epsplat::io::points::{Faces, Points};
use epsplat::low_level::scene::{Colors, Up};
use epsplat::options::InputOptions;
use epsplat::{Error, Given, Progress, Result, SceneOptions, low_level};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{check_shape, integers, last_axis, narrow, scalars, wide, wide_scalars};
use crate::error::exception;
use crate::options::{Scope, arguments, parsed};
use crate::task::run;

/// A scene, and the arguments that its options were parsed from.
#[pyclass(frozen, module = "epsplat._epsplat")]
pub struct Scene {
    pub scene: epsplat::Scene,
    pub arguments: Vec<String>,
    pub options: SceneOptions,
    /// The points of a scene of arrays; None for files.
    points: Option<u64>,
}

#[pymethods]
impl Scene {
    /// A scene of files and folders.
    #[staticmethod]
    fn open(py: Python<'_>, paths: Vec<PathBuf>, keywords: &Bound<'_, PyDict>) -> PyResult<Self> {
        let arguments = arguments(Scope::Scene, keywords)?;
        let options = parsed(py, &arguments)?.scene;
        let (scene, _) = run(py, None, |_| epsplat::Scene::open(paths, &options))?;
        Ok(Self { scene, arguments, options, points: None })
    }

    /// A scene of arrays, whose names are the keys of `arrays`.
    #[staticmethod]
    fn of_arrays(py: Python<'_>, arrays: &Bound<'_, PyDict>, keywords: &Bound<'_, PyDict>) -> PyResult<Self> {
        let arguments = arguments(Scope::Scene, keywords)?;
        let options = parsed(py, &arguments)?.scene;
        let count = checked_once(arrays, &options).map_err(|error| exception(py, &error))? as u64;
        let given = Arrays { arrays: arrays.clone().unbind(), options: options.clone() };
        let scene = epsplat::Scene::from_given(given, &options);
        Ok(Self { scene, arguments, options, points: Some(count) })
    }

    /// The files of the scene, including those found in folders.
    #[getter]
    fn files(&self) -> Vec<PathBuf> {
        self.scene.files().paths().to_vec()
    }

    /// The number of points of a scene of arrays; None for files, which are read later.
    #[getter]
    fn points(&self) -> Option<u64> {
        self.points
    }
}

impl Scene {
    /// A scene of points that the library made.
    pub fn of(points: Points) -> Self {
        let (options, count) = (SceneOptions::default(), points.positions.len() as u64);
        let scene = epsplat::Scene::from_points(vec![points], &options);
        Self { scene, arguments: Vec::new(), options, points: Some(count) }
    }
}

/// Arrays of numpy, by their names. The scene shares their memory.
struct Arrays {
    arrays: Py<PyDict>,
    options: SceneOptions,
}

impl Given for Arrays {
    fn inputs(&self) -> usize {
        1
    }

    fn points(&self, progress: &dyn Progress) -> Result<Cow<'_, [Points]>> {
        // The caller waits without the interpreter's lock.
        let points = Python::attach(|py| points(self.arrays.bind(py), &self.options))?;
        // Ends here after a signal.
        progress.advance(0);
        Ok(Cow::Owned(vec![points]))
    }
}

/// An array by its name; None if it is not given.
fn array<'py>(arrays: &Bound<'py, PyDict>, name: &str) -> Option<Bound<'py, PyAny>> {
    arrays.get_item(name).ok().flatten().filter(|array| !array.is_none())
}

fn usage<T>(sentence: impl Into<String>) -> Result<T> {
    Err(Error::Usage(sentence.into()))
}

/// Checks all that can be said of arrays before a picture is made. Returns the number of points.
fn checked_once(arrays: &Bound<'_, PyDict>, options: &SceneOptions) -> Result<usize> {
    if options.input != InputOptions::default() {
        return usage(
            "where, classes and other options that choose points of files do not apply to arrays: select their rows",
        );
    }
    let count = checked(arrays, options)?;
    array(arrays, "triangles").map_or(Ok(()), |triangles| faces(&triangles, count).map(|_| ()))?;
    Ok(count)
}

/// Checks the shapes of arrays. Returns the number of points.
fn checked(arrays: &Bound<'_, PyDict>, options: &SceneOptions) -> Result<usize> {
    let Some(positions) = array(arrays, "positions") else { return usage("positions: an array is needed") };
    check_shape("positions", &positions, None, &[3])?;
    let count = positions.len().unwrap_or(0);
    if count == 0 {
        return usage("positions: the array is empty, and there is nothing to draw");
    }
    if u32::try_from(count).is_err() {
        return usage("positions: a scene has at most 4294967295 points");
    }
    let tails: [(&str, &[usize]); 5] =
        [("normals", &[3]), ("radii", &[]), ("half_axes", &[2, 3]), ("alpha", &[]), ("texture", &[2])];
    for (name, tail) in tails {
        array(arrays, name).map_or(Ok(()), |array| check_shape(name, &array, Some(count), tail))?;
    }
    if let Some(colors) = array(arrays, "colors") {
        let channels = if last_axis(&colors) == 4 { 4 } else { 3 };
        check_shape("colors", &colors, Some(count), &[channels])?;
    }
    if let Some(triangles) = array(arrays, "triangles") {
        check_shape("triangles", &triangles, None, &[3])?;
    }
    if let Some(ColorBy::Attribute(name)) = &options.colors.color_by
        && let Some(values) = attribute(arrays, name)?
    {
        check_shape(name, &values, Some(count), &[])?;
    }
    Ok(count)
}

/// Converts arrays to points.
fn points(arrays: &Bound<'_, PyDict>, options: &SceneOptions) -> Result<Points> {
    let count = checked(arrays, options)?;
    let positions = match array(arrays, "positions") {
        Some(positions) => wide::<3>("positions", &positions, Some(count))?,
        None => Vec::new(),
    };
    let scalars = |name: &str| array(arrays, name).map(|array| scalars(name, &array, count)).transpose();
    let colors = array(arrays, "colors").map(|colors| of_colors(&colors, count)).transpose()?;
    let faces = array(arrays, "triangles").map(|triangles| faces(&triangles, count)).transpose()?;
    let axes = array(arrays, "half_axes").map(|axes| narrow::<6>("half_axes", &axes, count, &[2, 3])).transpose()?;
    Ok(Points {
        normals: array(arrays, "normals").map(|normals| narrow("normals", &normals, count, &[3])).transpose()?,
        radii: scalars("radii")?,
        axes: axes.map(|all| all.into_iter().map(|[a, b, c, d, e, f]| [[a, b, c], [d, e, f]]).collect()),
        colors: with_alpha(colors, scalars("alpha")?),
        texture: array(arrays, "texture").map(|places| narrow("texture", &places, count, &[2])).transpose()?,
        of_mesh: faces.is_some(),
        faces,
        column: column(arrays, options, count)?.map(Box::new),
        up: array(arrays, "up").and_then(|up| match up.extract::<String>().unwrap_or_default().as_str() {
            "y" => Some(Up::Y),
            "z" => Some(Up::Z),
            _ => None,
        }),
        positions,
        ..Points::default()
    })
}

/// Reads colours: 8-bit sRGB codes, or linear floats.
fn of_colors(colors: &Bound<'_, PyAny>, count: usize) -> Result<Colors> {
    if last_axis(colors) == 4 {
        return Ok(match integers::<u8, 4>("colors", colors, Some(count))? {
            Some(codes) => Colors::Srgb8(codes),
            None => Colors::Linear(narrow("colors", colors, count, &[4])?),
        });
    }
    Ok(match integers::<u8, 3>("colors", colors, Some(count))? {
        Some(codes) => Colors::Srgb8(codes.into_iter().map(|[r, g, b]| [r, g, b, 255]).collect()),
        None => {
            let colors = narrow::<3>("colors", colors, count, &[3])?;
            Colors::Linear(colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect())
        }
    })
}

/// Multiplies the alphas of colours. Without colours the default one is taken.
fn with_alpha(colors: Option<Colors>, alpha: Option<Vec<f32>>) -> Option<Colors> {
    let Some(alpha) = alpha else { return colors };
    let mut linear = match colors {
        Some(Colors::Srgb8(codes)) => codes.into_iter().map(low_level::scene::color::decoded).collect(),
        Some(Colors::Linear(colors)) => colors,
        _ => vec![low_level::scene::color::DEFAULT_COLOR; alpha.len()],
    };
    linear.iter_mut().zip(alpha).for_each(|(color, alpha)| color[3] *= alpha);
    Some(Colors::Linear(linear))
}

/// Reads triangles, whose indices have to be those of points.
fn faces(triangles: &Bound<'_, PyAny>, count: usize) -> Result<Faces> {
    let Some(all) = integers::<i64, 3>("triangles", triangles, None)? else {
        return usage("triangles: an array of integers is needed");
    };
    let index = |value: i64| u32::try_from(value).ok().filter(|index| (*index as usize) < count);
    let triangle = |[a, b, c]: [i64; 3]| Some([index(a)?, index(b)?, index(c)?]);
    match all.into_iter().map(triangle).collect::<Option<Vec<_>>>() {
        Some(triangles) => Ok(Faces { triangles, ..Faces::default() }),
        None => usage(format!("triangles: the indices lie between 0 and {}, and some do not", count - 1)),
    }
}

/// Reads the attribute that the options colour by, if it is one of `attributes`.
fn column(arrays: &Bound<'_, PyDict>, options: &SceneOptions, count: usize) -> Result<Option<Column>> {
    let Some(ColorBy::Attribute(name)) = &options.colors.color_by else { return Ok(None) };
    let Some(values) = attribute(arrays, name)? else { return Ok(None) };
    Ok(Some(Column::new(name.clone(), wide_scalars(name, &values, count)?)))
}

/// The attribute of this name; None for a coordinate, which is an attribute of all points.
fn attribute<'py>(arrays: &Bound<'py, PyDict>, name: &str) -> Result<Option<Bound<'py, PyAny>>> {
    let given = array(arrays, "attributes").and_then(|all| all.cast::<PyDict>().ok().and_then(|all| array(all, name)));
    match given {
        Some(values) => Ok(Some(values)),
        None if ["x", "y", "z"].iter().any(|axis| axis.eq_ignore_ascii_case(name)) => Ok(None),
        None => usage(format!("the points have no attribute '{name}': give it in attributes")),
    }
}
