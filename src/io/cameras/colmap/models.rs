//! COLMAP's camera models: names, numbers and parameters.

use super::super::Distortion;

/// A camera model. Its parameters are one focal length or two, the principal point and the
/// coefficients of distortion.
pub(in crate::io::cameras) struct Model {
    pub number: i32,
    pub name: &'static str,
    /// Whether there are two focal lengths, fx and fy.
    two: bool,
    /// Whether the radius grows with the angle from the axis, even where all coefficients are 0.
    pub fisheye: bool,
    distortions: &'static [&'static str],
}

const fn model(number: i32, name: &'static str, two: bool, distortions: &'static [&'static str]) -> Model {
    Model { number, name, two, fisheye: false, distortions }
}

const fn fisheye(number: i32, name: &'static str, two: bool, distortions: &'static [&'static str]) -> Model {
    Model { number, name, two, fisheye: true, distortions }
}

/// All models, by number.
const MODELS: [Model; 12] = [
    model(0, "SIMPLE_PINHOLE", false, &[]),
    model(1, "PINHOLE", true, &[]),
    model(2, "SIMPLE_RADIAL", false, &["k"]),
    model(3, "RADIAL", false, &["k1", "k2"]),
    model(4, "OPENCV", true, &["k1", "k2", "p1", "p2"]),
    fisheye(5, "OPENCV_FISHEYE", true, &["k1", "k2", "k3", "k4"]),
    model(6, "FULL_OPENCV", true, &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]),
    model(7, "FOV", true, &["omega"]),
    fisheye(8, "SIMPLE_RADIAL_FISHEYE", false, &["k"]),
    fisheye(9, "RADIAL_FISHEYE", false, &["k1", "k2"]),
    fisheye(10, "THIN_PRISM_FISHEYE", true, &["k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"]),
    fisheye(
        11,
        "RAD_TAN_THIN_PRISM_FISHEYE",
        true,
        &["k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3"],
    ),
];

/// A camera without its pose.
pub(super) struct Camera {
    pub size: (u32, u32),
    pub intrinsics: [f64; 4],
    pub distortion: Option<Distortion>,
}

impl Model {
    pub(in crate::io::cameras) fn of_name(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name == name)
    }

    pub(super) fn of_number(number: i32) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.number == number)
    }

    /// The number of parameters.
    pub(super) fn parameters(&self) -> usize {
        3 + usize::from(self.two) + self.distortions.len()
    }

    /// The camera of these parameters; the error is one clause.
    pub(super) fn camera(&self, size: (u32, u32), parameters: &[f64]) -> Result<Camera, String> {
        let Self { name, distortions, .. } = self;
        let needed = self.parameters();
        if parameters.len() != needed {
            return Err(format!("a {name} camera has {needed} parameters, not {}", parameters.len()));
        }
        let (lens, rest) = parameters.split_at(needed - distortions.len());
        let intrinsics = match *lens {
            [fx, fy, cx, cy] => [fx, fy, cx, cy],
            [f, cx, cy] => [f, f, cx, cy],
            _ => return Err("its parameters are not a lens's".into()),
        };
        let distortion = match self.fisheye {
            true => Some(Distortion::Fisheye(name)),
            false => distortions.iter().zip(rest).find_map(|(name, value)| Distortion::of(name, *value)),
        };
        Ok(Camera { size, intrinsics, distortion })
    }
}
