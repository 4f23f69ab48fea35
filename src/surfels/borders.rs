//! Clips the disks of a part of a cloud where the whole cloud ends.
//!
//! The fewer points of a cloud are used, the larger their disks are, and the farther disks at the
//! cloud's borders reach past those borders. Surveys are cut into tiles, so their clouds end at the
//! faces of a box, and the files state the box of all their points.

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::{Bounds, Clip, Scene, Surfel};

/// A face clips only disks whose unit normal has at most this component along the face's normal. A
/// surface that merely touches a face does not end there.
const MOST_ALONG: f64 = 0.5;

/// A centre at most this far outside a face counts as inside the box. The unit is the disk's extent
/// along the face's normal. Positions are rounded, in files and in f32, but by less than is visible
/// at the disk's size.
const ROUNDED: f64 = 1.0 / 128.0;

/// Clips the disks of a part of a cloud near the faces of `bounds`, the box of all its points.
///
/// `bounds` is in world coordinates. `part` takes a centre and returns a ratio of radii there: that
/// of a disk if all points were used, to that of the actual disk. Past a face, a disk is kept only
/// as far as the smaller disk of a point on the face would reach. The clip lines lie in the disks'
/// planes and clip their caps too. A scene that already has clip lines is left unchanged.
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

/// The clip lines at the two faces that clip most of the disk.
fn ending(surfel: &Surfel, center: DVec3, bounds: &Bounds, part: impl Fn(DVec3) -> f64) -> Clip {
    let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
    let normal = s.cross(t).normalize_or_zero();
    let mut near: Vec<(f64, DVec3)> = Vec::new();
    for axis in 0..3 {
        let reach = s[axis].hypot(t[axis]);
        for (side, inside) in [(1.0, bounds.max[axis] - center[axis]), (-1.0, center[axis] - bounds.min[axis])] {
            if inside < -ROUNDED * reach {
                // The centre lies outside the box.
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
        // A disk in the middle is not clipped, nor is one whose centre is outside the box.
        assert!(scene.clips[0].is_none() && scene.clips[3].is_none());
        // Along x, disk 1 reaches 2. It is kept 1 up to the face and 2 / 4 past it: u <= 0.75.
        let inside = |surfel: usize, u: f64, v: f64| scene.clips[surfel].inside(u, v);
        assert!(inside(1, 0.749, 0.6) > 0.0 && inside(1, 0.751, 0.0) < 0.0 && inside(1, -1.0, 0.0) > 0.0);
        // At a corner both lines clip: x at 0.5 + 2 / 4 of 2, and y at 0.25 + 1 / 4 of 1.
        assert!(inside(2, -0.499, 0.499) > 0.0 && inside(2, -0.501, 0.0) < 0.0 && inside(2, 0.0, 0.501) < 0.0);
    }

    /// A row of points on a face is inside the box, however f32 rounds it. If all points are used,
    /// nothing is clipped.
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
