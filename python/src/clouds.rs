//! Functions of clouds: surfels from points, sampling, simplification, levels of detail, coverage
//! and visible points. Each does what the command of its name does.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use epsplat::io::points::Points;
use epsplat::io::{Mesh, ply};
use epsplat::low_level::metrics::SurfaceDistances;
use epsplat::low_level::metrics::coverage::coverage as measured;
use epsplat::low_level::scene::Cut;
use epsplat::low_level::surfels::sampling::voxels::Voxel;
use epsplat::low_level::surfels::sampling::{MeshSurface, Method, Priority, sample as sampled};
use epsplat::low_level::surfels::simplify::{Options, SplatShape, Tolerance, points, simplify_in_texture};
use epsplat::low_level::surfels::{
    FromPoints, Limits, Orientation, Size, build, build_at_vertices, build_within, curve, from_points, hierarchy,
};
use epsplat::low_level::truth::TriangleTree;
use epsplat::options::ColorOptions;
use epsplat::options::parse::orientation;
use epsplat::{Error, Progress, Result, SceneOptions};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};

use crate::error::{exception, usage};
use crate::options::{Scope, arguments, parsed};
use crate::scene::Scene;
use crate::task::run;
use crate::view::View;

/// The points of a scene's inputs, without the colours of an attribute.
pub fn inputs(scene: &epsplat::Scene, progress: &dyn Progress) -> Result<Vec<Points>> {
    match scene.files().paths().is_empty() {
        true => scene.points(progress).map(Cow::into_owned),
        false => scene.files().read(progress),
    }
}

/// The limits of surfels: those of the scene's options, and others of `keywords`.
fn limits(py: Python<'_>, scene: &Scene, keywords: &Bound<'_, PyDict>) -> PyResult<Limits> {
    if scene.options.colors.color_by.is_some() {
        return Err(usage(py, "color_by colours pictures and no surfels: give it to the scene that is rendered"));
    }
    let all = scene.arguments.iter().cloned().chain(arguments(Scope::Limits, keywords)?);
    Ok(parsed(py, &all.collect::<Vec<_>>())?.scene.surfels.limits.limits())
}

/// Fails for an output that is one of the scene's files.
fn check_output(scene: &epsplat::Scene, output: &Path) -> Result<()> {
    let same = |path: &PathBuf| path.canonicalize().ok().zip(output.canonicalize().ok()).is_some_and(|(a, b)| a == b);
    match scene.files().paths().iter().any(same) {
        true => Err(Error::Usage(format!(
            "{} would be overwritten while it is read: choose another name",
            output.display()
        ))),
        false => ply::check_extension(output),
    }
}

