//! The octree: sets of points that are divided at their mean (Pajarola 2003, section 3.2).

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;

use super::lattice::Lattice;
use crate::scene::Bounds;
use crate::scene::hierarchy::{DEEPEST, FAN_OUT};

/// A set of more than [`FAN_OUT`] points that spans fewer lattice steps than this gets a finer
/// lattice of its own. So the mean has five digits within the set, however far some points stray
/// from the body of the scene.
pub(super) const FEWEST_STEPS: i64 = 1 << 16;

/// The box and the sum of a set of more points than this are computed by all threads.
const MANY: usize = 1 << 16;

/// A point of the octree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Element {
    /// The point's lattice coordinates, called its place, on the lattice of the smallest set that
    /// contains it.
    pub place: [i32; 3],
    /// The index of its surfel.
    pub index: u32,
}

/// A set of points, contiguous in the order of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Set {
    pub first: u32,
    pub end: u32,
    /// The index of its lattice in [`Octree::lattices`].
    pub lattice: u32,
    /// The index of the first child set, and the number of child sets: 0 for a leaf.
    pub first_child: u32,
    pub children: u32,
}

impl Set {
    pub fn is_leaf(&self) -> bool {
        self.children == 0
    }

    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..self.end as usize
    }
}

/// The tree: all sets, level by level from the root.
pub(super) struct Octree {
    pub sets: Vec<Set>,
    /// The index of the first set of each level, and the number of sets.
    pub levels: Vec<usize>,
    pub lattices: Vec<Lattice>,
}

/// Compacts the places of points, three numbers each, within the memory of the points.
pub(super) fn places(elements: Vec<Element>) -> Vec<i32> {
    let count = elements.len();
    let mut places: Vec<i32> = bytemuck::cast_vec(elements);
    (0..count).for_each(|k| places.copy_within(4 * k..4 * k + 3, 3 * k));
    places.truncate(3 * count);
    places.shrink_to_fit();
    places
}

/// How a set is divided.
struct Divided {
    /// A finer lattice for the set, if it gets one.
    lattice: Option<Lattice>,
    /// The number of points in each octant; None for a leaf.
    counts: Option<[u32; 8]>,
}

impl Octree {
    /// Builds the tree of `count` points, fewer than 2^32, at `position`. Returns it with the
    /// points in the order of the leaves.
    ///
    /// The sets depend on the positions alone. `told` is called with the number of points of each
    /// leaf.
    pub fn grow(count: u32, position: impl Fn(u32) -> DVec3 + Sync, told: impl Fn(u64)) -> (Self, Vec<Element>) {
        let bounds = Bounds::of((0..count).into_par_iter().with_min_len(4096).map(&position));
        Self::grow_below((Lattice::over(&bounds), 0), count, position, told)
    }

    /// As [`Self::grow`], for a set that lies `depth` levels below the root and whose places are on
    /// the lattice `root`.
    pub fn grow_below(
        (root, depth): (Lattice, usize),
        count: u32,
        position: impl Fn(u32) -> DVec3 + Sync,
        told: impl Fn(u64),
    ) -> (Self, Vec<Element>) {
        let element = |index: u32| Element { place: root.place(position(index)), index };
        let mut elements: Vec<Element> = (0..count).into_par_iter().with_min_len(4096).map(element).collect();
        let all = Set { first: 0, end: count, lattice: 0, first_child: 0, children: 0 };
        let mut tree = Self { sets: vec![all], levels: vec![0, 1], lattices: vec![root] };
        while tree.divide_level(depth, &mut elements, &position, &told) {}
        (tree, elements)
    }

