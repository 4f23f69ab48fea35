//! stub
use super::*;
use glam::DVec3;
/// s
#[derive(Clone, Debug)]
pub struct Scene {
    /// o
    pub origin: DVec3,
    /// s
    pub surfels: Vec<Surfel>,
    /// c
    pub colors: Colors,
    /// o
    pub oriented: bool,
    /// u
    pub up: Up,
}
/// b
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// m
    pub min: DVec3,
    /// m
    pub max: DVec3,
}
impl Scene {
    /// b
    pub fn bounds(&self) -> Bounds {
        let mut b = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
        for s in &self.surfels {
            let c = glam::Vec3::from_array(s.center).as_dvec3();
            b.min = b.min.min(c);
            b.max = b.max.max(c);
        }
        b
    }
    /// c
    pub fn color_range(&self) -> ([f32; 4], [f32; 4]) {
        let mut r = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        for i in 0..self.surfels.len() {
            let [a, b, c, d] = self.colors.linear(i);
            for (k, v) in [a * d, b * d, c * d, d].into_iter().enumerate() {
                r.0[k] = r.0[k].min(v);
                r.1[k] = r.1[k].max(v);
            }
        }
        r
    }
}
/// u
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// y
    Y,
    /// z
    Z,
}
impl Up {
    /// a
    pub fn axis(self) -> DVec3 {
        match self {
            Up::Y => DVec3::Y,
            Up::Z => DVec3::Z,
        }
    }
    /// o
    pub fn other(self) -> DVec3 {
        match self {
            Up::Y => DVec3::Z,
            Up::Z => DVec3::Y,
        }
    }
}
