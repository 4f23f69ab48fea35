//! Lines at which a disk ends before its rim.

use glam::{DVec2, DVec3};

/// Two lines in the plane of a disk, each as (x, y, z): of the unit disk the points (u, v) are kept with `x u + y v + z >= 0`. Its
/// centre may be left out. (Zwicker, Raesaenen, Botsch, Dachsbacher and Pauly 2004, *Perspective Accurate Splatting*, section 5.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip(pub [[f32; 3]; 2]);

impl Clip {
    /// Lines that leave nothing out.
    pub const NONE: Self = Self([[0.0, 0.0, 1.0]; 2]);

    /// The line of a disk with these half-axes that keeps what has `normal . q >= offset`, q from the disk's centre in the plane and
    /// the unit of the half-axes. Its longest number is 1, as half-axes may be of any length.
    pub fn line(normal: DVec2, offset: f64, [s, t]: [DVec2; 2]) -> [f32; 3] {
        let line = [normal.dot(s), normal.dot(t), -offset];
        let longest = line.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        line.map(|x| (x / longest) as f32)
    }

    /// Whether it leaves nothing out.
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// The same with lines whose longest number is 1, so that no product of theirs overflows; a line that is none, or not finite,
    /// leaves nothing out.
    pub fn usable(self) -> Self {
        Self(self.0.map(|line| {
            let longest = line.iter().fold(0.0f32, |longest, x| longest.max(x.abs()));
            let usable = line.iter().all(|x| x.is_finite()) && longest > 0.0;
            if usable { line.map(|x| x / longest) } else { Self::NONE.0[0] }
        }))
    }

    /// How far inside both lines (u, v) lies, in units of the lines' own lengths: negative where it is left out.
    pub fn inside(&self, u: f64, v: f64) -> f64 {
        let along = |line: [f32; 3]| DVec3::from(line.map(f64::from)).dot(DVec3::new(u, v, 1.0));
        along(self.0[0]).min(along(self.0[1]))
    }

    /// How much of the way from the disk's centre to (u, v) is kept: at most 1, and 0 where the centre is left out.
    pub fn reach(&self, u: f64, v: f64) -> f64 {
        let of_line = |line: [f32; 3]| {
            let [x, y, z] = line.map(f64::from);
            let falls = -(x * u + y * v);
            match z {
                z if z < 0.0 => 0.0,
                z if falls > z => z / falls,
                _ => 1.0,
            }
        };
        of_line(self.0[0]).min(of_line(self.0[1]))
    }
}

impl Default for Clip {
    fn default() -> Self {
        Self::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_on_the_far_side_of_either_line_is_left_out() {
        let corner = Clip([[1.0, 0.0, 0.25], [0.0, -1.0, 0.0]]);
        assert!(corner.inside(0.0, -0.5) > 0.0 && corner.inside(-0.2, 0.0) >= 0.0);
        assert!(corner.inside(-0.3, -0.5) < 0.0 && corner.inside(0.5, 0.1) < 0.0);
        assert_eq!(Clip::NONE.inside(1.0, -1.0), 1.0);
        assert_eq!((corner.reach(-1.0, 0.0), corner.reach(1.0, -1.0), corner.reach(0.0, 1.0)), (0.25, 1.0, 0.0));
        let line = Clip::line(DVec2::Y, -0.5, [DVec2::X * 3.0, DVec2::Y * 2.0]);
        assert_eq!(line, [0.0, 1.0, 0.25]);
        let odd = Clip([[f32::NAN, 0.0, 0.0], [0.0, 3e38, -3e38]]);
        assert_eq!(odd.usable(), Clip([[0.0, 0.0, 1.0], [0.0, 1.0, -1.0]]));
    }
}
