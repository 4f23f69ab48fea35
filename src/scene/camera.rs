//! The camera: intrinsics in pixels and a rigid pose in world units.

use glam::{BVec2, DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::lens::Lens;
use super::optics::{Optics, Sight};
use super::{Samples, Scene, Up};
use crate::error::{Error, Result};

/// The mapping from camera space to pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Projection {
    /// `x = fx X/Z + cx`: focal lengths in pixels.
    Pinhole,
    /// `x = fx X + cx`: pixels per world unit.
    Orthographic,
}

/// A camera with intrinsics and pose.
///
/// Camera space is x right, y down, z forward. Pixel (i, j) has its centre at (i + 0.5, j + 0.5),
/// origin top left. Depth is camera-space z; for fisheyes and whole spheres it is the distance from
/// the eye ([`Camera::depth_is_distance`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Pinhole or orthographic.
    pub projection: Projection,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length (pinhole, pixels) or scale (orthographic, pixels per world unit) along x.
    pub fx: f64,
    /// Focal length (pinhole, pixels) or scale (orthographic, pixels per world unit) along y.
    pub fy: f64,
    /// Principal point, pixels from the left edge; need not be the centre.
    pub cx: f64,
    /// Principal point, pixels from the top edge.
    pub cy: f64,
    /// Position in world coordinates.
    pub eye: DVec3,
    /// Rotation from world to camera axes: its rows are the directions right, down and forward.
    pub rotation: DMat3,
    /// The smallest visible depth, world units, positive.
    pub near: f64,
    /// The lens, if the projection is a pinhole's but the lens is none: `fx fy cx cy` map the plane
    /// of [`Optics`] to pixels.
    pub optics: Option<Optics>,
}

/// The largest image width or height: bounds of splats are stored in 16 bits.
pub const MAX_SIDE: u32 = 32_768;

/// The most pixels in an image. Each takes up to 48 bytes of host memory on the way to a file, plus
/// 8 for each value of a map.
pub const MAX_PIXELS: u64 = 1 << 27;

/// The largest scale and near depth of a camera; the smallest is its inverse. The device computes
/// in f32.
pub(super) const LARGEST: f64 = 1e18;

/// The largest coordinate of a camera's eye. From there a narrow lens sees all of a scene with the
/// largest coordinates.
const FARTHEST: f64 = 1e28;

/// Rejects image sizes that no backend supports.
pub fn check_size(width: u32, height: u32) -> Result<()> {
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(Error::Usage(format!("an image is 1 to {MAX_SIDE} pixels wide and high, {width}x{height} is not")));
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::Usage(format!("an image has at most {MAX_PIXELS} pixels, {width}x{height} has more")));
    }
    Ok(())
}

/// Rejects near depths that f32 on the device cannot represent.
pub fn check_near(near: f64) -> Result<()> {
    if (1.0 / LARGEST..=LARGEST).contains(&near) {
        return Ok(());
    }
    Err(Error::Usage(format!("the near depth must be positive and within reason, {near:?} is not")))
}

impl Camera {
    /// The camera whose pixels are the `samples` of this one's pixels.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if a row or column has too many samples.
    pub fn sampled(&self, samples: Samples) -> Result<Self> {
        let Samples { across, down } = samples;
        let (width, height) = (u64::from(self.width) * u64::from(across), u64::from(self.height) * u64::from(down));
        if width.max(height) > MAX_SIDE.into() {
            return Err(Error::Usage(format!(
                "{} samples of each of {}x{} pixels are more than {MAX_SIDE} in a row or column: take fewer",
                samples.count(),
                self.width,
                self.height
            )));
        }
        let [x, y] = [across, down].map(f64::from);
        Ok(Self {
            width: width as u32,
            height: height as u32,
            fx: self.fx * x,
            fy: self.fy * y,
            cx: self.cx * x,
            cy: self.cy * y,
            ..self.clone()
        })
    }

