//! Relaxation: replaces a selected splat by another candidate that also covers the pieces that no
//! other selected splat covers, until some splats are superfluous.
//!
//! Greedy selection never removes a splat, so late ones fill gaps between early ones and overlap
//! them. Wu and Kobbelt move selected splats in rounds, to where they overlap less. Here the aim is
//! a smaller number: a move must lower the sum, over the selected splats, of the square root of the
//! area that each alone covers. A root is steepest near zero, so such moves shrink the shares of
//! splats that are hardly needed, and a splat that covers nothing alone is removed. Each cell stays
//! covered after each move.

use super::candidates::Candidates;
use super::cells::Cells;
use super::growing::Cover;
use crate::Progress;

/// A move must lower the sum by this fraction of a splat's own share, so that rounding cannot move
/// splats back and forth.
const LEAST_GAIN: f64 = 1e-6;

/// Moves splats for at most `rounds` rounds, or until no move lowers the sum. Each round tries each
/// selected splat once, in the order of candidates. Returns the selected splats, ascending.
pub(super) fn relax(
    cells: &Cells,
    candidates: &Candidates,
    selected: &[u32],
    rounds: u32,
    progress: &dyn Progress,
) -> Vec<u32> {
    let mut state = State::new(cells, candidates, selected);
    progress.begin("relaxing splats", u64::from(rounds) * selected.len() as u64);
    for _ in 0..rounds {
        let mut moved = false;
        let all: Vec<u32> = (0..candidates.splats.len() as u32).filter(|&splat| state.is_selected(splat)).collect();
        for splat in all {
            moved |= state.is_selected(splat) && state.improve(splat);
            progress.advance(1);
        }
        if !moved {
            break;
        }
    }
    progress.end();
    (0..candidates.splats.len() as u32).filter(|&splat| state.is_selected(splat)).collect()
}

struct State<'a> {
    cells: &'a Cells,
    candidates: &'a Candidates,
    /// The candidates that cover some of each cell.
    covering: Inverse,
    selected: Vec<bool>,
    /// For each piece, the number of selected splats that cover it. `joined` is the exclusive or of
    /// their indices: the index itself if there is only one.
    count: Vec<u32>,
    joined: Vec<u32>,
    /// For each splat, the number of pieces that it alone covers. `own_area` is their area.
    own_pieces: Vec<u32>,
    own_area: Vec<f64>,
    /// The pieces of each cell that a replacement must cover; zero between moves.
    needed: Vec<u16>,
}

/// For each cell, the candidates that cover some of it, ascending.
struct Inverse {
    first: Vec<u64>,
    splats: Vec<u32>,
}

impl Inverse {
    fn new(cell_count: usize, candidates: &Candidates) -> Self {
        let mut first = vec![0u64; cell_count + 1];
        let count = candidates.splats.len() as u32;
        for cover in (0..count).flat_map(|splat| candidates.covers(splat)) {
            first[cover.cell as usize + 1] += 1;
        }
        for cell in 0..cell_count {
            first[cell + 1] += first[cell];
        }
        let mut next = first.clone();
        let mut splats = vec![0; candidates.cover_count()];
        for splat in 0..count {
            for cover in candidates.covers(splat) {
                let place = &mut next[cover.cell as usize];
                splats[*place as usize] = splat;
                *place += 1;
            }
        }
        Self { first, splats }
    }

    fn of(&self, cell: u32) -> &[u32] {
        let [first, end] = [cell as usize, cell as usize + 1].map(|i| self.first[i] as usize);
        &self.splats[first..end]
    }
}

/// The indices of the set bits, ascending.
fn bits(mut pieces: u16) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = (pieces != 0).then(|| pieces.trailing_zeros() as usize)?;
        pieces &= pieces - 1;
        Some(lowest)
    })
}

impl<'a> State<'a> {
    fn new(cells: &'a Cells, candidates: &'a Candidates, selected: &[u32]) -> Self {
        let count = candidates.splats.len();
        let mut state = Self {
            cells,
            candidates,
            covering: Inverse::new(cells.radii.len(), candidates),
            selected: vec![false; count],
            count: vec![0; cells.piece_places()],
            joined: vec![0; cells.piece_places()],
            own_pieces: vec![0; count],
            own_area: vec![0.0; count],
            needed: vec![0; cells.radii.len()],
        };
        selected.iter().for_each(|&splat| state.add(splat));
        // The greedy selection may have made some splats superfluous itself.
        for &splat in selected {
            if state.own_pieces[splat as usize] == 0 {
                state.remove(splat);
            }
        }
        state
    }

    fn is_selected(&self, splat: u32) -> bool {
        self.selected[splat as usize]
    }

