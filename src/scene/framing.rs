//! Views that frame the scene: the default one, and those from a given side.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::camera::check_size;
use super::side::unit;
use super::{Bounds, Camera, Clip, Lens, Projection, Scene, Side, Surfel};
use crate::error::{Error, Result};

/// The fraction of the way from the image's middle to its edge that the surfels' centres fill.
pub(super) const FILL: f64 = 0.95;

/// The same fraction for disks, which is used if the image's border would cut a disk otherwise.
pub(super) const FILL_OF_DISKS: f64 = 0.98;

/// Rounds of centring. Each multiplies the remaining offset by about the square of the scene's
/// depth over its distance.
const ROUNDS: usize = 4;

/// The processes that hold the other shares of a scene, for numbers that depend on all surfels.
pub trait Others: Sync {
    /// Replaces each number by the largest one of all processes, which call this in the same order.
    fn largest(&self, own: &mut [f64]);
}

/// There are no other processes.
impl Others for () {
    fn largest(&self, _: &mut [f64]) {}
}

impl Camera {
    /// A camera that frames the scene's body: centred, and as large as fits in the image.
    ///
    /// The view is from the front, a little from the right and above; z-up scenes, which tend to be
    /// terrain, are seen from a steeper angle. The centres leave a margin of 5 %, and the border
    /// cuts no disk: larger disks move the camera farther away. An orthographic lens keeps its
    /// scale, so it may show less.
    pub fn framing(size: (u32, u32), lens: Lens, scene: &Scene, near: f64) -> Result<Self> {
        Ok(Self::framed(size, lens, (scene, &()), near, (None, None, Of::Disks))?.0)
    }

    /// As [`Camera::framing`], from a side and with an up direction if they are given; also returns
    /// the target.
    ///
    /// `up` is a world-space direction of any length, by default the scene's. The target is in
    /// world coordinates: [`Camera::look_at`] from the camera's eye to it gives the same camera.
    ///
    /// # Errors
    ///
    /// As [`Camera::framing`], and [`Error::Usage`] if `up` or the side has no
    /// direction, or if both have the same.
    pub fn framing_from(
        size: (u32, u32),
        lens: Lens,
        scene: &Scene,
        near: f64,
        (side, up): (Option<Side>, Option<DVec3>),
    ) -> Result<(Self, DVec3)> {
        Self::framing_among(size, lens, (scene, &()), near, (side, up))
    }

    /// As [`Camera::framing_from`], for a scene of which `others` hold the other shares.
    pub(crate) fn framing_among(
        size: (u32, u32),
        lens: Lens,
        (scene, others): (&Scene, &dyn Others),
        near: f64,
        (side, up): (Option<Side>, Option<DVec3>),
    ) -> Result<(Self, DVec3)> {
        Self::framed(size, lens, (scene, others), near, (side, up, Of::Disks))
    }

    /// The default view by the surfels' centres alone, for studies in which the view must not
    /// depend on the radius.
    #[cfg(feature = "bench")]
    pub(crate) fn framing_centers(size: (u32, u32), lens: Lens, scene: &Scene, near: f64) -> Result<Self> {
        Ok(Self::framed(size, lens, (scene, &()), near, (None, None, Of::Centers))?.0)
    }

    fn framed(
        (width, height): (u32, u32),
        lens: Lens,
        (scene, others): (&Scene, &dyn Others),
        near: f64,
        (side, up, of): (Option<Side>, Option<DVec3>, Of),
    ) -> Result<(Self, DVec3)> {
        let (pinhole, image) = image((width, height), lens)?;
        let (forward, up) = directions(side, up, scene)?;
        let framing = Framing::new((scene, others), pinhole, image, (forward, unit(up, "up")?));
        let mut eye = framing.eye(FILL, Of::Centers);
        if of == Of::Disks && framing.cuts(eye) {
            eye = framing.eye(FILL_OF_DISKS, Of::Disks);
        }
        let [right, down, forward] = framing.axes;
        let world = scene.origin + framing.center + right * eye.x + down * eye.y + forward * eye.z;
        let target = world + forward * framing.radius;
        Ok((Self::look_at((width, height), lens, world, target, Some(up), scene.up, near)?, target))
    }
}