/// Parses a value, which is named in the error.
fn value<T: std::str::FromStr>(py: Python<'_>, name: &str, text: &str) -> PyResult<T>
where
    T::Err: std::fmt::Display,
{
    text.parse().map_err(|error: T::Err| usage(py, &format!("{name}: {error}")))
}

/// The JSON of a report.
fn text(value: &impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// A scene, its counts as JSON, and notes.
type Made = (Scene, String, Vec<String>);

/// Computes surfels from points. Returns them with counts and notes.
#[pyfunction]
pub fn surfels(
    py: Python<'_>,
    scene: &Scene,
    size: &str,
    orient: Vec<String>,
    estimate_normals: bool,
    keywords: &Bound<'_, PyDict>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Made> {
    let limits = limits(py, scene, keywords)?;
    let size: Size = value(py, "size", size)?;
    let orientation = of_all(py, &orient)?;
    let options = FromPoints { size, orientation, estimate_normals, limits };
    let from = scene.scene.clone();
    let (made, mut notes) = run(py, progress, |progress| {
        from_points(inputs(&from, progress)?, &options, progress).map_err(|error| from.files().named(error))
    })?;
    notes.extend(made.notes());
    let report = json!({ "surfels": made.preparation.surfels, "parts": made.parts });
    Ok((Scene::of(made.points), report.to_string(), notes))
}

/// Joins orientations: one, or the positions of several scanners.
fn of_all(py: Python<'_>, given: &[String]) -> PyResult<Orientation> {
    let all = given.iter().map(|text| orientation(text).map_err(|why| usage(py, &format!("orient: {why}"))));
    let mut all = all.collect::<PyResult<Vec<_>>>()?;
    if all.len() < 2 {
        return Ok(all.pop().unwrap_or(Orientation::Propagate));
    }
    let scanners = all.into_iter().map(|one| match one {
        Orientation::Toward(positions) => Ok(positions),
        _ => Err(usage(py, "orient: several values must each be a scanner's position: give others only once")),
    });
    Ok(Orientation::Toward(scanners.collect::<PyResult<Vec<_>>>()?.into_iter().flatten().collect()))
}

/// The mesh of a scene: that of its only file, or of its arrays.
fn mesh(scene: &epsplat::Scene, options: &SceneOptions, progress: &dyn Progress) -> Result<Mesh> {
    let usage = |what: &str| Err(Error::Usage(what.into()));
    if let [path] = scene.files().paths() {
        return options.input.file.mesh(path, progress);
    }
    let mut points = scene.points(progress)?.into_owned();
    match (points.pop(), points.len()) {
        (Some(Points { positions, faces: Some(faces), colors, up, .. }), 0) => {
            Ok(Mesh { positions, triangles: faces.triangles, normals: faces.normals, colors, up, ..Mesh::default() })
        }
        _ => usage("a mesh is needed: one file, or arrays with triangles"),
    }
}

/// Covers a mesh with a given number of surfels.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn sample(
    py: Python<'_>,
    scene: &Scene,
    count: usize,
    priority: &str,
    method: &str,
    shape: &str,
    depth: Option<u32>,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Made> {
    let priority: Priority = value(py, "priority", priority)?;
    let curved = match shape {
        "disk" => false,
        "cap" => true,
        _ => return Err(usage(py, &format!("shape: it is disk or cap, not {shape:?}"))),
    };
    if !["stratified", "projected", "uniform"].contains(&method) {
        return Err(usage(py, &format!("method: it is stratified, projected or uniform, not {method:?}")));
    }
    if curved && method == "uniform" {
        return Err(usage(py, "uniform samples have no half-axes to curve: leave shape out"));
    }
    let (from, options) = (scene.scene.clone(), scene.options.clone());
    let ((made, report), mut notes) = run(py, progress, |progress| {
        let mesh = mesh(&from, &options, progress)?;
        mesh.notes.iter().for_each(|line| progress.note(line));
        let priority = |surface: &MeshSurface<'_>, voxels: &[Voxel]| priority.of(surface, voxels);
        let method = match method {
            "stratified" => Method::Stratified { priority: &priority, depth },
            "projected" => Method::Projected { priority: &priority, depth },
            _ => Method::Uniform,
        };
        let (points, report) = sampled(&mesh, count, &method, seed, progress)?;
        Ok((if curved { curve(points, progress)? } else { points }, report))
    })?;
    notes.extend(report.notes());
    Ok((Scene::of(made), text(&report).to_string(), notes))
}

/// Replaces surfels by fewer, larger ones.
#[pyfunction]
pub fn simplify(
    py: Python<'_>,
    scene: &Scene,
    tolerance: &str,
    shape: &str,
    relax: u32,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Made> {
    let tolerance: Tolerance = value(py, "tolerance", tolerance)?;
    let shape = match shape {
        "disk" => SplatShape::Disk,
        "ellipse" => SplatShape::Ellipse,
        "cap" => SplatShape::Cap,
        _ => return Err(usage(py, &format!("shape: it is disk, ellipse or cap, not {shape:?}"))),
    };
    let options = Options { tolerance, shape, relaxations: relax };
    let from = scene.scene.clone();
    let ((made, report), notes) = run(py, progress, |progress| {
        let built = build_at_vertices(inputs(&from, progress)?, progress);
        let (scene, preparation, coordinates) = built.map_err(|error| from.files().named(error))?;
        preparation.notes().iter().for_each(|line| progress.note(line));
        let (simplified, coordinates, report) = simplify_in_texture(&scene, &coordinates, &options, progress)?;
        Ok((points(&simplified, coordinates, shape), report))
    })?;
    Ok((Scene::of(made), text(&report).to_string(), notes))
}

/// Builds levels of detail and writes them.
#[pyfunction]
#[pyo3(signature = (scene, output, cut, keywords, progress))]
pub fn lod(
    py: Python<'_>,
    scene: &Scene,
    output: PathBuf,
    cut: Option<f64>,
    keywords: &Bound<'_, PyDict>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    let limits = limits(py, scene, keywords)?;
    if cut.is_some_and(|length| !(length.is_finite() && length > 0.0)) {
        return Err(usage(py, "cut: it is a length: give a positive number of world units"));
    }
    let from = scene.scene.clone();
    let (report, notes) = run(py, progress, |progress| {
        check_output(&from, &output)?;
        let built = build_within(inputs(&from, progress)?, Vec::new(), &limits, progress);
        let (scene, preparation) = built.map_err(|error| from.files().named(error))?;
        preparation.notes().iter().for_each(|line| progress.note(line));
        let (scene, tree) = match scene.hierarchy.clone() {
            Some(known) => (scene, known),
            None => hierarchy::build(scene, progress)?,
        };
        let part = cut.map(|length| Cut::by_length(&tree, length).scene(&scene, &tree, true));
        ply::write_scene(&output, part.as_ref().unwrap_or(&scene), None, progress)?;
        let mut report = json!({
            "surfels": scene.surfels.len(),
            "nodes": tree.nodes.len(),
            "levels": tree.levels(),
        });
        if let Some(part) = part {
            report["cut"] = part.surfels.len().into();
        }
        Ok(report)
    })?;
    Ok((report.to_string(), notes))
}

/// Measures holes between surfels that represent a mesh, and their distances from it.
#[pyfunction]
pub fn coverage(
    py: Python<'_>,
    scene: &Scene,
    of: &Scene,
    views: u32,
    side: u32,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    if !(1..=65_536).contains(&views) || !(1..=8192).contains(&side) {
        return Err(usage(py, "views lie between 1 and 65536, and side between 1 and 8192"));
    }
    let (from, of_mesh, options) = (scene.scene.clone(), of.scene.clone(), of.options.clone());
    let (report, notes) = run(py, progress, |progress| {
        let mesh = mesh(&of_mesh, &options, progress)?;
        let triangles = TriangleTree::new(&mesh)?;
        if triangles.is_empty() {
            let what = "the mesh has no triangle with an area, so there is nothing to cover";
            return Err(Error::EmptyScene(what.into()));
        }
        let (scene, preparation) = build(inputs(&from, progress)?, progress)?;
        preparation.notes().iter().for_each(|line| progress.note(line));
        let seen = measured(&triangles, &scene, views, side, progress)?;
        let distances = SurfaceDistances::of(&scene, &mesh, &triangles)?;
        let mut report = json!({
            "surfels": scene.surfels.len(),
            "triangles": triangles.len(),
            "diagonal": 2.0 * triangles.radius(),
            "hole_free": seen.is_hole_free(),
        });
        for part in [text(&seen), text(&distances)] {
            if let (Value::Object(all), Value::Object(part)) = (&mut report, part) {
                all.extend(part);
            }
        }
        Ok(report)
    })?;
    Ok((report.to_string(), notes))
}

/// The counts of each input, the number of points that each view sees, and notes.
type Seen<'py> = (Vec<Bound<'py, PyAny>>, Vec<u64>, Vec<String>);

/// Counts the views that see each point. Returns a count for each point of each input, and the
/// points that each view sees.
#[pyfunction]
pub fn visible<'py>(
    py: Python<'py>,
    scene: &Scene,
    views: Vec<PyRef<'py, View>>,
    keywords: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Seen<'py>> {
    let parsed = parsed(py, &arguments(Scope::Renderer, keywords)?)?;
    let views = views.iter().map(|view| view.with(&parsed.camera)).collect::<Result<Vec<_>>>();
    let views = views.map_err(|error| exception(py, &error))?;
    // Colours show nothing here.
    let options = SceneOptions { colors: ColorOptions::default(), ..scene.options.clone() };
    let from = scene.scene.clone();
    let (visible, notes) = run(py, progress, |progress| {
        let scene = epsplat::Scene::from_points(inputs(&from, progress)?, &options);
        let seen = scene.visible(&views, &parsed.render, &parsed.device, progress);
        let seen = seen.map_err(|error| from.files().named(error))?;
        if seen.points.iter().all(|count| *count == 0) {
            progress.note(
                "warning: no view sees any of the points: the cameras may have other coordinates, or look elsewhere",
            );
        }
        Ok(seen)
    })?;
    let counts = visible.views.into_iter().map(|counts| PyArray1::from_vec(py, counts).into_any()).collect();
    Ok((counts, visible.points, notes))
}

/// The arrays of the points of an input.
#[pyfunction]
pub fn arrays<'py>(py: Python<'py>, scene: &Scene) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let from = scene.scene.clone();
    let (all, _) = run(py, None, |progress| inputs(&from, progress))?;
    all.into_iter().map(|points| of_points(py, points)).collect()
}

