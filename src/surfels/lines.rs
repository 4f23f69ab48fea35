//! Chooses the clip lines of a disk: among all ends of the surface around the disk, the two lines
//! that cut off most.

use glam::DVec2;

use crate::scene::Clip;

/// The largest number of lines that are considered per disk.
const MOST: usize = 32;

/// Two lines count as the same if the cosine between their directions is larger than the first
/// value, 2 degrees, and their offsets differ by less than the second. Only one of them is
/// considered, because an end of the surface has a line for each triangle or point along it.
const SAME: (f64, f64) = (0.9994, 0.02);

/// A line on the unit disk, which keeps the points q with `inward . q >= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    /// Unit vector.
    pub inward: DVec2,
    /// Negative if the disk's centre is kept.
    pub offset: f64,
}

impl Line {
    /// The line through two points, which keeps the left side seen from the first to the second.
    /// None if they coincide.
    pub fn through(from: DVec2, to: DVec2) -> Option<Self> {
        let inward = (to - from).try_normalize()?.perp();
        Some(Self { inward, offset: inward.dot(from) })
    }

    /// Moves the line outward until it keeps the disk's centre and all of `points`, and by `margin`
    /// more.
    ///
    /// A disk must cover its cell: where an end bends around the cell, the line along one of its
    /// sides would cut off the part past the next side.
    pub fn keeping(self, points: &[DVec2], margin: f64) -> Self {
        let of_points = points.iter().map(|point| point.dot(self.inward)).fold(0.0, f64::min);
        Self { offset: self.offset.min(of_points) - margin, ..self }
    }
}

/// The point of a segment that is nearest to the disk's centre, as a fraction of the way between
/// its ends.
pub(super) fn nearest_share(from: DVec2, to: DVec2) -> f64 {
    let along = to - from;
    let share = -from.dot(along) / along.length_squared();
    if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
}

/// The corners of the convex hull of `points`: a line that keeps them keeps all points.
pub(super) fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut corners: Vec<DVec2> = Vec::new();
        for point in points {
            while let [.., before, last] = corners.as_slice()
                && (last - before).perp_dot(point - last) <= 0.0
            {
                corners.pop();
            }
            corners.push(point);
        }
        corners
    };
    let (lower, upper) = (chain(&mut points.iter().copied()), chain(&mut points.iter().rev().copied()));
    [lower, upper].concat()
}

/// Returns the `lines` to consider, each with its data, among those that cut the disk. Lines that
/// cut off most come first, and of several nearly equal lines only the first remains.
pub(super) fn apart<T: Copy>(mut lines: Vec<(Line, T)>) -> Vec<(Line, T)> {
    lines.retain(|(line, _)| line.offset > -1.0);
    lines.sort_by(|(a, _), (b, _)| {
        let ([ax, ay], [bx, by]) = (a.inward.to_array(), b.inward.to_array());
        b.offset.total_cmp(&a.offset).then(ax.total_cmp(&bx)).then(ay.total_cmp(&by))
    });
    let mut apart: Vec<(Line, T)> = Vec::with_capacity(MOST);
    for (line, of_line) in lines {
        let same = |(other, _): &(Line, T)| {
            other.inward.dot(line.inward) > SAME.0 && (other.offset - line.offset).abs() < SAME.1
        };
        if apart.len() == MOST {
            break;
        }
        if !apart.iter().any(same) {
            apart.push((line, of_line));
        }
    }
    apart
}

/// Returns at most two of `lines`: those that together cut off most of the disk. A line that cuts
/// off nothing is not used.
pub(super) fn clip(lines: Vec<Line>) -> Clip {
    let lines: Vec<Line> =
        apart(lines.into_iter().map(|line| (line, ())).collect()).into_iter().map(|(line, ())| line).collect();
    let mut clip = Clip::NONE;
    for (line, of_disk) in best(&lines).into_iter().flatten().zip(&mut clip.0) {
        *of_disk = Clip::line(line.inward, line.offset, [DVec2::X, DVec2::Y]);
    }
    clip
}

/// The number of points, distributed evenly over the unit disk, by which areas are compared.
const POINTS: u32 = 128;

/// The line or pair of lines that cuts off most. Among equals, single lines come before pairs, and
/// lower indices first.
fn best(lines: &[Line]) -> [Option<Line>; 2] {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let point = |k: u32| DVec2::from_angle(golden * f64::from(k)) * ((f64::from(k) + 0.5) / f64::from(POINTS)).sqrt();
    let left_out = |line: &Line| {
        (0..POINTS).filter(|k| line.inward.dot(point(*k)) < line.offset).fold(0u128, |bits, k| bits | 1 << k)
    };
    let masks: Vec<u128> = lines.iter().map(left_out).collect();
    let (mut most, mut best) = (None, [None; 2]);
    let single = (0..lines.len()).map(|a| (a, a));
    let pairs = (0..lines.len()).flat_map(|a| (a + 1..lines.len()).map(move |b| (a, b)));
    for (a, b) in single.chain(pairs) {
        let count = (masks[a] | masks[b]).count_ones();
        if most.is_none_or(|most| count > most) {
            most = Some(count);
            best = [Some(lines[a]), Some(lines[b]).filter(|_| a != b)];
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_keeps_what_must_be_covered() {
        let end = Line::through(DVec2::new(0.5, -1.0), DVec2::new(0.5, 1.0)).map(|line| (line.inward, line.offset));
        assert_eq!(end, Some((DVec2::NEG_X, -0.5)));
        let end = Line { inward: DVec2::NEG_X, offset: -0.5 };
        assert_eq!(end.keeping(&[DVec2::new(0.7, 0.2)], 0.1).offset, -0.7 - 0.1);
        assert_eq!(end.keeping(&[DVec2::new(-0.7, 0.2)], 0.0), end);
        assert_eq!(Line::through(DVec2::X, DVec2::X), None);
        assert_eq!(nearest_share(DVec2::new(1.0, -1.0), DVec2::new(1.0, 3.0)), 0.25);
    }

    #[test]
    fn a_hull_keeps_what_its_points_do() {
        let points: Vec<DVec2> = (0..50).map(|k| DVec2::from_angle(f64::from(k * k)) * f64::from(k % 7)).collect();
        let corners = hull(points.clone());
        assert!(corners.len() < 30, "{}", corners.len());
        for degrees in 0..72 {
            let toward = DVec2::from_angle(f64::from(degrees) * 0.087);
            let least = |points: &[DVec2]| points.iter().map(|p| p.dot(toward)).fold(f64::INFINITY, f64::min);
            assert_eq!(least(&points), least(&corners));
        }
        assert_eq!(hull(vec![]), vec![]);
    }

    #[test]
    fn of_all_lines_two_that_leave_out_most_are_taken() {
        let line = |degrees: f64, offset: f64| Line { inward: DVec2::from_angle(degrees.to_radians()), offset };
        let [right, above, nearly] = [line(180.0, -0.5), line(270.0, -0.6), line(181.0, -0.52)];
        let Clip([first, second]) = clip(vec![above, nearly, right, line(0.0, -1.5)]);
        assert_eq!((first, second[1] < -0.5), ([-1.0, first[1], 0.5], true));
        assert_eq!(clip(vec![line(0.0, -1.5)]), Clip::NONE);
        // A line that another one makes redundant is left out.
        assert_eq!(clip(vec![right, line(180.0, -0.9)]).0[1], Clip::NONE.0[0]);
    }
}
