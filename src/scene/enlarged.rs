//! Scenes whose surfels are larger or smaller.

use rayon::prelude::*;

use super::{Colors, Scene};

impl Scene {
    /// Scales all surfels about their centres by `factor`, with their curvatures unchanged. Clip
    /// lines keep their places on the surfels. Levels of detail are dropped, as they have the old
    /// sizes.
    pub fn enlarge(&mut self, factor: f32) {
        self.hierarchy = None;
        let scaled = |axis: [f32; 3]| axis.map(|c| c * factor);
        self.surfels.par_iter_mut().for_each(|surfel| (surfel.s, surfel.t) = (scaled(surfel.s), scaled(surfel.t)));
        // The height of a paraboloid over its rim grows with the square of the radius.
        self.caps.par_iter_mut().for_each(|cap| cap.0 = cap.0.map(|height| height * factor * factor));
        self.thirds.par_iter_mut().for_each(|third| *third *= factor);
        if let Colors::Textured(textured) = &mut self.colors {
            *textured = textured.enlarged(factor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Cap, Surfel};

    #[test]
    fn enlarged_surfels_have_the_same_curvature() {
        let surfel = Surfel { center: [1.0, 2.0, 3.0], s: [2.0, 0.0, 0.0], t: [0.0, 1.0, 0.0] };
        let mut scene = Scene { surfels: vec![surfel], caps: vec![Cap([-4.0, 0.5, -1.0])], ..Scene::default() };
        scene.enlarge(0.5);
        assert_eq!(scene.surfels, [Surfel { s: [1.0, 0.0, 0.0], t: [0.0, 0.5, 0.0], ..surfel }]);
        // The curvature along s is -uu / |s|².
        assert_eq!(scene.caps, [Cap([-1.0, 0.125, -0.25])]);
    }
}
