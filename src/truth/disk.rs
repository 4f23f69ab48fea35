//! Intersections and distances of one disk: an ellipse, flat or curved.

use glam::{DVec2, DVec3, Vec3A};
use obvhs::aabb::Aabb;

use super::triangles::PADDING;
use crate::scene::{Cap, Clip};

/// The shorter half-axis is set to at least this fraction of the longer one, so that a disk that
/// degenerates to a line has a distance too.
const THINNEST: f64 = 1e-9;

/// A disk in units of the tree's radius, relative to the tree's centre.
#[derive(Clone, Debug)]
pub(super) struct Disk {
    pub center: DVec3,
    /// Unit directions of the longer half-axis, the shorter one and the normal.
    axes: [DVec3; 3],
    /// Lengths of the half-axes, the longer one first.
    pub half: [f64; 2],
    /// The clip lines, in terms of the original half-axes.
    clip: Clip,
    /// The cap's coefficients uu, uv and vv for the principal half-axes; 0 for a flat disk.
    heights: [f64; 3],
    /// Cosine and sine of the angle from the original half-axes to the principal ones.
    turn: DVec2,
}

impl Disk {
    /// Creates a flat disk. If s and t are not perpendicular, its axes are the principal half-axes
    /// of the same ellipse.
    pub fn new(center: DVec3, s: DVec3, t: DVec3) -> Self {
        // The rotation by which (s, t) become perpendicular: tan 2x = 2 s.t / (s.s - t.t).
        let turn = 0.5 * (2.0 * s.dot(t)).atan2(s.length_squared() - t.length_squared());
        let (sin, cos) = turn.sin_cos();
        let (long, short) = (s * cos + t * sin, t * cos - s * sin);
        let half = [long.length(), short.length().max(THINNEST * long.length())];
        let long = long.normalize_or(DVec3::X);
        let short = short.try_normalize().unwrap_or_else(|| long.any_orthonormal_vector());
        let turn = DVec2::new(cos, sin);
        Self { center, axes: [long, short, long.cross(short)], half, clip: Clip::NONE, heights: [0.0; 3], turn }
    }

    /// Returns the disk cut by clip lines, which are given in terms of the original half-axes.
    pub fn cut(self, clip: Clip) -> Self {
        Self { clip, ..self }
    }

    /// Returns the disk with a cap, whose coefficients are given for the original half-axes.
    ///
    /// The coefficients are converted to the principal half-axes: p = u' s' + v' t' with s' = s cos
    /// + t sin and t' = t cos - s sin.
    pub fn curved(self, [uu, uv, vv]: [f64; 3]) -> Self {
        let (c, s) = (self.turn.x, self.turn.y);
        let heights = [
            uu * c * c + 2.0 * uv * c * s + vv * s * s,
            (vv - uu) * c * s + uv * (c * c - s * s),
            uu * s * s - 2.0 * uv * c * s + vv * c * c,
        ];
        Self { heights, ..self }
    }

    pub fn padded_box(&self) -> Aabb {
        let [long, short] = [self.axes[0] * self.half[0], self.axes[1] * self.half[1]];
        let reach = (long * long + short * short).map(f64::sqrt) + f64::from(PADDING);
        let [low, high] = Cap(self.heights.map(|height| height as f32)).extremes().map(|height| self.axes[2] * height);
        let corner = |at: DVec3| Vec3A::from(at.as_vec3());
        Aabb::new(corner(self.center - reach + low.min(high)), corner(self.center + reach + low.max(high)))
    }

    /// The symmetric bilinear form of the cap; `bent(a, a)` is its height at the point a of the
    /// unit disk.
    fn bent(&self, a: DVec2, b: DVec2) -> f64 {
        let [uu, uv, vv] = self.heights;
        0.5 * (uu * a.x * b.x + uv * (a.x * b.y + a.y * b.x) + vv * a.y * b.y)
    }

    /// Returns the parameter t at which the line `point + t * direction` meets the disk.
    ///
    /// If the line meets a cap twice, this is the intersection nearer to `point`. None if the line
    /// misses the disk, or lies in the plane of a flat disk.
    pub fn met_at(&self, point: DVec3, direction: DVec3) -> Option<f64> {
        let [long, short, normal] = self.axes;
        let local = |v: DVec3| DVec2::new(v.dot(long) / self.half[0], v.dot(short) / self.half[1]);
        let (start, step) = (local(point - self.center), local(direction));
        let a = self.bent(step, step);
        let b = 2.0 * self.bent(start, step) - direction.dot(normal);
        let c = self.bent(start, start) - (point - self.center).dot(normal);
        let (cos, sin) = (self.turn.x, self.turn.y);
        let lies = |t: &f64| {
            let at = start + step * *t;
            let inside = self.clip.inside(at.x * cos - at.y * sin, at.x * sin + at.y * cos) >= 0.0;
            inside && at.length_squared() <= 1.0
        };
        if self.heights == [0.0; 3] {
            return Some(-c / b).filter(lies);
        }
        let root = (b * b - 4.0 * a * c).sqrt();
        let far = -0.5 * (b + root.copysign(b));
        [c / far, far / a].into_iter().filter(lies).min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }

    /// The squared distance from a point to the disk, in units of the tree's radius. For a curved
    /// disk it is an upper bound, see `squared_distance_to_cap`.
    pub fn squared_distance(&self, point: DVec3) -> f64 {
        let offset = point - self.center;
        let foot = DVec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1]));
        let height = offset.dot(self.axes[2]);
        let nearest = self.nearest_in_plane(foot);
        if self.heights == [0.0; 3] || !nearest.is_finite() {
            return foot.distance_squared(nearest) + height * height;
        }
        self.squared_distance_to_cap(foot.extend(height), nearest)
    }

    /// The squared distance from `point`, in the disk's axes, to the cap, by iteration from the
    /// point `first` of the plane.
    ///
    /// Each step goes to the nearest point of the tangent plane at the previous one, as long as
    /// that reduces the distance. The result is never less than the true distance.
    fn squared_distance_to_cap(&self, point: DVec3, first: DVec2) -> f64 {
        const STEPS: u32 = 8;
        let half = DVec2::from_array(self.half);
        let at = |place: DVec2| place.extend(self.bent(place / half, place / half));
        let (mut place, mut least) = (first, point.distance_squared(at(first)));
        for _ in 0..STEPS {
            let [uu, uv, vv] = self.heights;
            let unit = place / half;
            let slope = DVec2::new(uu * unit.x + uv * unit.y, uv * unit.x + vv * unit.y) / half;
            let normal = (-slope).extend(1.0).normalize();
            let on_plane = point - normal * (point - at(place)).dot(normal);
            let next = self.nearest_in_plane(on_plane.truncate());
            let distance = point.distance_squared(at(next));
            if distance.is_nan() || distance >= least {
                break;
            }
            (place, least) = (next, distance);
        }
        least
    }

    /// Returns the point nearest to `foot` of the part of the ellipse that the clip lines keep;
    /// infinite if they keep nothing.
    ///
    /// If the lines keep the nearest point of the whole ellipse, it is that point. Otherwise the
    /// nearest point lies on the chord of a line, as the kept part is convex.
    fn nearest_in_plane(&self, foot: DVec2) -> DVec2 {
        let whole = self.nearest_of_ellipse(foot);
        let half = DVec2::from_array(self.half);
        if self.clip.is_none() {
            return whole;
        }
        let lines = self.clip.0.map(|line| self.principal(line));
        if lines.iter().all(|line| line.dot((whole / half).extend(1.0)) >= 0.0) {
            return whole;
        }
        let chords = [chord(lines[0], lines[1]), chord(lines[1], lines[0])].into_iter().flatten();
        let on_chord = chords.map(|[from, to]| {
            let (from, to) = (from * half, to * half);
            let along = (foot - from).dot(to - from) / (to - from).length_squared();
            from + (to - from) * if along.is_nan() { 0.0 } else { along.clamp(0.0, 1.0) }
        });
        let nearer = |a: &DVec2, b: &DVec2| foot.distance_squared(*a).total_cmp(&foot.distance_squared(*b));
        on_chord.min_by(nearer).unwrap_or(DVec2::INFINITY)
    }

    /// Converts a clip line to the principal half-axes.
    fn principal(&self, line: [f32; 3]) -> DVec3 {
        let ([x, y, z], [cos, sin]) = (line.map(f64::from), self.turn.to_array());
        DVec3::new(x * cos + y * sin, y * cos - x * sin, z)
    }

    /// The point of the whole ellipse that is nearest to `foot`.
    ///
    /// From outside, the nearest point (x', y') of the ellipse with half-axes a and b has a normal
    /// through (x, y): `x' = a² x / (t + a²)`, `y' = b² y / (t + b²)`, where t is the root of
    /// `(a x / (t + a²))² + (b y / (t + b²))² = 1`. The left side is convex and decreasing in t, so
    /// Newton's method approaches the root from below and never passes it.
    fn nearest_of_ellipse(&self, foot: DVec2) -> DVec2 {
        let [x, y] = foot.abs().to_array();
        let [a, b] = self.half;
        if (x / a).powi(2) + (y / b).powi(2) <= 1.0 {
            return foot;
        }
        let mut t = (a * x - a * a).max(b * y - b * b).max(0.0);
        for _ in 0..60 {
            let (p, q) = (a * x / (t + a * a), b * y / (t + b * b));
            let slope = p * p / (t + a * a) + q * q / (t + b * b);
            let step = 0.5 * (p * p + q * q - 1.0) / slope;
            if step.is_nan() || step <= 1e-14 * (t + b * b) {
                break;
            }
            t += step;
        }
        foot - DVec2::new(x * t / (t + a * a), y * t / (t + b * b))
            * DVec2::new(1.0f64.copysign(foot.x), 1.0f64.copysign(foot.y))
    }
}

/// Returns the ends of a line's chord across the unit disk, shortened to the part that the `other`
/// line keeps; None if there is no such part.
fn chord(line: DVec3, other: DVec3) -> Option<[DVec2; 2]> {
    let length = line.truncate().length();
    let (toward, distance) = (line.truncate() / length, -line.z / length);
    let half = (1.0 - distance * distance).sqrt();
    let (mut low, mut high) = (-half, half);
    // A line beyond the rim or without a direction has no chord.
    if half.is_nan() {
        return None;
    }
    let (foot, along) = (toward * distance, toward.perp());
    let (at_foot, rise) = (other.dot(foot.extend(1.0)), other.truncate().dot(along));
    if rise > 0.0 {
        low = low.max(-at_foot / rise);
    } else if rise < 0.0 {
        high = high.min(-at_foot / rise);
    } else if at_foot < 0.0 {
        return None;
    }
    (low <= high).then_some([foot + along * low, foot + along * high])
}
