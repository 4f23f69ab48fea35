//! The box that the default view shows: the body of a scene without small groups of points far from
//! the rest.
//!
//! The body leaves out points so far away that nothing else would be visible. Nearer strays matter
//! too: a bird or a reflection at twice the extent of a scan does no harm to coordinates, but
//! shrinks the rest to a third of the picture.

use std::collections::HashMap;

use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

use super::Bounds;
use super::body::Places;

/// Groups closer to each other than this fraction of the core's longest edge are one group; groups
/// farther than twice that are separate.
const APART: f64 = 0.125;

/// A separate group is left out only if it has at most this many points.
const FEW: u64 = 16;

/// A separate group is left out only if it has at most one in this many of all points.
const SHARE: u64 = 1000;

/// The points in one cell of the grid: their number, their box, and whether a disk among them has
/// at least the cell's edge as radius.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Cell {
    count: u64,
    bounds: Bounds,
    large: bool,
}

impl Cell {
    fn union(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            bounds: self.bounds.union(other.bounds),
            large: self.large || other.large,
        }
    }
}

/// The box of the points in `body` without separate small groups, and the number of points left
/// out.
///
/// A group is left out if three conditions hold. It has at most [`FEW`] points and at most one in
/// [`SHARE`] of all, or all its points are at one position. It is separate from `core` and from all
/// other groups. None of its disks has a radius of a cell's edge or more, which could bridge the
/// gap. The result depends on the set of points alone.
pub(super) fn without_apart((core, body): (&Bounds, &Bounds), places: &impl Places) -> (Bounds, u64) {
    let edge = APART * core.extent().max_element();
    let near = Bounds { min: core.min - 2.0 * edge, max: core.max + 2.0 * edge };
    let holds = |bounds: &Bounds, p: DVec3| p.cmpge(bounds.min).all() && p.cmple(bounds.max).all();
    let count = places.count() as u64;
    if count < SHARE || holds(&near, body.min) && holds(&near, body.max) {
        return (*body, 0);
    }
    // Points near the core need no cell: the grid holds only points farther away.
    let grid = |p: DVec3| ((p - core.min) / edge).floor().as_ivec3();
    type Beyond = (Bounds, HashMap<IVec3, Cell>);
    let add = |(mut inside, mut cells): Beyond, p: DVec3, radius: f64| {
        if holds(&near, p) {
            inside = inside.with_point(p);
        } else if holds(body, p) {
            let cell = Cell { count: 1, bounds: Bounds::EMPTY.with_point(p), large: radius >= edge };
            cells.entry(grid(p)).and_modify(|known| *known = known.union(cell)).or_insert(cell);
        }
        (inside, cells)
    };
    let join = |a: Beyond, b: Beyond| {
        let mut cells = a.1;
        for (place, cell) in b.1 {
            cells.entry(place).and_modify(|known| *known = known.union(cell)).or_insert(cell);
        }
        (a.0.union(b.0), cells)
    };
    let nothing = || (Bounds::EMPTY, HashMap::new());
    let (mut bounds, mut cells) = places.fold(nothing, add, join);
    let mut apart = 0;
    while let Some(&first) = cells.keys().next() {
        let group = taken(&mut cells, first);
        // A group less than a cell away from the core's surroundings belongs to the core.
        let touches = group.bounds.min.cmple(near.max + edge).all() && group.bounds.max.cmpge(near.min - edge).all();
        let few = group.count <= FEW.min(count / SHARE) || group.bounds.extent() == DVec3::ZERO;
        if few && !touches && !group.large {
            apart += group.count;
        } else {
            bounds = bounds.union(group.bounds);
        }
    }
    (bounds, apart)
}

/// Removes `first` and all cells connected to it, across faces, edges or corners, and returns their
/// union.
fn taken(cells: &mut HashMap<IVec3, Cell>, first: IVec3) -> Cell {
    let mut group = Cell { count: 0, bounds: Bounds::EMPTY, large: false };
    let mut places = vec![first];
    while let Some(place) = places.pop() {
        let Some(cell) = cells.remove(&place) else { continue };
        group = group.union(cell);
        for k in 0..27 {
            places.push(place + IVec3::new(k % 3, k / 3 % 3, k / 9) - 1);
        }
    }
    group
}
