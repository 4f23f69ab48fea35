//! Reads the part of a file with levels of detail that a picture needs. The part is a scene whose
//! picture equals that of the whole file to the bit.
//!
//! The tree is read from the root down, level by level: the children or surfels of a node are read
//! if the picture may need them. Other nodes become leaves without surfels, so the part is a tree,
//! too, from which the same nodes are drawn.

use std::ops::Range;
use std::sync::Arc;

use super::complete;
use crate::io::Points;
use crate::io::ply::Levels;
use crate::scene::Scene;
use crate::scene::hierarchy::{DEEPEST, FAN_OUT, Hierarchy, Node};
use crate::scene::whole::LevelFacts;
use crate::{Progress, Result};

/// The number of nodes or points that are read at once, which bounds the memory for decoding. While
/// a block of nodes is decoded, the next block is read and the previous one is appended, so nodes
/// take three times as much.
const BLOCK: u32 = 1 << 16;

/// The size of a part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// The number of nodes.
    pub nodes: u64,
    /// The number of surfels.
    pub surfels: u64,
    /// The size of both in the file, bytes.
    pub bytes: u64,
}

/// A scene without surfels, with the facts that the file states about all its surfels.
pub fn nothing(levels: &Levels) -> Scene {
    let whole = levels.whole;
    let oriented = !levels.unsided;
    Scene {
        origin: whole.origin,
        oriented,
        closed: levels.closed && oriented,
        up: levels.up.unwrap_or_default(),
        part_of: Some(Box::new(whole)),
        ..Scene::default()
    }
}

/// Reads the part of a file that holds the surfels and children of those nodes for which
/// `may_be_divided` returns true. Returns its scene and its size.
///
/// `may_be_divided` is called with a tree of nodes, relative to the file's origin, and the index of
/// one of them.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) and [`Error::Malformed`](crate::Error::Malformed) of the
/// file, and any error of `fits`, which is called with the size of the part so far.
pub fn part(
    levels: &Levels,
    may_be_divided: impl Fn(&Hierarchy, u32) -> bool + Sync,
    fits: impl Fn(&Taken) -> Result<()> + Sync,
    progress: &dyn Progress,
) -> Result<(Scene, Taken)> {
    progress.begin("reading levels of detail", 0);
    let grown = grown(levels, may_be_divided, fits, progress);
    progress.end();
    let (mut tree, taken, facts) = grown?;
    let numbers = in_order(&mut tree)
        .ok_or_else(|| levels.malformed("the points of its levels of detail do not follow each other"))?;
    progress.begin("reading surfels", taken.surfels);
    let scene = scene(levels, &numbers, (tree, facts), progress);
    progress.end();
    Ok((scene?, taken))
}

/// Reads the surfels of a file with these indices, without the tree over them. The scene has the
/// facts that the file states about all surfels.
///
/// # Errors
///
/// As [`part`].
pub fn surfels(levels: &Levels, numbers: &[Range<u32>], progress: &dyn Progress) -> Result<Scene> {
    progress.begin("reading surfels", numbers.iter().map(|own| own.len() as u64).sum());
    let nodes = (Hierarchy::default(), LevelFacts::default());
    let scene = scene(levels, numbers, nodes, progress);
    progress.end();
    Ok(Scene { hierarchy: None, ..scene? })
}

/// Reads the nodes of a part, whose leaves hold the indices of surfels in the file. Returns the
/// nodes, the size of the part, and the facts about all nodes of the part.
fn grown(
    levels: &Levels,
    may_be_divided: impl Fn(&Hierarchy, u32) -> bool + Sync,
    fits: impl Fn(&Taken) -> Result<()> + Sync,
    progress: &dyn Progress,
) -> Result<(Hierarchy, Taken, LevelFacts)> {
    let judged = |nodes: Hierarchy| {
        let divided: Vec<bool> = (0..nodes.nodes.len() as u32).map(|index| may_be_divided(&nodes, index)).collect();
        let facts = LevelFacts::of(&nodes);
        (nodes, divided, facts)
    };
    let (mut tree, mut taken) = (Hierarchy::default(), Taken { nodes: 0, surfels: 0, bytes: 0 });
    let mut facts = LevelFacts::default();
    // The indices in the file of a level's nodes, ascending.
    let mut numbers: Vec<Range<u32>> = std::iter::once(0..1).collect();
    for _ in 0..=DEEPEST {
        let Some(last) = numbers.last() else { break };
        let place = tree.nodes.len() + numbers.iter().map(Range::len).sum::<usize>();
        let mut below = Below { numbers: Vec::new(), reached: last.end, place: place as u32, surfels: 0 };
        let append = |parts: Vec<(Hierarchy, Vec<bool>, LevelFacts)>| {
            for (nodes, divided, of_part) in parts {
                facts = facts.both(of_part);
                progress.advance(divided.len() as u64);
                taken.nodes += divided.len() as u64;
                let added = below.append(&mut tree, nodes, &divided);
                added.ok_or_else(|| levels.malformed("its levels of detail (element node) are no tree"))?;
            }
            fits(&Taken { surfels: taken.surfels + below.surfels, ..taken })
        };
        in_blocks(levels, &numbers, judged, append)?;
        taken.surfels += below.surfels;
        numbers = below.numbers;
    }
    if !numbers.is_empty() {
        return Err(levels.malformed("its levels of detail (element node) are no tree: it is too deep"));
    }
    taken.bytes = levels.bytes(taken.surfels, taken.nodes);
    Ok((tree, taken, facts))
}

