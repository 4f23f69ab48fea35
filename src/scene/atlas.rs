//! A common plane for several textures, so that surfels of all of them are blended alike.

use serde::{Deserialize, Serialize};

/// The margin around the coordinates of each texture in the plane. Surfels that reach past an edge
/// still show their own texture, and the mean of coordinates in two textures is far enough from
/// both to be recognised as invalid.
const BESIDE: f32 = 1.0;

/// The layout of several textures in one plane of coordinates: the cells of a square grid.
///
/// A cell holds the coordinates of one texture, translated by a whole number of repeats. Points
/// without a texture have the cells after those of the textures.
///
/// The coordinates of two textures are thus as far apart as those on two sides of a seam, and a
/// pixel where both meet is treated as one at a seam ([`Textured`](super::Textured)). The width of
/// the plane grows with the square root of the number of textures, which costs digits of the sums.
/// The smallest reach is a fraction of that width, so seams within a texture are detected less
/// precisely the more textures there are: between places 0.016 apart for one texture, 0.06 for
/// four, 0.16 for sixteen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Atlas {
    /// Whole numbers below every u and every v.
    pub corner: [f32; 2],
    /// The side of a cell, a whole number.
    pub cell: f32,
    /// The number of cells in a row.
    pub columns: u32,
    /// The number of textures.
    pub textures: u32,
}

impl Default for Atlas {
    fn default() -> Self {
        Self::ONE
    }
}

impl Atlas {
    /// The layout of a single texture, whose coordinates are unchanged.
    pub const ONE: Self = Self { corner: [0.0; 2], cell: 1.0, columns: 1, textures: 1 };

    /// The layout of `textures` for points with these texture numbers and finite coordinates. A
    /// number of `textures` or more means no texture.
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

    /// The coordinates in the plane of `place` in texture `number`.
    pub fn joint(&self, number: u32, place: [f32; 2]) -> [f32; 2] {
        let number = number.min(self.textures);
        let cell = [number % self.columns, number / self.columns].map(f64::from);
        self.moved(place.map(f64::from), cell, 1.0).map(|turns| turns as f32)
    }

    /// The number of the texture whose cell contains `place`; at least [`Self::textures`] for a
    /// cell without one.
    pub fn number(&self, place: [f64; 2]) -> u32 {
        let [column, row] = self.cell_of(place).map(|cell| cell as u32);
        row * self.columns + column
    }

    /// The coordinates within its texture of `place` in the plane.
    pub fn own(&self, place: [f64; 2]) -> [f64; 2] {
        self.moved(place, self.cell_of(place), -1.0)
    }

    fn moved(&self, place: [f64; 2], cell: [f64; 2], sign: f64) -> [f64; 2] {
        [0, 1].map(|k| place[k] + sign * cell[k] * f64::from(self.cell))
    }

    /// The column and row of the cell that contains `place`. The twin of `cell_of` in
    /// `wgsl/accumulate/texture.wgsl`.
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
                // Past its edges it is still its own texture.
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
