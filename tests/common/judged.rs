//! Scenes of a test's own, judged pixel by pixel by the bounds of the hard cases.

use epsplat::low_level::hardcases::{HardCase, Verdict};
use epsplat::low_level::plan::{Accumulator, RenderOptions};
use epsplat::low_level::render::Backend;
use epsplat::low_level::scene::{Camera, Scene, Shading};

/// Fails if the device's image of `scene`, of which the reference covers such a share of pixels, exceeds its derived bound anywhere.
pub fn judge(
    name: &str,
    (scene, camera): (&Scene, &Camera),
    options: RenderOptions,
    covered: (f64, f64),
    backend: &Backend,
) {
    let case = HardCase {
        name: name.to_owned(),
        about: "",
        bound: "",
        scene: scene.clone(),
        camera: camera.clone(),
        options: RenderOptions { shading: Shading::Unlit, ..options },
        covered,
        excused: 0.01,
        expected: Vec::new(),
        smallest: None,
    };
    let truth = case.truth().unwrap();
    let row = case.judge(&truth, Accumulator::Fixed.row(), backend).unwrap();
    assert!(matches!(row.verdict, Verdict::Pass), "{name}: {row:?}");
}
