//! Views: cameras of options, of matrices and of files.

use std::path::{Path, PathBuf};

use epsplat::glam::{DMat3, DVec3};
use epsplat::io::camera::{self, CameraFile, Pose};
use epsplat::io::cameras;
use epsplat::{CameraOptions, Lens};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::wide;
use crate::error::{exception, usage};
use crate::options::{Scope, arguments, parsed};
use crate::task::run;

/// A view before the renderer's size is known.
#[derive(Clone)]
enum Kind {
    Options(Box<CameraOptions>),
    /// A camera of a file or of matrices, with the size and near depth that options give.
    File(Box<CameraFile>, Box<CameraOptions>),
    Known(Box<epsplat::View>),
}

/// A camera, complete except for values from the scene and the renderer.
#[pyclass(frozen, module = "epsplat._epsplat")]
pub struct View {
    kind: Kind,
    /// The name of its picture in a file of cameras, or its place in an array.
    #[pyo3(get)]
    name: String,
}

#[pymethods]
impl View {
    /// A view by options of the command line.
    #[staticmethod]
    fn of_options(py: Python<'_>, keywords: &Bound<'_, PyDict>) -> PyResult<Self> {
        let arguments = arguments(Scope::View, keywords)?;
        let options = parsed(py, &arguments)?.camera;
        let kind = match &options.file {
            Some(path) => {
                let (file, _) = run(py, None, |_| camera::read(path))?;
                Kind::File(Box::new(file), Box::new(options))
            }
            None => Kind::Options(Box::new(options)),
        };
        let made = Self { kind, name: arguments.join(" ") };
        // Finds faults before a renderer takes the view.
        made.with(&CameraOptions::default()).map_err(|error| exception(py, &error))?;
        Ok(made)
    }

    /// The views of world-to-camera matrices (C, 16) and intrinsics (C, 9), row after row.
    #[staticmethod]
    fn of_matrices(py: Python<'_>, poses: &Bound<'_, PyAny>, intrinsics: &Bound<'_, PyAny>) -> PyResult<Vec<Self>> {
        let failed = |error| exception(py, &error);
        let poses = wide::<16>("viewmats", poses, None).map_err(failed)?;
        let intrinsics = wide::<9>("Ks", intrinsics, Some(poses.len())).map_err(failed)?;
        poses.iter().zip(&intrinsics).enumerate().map(|(index, (pose, k))| matrices(py, index, pose, k)).collect()
    }

    /// The views of a file of cameras, with the names of their pictures.
    #[staticmethod]
    fn of_file(
        py: Python<'_>,
        path: PathBuf,
        size: (u32, u32),
        scale: Option<f64>,
        pinholes: bool,
    ) -> PyResult<Vec<Self>> {
        if scale.is_some_and(|factor| !(factor.is_finite() && factor > 0.0)) {
            return Err(usage(py, "scale: a factor is a positive number"));
        }
        let (named, _) = run(py, None, |_| cameras::read(&path, size))?;
        let view = |camera: cameras::NamedCamera| {
            if let (Some(model), false) = (camera.undrawn, pinholes) {
                let what = format!(
                    "{}: the lens of {}, of the model {model}, is not rendered: undistort the pictures, or give \
                     ignore_distortion",
                    path.display(),
                    camera.name
                );
                return Err(usage(py, &what));
            }
            let pinhole = camera.camera.as_pinhole().filter(|_| pinholes);
            let file = pinhole.unwrap_or(camera.camera).scaled(scale.unwrap_or(1.0));
            Ok(Self { kind: Kind::File(Box::new(file), Box::default()), name: camera.name })
        };
        named.into_iter().map(view).collect()
    }

    fn __repr__(&self) -> String {
        format!("View({})", self.name)
    }
}

impl View {
    /// A view that the library made.
    pub fn known(view: epsplat::View, name: String) -> Self {
        Self { kind: Kind::Known(Box::new(view)), name }
    }

