//! The fineness of a cut through levels of detail.

use std::f64::consts::PI;
use std::str::FromStr;

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::hierarchy::Node;
use super::{Camera, Projection};
use crate::error::Error;

/// The size of a node in the image below which it is drawn instead of its descendants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Detail {
    /// An area in square pixels.
    Pixels(f64),
    /// A fraction of the image's area.
    Share(f64),
    /// The smallest size with which at most this many surfels and nodes are drawn; it differs for
    /// each view.
    Splats(u64),
}

impl Detail {
    /// Draws every surfel: no node is small enough to replace its descendants.
    pub const FINEST: Self = Self::Pixels(0.0);

    /// Whether this draws every surfel.
    pub fn is_finest(self) -> bool {
        matches!(self, Self::Pixels(size) | Self::Share(size) if size == 0.0)
    }

    /// The size in square pixels for an image of `image` pixels. It is 0 for [`Self::Splats`],
    /// whose size is searched first ([`sized`](crate::passes::select::sized)).
    pub fn pixels(self, image: f64) -> f64 {
        match self {
            Self::Pixels(pixels) => pixels,
            Self::Share(share) => share * image,
            Self::Splats(_) => 0.0,
        }
    }
}

impl FromStr for Detail {
    type Err = Error;

    /// `0`, `16px`, `0.01%` or `100000splats`.
    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = || {
            Error::Usage(format!(
                "a level of detail is 0 (everything), a node size in square pixels (16px) or as a part of the image (0.01%), or a number of splats (100000splats), not '{text}'"
            ))
        };
        let number = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite() && *number >= 0.0);
        if let Some(count) = text.strip_suffix("splats") {
            return count.parse().ok().filter(|count| *count > 0).map(Self::Splats).ok_or_else(wrong);
        }
        let detail = match (text.strip_suffix("px"), text.strip_suffix('%')) {
            (Some(pixels), _) => number(pixels).map(Self::Pixels),
            (_, Some(percent)) => number(percent).map(|percent| Self::Share(percent / 100.0)),
            (None, None) => number(text).filter(|number| *number == 0.0).map(Self::Pixels),
        };
        detail.ok_or_else(wrong)
    }
}

/// The shape that a node is drawn as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NodeShape {
    /// Curved as the surface below the node.
    #[default]
    Cap,
    /// A disk in the node's plane.
    Disk,
}

impl FromStr for NodeShape {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "cap" => Ok(Self::Cap),
            "disk" => Ok(Self::Disk),
            _ => Err(Error::Usage(format!("nodes are drawn as a cap or a disk, not {text:?}"))),
        }
    }
}

/// The size of a node that [`Detail`] is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DetailMeasure {
    /// The area of the ellipse's image, as in Pajarola 2003. An ellipse seen edge-on has no area,
    /// so silhouettes get the coarsest nodes.
    Area,
    /// The area of the image that the node's bounding sphere would have in the middle of the image.
    /// Silhouettes are as fine as surfaces seen from the front, and nodes that are as high as long,
    /// for example at a ridge, are divided sooner. The sphere is larger than its contents where the
    /// surfels lie off the node's cap ([`Node::radius`]).
    #[default]
    Extent,
    /// The area of the square whose side is the longer of the images of the ellipse's two axes.
    /// This reading of Pajarola 2003 comes nearest to the numbers in its Table 2.
    Square,
}

impl FromStr for DetailMeasure {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let named = Self::ALL.into_iter().find(|(_, name, _)| *name == text).map(|(measure, ..)| measure);
        named.ok_or_else(|| Error::Usage(format!("nodes are measured by area, extent or square, not {text:?}")))
    }
}

impl DetailMeasure {
    /// All measures with their names and descriptions.
    pub const ALL: [(Self, &'static str, &'static str); 3] = [
        (Self::Area, "area", "the area of a node's image, as in Pajarola 2003"),
        (Self::Extent, "extent", "the area of its bounding sphere's image, larger where surfels lie off its cap"),
        (Self::Square, "square", "the area of the square over the longer image of its axes"),
    ];