    /// Divides the sets of the last level of a tree whose first set has this depth. Returns whether
    /// there is a further level.
    fn divide_level(
        &mut self,
        depth: usize,
        elements: &mut [Element],
        position: &(impl Fn(u32) -> DVec3 + Sync),
        told: &impl Fn(u64),
    ) -> bool {
        let [.., begin, end] = self.levels[..] else { return false };
        // The sets of the deepest level are leaves.
        let deepest = depth + self.levels.len() - 2 == DEEPEST;
        let level = &self.sets[begin..end];
        let mut slices = Vec::with_capacity(level.len());
        let (mut rest, mut at) = (elements, 0);
        for set in level {
            let (own, after) = rest.split_at_mut(set.first as usize - at).1.split_at_mut(set.range().len());
            (rest, at) = (after, set.end as usize);
            slices.push(own);
        }
        let divided: Vec<Divided> = slices.into_par_iter().map(|own| divided(own, deepest, position)).collect();
        for (index, Divided { lattice, counts }) in (begin..end).zip(divided) {
            let mut set = self.sets[index];
            if let Some(lattice) = lattice {
                set.lattice = self.lattices.len() as u32;
                self.lattices.push(lattice);
            }
            if let Some(counts) = counts {
                set.first_child = self.sets.len() as u32;
                let mut first = set.first;
                for count in counts.into_iter().filter(|count| *count > 0) {
                    self.sets.push(Set {
                        first,
                        end: first + count,
                        lattice: set.lattice,
                        first_child: 0,
                        children: 0,
                    });
                    first += count;
                    set.children += 1;
                }
            } else {
                told(u64::from(set.end - set.first));
            }
            self.sets[index] = set;
        }
        let more = self.sets.len() > end;
        if more {
            self.levels.push(self.sets.len());
        }
        more
    }
}

/// Groups the points of a set by octant, unless it is a leaf.
fn divided(own: &mut [Element], deepest: bool, position: &(impl Fn(u32) -> DVec3 + Sync)) -> Divided {
    let mut lattice = None;
    let mut extent = extent(own);
    if extent < FEWEST_STEPS && own.len() > FAN_OUT {
        let bounds = Bounds::of(own.par_iter().with_min_len(4096).map(|element| position(element.index)));
        let finer = Lattice::over(&bounds);
        own.par_iter_mut().with_min_len(4096).for_each(|element| element.place = finer.place(position(element.index)));
        lattice = Some(finer);
        extent = self::extent(own);
    }
    if own.len() <= FAN_OUT || extent == 0 || deepest {
        return Divided { lattice, counts: None };
    }
    let sum = sum(own);
    let count = own.len() as i64;
    let octant = |element: &Element| octant(element.place, count, sum);
    Divided { lattice, counts: Some(put_together(own, octant)) }
}

/// The octant of a place in a set of `count` points whose places add up to `sum`, one bit per axis.
///
/// Bit k is set if `count q_k > Σ q_k`, which is exact. A coordinate at the mean gets the bit 0, so
/// a set of different places always has at least two octants.
pub(super) fn octant(place: [i32; 3], count: i64, sum: [i64; 3]) -> usize {
    (0..3).fold(0, |octant, k| octant | usize::from(count * i64::from(place[k]) > sum[k]) << k)
}

/// The longest side of the box around a set, lattice steps.
fn extent(own: &[Element]) -> i64 {
    let nothing = || ([i32::MAX; 3], [i32::MIN; 3]);
    let both = |a: ([i32; 3], [i32; 3]), b: ([i32; 3], [i32; 3])| {
        (std::array::from_fn(|k| a.0[k].min(b.0[k])), std::array::from_fn(|k| a.1[k].max(b.1[k])))
    };
    let box_of =
        |part: &[Element]| part.iter().fold(nothing(), |all, element| both(all, (element.place, element.place)));
    let (low, high) =
        if own.len() > MANY { own.par_chunks(MANY).map(box_of).reduce(nothing, both) } else { box_of(own) };
    (0..3).map(|k| i64::from(high[k]) - i64::from(low[k])).max().unwrap_or(0)
}

/// The sum of the places of a set.
fn sum(own: &[Element]) -> [i64; 3] {
    let both = |a: [i64; 3], b: [i64; 3]| std::array::from_fn(|k| a[k] + b[k]);
    let of = |part: &[Element]| part.iter().fold([0; 3], |all, element| both(all, element.place.map(i64::from)));
    if own.len() > MANY { own.par_chunks(MANY).map(of).reduce(|| [0; 3], both) } else { of(own) }
}