    /// A camera at `eye` that looks at `target`, both in world coordinates.
    ///
    /// If `up` is None, up is the axis `scene_up`, or [`Up::other`] if the view is along that axis.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if `eye` and `target` coincide or are too far away, if `up` is zero or
    /// along the view, and as [`Camera::posed`].
    pub fn look_at(
        (width, height): (u32, u32),
        lens: Lens,
        eye: DVec3,
        target: DVec3,
        up: Option<DVec3>,
        scene_up: Up,
        near: f64,
    ) -> Result<Self> {
        let forward = target - eye;
        if forward == DVec3::ZERO || !forward.abs().cmple(DVec3::splat(2.0 * FARTHEST)).all() {
            return Err(Error::Usage(format!(
                "the camera's eye and target must be apart from each other and within {FARTHEST:e} of the origin"
            )));
        }
        let forward = unit(forward);
        let right = match up {
            Some(up) => {
                let right = forward.cross(unit(up));
                if right.length().is_nan() || right.length() <= 1e-6 {
                    return Err(Error::Usage("the camera's up is zero or points along its view".into()));
                }
                right
            }
            None => {
                let right = forward.cross(scene_up.axis());
                if right.length() > 1e-3 { right } else { forward.cross(scene_up.other()) }
            }
        }
        .normalize();
        let down = forward.cross(right);
        Self::posed((width, height), lens, eye, DMat3::from_cols(right, down, forward).transpose(), near)
    }

    /// A camera with a given world-to-camera rotation.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if `rotation` is not orthonormal with determinant +1, to 1e-4, if `eye` is
    /// too far away, or if size, lens or near depth are out of range.
    pub fn posed((width, height): (u32, u32), lens: Lens, eye: DVec3, rotation: DMat3, near: f64) -> Result<Self> {
        check_size(width, height)?;
        let (projection, [fx, fy, cx, cy]) = lens.intrinsics(width, height)?;
        let skew = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
        if !eye.abs().cmple(DVec3::splat(FARTHEST)).all() {
            return Err(Error::Usage(format!("the camera's eye must be within {FARTHEST:e} of the origin")));
        }
        // Poses come from text with few decimals, so a near rotation is orthonormalised. The
        // comparisons are written so that NaN fails too.
        let rigid = skew.iter().all(|e| e.abs() < 1e-4) && rotation.determinant() > 0.0;
        if !rigid {
            return Err(Error::Usage(
                "the camera's pose is not a rigid motion: its rotation must be orthonormal with determinant +1".into(),
            ));
        }
        check_near(near)?;
        let forward = rotation.row(2).normalize();
        let right = rotation.row(0).reject_from_normalized(forward).normalize();
        let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
        let plane = |at: DVec2| (at - DVec2::new(cx, cy)) / DVec2::new(fx, fy);
        let border = border(DVec2::new(width.into(), height.into())).map(plane);
        let optics = lens.optics().map(|optics| optics.within(border, 1.0 / fx.min(fy)));
        Ok(Self { projection, width, height, fx, fy, cx, cy, eye, rotation, near, optics })
    }

    /// The default near depth: a millionth of the scene's extent.
    pub fn default_near(scene: &Scene) -> f64 {
        let extent = scene.body().0.extent().length();
        let size = if extent > 0.0 { extent } else { 2.0 * f64::from(scene.largest_radius()) };
        (size * 1e-6).clamp(1.0 / LARGEST, LARGEST)
    }

