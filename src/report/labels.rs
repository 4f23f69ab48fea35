//! Places the names of points so that they hide no other name, marker or line.
//!
//! Names are placed one after the other, each at the best of a fixed set of positions around its
//! point ("greedy" in Christensen, Marks and Shieber 1995). That is enough for the tens of points
//! of a plot, and the result is always the same.

/// A rectangle in the plot's units, y down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Area {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Area {
    /// Returns the square with sides of 2 `half` around a point.
    pub fn around(x: f64, y: f64, half: f64) -> Self {
        Self { left: x - half, top: y - half, right: x + half, bottom: y + half }
    }

    /// Area of the intersection, in square units.
    pub fn overlap(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        width.max(0.0) * height.max(0.0)
    }

    fn size(&self) -> f64 {
        self.overlap(self)
    }
}

/// Height of a name.
pub(super) const HEIGHT: f64 = 13.0;
/// Width of a character, slightly more than the average of common sans-serif fonts, so that a name
/// is narrower than the space reserved for it.
const CHARACTER: f64 = 6.7;
/// Distances between a name and its marker. From the second distance on, a line joins name and
/// marker.
const DISTANCES: [f64; 5] = [7.0, 14.0, 24.0, 38.0, 56.0];
/// Directions of a name from its marker, the preferred one first: readers look to the right first.
const DIRECTIONS: [(f64, f64); 12] = [
    (1.0, 0.0),
    (1.0, -0.8),
    (1.0, 0.8),
    (-1.0, 0.0),
    (0.0, -1.0),
    (0.0, 1.0),
    (-1.0, -0.8),
    (-1.0, 0.8),
    (1.0, -1.5),
    (1.0, 1.5),
    (-1.0, -1.5),
    (-1.0, 1.5),
];

/// Returns the best place for a name of `characters` characters at the point (x, y) inside
/// `bounds`, and whether it needs a line to the point.
pub(super) fn place(characters: usize, (x, y): (f64, f64), bounds: &Area, taken: &[Area]) -> (Area, bool) {
    let (width, height) = (characters as f64 * CHARACTER, HEIGHT);
    let mut best = (f64::INFINITY, Area::around(x, y, 0.0), false);
    for (step, distance) in DISTANCES.into_iter().enumerate() {
        for (turn, (right, down)) in DIRECTIONS.into_iter().enumerate() {
            let (cx, cy) = (x + right * (distance + width / 2.0), y + down * (distance + height / 2.0));
            let area = Area {
                left: cx - width / 2.0,
                top: cy - height / 2.0,
                right: cx + width / 2.0,
                bottom: cy + height / 2.0,
            };
            let outside = area.size() - area.overlap(bounds);
            let kept_free = Area { top: area.top - 1.5, bottom: area.bottom + 1.5, ..area };
            let hidden: f64 = taken.iter().map(|other| kept_free.overlap(other)).sum();
            let cost = 10.0 * (outside + hidden) + 6.0 * step as f64 + turn as f64;
            if cost < best.0 {
                best = (cost, area, step > 0);
            }
        }
    }
    (best.1, best.2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_crowded_points_do_not_meet() {
        let bounds = Area { left: 0.0, top: 0.0, right: 400.0, bottom: 300.0 };
        let points: Vec<(f64, f64)> =
            (0..9).map(|i| (200.0 + f64::from(i % 3) * 9.0, 150.0 + f64::from(i) * 3.0)).collect();
        let mut taken: Vec<Area> = points.iter().map(|(x, y)| Area::around(*x, *y, 5.0)).collect();
        for point in &points {
            let (area, _) = place(8, *point, &bounds, &taken);
            assert!(taken.iter().all(|other| area.overlap(other) == 0.0), "{area:?}");
            assert!(area.left >= 0.0 && area.right <= 400.0 && area.top >= 0.0 && area.bottom <= 300.0);
            taken.push(area);
        }
    }

    #[test]
    fn a_point_at_the_edge_has_its_name_inside() {
        let bounds = Area { left: 0.0, top: 0.0, right: 100.0, bottom: 100.0 };
        let (area, line) = place(5, (98.0, 50.0), &bounds, &[]);
        assert!(area.right < 98.0 && !line);
    }
}
