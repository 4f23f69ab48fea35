//! Provenance: the input and point that each surfel comes from, and the input and face of each
//! triangle.

use std::ops::Range;

/// The origin of a scene's surfels: consecutive inputs, each without the points that were left out.
/// A scene that was not read from files has no inputs and counts as one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    inputs: Vec<Input>,
    /// For each surfel, its index before the scene was reordered.
    order: Option<Vec<u32>>,
    /// For each triangle, the number of its mesh and of its face in that mesh.
    faces: Vec<[u32; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
struct Input {
    /// The number of surfels in the inputs before this one.
    first: u64,
    /// Sorted numbers of the points that became no surfel.
    left_out: Vec<u64>,
    /// For each surfel, the number of its point among the points that are kept. None if each of
    /// these points has one surfel.
    numbers: Option<Vec<u32>>,
}

impl Provenance {
    /// Appends an input whose first surfel has the index `first` in the scene.
    ///
    /// `left_out` are the sorted numbers of its points that become no surfel. If a point may become
    /// several surfels, `numbers` has for each surfel the number of its point among the points that
    /// are kept.
    pub fn push(&mut self, first: u64, left_out: Vec<u64>, numbers: Option<Vec<u32>>) {
        self.inputs.push(Input { first, left_out, numbers });
    }

    /// Keeps only the surfels whose flag in `keep` is set; it has one flag per surfel.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        let mut inputs = std::mem::take(&mut self.inputs).into_iter().peekable();
        let mut kept = 0;
        while let Some(Input { first, mut left_out, mut numbers }) = inputs.next() {
            let end = inputs.peek().map_or(keep.len() as u64, |next| next.first);
            let own = &keep[first as usize..end as usize];
            let dropped: Vec<u64> = own.iter().zip(0..).filter(|(keep, _)| !**keep).map(|(_, place)| place).collect();
            match &mut numbers {
                Some(numbers) => {
                    let mut flags = own.iter();
                    numbers.retain(|_| flags.next().copied().unwrap_or(false));
                }
                None => {
                    let of_points: Vec<u64> = dropped.iter().map(|place| number(&left_out, *place)).collect();
                    left_out.extend(of_points);
                    left_out.sort_unstable();
                }
            }
            self.push(kept, left_out, numbers);
            kept += (own.len() - dropped.len()) as u64;
        }
    }

    /// The index range of each input's surfels, without empty ranges. `surfels` is the total
    /// number. A reordered scene has one range for all inputs.
    pub fn ranges(&self, surfels: u64) -> impl Iterator<Item = Range<u64>> {
        let inputs = if self.order.is_some() { &[][..] } else { &self.inputs };
        let firsts = inputs.iter().skip(1).map(|input| input.first);
        let ends = firsts.clone().chain([surfels]);
        [0].into_iter().chain(firsts).zip(ends).map(|(first, end)| first..end).filter(|own| !own.is_empty())
    }

    /// Reorders the surfels: the new surfel k is the old surfel `order[k]`.
    pub(crate) fn reorder(&mut self, order: &[u32]) {
        let before = |index: u32| self.order.as_ref().map_or(index, |before| before[index as usize]);
        self.order = Some(order.iter().map(|&index| before(index)).collect());
    }

    /// The number of the input of surfel `index`, and the number of its point in that input; both
    /// start at 0.
    pub fn of(&self, index: u64) -> (u64, u64) {
        let before = |order: &Vec<u32>| order.get(index as usize).copied().map(u64::from);
        let index = self.order.as_ref().and_then(before).unwrap_or(index);
        let after = self.inputs.partition_point(|input| input.first <= index);
        let Some(input) = after.checked_sub(1).and_then(|input| self.inputs.get(input)) else { return (0, index) };
        let kept = index - input.first;
        let of = input.numbers.as_ref().and_then(|numbers| numbers.get(kept as usize)).map(|&number| number.into());
        (after as u64 - 1, number(&input.left_out, of.unwrap_or(kept)))
    }
}

impl Provenance {
    /// Sets the number of its mesh, and of its face in that mesh, for each triangle of the scene.
    pub(crate) fn set_faces(&mut self, faces: Vec<[u32; 2]>) {
        self.faces = faces;
    }

    /// Replaces the number of each mesh by that of its input.
    pub(crate) fn number_meshes(&mut self, inputs: &[u32]) {
        for [mesh, _] in &mut self.faces {
            *mesh = inputs.get(*mesh as usize).copied().unwrap_or(*mesh);
        }
    }

    /// The number of the input of triangle `index`, and the number of its face in that input; both
    /// start at 0. A triangle that was not read from a file counts as one of input 0.
    pub fn of_triangle(&self, index: u32) -> [u32; 2] {
        self.faces.get(index as usize).copied().unwrap_or([0, index])
    }
}

/// The number of the point with index `kept` (from 0) among the points not in the sorted
/// `left_out`.
fn number(left_out: &[u64], kept: u64) -> u64 {
    // Binary search: `left_out[k] - k` kept points precede the k-th point that is left out.
    let (mut low, mut high) = (0, left_out.len());
    while low < high {
        let middle = low.midpoint(high);
        if left_out[middle] - middle as u64 <= kept { low = middle + 1 } else { high = middle }
    }
    kept + low as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_numbered_as_their_files_hold_them() {
        let mut provenance = Provenance::default();
        assert_eq!(provenance.of(7), (0, 7));
        provenance.push(0, vec![0, 3, 4], None);
        provenance.push(3, vec![], None);
        // An input without surfels.
        provenance.push(5, vec![0, 1], None);
        provenance.push(5, vec![1], None);
        let all: Vec<_> = (0..8).map(|index| provenance.of(index)).collect();
        assert_eq!(all, [(0, 1), (0, 2), (0, 5), (1, 0), (1, 1), (3, 0), (3, 2), (3, 3)]);
    }

    #[test]
    fn points_that_are_dropped_later_are_left_out_too() {
        let mut provenance = Provenance::default();
        provenance.push(0, vec![0, 3, 4], None);
        provenance.push(3, vec![], None);
        provenance.push(5, vec![0, 1], None);
        provenance.push(5, vec![1], None);
        let before: Vec<_> = (0..8).map(|index| provenance.of(index)).collect();
        let keep = [true, false, true, false, true, true, false, true];
        provenance.retain(&keep);
        let kept = before.iter().zip(keep).filter(|(_, keep)| *keep).map(|(point, _)| *point);
        let after: Vec<_> = (0..5).map(|index| provenance.of(index)).collect();
        assert_eq!(after, kept.collect::<Vec<_>>());
    }

    #[test]
    fn numbers_are_those_that_counting_gives() {
        for mask in 0..1u32 << 10 {
            let left_out: Vec<u64> = (0..10).filter(|bit| mask >> bit & 1 == 1).collect();
            let kept = (0..20u64).filter(|n| !left_out.contains(n));
            assert!(kept.enumerate().all(|(k, n)| number(&left_out, k as u64) == n), "{left_out:?}");
        }
    }
}
