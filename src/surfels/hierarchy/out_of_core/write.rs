//! Writes the output file: the stored surfels in the order of the tree, and the nodes level by
//! level.

use std::ops::Range;
use std::path::Path;

use super::Report;
use super::kept::{Kept, Part, properties};
use super::sources::{PIECE, Read};
use super::survey::Survey;
use crate::io::ply::write_kept;
use crate::scene::hierarchy::NodeAndLow;
use crate::scene::scene::core_of;
use crate::scene::{Whole, framed_within};
use crate::surfels::Preparation;
use crate::{Error, Progress, Result};

/// Writes the finished tree to the file `path`.
pub(super) fn write(path: &Path, kept: Kept<'_>, survey: &Survey, progress: &dyn Progress) -> Result<Report> {
    let above = kept.parts.iter().filter(|part| matches!(part, Part::Above { .. })).count();
    let nodes = kept.nodes.count() + above as u64;
    let (whole, strays) = whole(&kept, survey, nodes, progress)?;
    let levels = kept.parts.iter().map(Part::end).max().unwrap_or(0);
    let pieces: Vec<Piece<'_>> =
        (0..levels).flat_map(|level| kept.parts.iter().flat_map(move |part| part.pieces(level))).collect();
    let mut next = 1;
    let read = |piece: Piece<'_>| {
        let mut read = match piece {
            Piece::One(made) => vec![*made],
            Piece::Kept(numbers) => kept.nodes.read(numbers)?,
        };
        for (node, _) in read.iter_mut().filter(|(node, _)| !node.leaf) {
            // The children of a level's nodes are contiguous.
            node.first = next;
            next += node.count;
        }
        Ok(read)
    };
    progress.begin("writing points", kept.surfels.count() + nodes);
    let written = write_kept(
        path,
        (properties(survey), &kept.surfels),
        (kept.kind, &whole),
        pieces.into_iter().map(read),
        progress,
    );
    progress.end();
    written?;
    let subtrees = kept.parts.len() as u64 - above as u64;
    let preparation = Preparation { strays, ..survey.preparation.clone() };
    Ok(Report { surfels: kept.surfels.count(), nodes, levels: levels as u64, subtrees, preparation })
}

/// A few contiguous nodes.
enum Piece<'a> {
    One(&'a NodeAndLow),
    Kept(Range<u64>),
}

impl Part {
    /// The level after the deepest level of the part.
    fn end(&self) -> usize {
        match self {
            Self::Above { depth, .. } => depth + 1,
            Self::Subtree { depth, levels, .. } => depth + levels.len() - 1,
        }
    }

    /// The nodes of the part on a level of the tree.
    fn pieces(&self, level: usize) -> Vec<Piece<'_>> {
        match self {
            Self::Above { depth, made, .. } if *depth == level => vec![Piece::One(made)],
            Self::Subtree { depth, first, levels } if level >= *depth => {
                let own = |level: usize| levels.get(level - depth).map(|start| first + *start as u64);
                let (Some(start), Some(end)) = (own(level), own(level + 1)) else { return Vec::new() };
                let starts = (start..end).step_by(PIECE as usize);
                starts.map(|start| Piece::Kept(start..end.min(start + PIECE))).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// The facts that a reader of a part of the file needs, and the number of strays.
fn whole(kept: &Kept<'_>, survey: &Survey, nodes: u64, progress: &dyn Progress) -> Result<(Whole, u64)> {
    let count = kept.surfels.count();
    let places = |piece: Range<u64>| {
        let scene = kept.part(piece)?;
        progress.advance(scene.surfels.len() as u64);
        Ok((0..scene.surfels.len()).map(|k| (scene.center(k), f64::from(scene.surfels[k].radius()))).collect())
    };
    progress.begin("measuring the scene", count);
    let read = Read::new(count as usize, kept.surfels.pieces(PIECE), places, None);
    let boxes = read.made(|places| framed_within(kept.sample.clone().core(), survey.bounds, places));
    progress.end();
    let (body, framed, strays) = boxes?;
    let whole = Whole {
        // The survey has refused larger counts.
        surfels: count as u32,
        nodes: u32::try_from(nodes)
            .map_err(|_| Error::Usage(format!("a tree has at most 2^32 - 1 nodes, not {nodes}")))?,
        origin: survey.known.origin,
        bounds: survey.bounds,
        body,
        core: core_of(kept.sampled.iter().copied()).unwrap_or(survey.bounds),
        framed,
        color: survey.range,
        largest_radius: survey.largest_radius,
        largest_shorter: survey.largest_shorter,
        levels: kept.levels,
        has: survey.has,
    };
    Ok((whole, strays))
}
