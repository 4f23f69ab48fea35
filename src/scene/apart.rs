//! What the default view shows: the body of a scene without the few points that lie apart from it.
//!
//! The body leaves out what is so far away that nothing else would show. A bird or a reflection at two extents of a scan spoils no
//! coordinate, but shrinks the rest to a third of the picture.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use super::Bounds;
use super::body::Places;

/// Two groups of points are one if they are nearer to each other than this part of the core's longest edge; farther than twice that,
/// they are apart.
const APART: f64 = 0.125;

/// A group apart is left out if it has at most this many points,
const FEW: u64 = 16;

/// and at most one in so many of all.
const SHARE: u64 = 1000;

/// Of points in one cell of the grid: how many, their box, and whether a disk of them is as large as a cell.
#[derive(Clone, Copy)]
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

/// The box of those points in `body` that are not apart, and how many are: a group of at most [`FEW`] different points,
/// and one in [`SHARE`] of all, that lies apart from `core` and from all others, and whose disks do not bridge that. It depends on the set of points alone.
pub(super) fn without_apart((core, body): (&Bounds, &Bounds), places: &impl Places) -> (Bounds, u64) {
    let edge = APART * core.extent().max_element();
    let near = Bounds { min: core.min - 2.0 * edge, max: core.max + 2.0 * edge };
    let holds = |bounds: &Bounds, p: DVec3| p.cmpge(bounds.min).all() && p.cmple(bounds.max).all();
    let count = places.count() as u64;
    if count < SHARE || holds(&near, body.min) && holds(&near, body.max) {
        return (*body, 0);
    }
    // What is near the core is of it; the grid is of what is beyond.
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
        // A gap of less than a cell to the core's surroundings is none.
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

/// Takes the cells that hang together with `first`: each borders on another of them.
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