    /// The size of a node in square pixels. `center` is its centre relative to the eye, in world
    /// axes. For a pinhole camera the size is infinite up to the near depth.
    pub fn of(self, node: &Node, center: DVec3, camera: &Camera) -> f64 {
        let turned = |v: DVec3| camera.rotation * v;
        let (at, focal) = (turned(center), DVec2::new(camera.fx, camera.fy));
        if camera.projection == Projection::Pinhole && at.z <= camera.near {
            return f64::INFINITY;
        }
        let image = |axis: [f32; 3]| {
            let axis = turned(DVec3::from_array(axis.map(f64::from)));
            match camera.projection {
                Projection::Pinhole => (axis.truncate() - at.truncate() / at.z * axis.z) / at.z * focal,
                Projection::Orthographic => axis.truncate() * focal,
            }
        };
        match self {
            Self::Area => {
                let [s, t] = [node.surfel.s, node.surfel.t].map(image);
                PI * s.perp_dot(t).abs()
            }
            Self::Square => {
                let [s, t] = [node.surfel.s, node.surfel.t].map(|axis| image(axis).length_squared());
                4.0 * s.max(t)
            }
            Self::Extent => {
                let depth = if camera.projection == Projection::Pinhole { at.z } else { 1.0 };
                PI * (f64::from(node.radius) / depth * focal.max_element()).powi(2)
            }
        }
    }
}

/// Exponents of the largest and smallest powers of two between which [`finest`] searches, square
/// pixels.
const LARGEST: f64 = 60.0;
const SMALLEST: f64 = -30.0;

/// The number of bisection steps between two powers of two, which find the size to a millionth.
const HALVINGS: u32 = 20;

/// The smallest size, square pixels, for which `fits` is true, or one a millionth larger.
///
/// `fits` says whether no more is drawn than allowed. It must be true for all larger sizes too.
pub(crate) fn finest(fits: impl Fn(f64) -> bool) -> f64 {
    // The search starts from large sizes, as small ones draw much more.
    let mut high = LARGEST;
    while high > SMALLEST && fits((high - 1.0).exp2()) {
        high -= 1.0;
    }
    let mut low = high - 1.0;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        (low, high) = if fits(middle.exp2()) { (low, middle) } else { (middle, high) };
    }
    high.exp2()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::{DMat3, Vec3};

    use super::*;
    use crate::scene::{Cap, Lens, Surfel};

    #[test]
    fn sizes_are_read() {
        assert_eq!("16px".parse::<Detail>().unwrap(), Detail::Pixels(16.0));
        assert_eq!("0.01%".parse::<Detail>().unwrap(), Detail::Share(1e-4));
        assert_eq!("70splats".parse::<Detail>().unwrap(), Detail::Splats(70));
        assert_eq!("0".parse::<Detail>().unwrap(), Detail::FINEST);
        assert_eq!("area".parse::<DetailMeasure>().unwrap(), DetailMeasure::Area);
        assert!("length".parse::<DetailMeasure>().is_err());
        for wrong in ["", "px", "-1px", "nanpx", "3", "1e999%", "5 px"] {
            assert!(wrong.parse::<Detail>().is_err(), "{wrong}");
        }
    }

    fn node(surfel: Surfel) -> Node {
        Node { surfel, cap: Cap::FLAT, color: [1.0; 4], radius: 0.5, cone: 1.0, first: 0, count: 1, leaf: true }
    }

    #[test]
    fn a_disk_has_the_size_that_it_is_seen_at() {
        for (lens, pixels) in [(Lens::Fov(90.0), 50.0 / 4.0), (Lens::OrthographicHeight(10.0), 10.0)] {
            let camera = Camera::posed((100, 100), lens, DVec3::ZERO, DMat3::IDENTITY, 0.1).unwrap();
            let center = DVec3::new(0.0, 0.0, 4.0);
            let disk = |normal| node(Surfel::disk(Vec3::ZERO, normal, 0.5));
            let front = disk(Vec3::Z);
            let (area, extent) = (DetailMeasure::Area, DetailMeasure::Extent);
            let expected = PI * (0.5 * pixels) * (0.5 * pixels);
            assert!((area.of(&front, center, &camera) / expected - 1.0).abs() < 1e-6);
            assert!((extent.of(&front, center, &camera) / expected - 1.0).abs() < 1e-6);
            let edge = disk(Vec3::X);
            assert!(area.of(&edge, center, &camera) < 1e-6 * expected);
            assert!((extent.of(&edge, center, &camera) / expected - 1.0).abs() < 1e-6);
            let high = Node { radius: 2.0, ..front };
            assert!((extent.of(&high, center, &camera) / expected - 16.0).abs() < 1e-5);
            assert_eq!(area.of(&high, center, &camera), area.of(&front, center, &camera));
        }
        let camera = Camera::posed((9, 9), Lens::Fov(60.0), DVec3::ZERO, DMat3::IDENTITY, 0.1).unwrap();
        for measure in DetailMeasure::ALL {
            let one = node(Surfel::disk(Vec3::ZERO, Vec3::Z, 1.0));
            assert_eq!(measure.0.of(&one, DVec3::new(0.0, 0.0, -1.0), &camera), f64::INFINITY);
        }
    }
}