/// Returns the height of an orthographic image that shows the whole scene from a side, world units;
/// side and up are those of [`Camera::framing_from`]. `others` hold the other shares of the scene.
///
/// # Errors
///
/// As [`Camera::framing_from`].
pub fn fitted_height(
    (width, height): (u32, u32),
    (scene, others): (&Scene, &dyn Others),
    (side, up): (Option<Side>, Option<DVec3>),
) -> Result<f64> {
    check_size(width, height)?;
    let (forward, up) = directions(side, up, scene)?;
    let image = [[0.0, 0.5, 0.5]; 2];
    let framing = Framing::new((scene, others), false, image, (forward, unit(up, "up")?));
    let [right, left, bottom, top] = framing.reach(framing.eye(FILL, Of::Centers), Of::Disks);
    let across = right.max(left) * f64::from(height) / f64::from(width);
    let reach = across.max(bottom).max(top);
    // A level line seen from its end has no extent in the image.
    let reach = if reach > 0.0 && reach.is_finite() { reach } else { framing.radius };
    Ok(2.0 * reach / FILL)
}

/// Whether the camera is a pinhole, and for the image's width and height each: the middle, half the
/// size, and half the size less a border pixel, as X/Z (pinhole) or X (orthographic).
pub(super) fn image((width, height): (u32, u32), lens: Lens) -> Result<(bool, [[f64; 3]; 2])> {
    check_size(width, height)?;
    let (projection, [fx, fy, cx, cy]) = lens.intrinsics(width, height)?;
    if lens.optics().is_some() {
        return Err(Error::Usage("a lens that is no pinhole does not frame a scene: give its position".into()));
    }
    let interval = |size: u32, principal: f64, f: f64| {
        let size = f64::from(size);
        // Ending a pixel before the border leaves the border's own pixels free.
        let free = (0.5 * size - 1.0).max(0.25 * size);
        [(0.5 * size - principal) / f, 0.5 * size / f, free / f]
    };
    Ok((projection == Projection::Pinhole, [interval(width, cx, fx), interval(height, cy, fy)]))
}

/// The directions of the view and of up in its image, from `side` or by default.
pub(super) fn directions(side: Option<Side>, up: Option<DVec3>, scene: &Scene) -> Result<(DVec3, DVec3)> {
    match side {
        Some(side) => side.view(up, scene.up),
        None => {
            let given = up.unwrap_or(scene.up.axis());
            Ok((forward(unit(given, "up")?), given))
        }
    }
}

/// The part of a surfel that has to be inside the image.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Of {
    Centers,
    Disks,
}

/// The scene in the axes of the camera.
pub(super) struct Framing<'a> {
    scene: &'a Scene,
    others: &'a dyn Others,
    pub(super) pinhole: bool,
    /// For the image's width and height each: the middle, half the size, and half the size less a
    /// border pixel, as X/Z (pinhole) or X (orthographic).
    pub(super) image: [[f64; 3]; 2],
    /// The world directions right, down and forward.
    axes: [DVec3; 3],
    /// The box of the centres that are framed, relative to the scene's origin.
    body: Bounds,
    pub(super) center: DVec3,
    /// The radius of the scene, world units.
    pub(super) radius: f64,
    /// The smallest depth that a centre may have, world units.
    pub(super) clearance: f64,
}

/// A clipped disk in the camera's axes, relative to the centre of the body.
#[derive(Clone, Copy)]
pub(super) struct Disk {
    p: DVec3,
    s: DVec3,
    t: DVec3,
    clip: Clip,
}

