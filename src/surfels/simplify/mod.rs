//! Replaces the surfels of a surface by fewer, larger ones within a tolerance, by splat growing and
//! selection (Tien 2008, chapter 4, after Wu and Kobbelt 2004, "Optimized sub-sampling of point
//! sets for surface splatting").
//!
//! ```text
//! samples    = distinct(surfels)                one position, normal and colour each
//! cells      = voronoi(samples)                 surface elements; neighbours share an edge
//! candidates = grow(samples, cells, tolerance)  largest disks with heights within 2 tolerance
//! selected   = select(candidates)               greedily by area, until disks hold all cells
//! selected   = relax(selected)                  moves that leave fewer (optional)
//! ```
//!
//! Each stage has its own file. The result does not depend on the order of the surfels or on the
//! number of threads.
//!
//! **Hole-free.** Even where each point lies in a disk, the surface between points may be bare. The
//! thesis counts as covered the points within a constant fraction of the radius (0.5 to 0.7), Wu
//! and Kobbelt those inside that are not on the convex hull. Here a cell is divided into pieces,
//! the triangles between its point and its edges, and a disk covers the triangles that lie in it.
//! Disks are convex and the triangles tile the surface, so selected disks that cover all triangles
//! leave no hole, and two disks may share a cell. Slits remain in oblique views, where disks of
//! different heights meet, and where the surface is rough between points: [`written`] closes them.
//! For the Stanford bunny, with 13,152 disks for 57,000 samples at a tolerance of 0.00036
//! diagonals, one of 3.5 million rays finds a hole.
//!
//! **Caps.** A cap grows in rounds. In the first round, a disk grows. In each further round, a cap
//! grows over the paraboloid, with a normal of its own, that is fitted to the points inside the
//! previous splat. The caps of the last rounds are ellipses. A cap holds only points whose normals
//! are within 37 degrees of its own. So it covers the same part of a cell on the surface as in the
//! cap's plane.
//!
//! **Edges.** Cells end, and the graph has no edge, at the clip lines of the input surfels and at
//! creases of more than 60 degrees. Disks that stand for several surfels are clipped there, as far
//! as their covered pieces allow. As they are clipped, they may grow past two such ends.
//!
//! **Textures.** If the input surfels have texture coordinates, cells end at seams too: disks do
//! not cover surface on both sides of a seam. Disks that are clipped on both sides of a seam
//! overlap little there, so the mean colour of one side hardly shows on the other.
//!
//! **Within the tolerance.** A disk covers cells only of points that it grew over, and none of
//! these is farther from it than the tolerance. Where the surface bends by more than that within a
//! cell, no such disk covers the whole cell; and at a crease, any disk that covers the whole cell
//! also lies over points of the other side, seen along its normal. In both cases, the cell's own
//! point gets a disk as large as the cell ([`Report::beyond_tolerance`] counts such disks). It
//! covers nothing of the cells beyond the crease.

mod borders;
mod candidates;
mod cells;
mod cut;
mod ended;
mod growing;
mod outcome;
mod paraboloid;
mod points;
mod relaxation;
mod samples;
mod selection;
mod thesis;

use std::str::FromStr;

use self::candidates::Candidates;
use self::cells::Cells;
pub use self::outcome::{Report, grown, written};
pub use self::points::points;
use self::samples::Samples;
pub use self::thesis::as_in_the_thesis;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::options::kind_and_amount;
use crate::surfels::Coordinates;

/// The largest distance of a point from the splat that stands for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// A fraction of the diagonal of the box around the surfels' centres.
    Relative(f64),
    /// World units.
    Absolute(f64),
}

impl Tolerance {
    /// The tolerance in world units, for surfels in a box of this diagonal.
    pub fn in_world(self, diagonal: f64) -> f64 {
        match self {
            Self::Relative(fraction) => fraction * diagonal,
            Self::Absolute(distance) => distance,
        }
    }
}

