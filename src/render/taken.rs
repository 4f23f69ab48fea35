//! Reads from a file with levels of detail only what given views need.

use super::encoded;
use super::parts::parts;
use crate::io::ply::Levels;
use crate::passes::select::{self, Wanted};
use crate::plan::{Facts, Settings, culls_back};
use crate::scene::{Camera, Detail, Hierarchy, Scene};
use crate::surfels::part::{self, Taken};
use crate::{Progress, Result};

/// Reads the part of a file from which the pictures of `views` (cameras with options) are made;
/// they are bit-identical to pictures of the whole file. The part depends only on the views and the
/// file.
///
/// # Errors
/// [`Error::Read`](crate::Error::Read) and [`Error::Malformed`](crate::Error::Malformed) for the
/// file, and any error that `fits` returns for the part read so far.
pub fn taken(
    levels: &Levels,
    views: &[(&Camera, &Settings)],
    fits: impl Fn(&Taken) -> Result<()> + Sync,
    progress: &dyn Progress,
) -> Result<(Scene, Taken)> {
    let (facts, origin) = (Facts::of(&part::nothing(levels)), levels.whole.origin);
    let mut all: Vec<(&Camera, Wanted)> = Vec::new();
    for &(camera, options) in views {
        // If a number of splats is requested, the node size depends on all nodes in view, so all
        // are read.
        let detail = if matches!(options.detail, Detail::Splats(_)) { Detail::FINEST } else { options.detail };
        let wanted = |part: &Settings| Wanted { detail, ..Wanted::of(part, culls_back(&facts, camera, part)) };
        // The renders for colour and for maps may differ in culled back faces and in sample sizes,
        // so the part must serve each of them.
        all.extend(parts(&facts, &encoded::of(&facts, options)).iter().map(|part| (camera, wanted(part))));
    }
    let any = |tree: &Hierarchy, index: u32| {
        let (node, low) = (&tree.nodes[index as usize], tree.low(index));
        all.iter().any(|(camera, wanted)| select::may_divide(node, low, (origin, camera), wanted))
    };
    part::part(levels, any, fits, progress)
}
