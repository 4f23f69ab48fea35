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
const MODELS: [Model; 18] = [
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
    model(12, "SIMPLE_DIVISION", false, &["k"]),
    model(13, "DIVISION", true, &["k"]),
    fisheye(14, "SIMPLE_FISHEYE", false, &[]),
    fisheye(15, "FISHEYE", true, &[]),
    model(16, "EUCM", true, &["alpha", "beta"]),
    model(17, SPHERE, false, &[]),
];

/// The model of a whole sphere, whose parameters are the width and the height of the picture.
const SPHERE: &str = "EQUIRECTANGULAR";

/// The models whose lenses are not drawn.
const UNDRAWN: [&str; 4] = ["RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "EUCM"];

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
        UNDRAWN.contains(&self.name)
    }

    /// The number of parameters.
    pub(super) fn parameters(&self) -> usize {
        if self.name == SPHERE { 2 } else { 3 + usize::from(self.two) + self.distortions.len() }
    }

    /// The camera of these parameters; the error is one clause.
    pub(super) fn camera(&self, size: (u32, u32), parameters: &[f64]) -> Result<Camera, String> {
        let Self { name, distortions, .. } = self;
        let needed = self.parameters();
        if parameters.len() != needed {
            return Err(format!("a {name} camera has {needed} parameters, not {}", parameters.len()));
        }
        if *name == SPHERE {
            return Ok(Camera { size, lens: Lens::Equirectangular, undrawn: None });
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
    fn lens(&self, intrinsics: [f64; 4], values: &[f64]) -> Lens {
        let of = |name: &str| {
            let place = self.distortions.iter().position(|own| *own == name);
            place.and_then(|place| values.get(place)).copied().unwrap_or(0.0)
        };
        self.lens_of(intrinsics, &of)
    }

    /// Whether [`Self::lens_of`] uses the coefficient of this name. Other programs write
    /// coefficients that COLMAP's model has not, as k3 and k4 of `OPENCV`.
    pub(in crate::io::cameras) fn reads(&self, coefficient: &str) -> bool {
        match coefficient {
            "omega" => self.name == "FOV",
            "k5" | "k6" => self.name == "FULL_OPENCV",
            _ => self.name != "FOV",
        }
    }

    /// As [`Self::lens`], with the value of each coefficient by its name; 0 if it is not given.
    pub(in crate::io::cameras) fn lens_of(&self, intrinsics: [f64; 4], of: &dyn Fn(&str) -> f64) -> Lens {
        let form = if self.fisheye { Form::Fisheye } else { Form::Perspective };
        let plain = Optics::of(form).with_tangential([of("p1"), of("p2")]).with_prism([of("sx1"), of("sy1")]);
        match self.name {
            // The formula is even in omega.
            "FOV" if of("omega") != 0.0 => {
                let optics = Optics::field_of_view(of("omega").abs());
                let [fx, fy, cx, cy] = intrinsics;
                Lens::Curved(optics, [fx / optics.per_focal(), fy / optics.per_focal(), cx, cy])
            }
            // In this model the coefficients from k4 on are those of the denominator.
            "FULL_OPENCV" => {
                let optics = plain.with_radial([of("k1") + of("k"), of("k2"), of("k3"), 0.0]);
                bent(optics.with_denominator([of("k4"), of("k5"), of("k6")]), intrinsics)
            }
            _ => bent(plain.with_radial([of("k1") + of("k"), of("k2"), of("k3"), of("k4")]), intrinsics),
        }
    }
}

/// A lens of these optics; a pinhole if they bend nothing.
fn bent(optics: Optics, intrinsics: [f64; 4]) -> Lens {
    if optics.is_pinhole() { Lens::Intrinsics(intrinsics) } else { Lens::Curved(optics, intrinsics) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use glam::{DMat3, DVec3};

    use super::*;
    use crate::io::camera::{CameraFile, Pose};

    #[test]
    fn later_models_are_known_by_number_and_name() {
        let camera = |number: i32, name: &str, parameters: &[f64]| {
            let model = Model::of_number(number).unwrap();
            assert_eq!((model.name, Model::of_name(name).unwrap().number), (name, number));
            assert_eq!(model.parameters(), parameters.len(), "{name}");
            let camera = model.camera((8, 4), parameters).unwrap();
            (camera.lens, camera.undrawn)
        };
        let equidistant = Optics::of(Form::Fisheye);
        assert_eq!(
            camera(14, "SIMPLE_FISHEYE", &[5.0, 4.0, 2.0]),
            (Lens::Curved(equidistant, [5.0, 5.0, 4.0, 2.0]), None)
        );
        assert_eq!(
            camera(15, "FISHEYE", &[5.0, 6.0, 4.0, 2.0]),
            (Lens::Curved(equidistant, [5.0, 6.0, 4.0, 2.0]), None)
        );
        assert_eq!(camera(17, "EQUIRECTANGULAR", &[8.0, 4.0]), (Lens::Equirectangular, None));
        let pinhole = Lens::Intrinsics([5.0, 6.0, 4.0, 2.0]);
        assert_eq!(camera(13, "DIVISION", &[5.0, 6.0, 4.0, 2.0, 0.1]), (pinhole, Some("DIVISION")));
        assert_eq!(camera(16, "EUCM", &[5.0, 6.0, 4.0, 2.0, 0.5, 1.0]), (pinhole, Some("EUCM")));
        let square = Lens::Intrinsics([5.0, 5.0, 4.0, 2.0]);
        assert_eq!(camera(12, "SIMPLE_DIVISION", &[5.0, 4.0, 2.0, 0.1]), (square, Some("SIMPLE_DIVISION")));
    }

    /// A pinhole in place of a lens has the focal lengths of the file, also those of the FOV model,
    /// whose plane is scaled.
    #[test]
    fn a_pinhole_has_the_focal_lengths_of_the_file() {
        for (name, rest) in [("FOV", &[0.9][..]), ("OPENCV", &[0.1, 0.0, 0.0, 0.0]), ("FISHEYE", &[])] {
            let parameters = [&[200.0, 210.0, 100.0, 90.0][..], rest].concat();
            let lens = Model::of_name(name).unwrap().camera((200, 180), &parameters).unwrap().lens;
            let pose = Pose::Rigid(DMat3::IDENTITY, DVec3::ZERO);
            let file = CameraFile { size: Some((200, 180)), lens, pose, near: None };
            let Lens::Intrinsics(values) = file.as_pinhole().unwrap().lens else { panic!("{name}") };
            let off = values.iter().zip(&parameters).map(|(own, given)| (own - given).abs()).fold(0.0, f64::max);
            assert!(off < 1e-10, "{name}: {values:?}");
        }
    }
}