impl FromStr for Tolerance {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::Usage(format!(
                "a tolerance is rel:E (fraction of the diagonal) or abs:E (world units), not {text:?}"
            ))
        };
        match kind_and_amount(text).ok_or_else(bad)? {
            ("rel", value) => Ok(Self::Relative(value)),
            ("abs", value) => Ok(Self::Absolute(value)),
            _ => Err(bad()),
        }
    }
}

/// The shape of the splats that grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplatShape {
    /// Circular disks, as in the thesis.
    #[default]
    Disk,
    /// Ellipses along the principal curvatures where these cover more than disks, as in Wu and
    /// Kobbelt.
    Ellipse,
    /// Disks and ellipses that are curved as the points inside are ([`Cap`](crate::scene::Cap)), so
    /// they can hold more of them.
    Cap,
}

/// The options of [`simplify`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The largest distance of a point from the splat that stands for it.
    pub tolerance: Tolerance,
    /// The shape of the splats that grow.
    pub shape: SplatShape,
    /// The largest number of rounds of relaxation; 0 for none.
    pub relaxations: u32,
}

/// Selects few large surfels that stand for all surfels of `scene`.
///
/// Each selected surfel grows from an input surfel. It has the normal of that surfel; a cap may
/// have a similar normal. Its centre lies on the line through that surfel along the normal, halfway
/// between the highest and the lowest of the surfels inside, so that all of them are within the
/// tolerance. Its colour is the mean over the area that it covers (linear light, weighted by
/// alpha).
///
/// The surface consists of the area at the surfels and of the gaps of at most a few spacings that
/// surfels surround. Where the surface ends, it extends as far as its surfels do. Normals that
/// differ by a right angle or more belong to different surfaces, unless they were estimated and
/// have no side.
///
/// # Errors
///
/// [`Error::Usage`] for a tolerance that is negative or not finite, or more than 2^32 - 1 surfels.
pub fn simplify(scene: &Scene, options: &Options, progress: &dyn Progress) -> Result<(Scene, Report)> {
    simplify_in_texture(scene, &Coordinates::default(), options, progress).map(|(scene, _, report)| (scene, report))
}

/// As [`simplify`], for surfels with texture coordinates. Also returns the texture coordinates of
/// the selected surfels.
///
/// The slopes of the coordinates are fitted over the surfels that each selected surfel stands for;
/// a surfel that stands only for itself keeps its slopes. No selected surfel stands for surfels on
/// both sides of a seam, where coordinates jump.
///
/// # Errors
///
/// As [`simplify`].
pub fn simplify_in_texture(
    scene: &Scene,
    coordinates: &Coordinates,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Scene, Coordinates, Report)> {
    let tolerance = options.tolerance.in_world(scene.bounds().extent().length());
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        return Err(Error::Usage(format!("a tolerance must be finite and at least 0: {tolerance} is not")));
    }
    progress.begin("sorting points", 0);
    let samples = Samples::new(scene, coordinates)?;
    progress.end();
    let scaled = tolerance * samples.positions.scale();
    let cells = Cells::new(&samples, scaled, progress);
    let candidates = Candidates::grow(&samples, &cells, scaled, options.shape, progress);
    let mut selected = selection::select(&cells, &candidates, progress);
    let before_relaxation = selected.len() as u64;
    if options.relaxations > 0 {
        selected = relaxation::relax(&cells, &candidates, &selected, options.relaxations, progress);
    }
    let (simplified, left, deviations) =
        outcome::scene((scene, &coordinates.slopes), &samples, &cells, &candidates, &selected, scaled);
    // The factor allows for rounding.
    let beyond = |&&index: &&u32| candidates.splats[index as usize].deviation > scaled * (1.0 + 1e-9);
    let beyond_tolerance = selected.iter().filter(beyond).count() as u64;
    let report = Report {
        surfels: scene.surfels.len() as u64,
        distinct_positions: samples.len() as u64,
        selected: selected.len() as u64,
        before_relaxation,
        tolerance,
        max_deviation: deviations.max,
        // Rounding may make the mean of equal deviations exceed the largest.
        mean_deviation: deviations.mean.min(deviations.max),
        beyond_tolerance,
    };
    Ok((simplified, Coordinates { atlas: coordinates.atlas, ..left }, report))
}
