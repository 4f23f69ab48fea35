//! Where a splat ends: at the lines of the surfels that it stands for, and at sharp edges around it.

use glam::{DVec2, DVec3};

use super::cells::{Cells, tangent_basis};
use super::growing::Cover;
use super::samples::Samples;
use crate::scene::Clip;
use crate::surfels::lines::{self, Line, hull, nearest_share};

/// How far past an end a splat goes: twice its deviation, as disks that end at one line may lie so far apart there; and a part of the
/// radius of the surfel that it grew from, as cells only nearly tile a rough surface. Of 3.5 million rays at 7,248 disks for
/// `data/bunny.obj`, five find a hole with a tenth, and none with a fifth.
const MARGIN: [f64; 2] = [2.0, 0.2];

/// A splat is cut where it stands out past an end by more than so many deviations: less may be the roughness of the surface, whose holes
/// disks close by their overlap.
const ROUGH: f64 = 4.0;

/// The lines at which a splat of these half-axes ends: those at which the surfels end that it stands for, and what lies around them. It
/// keeps what it covers, of which the points lie up to `deviation` from its plane; the surfel that it grew from has this `radius`.
pub(super) fn clip(
    samples: &Samples,
    cells: &Cells,
    covers: &[Cover],
    (center, axes): (DVec3, [DVec3; 2]),
    (deviation, radius): (f64, f64),
) -> Clip {
    let inverse = axes.map(|axis| axis / axis.length_squared());
    let on_disk = |at: DVec3| DVec2::new((at - center).dot(inverse[0]), (at - center).dot(inverse[1]));
    let place = |cell: u32, corner: DVec2| {
        let [s, t] = tangent_basis(samples.normals[cell as usize]);
        on_disk(samples.positions.position(cell) + s * corner.x + t * corner.y)
    };
    if let [only] = covers {
        // What stands for one surfel ends where that did.
        let own = samples.lines[only.cell as usize].iter().map(|end| {
            let inward = DVec2::new(-end.toward.dot(axes[0]), -end.toward.dot(axes[1]));
            let offset = -(end.distance + (samples.positions.position(only.cell) - center).dot(end.toward));
            Line { inward: inward.normalize_or(DVec2::X), offset: offset / inward.length() }
        });
        return lines::clip(own.collect());
    }
    let normal = axes[0].cross(axes[1]);
    let faces = |cell: u32| samples.normals[cell as usize].dot(normal) > 0.5 * normal.length();
    let mut around: Vec<u32> =
        covers.iter().flat_map(|cover| [&[cover.cell], cells.neighbours(cover.cell)].concat()).collect();
    around.sort_unstable();
    around.dedup();
    let edges = around
        .iter()
        .filter(|cell| faces(**cell))
        .flat_map(|&cell| cells.cut_edges(cell).map(move |edge| (cell, edge)));
    let mut edges = edges.map(|(cell, edge)| edge.map(|corner| place(cell, corner))).peekable();
    if edges.peek().is_none() {
        return Clip::NONE;
    }
    let kept = covers.iter().flat_map(|c| cells.corners_of(c.cell, c.pieces).map(|corner| place(c.cell, corner)));
    let kept = hull(kept.collect());
    let shortest = axes[0].length().min(axes[1].length());
    let margin = (MARGIN[0] * deviation + MARGIN[1] * radius) / shortest;
    let line = |[from, to]: [DVec2; 2]| {
        let is_near = from.lerp(to, nearest_share(from, to)).length() < 1.0;
        let line = Line::through(from, to).filter(|_| is_near)?.keeping(kept.iter().copied(), margin);
        ((1.0 + line.offset) * shortest > ROUGH * deviation).then_some(line)
    };
    lines::clip(edges.filter_map(line).collect())
}
