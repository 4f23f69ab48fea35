//! The surfel: an oriented elliptical disk.

use glam::Vec3;

/// An elliptical disk `p + u s + v t`, `u² + v² <= 1`, in world units relative to [`Scene::origin`](super::Scene::origin).
///
/// This is the record the device reads too (`Surfel` in `wgsl/layout.wgsl`), so a scene is uploaded as it lies.
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
    /// A circular disk. `normal` need not have unit length but must not be zero; `radius` is positive.
    pub fn disk(center: Vec3, normal: Vec3, radius: f32) -> Self {
        let n = normal.normalize();
        // Duff et al. 2017, "Building an orthonormal basis, revisited": no branch point, no division by zero.
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        let s = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
        let t = Vec3::new(b, sign + n.y * n.y * a, -n.y);
        Self { center: center.to_array(), s: (s * radius).to_array(), t: (t * radius).to_array() }
    }

    /// The unnormalised normal s x t; its length is the product of the half-axes for perpendicular axes.
    pub fn normal(&self) -> Vec3 {
        Vec3::from_array(self.s).cross(Vec3::from_array(self.t))
    }

    /// The radius of the bounding sphere: the longer half-axis, for perpendicular axes.
    pub fn radius(&self) -> f32 {
        Vec3::from_array(self.s).length().max(Vec3::from_array(self.t).length())
    }
}
