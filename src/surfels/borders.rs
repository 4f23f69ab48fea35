//! Disks of a part of a cloud, which end where the cloud does.
//!
//! The fewer points are taken of a cloud the larger are their disks, and the farther those at its borders stand out past them. Clouds of
//! surveys end at the faces of a box, as they are cut into tiles, and files tell the box of all their points.

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::{Bounds, Clip, Scene, Surfel};

/// A face cuts the disks that stand up on it: those whose plane's normal has at most this cosine with its own. Where a surface touches a face
/// it does not end there.
const MOST_ALONG: f64 = 0.5;

/// How far outside a face, in a disk's own reach across it, a centre may lie that is of the box: places are rounded, in files and in f32, but
/// by less than disks show.
const ROUNDED: f64 = 1.0 / 128.0;

/// Cuts the disks of a part of a cloud near the faces of the box of all its points, world coordinates. Past a face they reach as far as disks of all points would around a
/// point in it, of which `part` says, at their centres, how large they are in the unit of these. Lines are of disks' planes: caps end with them. Where disks end at edges
/// already nothing is done.
pub fn end_at(scene: &mut Scene, bounds: &Bounds, part: impl Fn(DVec3) -> f64 + Sync) {
    if bounds.is_empty() || !scene.clips.is_empty() {
        return;
    }
    let clip = |index: usize| ending(&scene.surfels[index], scene.origin + scene.center(index), bounds, &part);
    let clips: Vec<Clip> = (0..scene.surfels.len()).into_par_iter().map(clip).collect();
    if !clips.iter().all(Clip::is_none) {
        scene.clips = clips;
    }
}

/// The lines of a disk at the faces that cut most of it.
fn ending(surfel: &Surfel, center: DVec3, bounds: &Bounds, part: impl Fn(DVec3) -> f64) -> Clip {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let normal = s.cross(t).normalize_or_zero();
    let mut near: Vec<(f64, DVec3)> = Vec::new();
    for axis in 0..3 {
        let reach = s[axis].hypot(t[axis]);
        for (side, inside) in [(1.0, bounds.max[axis] - center[axis]), (-1.0, center[axis] - bounds.min[axis])] {
            if inside < -ROUNDED * reach {
                // No point of the box.
                return Clip::NONE;
            }
            if inside < reach && normal[axis].abs() <= MOST_ALONG {
                near.push((inside.max(0.0) / reach, DVec3::new(-side * s[axis], -side * t[axis], 0.0) / reach));
            }
        }
    }
    let part = if near.is_empty() { 1.0 } else { part(center) };
    near.retain(|(inside, _)| inside + part < 1.0);
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let line = |which: usize| match near.get(which) {
        Some((inside, across)) => (across + DVec3::Z * (inside + part)).to_array().map(|x| x as f32),
        None => Clip::NONE.0[which],
    };
    Clip([line(0), line(1)]).usable()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn scene(surfels: Vec<Surfel>) -> Scene {
        Scene { origin: DVec3::new(1e6, 0.0, 0.0), surfels, ..Scene::default() }
    }

    fn bounds() -> Bounds {
        Bounds { min: DVec3::new(1e6 - 10.0, -10.0, -1.0), max: DVec3::new(1e6 + 10.0, 10.0, 1.0) }
    }

    #[test]
    fn disks_end_past_the_faces_of_the_box_as_those_of_all_points_do() {
        let up = |x: f32, y: f32| Surfel::ellipse(Vec3::new(x, y, 0.0), Vec3::X * 2.0, Vec3::Y);
        let mut scene = scene(vec![up(0.0, 0.0), up(9.0, 0.0), up(-9.5, 9.75), up(12.0, 0.0)]);
        end_at(&mut scene, &bounds(), |_| 0.25);
        // In the middle, and of a point outside, which is none of the box, nothing is cut.
        assert!(scene.clips[0].is_none() && scene.clips[3].is_none());
        // 1 inside, and a quarter of 2 past it: 1.5 of 2.
        let inside = |surfel: usize, u: f64, v: f64| scene.clips[surfel].inside(u, v);
        assert!(inside(1, 0.749, 0.6) > 0.0 && inside(1, 0.751, 0.0) < 0.0 && inside(1, -1.0, 0.0) > 0.0);
        // At a corner both lines cut: 0.5 and a half of 2 along x, 0.25 and a quarter of 1 along y.
        assert!(inside(2, -0.499, 0.499) > 0.0 && inside(2, -0.501, 0.0) < 0.0 && inside(2, 0.0, 0.501) < 0.0);
    }

    /// A row of points at a face lies on it, wherever f32 puts it; and where everything was taken nothing is cut.
    #[test]
    fn a_row_at_a_face_is_of_the_box() {
        let face = 500.01;
        let bounds = Bounds { min: DVec3::new(1e6 - face, -9.0, -1.0), max: DVec3::new(1e6 + face, 9.0, 1.0) };
        for x in [face as f32, -face as f32] {
            assert!(f64::from(x.abs()) > face);
            let mut scene = scene(vec![Surfel::ellipse(Vec3::new(x, 0.0, 0.0), Vec3::X, Vec3::Y)]);
            end_at(&mut scene, &bounds, |_| 1.0);
            assert!(scene.clips.is_empty());
            end_at(&mut scene, &bounds, |_| 0.5);
            let clip = scene.clips[0];
            assert!(clip.inside(f64::from(x.signum()) * 0.49, 0.0) > 0.0);
            assert!(clip.inside(f64::from(x.signum()) * 0.51, 0.0) < 0.0);
        }
    }

    #[test]
    fn what_touches_a_face_goes_on() {
        let lying = Surfel::ellipse(Vec3::new(0.0, 0.0, 1.0), Vec3::new(2.0, 0.0, 0.5), Vec3::Y);
        let mut scene = scene(vec![lying]);
        end_at(&mut scene, &bounds(), |_| 0.0);
        assert!(scene.clips.is_empty());
        end_at(&mut scene, &Bounds::EMPTY, |_| 0.0);
        assert!(scene.clips.is_empty());
    }
}
