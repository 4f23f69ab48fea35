//! Statistics of a file of Gaussians.

use epsplat::low_level::scene::{Colors, Scene, gaussian};
use serde::Serialize;

/// Statistics of a file of Gaussians.
#[derive(Serialize)]
pub(super) struct Gaussians {
    /// Degree of the spherical harmonics of view-dependent colours, 0 for constant colours.
    pub degree: u32,
    /// Minimum, median and maximum opacity of the Gaussians that are drawn.
    pub opacities: [f32; 3],
    /// Medians of the longer and of the shorter standard deviation, world units.
    pub deviations: [f32; 2],
    /// Median standard deviation along the shortest axis; None for Gaussian surfels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f32>,
}

impl Gaussians {
    pub fn of(scene: &Scene) -> Option<Self> {
        if !scene.encoded {
            return None;
        }
        let sorted = |values: &mut dyn Iterator<Item = f32>| {
            let mut values: Vec<f32> = values.collect();
            values.sort_by(f32::total_cmp);
            values
        };
        let middle = |values: &[f32]| values[values.len() / 2];
        let count = scene.surfels.len();
        let opacities = sorted(&mut (0..count).map(|index| scene.colors.linear(index)[3]));
        let deviation = |axis: f32| axis / gaussian::EXTENT as f32;
        let longer = sorted(&mut scene.surfels.iter().map(|surfel| deviation(surfel.radius())));
        let shorter = sorted(&mut scene.surfels.iter().map(|surfel| deviation(surfel.shorter())));
        Some(Self {
            degree: if let Colors::Harmonics(harmonics) = &scene.colors { harmonics.degree() } else { 0 },
            opacities: [opacities[0], middle(&opacities), opacities[count - 1]],
            deviations: [middle(&longer), middle(&shorter)],
            thickness: (!scene.thirds.is_empty())
                .then(|| middle(&sorted(&mut scene.thirds.iter().map(|third| deviation(*third))))),
        })
    }
}
