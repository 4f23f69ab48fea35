//! The disks of a scene as rays and points meet them: ellipses, flat or curved, neither blended nor filtered.
//!
//! As for triangles, a tree of padded f32 boxes finds candidates, and each is decided in f64.

use std::time::Duration;

use glam::{DVec2, DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::Ray;
use rayon::prelude::*;

use super::nearest::nearest;
use super::triangles::PADDING;
use crate::scene::{Bounds, Cap, Clip, Scene, Surfel};

/// The shorter half-axis is taken for at least this part of the longer: a disk seen as a line has a distance all the same.
const THINNEST: f64 = 1e-9;

/// The disks of a scene in a tree of boxes.
#[derive(Clone)]
pub struct DiskTree {
    tree: Bvh2,
    disks: Vec<Disk>,
    /// The middle of all disks, world coordinates.
    center: DVec3,
    /// Half the diagonal of their bounds, world units.
    radius: f64,
    /// The longest of the shorter half-axes, in units of `radius`.
    widest: f64,
}

/// In units of the tree's radius, relative to its centre.
#[derive(Clone, Debug)]
struct Disk {
    center: DVec3,
    /// Unit directions of the longer and of the shorter half-axis, and of the normal.
    axes: [DVec3; 3],
    /// Lengths of the half-axes, the longer one first.
    half: [f64; 2],
    /// Where it ends before its rim, by the half-axes that came.
    clip: Clip,
    /// The heights of its cap over the principal half-axes, uu, uv and vv; 0 of a flat one.
    heights: [f64; 3],
    /// Cosine and sine of the angle from those to the principal ones.
    turn: DVec2,
}

/// A surfel and its centre with all digits.
struct Placed<'a> {
    center: DVec3,
    surfel: &'a Surfel,
    clip: Clip,
    cap: Cap,
}

impl Placed<'_> {
    /// What tells it from others.
    fn bits(&self) -> ([u64; 3], [[u32; 3]; 5]) {
        let (Clip([first, second]), Cap(heights)) = (self.clip, self.cap);
        let axes = [self.surfel.s, self.surfel.t, first, second, heights].map(|axis| axis.map(f32::to_bits));
        (self.center.to_array().map(f64::to_bits), axes)
    }
}

impl DiskTree {
    /// Builds the tree. Surfels that are not finite or have no size are left out, and those that are the same are one.
    pub fn new(scene: &Scene) -> Self {
        let world = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
        let extent = |surfel: &Surfel| (world(surfel.s).powf(2.0) + world(surfel.t).powf(2.0)).map(f64::sqrt);
        let sized = |surfel: &&Surfel| {
            let numbers = [surfel.center, surfel.s, surfel.t];
            numbers.as_flattened().iter().all(|c| c.is_finite()) && surfel.radius() > 0.0
        };
        let clip = |index: usize| scene.clips.get(index).copied().unwrap_or_default();
        let cap = |index: usize| scene.caps.get(index).copied().unwrap_or_default();
        let placed = |index: usize| Placed {
            center: scene.center(index),
            surfel: &scene.surfels[index],
            clip: clip(index),
            cap: cap(index),
        };
        let all = (0..scene.surfels.len()).map(placed);
        let mut surfels: Vec<Placed<'_>> = all.filter(|placed| sized(&placed.surfel)).collect();
        // Boxes tell nothing apart that is in one place: of thousands that are, each would be looked at for each point.
        surfels.par_sort_unstable_by_key(Placed::bits);
        surfels.dedup_by_key(|placed| placed.bits());
        let bounds = surfels.par_iter().fold(
            || Bounds::EMPTY,
            |bounds, Placed { center, surfel, cap, .. }| {
                let (center, reach) = (*center, extent(surfel) + cap.highest());
                bounds.with_point(center - reach).with_point(center + reach)
            },
        );
        let bounds = bounds.reduce(|| Bounds::EMPTY, Bounds::union);
        let (center, extent) = (bounds.center(), bounds.extent().length());
        let radius = if extent > 0.0 { 0.5 * extent } else { 1.0 };
        let disk = |placed: &Placed<'_>| {
            let [s, t] = [placed.surfel.s, placed.surfel.t].map(world);
            let flat = Disk::new((placed.center - center) / radius, s / radius, t / radius);
            Disk { clip: placed.clip, ..flat }.curved(placed.cap.0.map(|height| f64::from(height) / radius))
        };
        let disks: Vec<Disk> = surfels.par_iter().map(disk).collect();
        let boxes: Vec<Aabb> = disks.iter().map(Disk::padded_box).collect();
        // The builder takes no empty list in all of its steps.
        let tree = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
        };
        let widest = disks.iter().map(|disk| disk.half[1]).fold(0.0, f64::max);
        Self { tree, disks, center: scene.origin + center, radius, widest }
    }

    /// How many disks there are.
    pub fn len(&self) -> usize {
        self.disks.len()
    }

    /// No surfel has a size.
    pub fn is_empty(&self) -> bool {
        self.disks.is_empty()
    }

    /// Whether the line through `point` along `direction` (of unit length) meets a disk, no farther from `point` than
    /// `reach` times the disk's own shorter half-axis. World coordinates.
    pub fn covers(&self, point: DVec3, direction: DVec3, reach: f64) -> bool {
        let point = (point - self.center) / self.radius;
        let farthest = reach * self.widest + f64::from(PADDING);
        // Nothing is met from outside the ball of the boxes; the f32 numbers below are thus small.
        if self.is_empty() || point.is_nan() || point.length() > 1.1 + farthest {
            return false;
        }
        let start = (point - direction * farthest).as_vec3a();
        let segment = Ray::new(start, direction.as_vec3a(), 0.0, (2.0 * farthest) as f32);
        !self.tree.ray_traverse_miss(segment, |_, entry| {
            let disk = &self.disks[self.tree.primitive_indices[entry] as usize];
            if disk.met_at(point, direction).is_some_and(|t| t.abs() <= reach * disk.half[1]) {
                0.0
            } else {
                f32::INFINITY
            }
        })
    }

    /// The distance of a point from the nearest disk, +inf if there is none. World coordinates and units.
    pub fn distance(&self, point: DVec3) -> f64 {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| self.disks[index].squared_distance(point);
        nearest(&self.tree, point, squared).0.sqrt() * self.radius
    }

    /// The longer half-axis of the disk nearest to a point, None if there is no disk. World coordinates and units.
    pub fn radius_near(&self, point: DVec3) -> Option<f64> {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| self.disks[index].squared_distance(point);
        nearest(&self.tree, point, squared).1.map(|index| self.disks[index].half[0] * self.radius)
    }

    /// The distance of a point from the nearest disk's centre, +inf if there is none. World coordinates and units.
    pub fn distance_to_center(&self, point: DVec3) -> f64 {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| self.disks[index].center.distance_squared(point);
        nearest(&self.tree, point, squared).0.sqrt() * self.radius
    }
}

