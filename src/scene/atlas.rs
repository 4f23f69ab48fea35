//! Several textures side by side in one plane of coordinates, so that surfels of all of them are blended alike.

/// Free coordinates at each side of a texture in the plane: what its surfels show past its edges is its own, and what surfels of two textures
/// blend to lies far enough from both that no mean passes for a place in either.
const BESIDE: f32 = 1.0;

/// Where textures lie in a plane of coordinates: in cells of a square grid, which hold the coordinates of each as they are, but for a whole
/// number of turns. Points that no texture paints have the cells after those of the textures.
///
/// The places of two textures are so as far apart as those on two sides of a seam, and a pixel at which both meet is seen as one at a seam
/// ([`Textured`](super::Textured)). The plane is as wide as the square root of the textures' number, which costs digits of the sums; and as the
/// least reach there is a part of its width, seams within a texture are told the less sharply the more textures there are: of one between places
/// that are 0.016 of it apart, of four between those 0.06, of sixteen 0.16.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Atlas {
    /// Whole numbers below every u and every v.
    pub corner: [f32; 2],
    /// The side of a cell, a whole number.
    pub cell: f32,
    /// Cells in a row.
    pub columns: u32,
    /// How many textures there are.
    pub textures: u32,
}

impl Default for Atlas {
    fn default() -> Self {
        Self::ONE
    }
}

impl Atlas {
    /// Of one texture, whose coordinates stay what they are.
    pub const ONE: Self = Self { corner: [0.0; 2], cell: 1.0, columns: 1, textures: 1 };

    /// That of `textures`, of which points have these numbers and finite coordinates; a number past them means none.
    pub fn of(textures: u32, points: impl Iterator<Item = (u32, [f32; 2])> + Clone) -> Self {
        let bare = points.clone().any(|(number, _)| number >= textures);
        if textures == 1 && !bare {
            return Self::ONE;
        }
        let ends = |k: usize| {
            let all = points.clone().map(move |(_, place)| place[k]);
            let (low, high) = all.fold((0f32, 1f32), |(low, high), turns| (low.min(turns), high.max(turns)));
            (low.floor(), high.ceil())
        };
        let [(left, right), (bottom, top)] = [0, 1].map(ends);
        let cells = u64::from(textures) + u64::from(bare);
        let columns = (1..).find(|columns: &u64| columns * columns >= cells).unwrap_or(1) as u32;
        let cell = (right - left).max(top - bottom) + 2.0 * BESIDE;
        Self { corner: [left - BESIDE, bottom - BESIDE], cell, columns, textures }
    }

    /// Where the coordinates of a texture lie in the plane.
    pub fn joint(&self, number: u32, place: [f32; 2]) -> [f32; 2] {
        let number = number.min(self.textures);
        let cell = [number % self.columns, number / self.columns].map(f64::from);
        self.moved(place.map(f64::from), cell, 1.0).map(|turns| turns as f32)
    }

    /// The number of the texture whose cell a place of the plane lies in; one past the textures' means none.
    pub fn number(&self, place: [f64; 2]) -> u32 {
        let [column, row] = self.cell_of(place).map(|cell| cell as u32);
        row * self.columns + column
    }

    /// The coordinates in the texture of a place of the plane.
    pub fn own(&self, place: [f64; 2]) -> [f64; 2] {
        self.moved(place, self.cell_of(place), -1.0)
    }

    fn moved(&self, place: [f64; 2], cell: [f64; 2], sign: f64) -> [f64; 2] {
        [0, 1].map(|k| place[k] + sign * cell[k] * f64::from(self.cell))
    }

    /// The twin of `cell_of` in `wgsl/texture.wgsl`.
    fn cell_of(&self, place: [f64; 2]) -> [f64; 2] {
        let last = f64::from(self.columns - 1);
        [0, 1].map(|k| ((place[k] - f64::from(self.corner[k])) / f64::from(self.cell)).floor().clamp(0.0, last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_back_from_the_plane() {
        let of = |number: u32| (number, [number as f32 * 0.7 - 1.3, 4.5 - number as f32]);
        let points = (0..7).map(of);
        for textures in [5, 7] {
            let atlas = Atlas::of(textures, points.clone());
            let mut seen: Vec<[f32; 2]> = Vec::new();
            for (number, place) in points.clone() {
                let joint = atlas.joint(number, place);
                let exact = joint.map(f64::from);
                assert_eq!(atlas.number(exact), number.min(textures));
                let [u, v] = atlas.own(exact).map(|turns| turns as f32);
                assert!((u - place[0]).abs() < 1e-5 && (v - place[1]).abs() < 1e-5, "{number}: {u} {v}");
                // Past its edges it is still its own.
                for (du, dv) in [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)] {
                    assert_eq!(atlas.number([exact[0] + du, exact[1] + dv]), number.min(textures));
                }
                let near = |other: &[f32; 2]| (joint[0] - other[0]).hypot(joint[1] - other[1]) < BESIDE;
                assert!(number > textures || !seen.iter().any(near), "{number}: {joint:?}");
                seen.push(joint);
            }
        }
        assert_eq!(Atlas::of(1, [(0, [0.5, 9.0])].into_iter()), Atlas::ONE);
        assert_eq!(Atlas::ONE.joint(0, [-3.5, 9.0]), [-3.5, 9.0]);
        let place = [-3.5, 9.0];
        assert_eq!((Atlas::ONE.number(place), Atlas::ONE.own(place)), (0, place));
    }
}