/// Sorts the points of a set by octant, in place, and returns how many each octant has. Points
/// within an octant are in no particular order.
fn put_together(own: &mut [Element], octant: impl Fn(&Element) -> usize) -> [u32; 8] {
    let mut counts = [0; 8];
    own.iter().for_each(|element| counts[octant(element)] += 1);
    let mut next = [0; 8];
    let mut ends = [0; 8];
    let mut end = 0;
    for k in 0..8 {
        next[k] = end;
        end += counts[k] as usize;
        ends[k] = end;
    }
    for k in 0..8 {
        while next[k] < ends[k] {
            // Each swap moves one point to its octant, so this loop ends.
            let of = octant(&own[next[k]]);
            own.swap(next[k], next[of]);
            next[of] += 1;
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn positions(count: usize, spread: f64) -> Vec<DVec3> {
        let mut random = Random::stream(11, 0);
        (0..count).map(|_| DVec3::from_array(std::array::from_fn(|_| spread * random.number()))).collect()
    }

    fn grown(points: &[DVec3]) -> (Octree, Vec<Element>) {
        Octree::grow(points.len() as u32, |index| points[index as usize], |_| ())
    }

    /// The number of sets of a plain recursive division in f64, by definition.
    fn plain(points: Vec<DVec3>) -> usize {
        if points.len() <= FAN_OUT || points.iter().all(|point| *point == points[0]) {
            return 1;
        }
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        let octant = |point: &DVec3| point.cmpgt(mean).bitmask();
        1 + (0..8)
            .map(|of| points.iter().copied().filter(|point| octant(point) == of).collect::<Vec<_>>())
            .filter(|part| !part.is_empty())
            .map(plain)
            .sum::<usize>()
    }

    #[test]
    fn sets_are_those_of_a_plain_division() {
        for (count, copies) in [(1, 1), (8, 1), (9, 1), (5000, 1), (700, 12)] {
            let points: Vec<DVec3> = positions(count, 3.0).into_iter().flat_map(|point| vec![point; copies]).collect();
            let (tree, elements) = grown(&points);
            assert_eq!(tree.sets.len(), plain(points.clone()), "{count} x {copies}");
            let mut leaves: Vec<&Set> = tree.sets.iter().filter(|set| set.is_leaf()).collect();
            leaves.sort_by_key(|set| set.first);
            assert!(leaves.windows(2).all(|two| two[0].end == two[1].first));
            assert_eq!((leaves[0].first, leaves[leaves.len() - 1].end as usize), (0, points.len()));
            let mut seen: Vec<u32> = elements.iter().map(|element| element.index).collect();
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..points.len() as u32));
            let of_elements: Vec<i32> = elements.iter().flat_map(|element| element.place).collect();
            assert_eq!(places(elements), of_elements);
        }
    }

    #[test]
    fn points_that_stray_cost_others_no_digits() {
        let near = positions(3000, 1.0);
        let with_stray: Vec<DVec3> = near.iter().copied().chain([DVec3::splat(1e17)]).collect();
        let ((tree, _), (alone, _)) = (grown(&with_stray), grown(&near));
        assert_eq!(tree.sets.len(), alone.sets.len() + 2);
        // Nested clusters stay within the deepest level; points that no lattice separates are one
        // leaf.
        let nested: Vec<DVec3> = (0..400).map(|k| DVec3::splat(0.5f64.powi(k))).collect();
        let (tree, _) = grown(&nested);
        assert!(tree.levels.len() <= DEEPEST + 2);
        let (equal, _) = grown(&vec![DVec3::splat(0.3); 100]);
        assert_eq!((equal.sets.len(), equal.levels.len()), (1, 2));
    }

    #[test]
    fn any_order_gives_the_same_sets() {
        let points = positions(4000, 2.0);
        let turned: Vec<DVec3> = points.iter().rev().copied().collect();
        let (one, other) = (grown(&points), grown(&turned));
        assert_eq!(one.0.sets, other.0.sets);
        for set in one.0.sets.iter().filter(|set| set.is_leaf()) {
            let own = |(_, elements): &(Octree, Vec<Element>), flip: bool| {
                let number = |e: &Element| if flip { points.len() as u32 - 1 - e.index } else { e.index };
                let mut all: Vec<u32> = elements[set.range()].iter().map(number).collect();
                all.sort_unstable();
                all
            };
            assert_eq!(own(&one, false), own(&other, true));
        }
    }
}