    /// Converts a point from world to camera space.
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.rotation * (world - self.eye)
    }

    /// A point of camera space as the lens sees it; `None` if the camera is a pinhole or
    /// orthographic, or if the lens does not see the point.
    pub fn sight(&self, p: DVec3) -> Option<Sight> {
        self.optics.as_ref().and_then(|optics| optics.see(p))
    }

    /// The image point of a point of camera space, pixels, and its depth; `None` if the point has
    /// none, because it lies before the near depth or beyond what the lens shows.
    pub fn image(&self, p: DVec3) -> Option<(DVec2, f64)> {
        let (plane, depth) = match (&self.optics, self.projection) {
            (Some(optics), _) => optics.see(p).map(|sight| (sight.plane, sight.depth))?,
            (None, Projection::Pinhole) => (p.truncate() / p.z, p.z),
            (None, Projection::Orthographic) => (p.truncate(), p.z),
        };
        let (focal, principal) = (DVec2::new(self.fx, self.fy), DVec2::new(self.cx, self.cy));
        (depth >= self.near).then(|| (focal * plane + principal, depth))
    }

    /// As [`Camera::image`], for what is drawn straight around the point: `None` far outside the
    /// image of a lens ([`Optics::reach`]).
    pub fn corner(&self, p: DVec3) -> Option<(DVec2, f64)> {
        let is_near = self.optics.as_ref().is_none_or(|optics| {
            let sight = optics.see(p);
            sight.is_some_and(|sight| sight.radius <= optics.reach())
        });
        self.image(p).filter(|_| is_near)
    }

    /// Whether depth is the distance from the eye instead of camera-space z.
    pub fn depth_is_distance(&self) -> bool {
        self.optics.is_some_and(|optics| optics.depth_is_distance())
    }

    /// The depth of a point of camera space, world units.
    pub fn depth(&self, p: DVec3) -> f64 {
        if self.depth_is_distance() { p.length() } else { p.z }
    }

    /// The point of a pinhole's or a lens's plane at the image point (x, y), pixels.
    fn plane(&self, x: f64, y: f64) -> DVec2 {
        DVec2::new((x - self.cx) / self.fx, (y - self.cy) / self.fy)
    }

    /// Whether the camera shows something at the image point (x, y), pixels: a lens shows nothing
    /// beyond its image ([`Optics::shows`]).
    pub fn shows(&self, x: f64, y: f64) -> bool {
        self.optics.as_ref().is_none_or(|optics| optics.shows(self.plane(x, y)))
    }

    /// The world-space direction of the view ray through the image point (x, y), pixels.
    ///
    /// It is not normalised: its depth is 1. The ray starts at [`ray_start`](Self::ray_start).
    /// Where a lens shows nothing ([`shows`](Self::shows)), it is that of [`Optics::ray`].
    pub fn ray(&self, x: f64, y: f64) -> DVec3 {
        if let Some(optics) = &self.optics {
            let plane = self.plane(x, y);
            return self.rotation.transpose() * optics.ray(plane);
        }
        let camera = match self.projection {
            Projection::Pinhole => DVec3::new((x - self.cx) / self.fx, (y - self.cy) / self.fy, 1.0),
            Projection::Orthographic => DVec3::Z,
        };
        self.rotation.transpose() * camera
    }

    /// The point with camera-space z = 0 on the ray of the image point (x, y), pixels, in world
    /// space.
    ///
    /// For a pinhole camera it is the eye, for an orthographic one the image point itself.
    pub fn ray_start(&self, x: f64, y: f64) -> DVec3 {
        match self.projection {
            Projection::Pinhole => self.eye,
            Projection::Orthographic => {
                let camera = DVec3::new((x - self.cx) / self.fx, (y - self.cy) / self.fy, 0.0);
                self.eye + self.rotation.transpose() * camera
            }
        }
    }

    /// The depth gained per unit of length along the view ray through the centre of pixel (x, y): 1
    /// for orthographic cameras.
    pub fn along_axis(&self, x: u32, y: u32) -> f64 {
        1.0 / self.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).length()
    }

    /// The unit direction from the eye to `point`, world space; for an orthographic camera the
    /// direction of its axis.
    pub fn direction_to(&self, point: DVec3) -> DVec3 {
        match self.projection {
            Projection::Pinhole => (point - self.eye).normalize_or_zero(),
            Projection::Orthographic => self.rotation.row(2),
        }
    }

    /// The number of pixels in the image.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether a ball lies entirely outside the image, by more than `margin` pixels.
    ///
    /// `at` is its centre in camera space. The test is against the planes through the eye and the
    /// edges of the image, so it also works for a ball that reaches the plane of the eye.
    pub(crate) fn is_beside_image(&self, at: DVec3, radius: f64, margin: DVec2) -> bool {
        self.beside(at, radius, margin).iter().any(|sides| sides.any())
    }

    /// Whether a convex body, given by its corners in camera space, lies entirely beyond one edge
    /// of the image, by more than `margin` pixels.
    pub(crate) fn is_body_beside_image(&self, corners: &[DVec3], margin: DVec2) -> bool {
        let sides = corners.iter().map(|corner| self.beside(*corner, 0.0, margin));
        sides.reduce(|[a, b], [c, d]| [a & c, b & d]).is_some_and(|all| all.iter().any(|sides| sides.any()))
    }

    /// Whether a ball lies beyond the left and top edges, and beyond the right and bottom ones.
    fn beside(&self, at: DVec3, radius: f64, margin: DVec2) -> [BVec2; 2] {
        // The edges of a lens's image are no planes.
        if self.optics.is_some() {
            return [BVec2::FALSE; 2];
        }
        let (focal, principal) = (DVec2::new(self.fx, self.fy), DVec2::new(self.cx, self.cy));
        let size = DVec2::new(self.width.into(), self.height.into());
        let (before, after) = (principal + margin, size + margin - principal);
        let along = focal * at.truncate();
        match self.projection {
            Projection::Pinhole => {
                let reach = |edge: DVec2| (focal * focal + edge * edge).map(f64::sqrt) * radius;
                [(along + before * at.z).cmplt(-reach(before)), (along - after * at.z).cmpgt(reach(after))]
            }
            Projection::Orthographic => {
                [(along + before).cmplt(-focal * radius), (along - after).cmpgt(focal * radius)]
            }
        }
    }
}