impl Disk {
    /// Half-axes that are not perpendicular are conjugate ones of the same ellipse; its principal ones are found here.
    fn new(center: DVec3, s: DVec3, t: DVec3) -> Self {
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

    /// With the cap of these heights over the half-axes that came: p = u' s' + v' t' with s' = s cos + t sin and t' = t cos - s sin.
    fn curved(self, [uu, uv, vv]: [f64; 3]) -> Self {
        let (c, s) = (self.turn.x, self.turn.y);
        let heights = [
            uu * c * c + 2.0 * uv * c * s + vv * s * s,
            (vv - uu) * c * s + uv * (c * c - s * s),
            uu * s * s - 2.0 * uv * c * s + vv * c * c,
        ];
        Self { heights, ..self }
    }

    fn padded_box(&self) -> Aabb {
        let [long, short] = [self.axes[0] * self.half[0], self.axes[1] * self.half[1]];
        let reach = (long * long + short * short).map(f64::sqrt) + f64::from(PADDING);
        let [low, high] = Cap(self.heights.map(|height| height as f32)).extremes().map(|height| self.axes[2] * height);
        let corner = |at: DVec3| Vec3A::from(at.as_vec3());
        Aabb::new(corner(self.center - reach + low.min(high)), corner(self.center + reach + low.max(high)))
    }

    /// Half the bilinear form of the heights: of one place on the unit disk twice, how high the cap is there.
    fn bent(&self, a: DVec2, b: DVec2) -> f64 {
        let [uu, uv, vv] = self.heights;
        0.5 * (uu * a.x * b.x + uv * (a.x * b.y + a.y * b.x) + vv * a.y * b.y)
    }

    /// Where on the line `point + t * direction` the disk lies, the nearest to `point` of the line's two meetings with a cap; None where
    /// it does not, or is flat and seen edge-on.
    fn met_at(&self, point: DVec3, direction: DVec3) -> Option<f64> {
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

    /// Beyond the rim the nearest point (x', y') of the ellipse with half-axes a and b has the normal through (x, y):
    /// `x' = a² x / (t + a²)`, `y' = b² y / (t + b²)`, where t is the root of `(a x / (t + a²))² + (b y / (t + b²))² = 1`.
    /// That function is convex and falls, so Newton's method comes to the root from below and never passes it.
    fn squared_distance(&self, point: DVec3) -> f64 {
        let offset = point - self.center;
        let foot = DVec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1]));
        let height = offset.dot(self.axes[2]);
        let nearest = self.nearest_in_plane(foot);
        if self.heights == [0.0; 3] || !nearest.is_finite() {
            return foot.distance_squared(nearest) + height * height;
        }
        self.squared_distance_to_cap(foot.extend(height), nearest)
    }

    /// From a point in the disk's own axes to its cap, about the place `first` of the plane: from each place on to the nearest of the
    /// plane that touches the cap there, as long as that is nearer. No distance is less than the true one.
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

    /// The nearest point to `foot` of the ellipse, cut by its lines: that of the whole ellipse where the lines keep it, else one on a
    /// chord that a line cuts out, as what is kept is convex. Far away where nothing is kept.
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

    /// A line on the unit disk of the principal half-axes.
    fn principal(&self, line: [f32; 3]) -> DVec3 {
        let ([x, y, z], [cos, sin]) = (line.map(f64::from), self.turn.to_array());
        DVec3::new(x * cos + y * sin, y * cos - x * sin, z)
    }

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