fn of_points(py: Python<'_>, points: Points) -> PyResult<Bound<'_, PyDict>> {
    use epsplat::low_level::scene::Colors;
    // Gaussians have sRGB codes as floats.
    let points = match points.encoded || matches!(points.colors, Some(Colors::Harmonics(_))) {
        true => points.in_light(),
        false => points,
    };
    let (all, rows) = (PyDict::new(py), points.positions.len());
    all.set_item("positions", PyArray1::from_vec(py, points.positions.into_flattened()).reshape([rows, 3])?)?;
    if let Some(normals) = points.normals {
        all.set_item("normals", PyArray1::from_vec(py, normals.into_flattened()).reshape([rows, 3])?)?;
    }
    if let Some(radii) = points.radii {
        all.set_item("radii", PyArray1::from_vec(py, radii))?;
    }
    if let Some(axes) = points.axes {
        let flat = axes.into_flattened().into_flattened();
        all.set_item("half_axes", PyArray1::from_vec(py, flat).reshape([rows, 2, 3])?)?;
    }
    match points.colors {
        Some(Colors::Srgb8(codes)) => {
            all.set_item("colors", PyArray1::from_vec(py, codes.into_flattened()).reshape([rows, 4])?)?;
        }
        Some(Colors::Linear(colors)) => {
            all.set_item("colors", PyArray1::from_vec(py, colors.into_flattened()).reshape([rows, 4])?)?;
        }
        _ => {}
    }
    if let Some(places) = points.texture {
        all.set_item("texture", PyArray1::from_vec(py, places.into_flattened()).reshape([rows, 2])?)?;
    }
    if let Some(faces) = points.faces {
        let triangles = faces.triangles.into_iter().map(|triangle| triangle.map(i64::from)).collect::<Vec<_>>();
        let count = triangles.len();
        all.set_item("triangles", PyArray1::from_vec(py, triangles.into_flattened()).reshape([count, 3])?)?;
    }
    Ok(all)
}

/// Writes the points of a scene with one input as PLY.
#[pyfunction]
pub fn write(py: Python<'_>, scene: &Scene, output: PathBuf, progress: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    let from = scene.scene.clone();
    run(py, progress, |progress| {
        check_output(&from, &output)?;
        match &inputs(&from, progress)?[..] {
            [points] => ply::write_points(&output, points, progress),
            _ => Err(Error::Usage("one input is written at a time: make surfels of all of them first".into())),
        }
    })
    .map(|_| ())
}