/// Points on the border of an image of this size, pixels, the corners among them.
fn border(size: DVec2) -> impl Iterator<Item = DVec2> {
    const STEPS: u32 = 16;
    let share = |step: u32| f64::from(step) / f64::from(STEPS);
    let around = move |step: u32| {
        let (x, y) = (size.x * share(step), size.y * share(step));
        [DVec2::new(x, 0.0), DVec2::new(size.x, y), DVec2::new(size.x - x, size.y), DVec2::new(0.0, size.y - y)]
    };
    (0..STEPS).flat_map(around)
}

/// Normalises a vector of any length without overflow; zero stays zero.
fn unit(v: DVec3) -> DVec3 {
    (v / v.abs().max_element()).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn looking_north_has_east_on_the_right() {
        let camera =
            Camera::look_at((100, 100), Lens::Fov(90.0), DVec3::ZERO, DVec3::Y, Some(DVec3::Z), Up::Z, 0.01).unwrap();
        assert!((camera.to_camera(DVec3::X) - DVec3::X).length() < 1e-15);
        assert!((camera.to_camera(DVec3::Z) + DVec3::Y).length() < 1e-15);
        assert!((camera.fx - 50.0).abs() < 1e-12);
    }

    #[test]
    fn unusable_cameras_are_refused() {
        let look = |up| Camera::look_at((8, 8), Lens::Fov(45.0), DVec3::ZERO, DVec3::Z, up, Up::Z, 0.1);
        assert!(look(Some(DVec3::Z)).is_err());
        assert!(look(None).is_ok());
        assert!(check_size(0, 5).is_err() && check_size(100_000, 100_000).is_err());
        assert!(Camera::posed((8, 8), Lens::Fov(45.0), DVec3::ZERO, DMat3::IDENTITY * 2.0, 0.1).is_err());
        assert!(Camera::posed((8, 8), Lens::Fov(181.0), DVec3::ZERO, DMat3::IDENTITY, 0.1).is_err());
    }
}
