//! What became of the points of a scene.

#[cfg(doc)]
use super::{LARGEST_COORDINATE, Limits};
use crate::io::points::Flattened;
#[cfg(doc)]
use crate::scene::Scene;

/// What was done to the points on the way to a scene.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Preparation {
    /// Points in all inputs.
    pub points: u64,
    /// Points that are in the files but not among `points`: they are marked as withheld, which is deleted.
    pub withheld: u64,
    /// Points that are in the files but not among `points`: their class has the opacity 0.
    pub unseen: u64,
    /// Parts of files that could not be read and were left out, named and counted: a sentence each.
    pub unread: Vec<String>,
    /// Vertices that are in the meshes but not among `points`: no triangle names them.
    pub loose: u64,
    /// The same, but their triangles have no area, or a corner that is not finite or exceeds
    /// [`LARGEST_COORDINATE`].
    pub stranded: u64,
    /// Triangles of meshes left out because a coordinate of a corner is not finite or exceeds
    /// [`LARGEST_COORDINATE`].
    pub broken: u64,
    /// Gaussians left out because their scales, rotation, opacity or colour are no numbers, or span no surface.
    pub shapeless: u64,
    /// Ellipsoids that were made surfels.
    pub flattened: Option<Flattened>,
    /// Points left out because a coordinate is not finite or exceeds [`LARGEST_COORDINATE`].
    pub dropped_non_finite: u64,
    /// Points left out as outliers, which [`Limits::outliers`] asks for.
    pub dropped_outliers: u64,
    /// Surfels in the scene: `points - shapeless - dropped_non_finite - dropped_outliers`.
    pub surfels: u64,
    /// Surfels whose normal was missing, zero or not finite, and was estimated from neighbours.
    pub estimated_normals: u64,
    /// Surfels whose given normal faces the other way than that of the nearest point beside them; counted where radii were estimated. If they
    /// are more than a quarter, normals have no side ([`Scene::oriented`]): half of them would have, were sides random.
    pub opposed_normals: u64,
    /// Surfels whose radius was missing, not positive or not finite, and was estimated from neighbours.
    pub estimated_radii: u64,
    /// Points without a radius that are drawn facing the camera, and the one that all of them took, world units.
    pub common_radius: Option<(u64, f64)>,
    /// Surfels whose colour was not finite and was replaced by [`DEFAULT_COLOR`](crate::scene::color::DEFAULT_COLOR).
    pub replaced_colors: u64,
    /// Surfels whose alpha was not from 0 to 1 and became the nearer of the two.
    pub clamped_alphas: u64,
    /// Points whose texture coordinates were not finite or too large and became 0; counted where a texture paints them.
    pub replaced_places: u64,
    /// Surfels that have the mean of an image over their triangles, as no image paints them.
    pub averaged: u64,
    /// Images of materials that were halved, so that all of them fit into a device's memory.
    pub halved_images: u64,
    /// Different positions among the surfels; None if nothing had to be estimated, so nobody looked.
    pub distinct_positions: Option<u64>,
    /// No input says which way is up, so it was guessed.
    pub guessed_up: bool,
    /// Points that stray: they lie so far from nearly all others that the default view leaves them out ([`Scene::framed`]).
    pub strays: u64,
    /// Surfels whose radius was estimated and would have been larger than [`Limits::largest_ratio`] allows.
    pub limited_by_neighbours: u64,
    /// Surfels larger than a million times the scene, which were made that large.
    pub limited_radii: u64,
    /// The largest error of a centre's coordinate, world units, where it may show: it is more than 1/256 of the surfel's shorter
    /// half-axis, although coordinates are kept in twice the digits of f32.
    pub rounding: Option<f64>,
    /// Median distance between an estimated position and the nearest other one, world units; None if nothing had to be
    /// estimated or there is only one position.
    pub median_spacing: Option<f64>,
    /// Sentences about what readers found odd in the files
    /// ([`Points::notes`](crate::io::Points::notes)).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub told: Vec<String>,
}

impl Preparation {
    /// Whether given normals face either way, as a fit of planes leaves them.
    pub(crate) fn has_random_sides(&self) -> bool {
        4 * self.opposed_normals > self.surfels
    }

    /// What a user should hear of: a sentence for everything that was lost or replaced.
    pub fn notes(&self) -> Vec<String> {
        let counted = |count: u64, what: &str| (count > 0).then(|| format!("{count} points {what}"));
        let notes = [
            counted(
                self.withheld,
                "were left out: they are marked as withheld, which is deleted (--keep-withheld keeps them)",
            ),
            counted(self.unseen, "were left out: their class has the opacity 0"),
            (self.loose > 0).then(|| format!("{} vertices of no triangle were left out", self.loose)),
            (self.broken > 0)
                .then(|| format!("{} triangles were left out: a coordinate is not finite or too large", self.broken)),
            (self.stranded > 0).then(|| {
                let what = "were left out: none of their triangles has an area and finite corners";
                format!("{} vertices {what}", self.stranded)
            }),
            (self.shapeless > 0).then(|| {
                let what =
                    "were left out: their scales, rotation, opacity or colour are no numbers, or span no surface";
                format!("{} Gaussians {what}", self.shapeless)
            }),
            self.flattened.map(|flattened| flattened.sentence()),
            counted(self.dropped_non_finite, "were dropped: a coordinate is not finite or too large"),
            counted(self.dropped_outliers, "were dropped: they lie too far from their neighbours"),
            counted(
                self.replaced_colors,
                "had a colour that is not finite and became grey, or lost its change with the view",
            ),
            counted(self.clamped_alphas, "had an alpha that is not from 0 to 1 and got the nearer of the two"),
            counted(self.replaced_places, "had texture coordinates that are not finite or too large and became 0"),
        ];
        let images = [
            (self.averaged > 0).then(|| {
                format!("{} surfels have one colour each, the mean of the image on their triangle", self.averaged)
            }),
            (self.halved_images > 0).then(|| {
                format!(
                    "{} images were halved to paint surfels with: together they are too large (--triangles takes them as they are)",
                    self.halved_images
                )
            }),
        ];
        let common = self.common_radius.map(|(points, radius)| {
            format!("{points} points have no radius and took one for all, by the mean spacing: {radius:.3e} world units (--point-size)")
        });
        let strays = counted(self.strays, "stray: they lie far away from all others, outside of the default view");
        let by_neighbours =
            counted(self.limited_by_neighbours, "would have had larger surfels than their neighbours allow");
        let random = self.has_random_sides().then(|| {
            let (opposed, all) = (self.opposed_normals, self.surfels);
            format!("normals face either way: {opposed} of {all} are opposed to the nearest one's, so they have no side (epsplat surfels --estimate-normals gives them one)")
        });
        let limited =
            counted(self.limited_radii, "had a radius of more than a million times the scene and became that large");
        let rounding = self.rounding.map(|error| {
            format!("the smallest surfels lie so far from others that their coordinates err by up to {error:.2e} world units")
        });
        let told = self.unread.iter().chain(&self.told).cloned();
        let notes = notes.into_iter().chain(images);
        told.chain(notes.chain([common, strays, by_neighbours, random, limited, rounding]).flatten()).collect()
    }
}
