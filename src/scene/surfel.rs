//! The surfel: an oriented elliptical disk.

use glam::Vec3;

/// An elliptical disk `p + u s + v t`, `u² + v² <= 1`, in world units relative to
/// [`Scene::origin`](super::Scene::origin).
///
/// The device reads the same record (`Surfel` in `wgsl/common/layout.wgsl`), so a scene is uploaded
/// as is.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Surfel {
    /// Centre p.
    pub center: [f32; 3],
    /// Half-axis s.
    pub s: [f32; 3],
    /// Half-axis t.
    pub t: [f32; 3],
}

impl Surfel {
    /// A circular disk. `normal` must not be zero but may have any length; `radius` is positive.
    pub fn disk(center: Vec3, normal: Vec3, radius: f32) -> Self {
        let n = normal.normalize();
        // Duff et al. 2017, "Building an orthonormal basis, revisited": no branches, no division by
        // zero.
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        let s = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
        let t = Vec3::new(b, sign + n.y * n.y * a, -n.y);
        Self { center: center.to_array(), s: (s * radius).to_array(), t: (t * radius).to_array() }
    }

    /// The ellipse `center + u s + v t`, `u² + v² <= 1`, for any s and t that are not parallel.
    ///
    /// Axes that are not perpendicular are replaced by the perpendicular half-axes of the same
    /// ellipse.
    #[inline] // Otherwise the vectors are passed through memory, and reading them stalls.
    pub fn ellipse(center: Vec3, s: Vec3, t: Vec3) -> Self {
        // The cosine up to which f32 half-axes count as perpendicular.
        const ROUNDING: f64 = 1e-6;
        let (mut s, mut t) = (s.as_dvec3(), t.as_dvec3());
        // In f64, squares of products of f32 values neither overflow nor vanish.
        if s.dot(t).powi(2) > ROUNDING * ROUNDING * s.length_squared() * t.length_squared() {
            // (cos a, sin a) and (-sin a, cos a) are perpendicular in (u, v), so they give the same
            // ellipse with the same s x t. For the angle a below their images are perpendicular
            // too, and the first is the longer one. The second is computed from s x t: as t cos a -
            // s sin a it would be lost to rounding if it is much shorter.
            let normal = s.cross(t);
            let angle = 0.5 * (2.0 * s.dot(t)).atan2(s.length_squared() - t.length_squared());
            s = s * angle.cos() + t * angle.sin();
            t = normal.cross(s) / s.length_squared();
        }
        Self { center: center.to_array(), s: s.as_vec3().to_array(), t: t.as_vec3().to_array() }
    }

    /// The normal s x t, not normalised. For perpendicular axes its length is the product of the
    /// half-axes.
    pub fn normal(&self) -> Vec3 {
        Vec3::from_array(self.s).cross(Vec3::from_array(self.t))
    }

    /// The shorter half-axis. The epsilon `radius:K` is a multiple of it, as a long thin disk would
    /// otherwise reach through surfaces behind it.
    pub fn shorter(&self) -> f32 {
        Vec3::from_array(self.s).length().min(Vec3::from_array(self.t).length())
    }

    /// The radius of the bounding sphere: the longer half-axis, for perpendicular axes.
    pub fn radius(&self) -> f32 {
        Vec3::from_array(self.s).length().max(Vec3::from_array(self.t).length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oblique_half_axes_become_perpendicular_ones_of_the_same_ellipse() {
        let (s, t) = (Vec3::new(3.0, 1.0, 0.5), Vec3::new(2.0, -1.0, 0.25));
        let surfel = Surfel::ellipse(Vec3::ONE, s, t);
        let (major, minor) = (Vec3::from_array(surfel.s), Vec3::from_array(surfel.t));
        assert!(major.dot(minor).abs() < 1e-6 * major.length() * minor.length());
        assert!(surfel.normal().distance(s.cross(t)) < 1e-5 * s.cross(t).length());
        for step in 0..100 {
            let (sin, cos) = (step as f32 * 0.0628).sin_cos();
            let rim = s * cos + t * sin;
            let (u, v) = (rim.dot(major) / major.length_squared(), rim.dot(minor) / minor.length_squared());
            assert!((u.hypot(v) - 1.0).abs() < 1e-5, "{u} {v}");
        }
        // The original axes do not give a point on the rim.
        let rim = s * 0.8 + t * 0.6;
        assert!((rim.dot(s) / s.length_squared()).hypot(rim.dot(t) / t.length_squared()) > 1.1);
        // Half-axes of very different lengths work too.
        let (s, t) = (Vec3::new(0.0, 1.25e-12, 0.0), Vec3::new(0.0, -6e16, -8e15));
        let long = Surfel::ellipse(Vec3::ZERO, s, t);
        let [major, minor] = [long.s, long.t].map(|axis| Vec3::from_array(axis).as_dvec3());
        assert!(major.normalize().dot(minor.normalize()).abs() < 1e-6 && major.length() > 6e16, "{long:?}");
        let area = s.as_dvec3().cross(t.as_dvec3()).length();
        assert!((major.length() * minor.length() / area - 1.0).abs() < 1e-5, "{long:?}");
        let (s, t) = (Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.0, 0.3, 0.7));
        let kept = Surfel::ellipse(Vec3::ZERO, s, t);
        assert_eq!((kept.s, kept.t), (s.to_array(), t.to_array()));
    }
}