impl Disk {
    /// The disk's farthest point in the direction `along`.
    pub(super) fn farthest(self, along: DVec3) -> DVec3 {
        let (s, t) = (self.s.dot(along), self.t.dot(along));
        if !self.clip.is_none() {
            let [u, v] = self.clip.farthest(s, t);
            return self.p + self.s * u + self.t * v;
        }
        let length = s.hypot(t);
        if length > 0.0 { self.p + (self.s * s + self.t * t) / length } else { self.p }
    }

    /// The largest ratio of the coordinate along `axis` to depth, for a disk in front of the camera
    /// (Dinkelbach 1967: if the largest x - k z is zero, then k is the largest x / z).
    fn largest_ratio(self, axis: DVec3) -> f64 {
        let rounds = if self.s == self.t { 0 } else { 3 };
        (0..rounds).fold(self.p.dot(axis) / self.p.z, |k, _| {
            let q = self.farthest(axis - DVec3::Z * k);
            q.dot(axis) / q.z
        })
    }
}

impl<'a> Framing<'a> {
    pub(super) fn new(
        (scene, others): (&'a Scene, &'a dyn Others),
        pinhole: bool,
        image: [[f64; 3]; 2],
        (forward, up): (DVec3, DVec3),
    ) -> Self {
        let right = forward.cross(up).normalize();
        let (body, _) = scene.framed();
        // A scene whose points coincide has only the extent of its surfels.
        let half = 0.5 * body.extent().length();
        let largest = f64::from(scene.largest_radius());
        let (radius, clearance) = match half > 0.0 {
            // Where disks exceed the box of their centres, the scene is as large as the disks.
            true if largest > half => {
                let radius = half.max(median_radius(scene));
                (radius, 0.05 * radius)
            }
            true => (half, 0.05 * half),
            false => (largest, 3.0 * largest),
        };
        let axes = [right, forward.cross(right), forward];
        Self { scene, others, pinhole, image, axes, body, center: body.center(), radius, clearance }
    }

    /// The maximum of each component of `f` over all framed disks, in any order, those of other
    /// processes included.
    ///
    /// A disk much larger than the scene, for example that of a stray point, counts by its centre.
    pub(super) fn largest<const N: usize>(&self, of: Of, f: impl Fn(Disk) -> [f64; N] + Sync) -> [f64; N] {
        let local = |v: DVec3| DVec3::from_array(self.axes.map(|axis| v.dot(axis)));
        let value = |index: usize| {
            let axes = self.scene.surfels.get(index).map_or([[0.0; 3]; 2], |surfel| [surfel.s, surfel.t]);
            let [s, t] = axes.map(|v| DVec3::from_array(v.map(f64::from)));
            let p = self.scene.place(index).0;
            let inside = p.cmpge(self.body.min).all() && p.cmple(self.body.max).all();
            let whole = of == Of::Disks && s.length().max(t.length()) <= 2.0 * self.radius;
            let [s, t] = if whole { [local(s), local(t)] } else { [DVec3::ZERO; 2] };
            let clip = self.scene.clips.get(index).copied().unwrap_or_default();
            inside.then(|| f(Disk { p: local(p - self.center), s, t, clip }))
        };
        let join = |a: [f64; N], b: [f64; N]| std::array::from_fn(|k| a[k].max(b[k]));
        let none = || [f64::NEG_INFINITY; N];
        let all = (0..self.scene.places()).into_par_iter().map(|index| value(index).unwrap_or_else(none));
        let mut largest = all.reduce(none, join);
        self.others.largest(&mut largest);
        largest
    }

    /// The extents of the framed points toward the right, left, bottom and top, as X/Z or X, seen
    /// from `eye`.
    fn reach(&self, eye: DVec3, of: Of) -> [f64; 4] {
        let sides = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
        self.largest(of, |disk| {
            let disk = Disk { p: disk.p - eye, ..disk };
            sides.map(|side| if self.pinhole { disk.largest_ratio(side) } else { disk.farthest(side).dot(side) })
        })
    }