/// Reads the nodes with these indices block by block and passes what `made` returns for them to
/// `append`. While a block is decoded, the previous one is appended and the next one is read.
fn in_blocks<T: Send>(
    levels: &Levels,
    numbers: &[Range<u32>],
    made: impl Fn(Hierarchy) -> T + Sync,
    mut append: impl FnMut(Vec<T>) -> Result<()> + Send,
) -> Result<()> {
    let blocks = blocks(numbers);
    let mut next = blocks.iter();
    let mut read_next = |rows: &mut Vec<u8>| next.next().map_or(Ok(()), |block| levels.read_nodes(block, rows));
    let (mut rows, mut next_rows, mut decoded) = (Vec::new(), Vec::new(), Vec::new());
    read_next(&mut rows)?;
    for _ in &blocks {
        let before = std::mem::take(&mut decoded);
        let others = || append(before).and_then(|()| read_next(&mut next_rows));
        let (these, others) = rayon::join(|| levels.nodes(&rows, &made), others);
        others?;
        decoded = these?;
        std::mem::swap(&mut rows, &mut next_rows);
    }
    append(decoded)
}

/// The level below the current one.
struct Below {
    /// The indices in the file of the children of divided nodes.
    numbers: Vec<Range<u32>>,
    /// The indices of further children are at least this.
    reached: u32,
    /// The index that the next child gets in the part.
    place: u32,
    /// The number of surfels of the divided leaves.
    surfels: u64,
}

impl Below {
    /// Appends nodes of the current level to the tree. Nodes that are not divided become leaves
    /// without surfels. Returns None if the nodes do not form a tree.
    fn append(&mut self, tree: &mut Hierarchy, nodes: Hierarchy, divided: &[bool]) -> Option<()> {
        for (node, divided) in nodes.nodes.into_iter().zip(divided) {
            if node.count == 0 || (!node.leaf && node.count as usize > FAN_OUT) {
                return None;
            }
            tree.nodes.push(match (divided, node.leaf) {
                (false, _) => Node { first: 0, count: 0, leaf: true, ..node },
                (true, true) => {
                    self.surfels += u64::from(node.count);
                    node
                }
                (true, false) if node.first < self.reached => return None,
                (true, false) => {
                    self.reached = node.first.checked_add(node.count)?;
                    push(&mut self.numbers, node.first..self.reached);
                    let first = self.place;
                    self.place += node.count;
                    Node { first, ..node }
                }
            });
        }
        tree.low.extend(nodes.low);
        Some(())
    }
}

/// Divides ranges into blocks of [`BLOCK`] indices; the last block may have fewer.
fn blocks(ranges: &[Range<u32>]) -> Vec<Vec<Range<u32>>> {
    let (mut all, mut room) = (Vec::new(), 0);
    for range in ranges {
        let mut rest = range.clone();
        while !rest.is_empty() {
            if room == 0 {
                all.push(Vec::new());
                room = BLOCK;
            }
            let next = rest.start..rest.end.min(rest.start.saturating_add(room));
            (room, rest.start) = (room - next.len() as u32, next.end);
            all.last_mut().into_iter().for_each(|block| block.push(next.clone()));
        }
    }
    all
}

/// Appends a range, and merges it with the last one if they are adjacent.
fn push(ranges: &mut Vec<Range<u32>>, next: Range<u32>) {
    match ranges.last_mut() {
        Some(last) if last.end == next.start => last.end = next.end,
        _ => ranges.push(next),
    }
}

