//! Explains why a picture is empty: a user who sees nothing of a scene needs to know where it is.

use rayon::prelude::*;

use super::lowpass::Design;
use super::project::{Body, Missed, projected};
use crate::frame::Frame;
use crate::plan::{Facts, Settings, culls_back};
use crate::scene::{Camera, Cut, Fade, Scene, Surfel};

/// The surfels of a scene in a view that shows none of them, counted by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unseen {
    /// Behind the camera, or nearer than its near depth.
    pub behind: u64,
    /// Beside the image.
    pub outside: u64,
    /// In the image, but over no pixel's centre: too small, or seen edge-on.
    pub between: u64,
    /// Facing away, in a view that culls backs.
    pub away: u64,
    /// Over pixels, but without effect: seen edge-on, transparent, or of the background's colour.
    pub over: u64,
    /// Triangles, wherever they lie.
    pub triangles: u64,
}

impl Unseen {
    /// Counts the surfels of `scene` in the view of `camera`. For a scene of which only a part is
    /// loaded, counts the surfels and nodes that are loaded.
    pub fn of(scene: &Scene, camera: &Camera, options: &Settings) -> Self {
        if let (Some(_), Some(tree)) = (&scene.part_of, &scene.hierarchy) {
            let nodes = (0..tree.nodes.len() as u32).filter(|&index| tree.nodes[index as usize].count == 0);
            let nodes = nodes.map(|index| (index, Fade::WHOLE)).collect();
            let all = Cut { nodes, surfels: vec![(0..scene.surfels.len() as u32, Fade::WHOLE)] };
            let held = Scene { part_of: None, hierarchy: None, ..all.scene(scene, tree, false) };
            return Self::of(&held, camera, options);
        }
        let eye = camera.eye - scene.origin;
        let design = Design::of(options);
        let cull_back = culls_back(&Facts::of(scene), camera, options);
        let look = |(index, surfel): (usize, &Surfel)| {
            let seen = projected(
                (0, surfel, Body::of(scene, index, options)),
                scene.center(index) - eye,
                camera,
                &design,
                false,
            );
            let reasons = [Some(Missed::Behind), Some(Missed::Outside), Some(Missed::Between), None];
            let [behind, outside, between, over] =
                reasons.map(|reason| u64::from(seen.as_ref().err() == reason.as_ref()));
            let away = u64::from(cull_back && seen.is_ok_and(|splat| splat.faces_away()));
            [behind, outside, between, away, over - away]
        };
        let add = |a: [u64; 5], b: [u64; 5]| std::array::from_fn(|k| a[k] + b[k]);
        let [behind, outside, between, away, over] =
            scene.surfels.par_iter().enumerate().map(look).reduce(|| [0; 5], add);
        Self { behind, outside, between, away, over, triangles: scene.triangles.len() as u64 }
    }

    /// A one-line warning for users.
    pub fn sentence(&self) -> String {
        let total = self.behind + self.outside + self.between + self.away + self.over;
        let reasons = [
            (self.behind, "behind the camera or nearer than --near"),
            (self.outside, "outside the image"),
            (self.between, "between the centres of its pixels, small or edge-on (--lowpass max shows them)"),
            (self.away, "with their backs to the camera (--cull none shows them)"),
            (self.over, "over pixels that they do not change: edge-on, transparent or of the background's colour"),
        ];
        let count = |count: u64| if count == total { "all".to_owned() } else { count.to_string() };
        let given = reasons.into_iter().filter(|(surfels, _)| *surfels > 0);
        let parts: Vec<String> = given.map(|(surfels, where_)| format!("{} lie {where_}", count(surfels))).collect();
        let surfels = (total > 0).then(|| format!("of {total} surfels {}", parts.join(", ")));
        let triangles = (self.triangles > 0).then(|| format!("none of {} triangles covers a pixel's centre in front of the camera in a colour other than the background's", self.triangles));
        let reasons: Vec<String> = surfels.into_iter().chain(triangles).collect();
        format!("warning: nothing shows: {}", reasons.join("; "))
    }
}

/// Whether `frame` shows only the background, up to the rounding of encoding and decoding.
pub fn is_empty(frame: &Frame, options: &Settings) -> bool {
    let near = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-6 * b.abs();
    frame.color.par_iter().all(|color| color.iter().zip(&options.background).all(near))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::{Colors, Lens, Up};

    #[test]
    fn each_surfel_has_its_reason() {
        let at = [
            (Vec3::new(0.0, 0.0, -3.0), 0.1),
            (Vec3::new(9.0, 0.0, 3.0), 0.1),
            (Vec3::new(9.0, 1.0, 3.0), 0.1),
            (Vec3::new(0.001, 0.001, 3.0), 1e-6),
            (Vec3::new(0.001, 0.001, 4.0), 1e-6),
            (Vec3::new(0.001, 0.002, 3.0), 1e-6),
        ];
        let surfels: Vec<Surfel> = at.iter().map(|(center, radius)| Surfel::disk(*center, Vec3::Z, *radius)).collect();
        let colors = Colors::Constant([1.0; 4]);
        let scene =
            Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() };
        let camera = Camera::look_at((32, 32), Lens::Fov(45.0), DVec3::ZERO, DVec3::Z, None, Up::Y, 0.1).unwrap();
        let options = Settings::default();
        let mut frame = Frame::new(&camera, options.maps);
        let unseen = Unseen::of(&scene, &camera, &options);
        assert_eq!(unseen, Unseen { behind: 1, outside: 2, between: 3, ..Unseen::default() });
        assert!(unseen.sentence().contains("of 6 surfels 1 lie behind the camera"), "{}", unseen.sentence());
        assert!(Unseen { between: 6, ..Unseen::default() }.sentence().contains("all lie between"));
        let alone = Unseen { triangles: 12, ..Unseen::default() }.sentence();
        assert!(alone.contains("shows: none of 12 triangles") && !alone.contains("surfels"), "{alone}");
        let black = Surfel::disk(Vec3::new(0.0, 0.0, 3.0), Vec3::Z, 1.0);
        let over = Scene { surfels: vec![black], ..scene.clone() };
        assert_eq!(Unseen::of(&over, &camera, &options).over, 1);
        assert!(is_empty(&frame, &options));
        frame.color[7] = [0.5, 0.5, 0.5, 1.0];
        assert!(!is_empty(&frame, &options));
    }
}