    /// The eye position from which the scene fills the fraction `fill` of the image, in the
    /// camera's axes relative to the centre of the body.
    fn eye(&self, fill: f64, of: Of) -> DVec3 {
        let filled = |half: f64, free: f64| if of == Of::Disks { free.min(fill * half) } else { fill * half };
        let [[mid_x, half_x], [mid_y, half_y]] = self.image.map(|[middle, half, free]| [middle, filled(half, free)]);
        let mut eye = DVec3::new(0.0, 0.0, -2.0 * self.radius);
        if self.pinhole {
            // The eye must keep every point between four planes, X - x <= (mid + half) (Z - z) and
            // so on. The more restrictive
            // pair of planes decides how far forward the eye may stand.
            let planes = [
                DVec3::new(1.0, 0.0, -(mid_x + half_x)),
                DVec3::new(-1.0, 0.0, mid_x - half_x),
                DVec3::new(0.0, 1.0, -(mid_y + half_y)),
                DVec3::new(0.0, -1.0, mid_y - half_y),
                DVec3::NEG_Z,
            ];
            let [left, right, above, below, front] =
                self.largest(of, |disk| planes.map(|plane| disk.farthest(plane).dot(plane)));
            let behind = front + self.clearance;
            let z = -((left + right) / (2.0 * half_x)).max((above + below) / (2.0 * half_y)).max(behind);
            eye = DVec3::new(0.5 * (left - right) + mid_x * z, 0.5 * (above - below) + mid_y * z, z);
        }
        // Disks are not centred: one near the eye in front of others would make the rounds
        // oscillate. The planes alone keep them inside the image.
        let rounds = if of == Of::Disks { 0 } else { ROUNDS };
        for _ in 0..rounds {
            let reach = self.reach(eye, of);
            let depth = if self.pinhole { -eye.z } else { 1.0 };
            eye.x += (0.5 * (reach[0] - reach[1]) - mid_x) * depth;
            eye.y += (0.5 * (reach[2] - reach[3]) - mid_y) * depth;
        }
        eye
    }

    /// Whether the image's border cuts a disk, seen from `eye`.
    fn cuts(&self, eye: DVec3) -> bool {
        let [[mid_x, _, half_x], [mid_y, _, half_y]] = self.image;
        let [front] = self.largest(Of::Disks, |disk| [eye.z - disk.farthest(DVec3::NEG_Z).z]);
        let [right, left, bottom, top] = self.reach(eye, Of::Disks);
        let beyond =
            (right > mid_x + half_x || -left < mid_x - half_x) || (bottom > mid_y + half_y || -top < mid_y - half_y);
        self.pinhole && (front >= 0.0 || beyond)
    }
}

/// The median of the surfels' radii, independent of their order.
fn median_radius(scene: &Scene) -> f64 {
    let mut radii: Vec<f32> = scene.surfels.par_iter().map(Surfel::radius).collect();
    let middle = radii.len() / 2;
    if radii.is_empty() { 0.0 } else { f64::from(*radii.select_nth_unstable_by(middle, f32::total_cmp).1) }
}

/// The default view direction for the unit vector `up`.
///
/// It is the direction for up along the y or z axis, whichever is nearer to the line of `up`. The
/// direction is rotated by the rotation that takes that axis to `up`.
fn forward(up: DVec3) -> DVec3 {
    let (axis, forward) = if up.z.abs() > up.y.abs() {
        (DVec3::Z, DVec3::new(-0.15, 1.0, -1.2))
    } else {
        (DVec3::Y, -DVec3::new(0.45, 0.35, 1.0))
    };
    let forward = forward.normalize();
    if up == axis { forward } else { DQuat::from_rotation_arc(axis, up) * forward }
}

#[cfg(test)]
mod tests;
