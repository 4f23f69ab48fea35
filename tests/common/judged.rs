//! Judges a test's own scene pixel by pixel by the derived bounds of the hard cases.

use epsplat::low_level::hardcases::{HardCase, Verdict};
use epsplat::low_level::plan::{Accumulator, Settings};
use epsplat::low_level::render::Backend;
use epsplat::low_level::scene::{Camera, Scene, Shading};

/// Fails if any pixel of the device's image exceeds its derived bound, or if the share of pixels
/// that the reference covers is outside `covered`.
pub fn judge(
    name: &str,
    (scene, camera): (&Scene, &Camera),
    options: Settings,
    covered: (f64, f64),
    backend: &Backend,
) {
    let case = HardCase {
        name: name.to_owned(),
        about: "",
        bound: "",
        scene: scene.clone(),
        camera: camera.clone(),
        options: Settings { shading: Shading::Unlit, ..options },
        covered,
        excused: 0.01,
        expected: Vec::new(),
        smallest: None,
    };
    let truth = case.truth().unwrap();
    let row = case.judge(&truth, Accumulator::Fixed.row(), backend).unwrap();
    assert!(matches!(row.verdict, Verdict::Pass), "{name}: {row:?}");
}
