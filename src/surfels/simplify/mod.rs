//! Fewer, larger surfels for the same surface, within a tolerance: splat growing and selection (Tien 2008, chapter 4, after Wu
//! and Kobbelt 2004, "Optimized sub-sampling of point sets for surface splatting").
//!
//! ```text
//! samples    = distinct(surfels)                  one position, normal and colour each
//! cells      = voronoi(samples)                   the surface element of each sample; neighbours share an edge
//! candidates = grow(samples, cells, tolerance)    the largest disk around a sample with heights within 2 tolerance
//! selected   = select(candidates)                 greedily by area, until each piece of each cell lies in a disk
//! selected   = relax(selected)                    moves that leave fewer (optional)
//! ```
//!
//! Each stage is a file. The result depends on no order of the surfels and no number of threads.
//!
//! **Hole-free.** A point is in a disk or not; a surface that lies between points needs more. The thesis counts as covered
//! what lies within a constant share of the radius (0.5 to 0.7), Wu and Kobbelt what does not lie on the convex hull of the points
//! inside. Here a cell is cut, from its point, into a triangle for each edge, and a disk covers those triangles that lie in it.
//! As disks are convex and the triangles tile the surface, selected disks that cover all triangles leave no hole, and two disks
//! may share a cell. What is left is seen aslant, where disks of different heights meet, or where the surface is rough between points:
//! [`written`] closes it. Of 3.5 million rays at 13,152 disks for 57,000 samples of the Stanford bunny, at a tolerance of 0.00036
//! diagonals, one finds a hole.
//!
//! **Caps.** A cap grows in turns: a disk, then the paraboloid through what the last one held, its own normal, and what that holds
//! within the tolerance; at last ellipses of it. It holds points whose normals are within 37 degrees of its own, so that what it covers
//! of them in its plane is what it covers of the surface.
//!
//! **Edges.** Where the surfels that came in end at lines, and at creases of more than 60 degrees, cells end and the graph has no
//! edge; disks that stand for several surfels are cut there, as far as what they cover allows. As they are cut they may grow past two ends.
//!
//! **Textures.** Where the surfels that came in have texture coordinates, cells end at seams too: what is painted from two parts of an image
//! is covered by disks of each. Disks that are cut at both sides of a seam overlap little there, so little of it shows their mean colours.
//!
//! **Within the tolerance.** A disk covers the cells of those points in it that it grew over, none of which is farther off than
//! the tolerance. Where the surface bends by more than that within a cell no disk covers all of it so, and at a crease any that
//! does holds, seen along its normal, points of the other side. There the cell's own point gets a disk as large as the cell
//! ([`Report::beyond_tolerance`] counts them), which covers nothing of cells beyond the crease.

mod borders;
mod candidates;
mod cells;
mod cut;
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

/// How far points may lie from the splat that stands for them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// A fraction of the diagonal of the box around the surfels' centres.
    Relative(f64),
    /// World units.
    Absolute(f64),
}

impl Tolerance {
    /// In world units, for surfels in a box of this diagonal.
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

/// What splats grow to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplatShape {
    /// Circular disks, as in the thesis.
    #[default]
    Disk,
    /// Ellipses along the principal curvatures where these cover more, as in Wu and Kobbelt.
    Ellipse,
    /// Disks and ellipses that curve as the points inside do ([`Cap`](crate::scene::Cap)), which lets them hold more of those.
    Cap,
}

/// How to simplify.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How far points may lie from the splat that stands for them.
    pub tolerance: Tolerance,
    /// What splats grow to.
    pub shape: SplatShape,
    /// Rounds of relaxation, at most.
    pub relaxations: u32,
}

/// Selects few large surfels that stand for all surfels of `scene`.
///
/// Each comes from a surfel: it has its normal, or as a cap one nearby, and its centre lies on the line through it along that
/// normal, halfway between the highest and the lowest of the surfels inside, so that each is within the tolerance. Its colour is
/// the mean of what it covers, by area (linear light, weighted by alpha).
///
/// The surface is where a scene's surfels are, and between them where they surround a gap that is no more than a few
/// spacings wide; where it ends, it goes on as far as its surfels do. Normals that face apart by a right angle or more belong
/// to different surfaces, unless they were estimated and have no side.
///
/// # Errors
///
/// [`Error::Usage`] for a tolerance that is negative or not finite, or more than 2^32 - 1 surfels.
pub fn simplify(scene: &Scene, options: &Options, progress: &dyn Progress) -> Result<(Scene, Report)> {
    simplify_in_texture(scene, &Coordinates::default(), options, progress).map(|(scene, _, report)| (scene, report))
}

/// [`simplify`] for surfels that have texture coordinates, and what those of the selected ones are. Slopes are fitted over the surfels that
/// each stands for, or stay of one that stands for itself, and none stands for surfels on both sides of a seam, where coordinates jump.
///
/// # Errors
///
/// Those of [`simplify`].
pub fn simplify_in_texture(
    scene: &Scene,
    coordinates: &Coordinates,
    options: &Options,
    progress: &dyn Progress,
) -> Result<(Scene, Coordinates, Report)> {
    let tolerance = options.tolerance.in_world(scene.bounds().extent().length());
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        return Err(Error::Usage(format!("a tolerance is finite and not negative, {tolerance} is not")));
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
    // Rounding aside.
    let beyond = |&&index: &&u32| candidates.splats[index as usize].deviation > scaled * (1.0 + 1e-9);
    let beyond_tolerance = selected.iter().filter(beyond).count() as u64;
    let report = Report {
        surfels: scene.surfels.len() as u64,
        distinct_positions: samples.len() as u64,
        selected: selected.len() as u64,
        before_relaxation,
        tolerance,
        max_deviation: deviations.max,
        // Where all are the same, a mean may be more by rounding.
        mean_deviation: deviations.mean.min(deviations.max),
        beyond_tolerance,
    };
    Ok((simplified, Coordinates { atlas: coordinates.atlas, ..left }, report))
}
