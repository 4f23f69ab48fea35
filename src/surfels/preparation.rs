//! Counts of the points that were left out, changed or estimated on the way to a scene.

#[cfg(doc)]
use super::{LARGEST_COORDINATE, Limits};
use crate::io::points::Flattened;
#[cfg(doc)]
use crate::scene::Scene;

/// The preparation of a scene's points.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Preparation {
    /// The number of points in all inputs.
    pub points: u64,
    /// The number of points that the files mark as withheld (deleted), which `points` does not
    /// include.
    pub withheld: u64,
    /// The number of points whose class has the opacity 0, which `points` does not include.
    pub unseen: u64,
    /// The number of points that do not pass the filter, which `points` does not include.
    #[serde(skip_serializing_if = "is_zero")]
    pub filtered: u64,
    /// Parts of files that could not be read and were left out: a sentence for each, with names and
    /// counts.
    pub unread: Vec<String>,
    /// The number of vertices that no triangle of their mesh uses, which `points` does not include.
    pub loose: u64,
    /// The number of vertices whose triangles all have no area, or a corner that is not finite or
    /// exceeds [`LARGEST_COORDINATE`]; `points` does not include them.
    pub stranded: u64,
    /// The number of mesh triangles that were left out because a coordinate of a corner is not
    /// finite or exceeds [`LARGEST_COORDINATE`].
    pub broken: u64,
    /// The number of Gaussians that were left out because their scales, rotation, opacity or colour
    /// are not finite, or they have no surface.
    pub shapeless: u64,
    /// The ellipsoids that became surfels.
    pub flattened: Option<Flattened>,
    /// The number of points that were left out because a coordinate is not finite or exceeds
    /// [`LARGEST_COORDINATE`].
    pub dropped_non_finite: u64,
    /// The number of points that were left out as outliers ([`Limits::outliers`]).
    pub dropped_outliers: u64,
    /// The number of surfels in the scene:
    /// `points - shapeless - dropped_non_finite - dropped_outliers`.
    pub surfels: u64,
    /// The number of surfels whose normal was missing, zero or not finite, and was estimated from
    /// neighbours.
    pub estimated_normals: u64,
    /// The number of surfels whose given normal is opposed to that of the nearest point beside
    /// them; counted where radii were estimated.
    ///
    /// If it exceeds a quarter of the surfels, normals have no side ([`Scene::oriented`]): with
    /// random signs, half of them would be opposed.
    pub opposed_normals: u64,
    /// The number of surfels whose radius was missing, not positive or not finite, and was
    /// estimated from neighbours.
    pub estimated_radii: u64,
    /// The number of points without a radius that are drawn facing the camera, and the radius that
    /// all of them have, world units.
    pub common_radius: Option<(u64, f64)>,
    /// The number of surfels whose colour was not finite or exceeded 1e18 and was replaced by
    /// [`DEFAULT_COLOR`](crate::scene::color::DEFAULT_COLOR), plus the number of those with such
    /// coefficients of harmonics, which became 0.
    pub replaced_colors: u64,
    /// The number of surfels whose alpha was outside [0, 1] and was clamped.
    pub clamped_alphas: u64,
    /// The number of points whose texture coordinates were not finite or too large and became 0;
    /// counted where a texture paints them.
    pub replaced_places: u64,
    /// The number of surfels that have the mean of an image over their triangle, as no image paints
    /// them.
    pub averaged: u64,
    /// The number of material images that were halved, so that all of them fit into a device's
    /// memory.
    pub halved_images: u64,
    /// The number of distinct positions of the surfels; None if nothing was estimated.
    pub distinct_positions: Option<u64>,
    /// Whether the up axis was guessed, because no input states it.
    pub guessed_up: bool,
    /// The number of stray points: they lie so far from nearly all others that the default view
    /// leaves them out ([`Scene::framed`]).
    pub strays: u64,
    /// The number of surfels whose estimated radius was reduced because of their neighbours
    /// ([`Limits::largest_ratio`]); None if no radius was estimated, or only some places of a cloud
    /// were examined.
    pub limited_by_neighbours: Option<u64>,
    /// The number of surfels larger than a million times the scene, which were reduced to that
    /// size.
    pub limited_radii: u64,
    /// The largest rounding error of a centre's coordinate, world units, among the errors that may
    /// be visible: more than 1/256 of the surfel's shorter half-axis, although coordinates are
    /// stored as two f32. None if there are no such errors.
    pub rounding: Option<f64>,
    /// Median distance from a position to the nearest other one, world units; None if nothing was
    /// estimated or there is only one position.
    pub median_spacing: Option<f64>,
    /// Sentences about oddities that readers found in the files
    /// ([`Points::notes`](crate::io::Points::notes)).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub told: Vec<String>,
}

/// Whether a count is 0, so that a report leaves it out.
fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl Preparation {
    /// Whether the signs of given normals are arbitrary, as those of fitted planes are.
    pub(crate) fn has_random_sides(&self) -> bool {
        4 * self.opposed_normals > self.surfels
    }

    /// Sentences for the user, one for each kind of loss or replacement.
    pub fn notes(&self) -> Vec<String> {
        let counted = |count: u64, what: &str| (count > 0).then(|| format!("{count} points {what}"));
        let notes = [
            counted(
                self.withheld,
                "were left out: they are marked as withheld, which is deleted (--keep-withheld keeps them)",
            ),
            counted(self.unseen, "were left out: their class has the opacity 0"),
            counted(self.filtered, "were left out by --where or --classes"),
            (self.loose > 0).then(|| format!("{} vertices of no triangle were left out", self.loose)),
            (self.broken > 0)
                .then(|| format!("{} triangles were left out: a coordinate is not finite or too large", self.broken)),
            (self.stranded > 0).then(|| {
                let what = "were left out: none of their triangles has an area and finite corners";
                format!("{} vertices {what}", self.stranded)
            }),
            (self.shapeless > 0).then(|| {
                let what =
                    "were left out: their scales, rotation, opacity or colour are not finite, or they have no surface";
                format!("{} Gaussians {what}", self.shapeless)
            }),
            self.flattened.map(|flattened| flattened.sentence()),
            counted(self.dropped_non_finite, "were dropped: a coordinate is not finite or too large"),
            counted(self.dropped_outliers, "were dropped: they lie too far from their neighbours"),
            counted(
                self.replaced_colors,
                "had a colour that is not finite: it became grey, or lost its dependence on the view",
            ),
            counted(self.clamped_alphas, "had an alpha outside 0 to 1, which was clamped"),
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
            format!("{points} points have no radius and got a common one from the mean spacing: {radius:.3e} world units (--point-size)")
        });
        let strays = counted(self.strays, "stray: they lie far away from all others, outside of the default view");
        let by_neighbours = counted(
            self.limited_by_neighbours.unwrap_or(0),
            "would have had larger surfels than their neighbours allow",
        );
        let random = self.has_random_sides().then(|| {
            let (opposed, all) = (self.opposed_normals, self.surfels);
            format!("normals face either way: {opposed} of {all} are opposed to the nearest one's, so they have no side (epsplat surfels --estimate-normals gives them one)")
        });
        let limited =
            counted(self.limited_radii, "had a radius of more than a million times the scene and were limited to it");
        let rounding = self.rounding.map(|error| {
            format!("the smallest surfels lie so far from others that their coordinates err by up to {error:.2e} world units")
        });
        let told = self.unread.iter().chain(&self.told).cloned();
        let notes = notes.into_iter().chain(images);
        told.chain(notes.chain([common, strays, by_neighbours, random, limited, rounding]).flatten()).collect()
    }
}
