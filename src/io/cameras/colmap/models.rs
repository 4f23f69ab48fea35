//! COLMAP's camera models: names, numbers and parameters.

use crate::scene::{Form, Lens, Optics};

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

/// The model whose lens is not drawn.
const UNDRAWN: &str = "RAD_TAN_THIN_PRISM_FISHEYE";

/// A camera without its pose.
pub(super) struct Camera {
    pub size: (u32, u32),
    pub lens: Lens,
    /// The name of the model if its lens is not drawn; `lens` is then a pinhole.
    pub undrawn: Option<&'static str>,
}

impl Model {
    pub(in crate::io::cameras) fn of_name(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.name == name)
    }

    pub(super) fn of_number(number: i32) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.number == number)
    }

    /// Whether the lens is not drawn.
    pub(in crate::io::cameras) fn is_undrawn(&self) -> bool {
        self.name == UNDRAWN
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
        let undrawn = self.is_undrawn().then_some(self.name);
        let lens = match undrawn {
            Some(_) => Lens::Intrinsics(intrinsics),
            None => self.lens(intrinsics, rest),
        };
        Ok(Camera { size, lens, undrawn })
    }

    /// The lens of focal lengths and principal point, with the values of the model's coefficients.
    pub(in crate::io::cameras) fn lens(&self, intrinsics: [f64; 4], values: &[f64]) -> Lens {
        let of = |name: &str| {
            let place = self.distortions.iter().position(|own| *own == name);
            place.and_then(|place| values.get(place)).copied().unwrap_or(0.0)
        };
        let form = if self.fisheye { Form::Fisheye } else { Form::Perspective };
        let plain = Optics::of(form).with_tangential([of("p1"), of("p2")]).with_prism([of("sx1"), of("sy1")]);
        match self.name {
            "FOV" if of("omega") != 0.0 => {
                let (omega, [fx, fy, cx, cy]) = (of("omega"), intrinsics);
                let optics = Optics::of(Form::Fisheye).widened(2.0 * (0.5 * omega).tan());
                Lens::Curved(optics, [fx / omega, fy / omega, cx, cy])
            }
            // In this model the coefficients from k4 on are those of the denominator.
            "FULL_OPENCV" => {
                let optics = plain.with_radial([of("k1"), of("k2"), of("k3"), 0.0]);
                bent(optics.with_denominator([of("k4"), of("k5"), of("k6")]), intrinsics)
            }
            _ => bent(plain.with_radial([of("k1") + of("k"), of("k2"), of("k3"), of("k4")]), intrinsics),
        }
    }
}

/// A lens of these optics; a pinhole if they bend nothing.
pub(in crate::io::cameras) fn bent(optics: Optics, intrinsics: [f64; 4]) -> Lens {
    if optics.is_pinhole() { Lens::Intrinsics(intrinsics) } else { Lens::Curved(optics, intrinsics) }
}