/// Returns the indices in the file of the leaves' surfels from left to right, and replaces them in
/// the leaves by indices in the part. None if the indices in the file do not ascend.
fn in_order(tree: &mut Hierarchy) -> Option<Vec<Range<u32>>> {
    let (mut all, mut reached, mut held) = (Vec::new(), 0, 0);
    let mut open = vec![0];
    while let Some(index) = open.pop() {
        let node: &mut Node = &mut tree.nodes[index as usize];
        let own = node.first..node.first.checked_add(node.count)?;
        if !node.leaf {
            // Children have larger indices than their parent, so the loop ends.
            open.extend(own.rev());
            continue;
        }
        if !own.is_empty() {
            if own.start < reached {
                return None;
            }
            reached = own.end;
            push(&mut all, own);
        }
        // Ascending ranges have fewer than 2^32 indices together.
        (node.first, held) = (held, held + node.count);
    }
    Some(all)
}

/// Reads the surfels with these indices and builds the scene with the tree over them.
fn scene(
    levels: &Levels,
    numbers: &[Range<u32>],
    (mut tree, facts): (Hierarchy, LevelFacts),
    progress: &dyn Progress,
) -> Result<Scene> {
    let whole = levels.whole;
    let empty = Scene { part_of: None, colors: levels.no_colors(), ..nothing(levels) };
    let mut scene = empty.clone();
    let made = |points: Points| {
        let (mut scene, count) = (empty.clone(), points.positions.len());
        complete::add(&mut scene, vec![points], whole.has)
            .filter(|added| added.positions.len() == count)
            .ok_or("a point of its levels of detail has no valid position or no half-axes")?;
        progress.advance(count as u64);
        Ok(scene)
    };
    for block in blocks(numbers) {
        levels.points(&block, made)?.into_iter().for_each(|part| complete::append(&mut scene, part));
    }
    tree.settle(&scene.surfels, &scene.low);
    scene.hierarchy = Some(Arc::new(tree));
    if !whole.holds(&scene, facts) {
        return Err(levels.malformed("its element 'scene' does not cover all of its points and nodes"));
    }
    Ok(Scene { part_of: Some(Box::new(whole)), ..scene })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Cap, Surfel};

    /// Rejects leaves that share points, whatever count they state.
    #[test]
    fn points_follow_each_other() {
        let node = |leaf: bool, first: u32, count: u32| {
            let surfel = Surfel { center: [0.0; 3], s: [1.0, 0.0, 0.0], t: [0.0, 1.0, 0.0] };
            Node { surfel, cap: Cap::FLAT, color: [1.0; 4], radius: 1.0, cone: 1.0, first, count, leaf }
        };
        let of = |one: (u32, u32), other: (u32, u32)| {
            let leaf = |(first, count): (u32, u32)| node(true, first, count);
            let nodes = vec![node(false, 1, 3), leaf(one), node(true, 0, 0), leaf(other)];
            let mut tree = Hierarchy { nodes, low: Vec::new() };
            in_order(&mut tree).map(|ranges| (ranges, tree.nodes[3].first))
        };
        assert_eq!(of((4, 2), (9, 3)), Some((vec![4..6, 9..12], 2)));
        assert_eq!(of((4, 2), (6, 3)), Some((std::iter::once(4..9).collect(), 2)));
        assert_eq!(of((4, 2), (5, 3)), None);
        assert_eq!(of((0, u32::MAX), (5, 10)), None);
        assert_eq!(of((4, 2), (u32::MAX, 2)), None);
    }

    #[test]
    fn blocks_have_all_numbers_once() {
        for ranges in [
            vec![],
            std::iter::once(3..4).collect(),
            vec![0..BLOCK, BLOCK + 9..BLOCK + 12],
            vec![5..3 * BLOCK + 1, u32::MAX - 3..u32::MAX],
        ] {
            let blocks = blocks(&ranges);
            assert!(blocks.iter().flatten().cloned().flatten().eq(ranges.iter().cloned().flatten()));
            let counts: Vec<usize> = blocks.iter().map(|block| block.iter().map(Range::len).sum()).collect();
            assert!(counts.iter().rev().skip(1).all(|count| *count == BLOCK as usize), "{counts:?}");
            assert!(counts.last().is_none_or(|count| (1..=BLOCK as usize).contains(count)), "{counts:?}");
        }
    }
}
