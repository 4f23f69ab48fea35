//! The disks of a scene for rays and distances: ellipses, flat or curved, neither blended nor
//! filtered.
//!
//! As for triangles, a tree of padded f32 boxes finds candidates, and each is decided in f64.

use std::time::Duration;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::Ray;
use rayon::prelude::*;

use super::disk::Disk;
use super::nearest::nearest;
use super::triangles::PADDING;
use crate::scene::{Bounds, Cap, Clip, Scene, Surfel};

/// The disks of a scene in a bounding volume hierarchy.
#[derive(Clone)]
pub struct DiskTree {
    tree: Bvh2,
    disks: Vec<Disk>,
    /// The centre of the bounding box of all disks, world coordinates.
    center: DVec3,
    /// Half the diagonal of that box, world units.
    radius: f64,
    /// The largest of the shorter half-axes, in units of `radius`.
    widest: f64,
}

/// A surfel, and its centre with all digits.
struct Placed<'a> {
    center: DVec3,
    surfel: &'a Surfel,
    clip: Clip,
    cap: Cap,
}

impl Placed<'_> {
    /// A key that is equal for equal disks only.
    fn bits(&self) -> ([u64; 3], [[u32; 3]; 5]) {
        let (Clip([first, second]), Cap(heights)) = (self.clip, self.cap);
        let axes = [self.surfel.s, self.surfel.t, first, second, heights].map(|axis| axis.map(f32::to_bits));
        (self.center.to_array().map(f64::to_bits), axes)
    }
}

impl DiskTree {
    /// Builds the tree. It leaves out surfels that are not finite or have no size, and keeps one of
    /// each set of equal surfels.
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
        // Boxes cannot separate disks in one position: if there were thousands, all would be tested
        // for every point.
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
            let heights = placed.cap.0.map(|height| f64::from(height) / radius);
            Disk::new((placed.center - center) / radius, s / radius, t / radius).cut(placed.clip).curved(heights)
        };
        let disks: Vec<Disk> = surfels.par_iter().map(disk).collect();
        let boxes: Vec<Aabb> = disks.iter().map(Disk::padded_box).collect();
        // Not every step of the builder accepts an empty list.
        let tree = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
        };
        let widest = disks.iter().map(|disk| disk.half[1]).fold(0.0, f64::max);
        Self { tree, disks, center: scene.origin + center, radius, widest }
    }

    /// The number of disks.
    pub fn len(&self) -> usize {
        self.disks.len()
    }

    /// Whether there are no disks.
    pub fn is_empty(&self) -> bool {
        self.disks.is_empty()
    }

    /// Whether the line through `point` along the unit `direction` meets a disk at a distance from
    /// `point` of at most `reach` times that disk's shorter half-axis. World coordinates.
    pub fn covers(&self, point: DVec3, direction: DVec3, reach: f64) -> bool {
        let point = (point - self.center) / self.radius;
        let farthest = reach * self.widest + f64::from(PADDING);
        // From a point outside the ball around the boxes, no disk is in reach. Inside the ball, the
        // f32 numbers below are small.
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

    /// The distance of `point` from the nearest disk, world units; +inf if there is none.
    pub fn distance(&self, point: DVec3) -> f64 {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| self.disks[index].squared_distance(point);
        nearest(&self.tree, point, squared).0.sqrt() * self.radius
    }

    /// The longer half-axis of the disk nearest to `point`, world units; None if there is no disk.
    pub fn radius_near(&self, point: DVec3) -> Option<f64> {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| self.disks[index].squared_distance(point);
        nearest(&self.tree, point, squared).1.map(|index| self.disks[index].half[0] * self.radius)
    }

    /// The distance of `point` from the nearest disk's centre, world units; +inf if there is none.
    pub fn distance_to_center(&self, point: DVec3) -> f64 {
        let point = (point - self.center) / self.radius;
        let squared = |index: usize| self.disks[index].center.distance_squared(point);
        nearest(&self.tree, point, squared).0.sqrt() * self.radius
    }
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

    /// Disks of many shapes, far from the origin: round, long, needles, and with half-axes that are
    /// not perpendicular.
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

    /// Clip lines of many kinds for the disks of `scene()`: some clip the centre, some cross on the
    /// disk, some clip nothing.
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
            // Forty disks equal others except for their clip lines.
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
                // At a corner between clip line and rim, the distance is uncertain by the spacing
                // of samples along the rim.
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
            // Cramer's rule on point + t direction = center + u s + v t, which needs no principal
            // axes.
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