    /// The index and the area of each piece of a cover.
    fn pieces(&self, cover: &Cover) -> impl Iterator<Item = (usize, f64)> + use<'a> {
        let (cells, cell) = (self.cells, cover.cell);
        bits(cover.pieces).map(move |bit| (cells.first_piece(cell) + bit, cells.area(cell, 1 << bit)))
    }

    fn own(&mut self, splat: u32, gained: i32, area: f64) {
        let pieces = &mut self.own_pieces[splat as usize];
        *pieces = pieces.saturating_add_signed(gained);
        self.own_area[splat as usize] += area;
    }

    fn add(&mut self, splat: u32) {
        self.selected[splat as usize] = true;
        for cover in self.candidates.covers(splat) {
            for (piece, area) in self.pieces(cover) {
                match self.count[piece] {
                    0 => self.own(splat, 1, area),
                    1 => self.own(self.joined[piece], -1, -area),
                    _ => {}
                }
                self.count[piece] += 1;
                self.joined[piece] ^= splat;
            }
        }
    }

    fn remove(&mut self, splat: u32) {
        self.selected[splat as usize] = false;
        for cover in self.candidates.covers(splat) {
            for (piece, area) in self.pieces(cover) {
                self.count[piece] -= 1;
                self.joined[piece] ^= splat;
                if self.count[piece] == 1 {
                    self.own(self.joined[piece], 1, area);
                }
            }
        }
        (self.own_pieces[splat as usize], self.own_area[splat as usize]) = (0, 0.0);
    }

    /// Replaces a selected splat by the candidate that lowers the sum most, if one does, and
    /// removes splats that become superfluous. Returns whether the splat was replaced.
    fn improve(&mut self, splat: u32) -> bool {
        let mut needed: Vec<Cover> = Vec::new();
        for cover in self.candidates.covers(splat) {
            let own = bits(cover.pieces).filter(|bit| self.count[self.cells.first_piece(cover.cell) + bit] == 1);
            let pieces = own.fold(0, |pieces, bit| pieces | 1 << bit);
            if pieces != 0 {
                needed.push(Cover { cell: cover.cell, pieces });
                self.needed[cover.cell as usize] = pieces;
            }
        }
        let rarest = needed.iter().map(|cover| cover.cell).min_by_key(|&cell| (self.covering.of(cell).len(), cell));
        let mut best: Option<(f64, u32)> = None;
        for &other in rarest.map_or(&[][..], |cell| self.covering.of(cell)) {
            if other != splat && self.covers_needed(other, needed.len()) {
                let change = self.change(splat, other);
                if best.is_none_or(|(least, _)| change < least) {
                    best = Some((change, other));
                }
            }
        }
        needed.iter().for_each(|cover| self.needed[cover.cell as usize] = 0);
        let enough = -LEAST_GAIN * self.own_area[splat as usize].max(0.0).sqrt();
        let Some((_, other)) = best.filter(|(change, _)| *change < enough) else { return false };
        self.add(other);
        self.remove(splat);
        let mut idle: Vec<u32> = Vec::new();
        for cover in self.candidates.covers(other) {
            idle.extend(self.covering.of(cover.cell).iter().filter(|&&splat| self.is_idle(splat)));
        }
        idle.sort_unstable();
        idle.dedup();
        for splat in idle {
            // Two splats that cover the same are both idle until one is removed.
            if self.is_idle(splat) {
                self.remove(splat);
            }
        }
        true
    }

    fn is_idle(&self, splat: u32) -> bool {
        self.is_selected(splat) && self.own_pieces[splat as usize] == 0
    }

    fn covers_needed(&self, other: u32, cells: usize) -> bool {
        let met = self.candidates.covers(other).iter().filter(|cover| {
            let needed = self.needed[cover.cell as usize];
            needed != 0 && needed & cover.pieces == needed
        });
        met.count() == cells
    }

    /// The change of the sum of roots if `other`, which covers all that `splat` alone covers, takes
    /// its place.
    fn change(&self, splat: u32, other: u32) -> f64 {
        // The areas that other selected splats gain or lose.
        let mut changes: Vec<(u32, f64)> = Vec::new();
        for cover in self.candidates.covers(splat) {
            for (piece, area) in self.pieces(cover).filter(|(piece, _)| self.count[*piece] == 2) {
                changes.push((self.joined[piece] ^ splat, area));
            }
        }
        let own_covers = self.candidates.covers(splat);
        for cover in self.candidates.covers(other) {
            let shared = own_covers
                .binary_search_by_key(&cover.cell, |own| own.cell)
                .map_or(0, |place| own_covers[place].pieces);
            for bit in bits(cover.pieces) {
                let piece = self.cells.first_piece(cover.cell) + bit;
                let of_splat = shared >> bit & 1 == 1;
                // After the move, one splat besides `other` covers the piece.
                let loses = match self.count[piece] {
                    1 if !of_splat => self.joined[piece],
                    2 if of_splat => self.joined[piece] ^ splat,
                    _ => continue,
                };
                changes.push((loses, -self.cells.area(cover.cell, 1 << bit)));
            }
        }
        changes.sort_by_key(|change| change.0);
        let root = |area: f64| area.max(0.0).sqrt();
        changes
            .chunk_by(|a, b| a.0 == b.0)
            .map(|of_one| {
                let before = self.own_area[of_one[0].0 as usize];
                let after = before + of_one.iter().map(|change| change.1).sum::<f64>();
                // Rounding leaves a small rest of an area that vanishes.
                root(if after < 1e-9 * before { 0.0 } else { after }) - root(before)
            })
            .sum()
    }
}
