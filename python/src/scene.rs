//! Scenes of files and of arrays.

use std::path::PathBuf;

use epsplat::io::ColorBy;
use epsplat::io::Column;
use epsplat::io::points::{Faces, Points};
use epsplat::low_level::scene::{Colors, Up};
use epsplat::{SceneOptions, low_level};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{integers, last_axis, narrow, scalars, wide, wide_scalars};
use crate::error::{exception, usage};
use crate::options::{Scope, arguments, parsed};

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
        let scene = epsplat::Scene::open(paths, &options).map_err(|error| exception(py, &error))?;
        Ok(Self { scene, arguments, options, points: None })
    }

    /// A scene of arrays, whose names are the keys of `arrays`.
    #[staticmethod]
    fn of_arrays(py: Python<'_>, arrays: &Bound<'_, PyDict>, keywords: &Bound<'_, PyDict>) -> PyResult<Self> {
        let arguments = arguments(Scope::Scene, keywords)?;
        let options = parsed(py, &arguments)?.scene;
        let points = points(arrays, &options)?;
        let count = points.positions.len() as u64;
        let scene = epsplat::Scene::from_points(vec![points], &options);
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

/// Converts arrays to points.
fn points(arrays: &Bound<'_, PyDict>, options: &SceneOptions) -> PyResult<Points> {
    let py = arrays.py();
    let array = |name: &str| arrays.get_item(name).map(|array| array.filter(|array| !array.is_none()));
    let Some(positions) = array("positions")? else { return Err(usage(py, "positions: an array is needed")) };
    let positions = wide::<3>("positions", &positions, None)?;
    let count = positions.len();
    if count == 0 {
        return Err(usage(py, "positions: the array is empty, and there is nothing to draw"));
    }
    if u32::try_from(count).is_err() {
        return Err(usage(py, "positions: a scene has at most 4294967295 points"));
    }
    let alpha = array("alpha")?.map(|alpha| scalars("alpha", &alpha, count)).transpose()?;
    let colors = array("colors")?.map(|colors| of_colors(&colors, count)).transpose()?;
    let faces = array("triangles")?.map(|triangles| faces(&triangles, count)).transpose()?;
    let axes = array("half_axes")?.map(|axes| narrow::<6>("half_axes", &axes, count, &[2, 3])).transpose()?;
    Ok(Points {
        normals: array("normals")?.map(|normals| narrow("normals", &normals, count, &[3])).transpose()?,
        radii: array("radii")?.map(|radii| scalars("radii", &radii, count)).transpose()?,
        axes: axes.map(|all| all.into_iter().map(|[a, b, c, d, e, f]| [[a, b, c], [d, e, f]]).collect()),
        colors: with_alpha(colors, alpha),
        texture: array("texture")?.map(|places| narrow("texture", &places, count, &[2])).transpose()?,
        of_mesh: faces.is_some(),
        faces,
        column: column(arrays, options, count)?.map(Box::new),
        up: array("up")?.map(|up| up.extract::<String>()).transpose()?.and_then(|up| match up.as_str() {
            "y" => Some(Up::Y),
            "z" => Some(Up::Z),
            _ => None,
        }),
        positions,
        ..Points::default()
    })
}

/// Reads colours: 8-bit sRGB codes, or linear floats.
fn of_colors(colors: &Bound<'_, PyAny>, count: usize) -> PyResult<Colors> {
    if last_axis(colors)? == 4 {
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
fn faces(triangles: &Bound<'_, PyAny>, count: usize) -> PyResult<Faces> {
    let py = triangles.py();
    let all = integers::<i64, 3>("triangles", triangles, None)?
        .ok_or_else(|| usage(py, "triangles: an array of integers is needed"))?;
    let index = |value: i64| u32::try_from(value).ok().filter(|index| (*index as usize) < count);
    let triangle = |[a, b, c]: [i64; 3]| Some([index(a)?, index(b)?, index(c)?]);
    let triangles = all.into_iter().map(triangle).collect::<Option<Vec<_>>>();
    let triangles = triangles.ok_or_else(|| {
        usage(py, &format!("triangles: the indices lie between 0 and {}, and some do not", count - 1))
    })?;
    Ok(Faces { triangles, ..Faces::default() })
}

/// Reads the attribute that the options colour by, if it is one of `attributes`.
fn column(arrays: &Bound<'_, PyDict>, options: &SceneOptions, count: usize) -> PyResult<Option<Column>> {
    let Some(ColorBy::Attribute(name)) = &options.colors.color_by else { return Ok(None) };
    let Some(attributes) = arrays.get_item("attributes")?.filter(|all| !all.is_none()) else {
        return missing(arrays.py(), name);
    };
    match attributes.cast::<PyDict>()?.get_item(name)? {
        Some(values) => Ok(Some(Column::new(name.clone(), wide_scalars(name, &values, count)?))),
        None => missing(arrays.py(), name),
    }
}

/// Coordinates are attributes too; others have to be given.
fn missing(py: Python<'_>, name: &str) -> PyResult<Option<Column>> {
    match ["x", "y", "z"].iter().any(|axis| axis.eq_ignore_ascii_case(name)) {
        true => Ok(None),
        false => Err(usage(py, &format!("the points have no attribute '{name}': give it in attributes"))),
    }
}