/// The part of a line that lies on the unit disk and inside the other line: its two ends.
fn chord(line: DVec3, other: DVec3) -> Option<[DVec2; 2]> {
    let length = line.truncate().length();
    let (toward, distance) = (line.truncate() / length, -line.z / length);
    let half = (1.0 - distance * distance).sqrt();
    let (mut low, mut high) = (-half, half);
    // No chord, of a line past the rim or without a direction, has no ends.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Colors, Up};

    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            2.0 * ((state >> 11) as f64 / (1u64 << 53) as f64) - 1.0
        }
    }

    /// Disks of all shapes: round, long, needles, and ones whose half-axes are not perpendicular; far from the origin.
    fn scene() -> Scene {
        let mut next = noise(1);
        let mut vector = || Vec3::new(next() as f32, next() as f32, next() as f32);
        let surfels = (0..300).map(|k| {
            let (center, s, t) = (vector() * 3.0, vector() * 0.3, vector() * 0.3);
            let t = if k % 3 == 0 { t } else { s.cross(t).normalize().cross(s) * [1.0, 0.2, 1e-3, 0.0][k % 4] };
            Surfel { center: center.to_array(), s: s.to_array(), t: t.to_array() }
        });
        let mut surfels: Vec<Surfel> = surfels.collect();
        surfels.extend_from_within(20..60);
        surfels[7].center[0] = f32::NAN;
        (surfels[8].s, surfels[8].t) = ([0.0; 3], [0.0; 3]);
        let origin = DVec3::new(6e5, 5e6, 0.0);
        Scene {
            origin,
            surfels,
            low: vec![],
            colors: Colors::Constant([1.0; 4]),
            oriented: true,
            up: Up::Y,
            ..Scene::default()
        }
    }

    /// Lines of all kinds for the disks of `scene()`: that leave out the centre, that meet on the disk, and none.
    fn clips() -> Vec<Clip> {
        let mut next = noise(5);
        let line = |angle: f64, z: f64| [angle.cos() as f32, angle.sin() as f32, z as f32];
        let mut clip = |k: u32| {
            let (angle, z) = (4.0 * next(), if k.is_multiple_of(7) { -0.3 } else { 0.3 * next().abs() });
            if k.is_multiple_of(3) { Clip::NONE } else { Clip([line(angle, z), line(angle + 1.3, 0.2)]) }
        };
        (0..340).map(&mut clip).collect()
    }

    #[test]
    fn distances_are_those_of_points_on_the_disks() {
        for clips in [Vec::new(), clips()] {
            let scene = Scene { clips, ..scene() };
            let tree = DiskTree::new(&scene);
            // Forty are the same as others but for their lines.
            assert_eq!(tree.len(), if scene.clips.is_empty() { 298 } else { 338 });
            let mut next = noise(2);
            for _ in 0..40 {
                let point = DVec3::new(next(), next(), next()) * 3.5;
                let (mut sampled, mut to_center) = (f64::INFINITY, f64::INFINITY);
                for (index, surfel) in scene.surfels.iter().enumerate() {
                    let [center, s, t] = [surfel.center, surfel.s, surfel.t].map(|v| Vec3::from_array(v).as_dvec3());
                    if s == DVec3::ZERO {
                        continue;
                    }
                    let clip = scene.clips.get(index).copied().unwrap_or_default();
                    to_center = to_center.min(center.distance(point));
                    for k in 0..20 * 200 {
                        let (sin, cos) = (f64::from(k % 200) / 200.0 * std::f64::consts::TAU).sin_cos();
                        let rho = f64::from(k / 200 + 1) / 20.0;
                        if clip.inside(rho * cos, rho * sin) >= 0.0 {
                            sampled = sampled.min((center + rho * (s * cos + t * sin)).distance(point));
                        }
                    }
                }
                let world = scene.origin + point;
                let distance = tree.distance(world);
                // To a corner between lines and rim it is as far along the rim from the next sample.
                let near = if scene.clips.is_empty() { distance.hypot(0.02) } else { distance + 0.02 };
                assert!(distance < sampled + 1e-8 && sampled < near, "{distance} {sampled}");
                assert!((tree.distance_to_center(world) - to_center).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn a_line_is_covered_by_the_disks_that_it_meets_within_reach() {
        let scene = scene();
        let tree = DiskTree::new(&scene);
        let mut next = noise(2);
        let (mut covered, mut near) = (0, 0);
        for _ in 0..3000 {
            let point = DVec3::new(next(), next(), next()) * 3.0;
            let direction = DVec3::new(next(), next(), next()).normalize();
            // By Cramer's rule on point + t direction = center + u s + v t, which knows no principal axes.
            let met = |surfel: &Surfel| {
                let [center, s, t] = [surfel.center, surfel.s, surfel.t].map(|v| Vec3::from_array(v).as_dvec3());
                let (offset, determinant) = (point - center, -direction.dot(s.cross(t)));
                let u = offset.dot(t.cross(-direction)) / determinant;
                let v = offset.dot((-direction).cross(s)) / determinant;
                let along = offset.dot(s.cross(t)) / determinant;
                let half = [s.length_squared(), t.length_squared(), 2.0 * s.dot(t)];
                let shorter = (0.5 * (half[0] + half[1] - (half[0] - half[1]).hypot(half[2]))).sqrt();
                (u * u + v * v <= 1.0).then_some(along.abs() / shorter)
            };
            let reaches = scene.surfels.iter().filter_map(met).fold(f64::INFINITY, f64::min);
            for reach in [0.5, 1.0, 30.0] {
                assert_eq!(tree.covers(scene.origin + point, direction, reach), reaches <= reach, "{reaches}");
            }
            covered += u32::from(reaches <= 30.0);
            near += u32::from(reaches <= 1.0);
        }
        assert!(near > 20 && covered > 5 * near, "{near} {covered}");
    }

    #[test]
    fn caps_are_met_and_near_where_they_are() {
        let mut next = noise(3);
        let mut scene = Scene { surfels: scene().surfels[9..].to_vec(), ..scene() };
        let heights = |surfel: &Surfel| {
            let mut height = || (0.5 * next()) as f32 * surfel.radius();
            Cap([height(), height(), height()])
        };
        scene.caps = scene.surfels.iter().map(heights).collect();
        let [caps, flat] = [DiskTree::new(&scene), DiskTree::new(&Scene { caps: Vec::new(), ..scene.clone() })];
        let (mut met, mut flat_met) = (0, 0);
        for (index, (surfel, cap)) in scene.surfels.iter().zip(&scene.caps).enumerate() {
            let [center, s, t] = [surfel.center, surfel.s, surfel.t].map(|v| Vec3::from_array(v).as_dvec3());
            let normal = s.cross(t).normalize_or_zero();
            if surfel.shorter() < 0.05 * surfel.radius() {
                continue;
            }
            let (sin, cos) = (index as f64).sin_cos();
            let (u, v) = (0.8 * cos, 0.8 * sin);
            let slope = cap.slope(u, v);
            let on_cap = center + s * u + t * v + normal * cap.height(u, v);
            let across = normal * s.cross(t).length() - t.cross(normal) * slope.x - normal.cross(s) * slope.y;
            let point = on_cap + across.normalize() * (0.1 * f64::from(surfel.shorter()));
            let distance = caps.distance(scene.origin + point);
            assert!(distance <= 0.1 * f64::from(surfel.shorter()) + 1e-7, "{distance} {surfel:?} {cap:?}");
            let near = |tree: &DiskTree| tree.covers(scene.origin + on_cap, across.normalize(), 1e-5);
            met += u32::from(near(&caps));
            flat_met += u32::from(near(&flat));
        }
        assert!(met > 150 && flat_met < 5, "{met} {flat_met}");
    }

    #[test]
    fn no_disks_cover_nothing_and_are_far() {
        let tree = DiskTree::new(&Scene { surfels: vec![], ..scene() });
        assert!(tree.is_empty() && !tree.covers(DVec3::ZERO, DVec3::X, 1.0));
        assert_eq!(tree.distance(DVec3::ZERO), f64::INFINITY);
    }
}