    /// Returns the library's view. The size and near depth of `all` stand in for those that are
    /// not given.
    pub fn with(&self, all: &CameraOptions) -> epsplat::Result<epsplat::View> {
        match &self.kind {
            Kind::Options(options) => {
                let options = CameraOptions {
                    size: options.size.or(all.size),
                    near: options.near.or(all.near),
                    ..(**options).clone()
                };
                epsplat::View::new(&options)
            }
            Kind::File(file, options) => {
                let options = CameraOptions {
                    size: options.size.or(all.size.filter(|_| file.size.is_none())),
                    near: options.near.or(all.near.filter(|_| file.near.is_none())),
                    ..(**options).clone()
                };
                let path = options.file.as_deref().unwrap_or(Path::new(&self.name));
                epsplat::View::of_file(&options, (**file).clone(), path, None)
            }
            Kind::Known(view) => Ok((**view).clone()),
        }
    }
}

/// How far a rotation may be from an orthonormal one.
const ROUNDING: f64 = 1e-3;

/// The view of one matrix and its intrinsics.
fn matrices(py: Python<'_>, index: usize, pose: &[f64; 16], k: &[f64; 9]) -> PyResult<View> {
    let wrong = |what: &str| Err(usage(py, what));
    let name = format!("viewmats[{index}]");
    let row = |row: usize| DVec3::new(pose[4 * row], pose[4 * row + 1], pose[4 * row + 2]);
    let rows = DMat3::from_cols(row(0), row(1), row(2));
    if pose.iter().any(|value| !value.is_finite()) {
        return wrong(&format!("{name}: a number is not finite"));
    }
    if pose[12..] != [0.0, 0.0, 0.0, 1.0] {
        return wrong(&format!("{name}: the last row of a world-to-camera matrix is 0, 0, 0, 1"));
    }
    let off = rows.transpose() * rows - DMat3::IDENTITY;
    if off.to_cols_array().iter().any(|value| value.abs() > ROUNDING) || rows.determinant() < 0.0 {
        return wrong(&format!("{name}: the first three columns are not a rotation"));
    }
    // f32 matrices are rotations up to rounding.
    let x = rows.col(0).normalize();
    let z = (rows.col(2) - x * x.dot(rows.col(2))).normalize();
    let columns = if off.to_cols_array().iter().all(|value| value.abs() < 1e-12) {
        rows
    } else {
        DMat3::from_cols(x, z.cross(x), z)
    };
    let (rotation, moved) = (columns.transpose(), DVec3::new(pose[3], pose[7], pose[11]));
    let eye = -(rotation.transpose() * moved);
    if k.iter().any(|value| !value.is_finite()) {
        return wrong(&format!("Ks[{index}]: a number is not finite"));
    }
    if k[1] != 0.0 || k[3] != 0.0 || k[6..] != [0.0, 0.0, 1.0] {
        return wrong(&format!("Ks[{index}]: intrinsics are (fx, 0, cx), (0, fy, cy) and (0, 0, 1), without skew"));
    }
    let lens = Lens::Intrinsics([k[0], k[4], k[2], k[5]]);
    let file = CameraFile { size: None, lens, pose: Pose::Rigid(rotation, eye), near: None };
    Ok(View { kind: Kind::File(Box::new(file), Box::default()), name })
}

/// Returns the matrices of cameras: world-to-camera (C, 4, 4) and intrinsics (C, 3, 3).
pub fn arrays<'py>(py: Python<'py>, cameras: &[epsplat::Camera]) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let (mut poses, mut intrinsics) = (Vec::new(), Vec::new());
    for camera in cameras {
        let moved = -(camera.rotation * camera.eye);
        for row in 0..3 {
            poses.extend(camera.rotation.row(row).to_array());
            poses.push(moved[row]);
        }
        poses.extend([0.0, 0.0, 0.0, 1.0]);
        intrinsics.extend([camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]);
    }
    let poses = PyArray1::from_vec(py, poses).reshape([cameras.len(), 4, 4])?;
    let intrinsics = PyArray1::from_vec(py, intrinsics).reshape([cameras.len(), 3, 3])?;
    Ok((poses.into_any(), intrinsics.into_any()))
}
