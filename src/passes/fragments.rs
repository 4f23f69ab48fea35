//! Stages 2 and 3 where surfaces show through each other ([`Composite`](crate::scene::Composite)):
//! makes a list of each pixel's fragments, from front to back, which [`layers`](super::layers) or
//! [`sorted`](super::sorted) composite.
//!
//! The visibility pass counts the fragments of each pixel, a prefix sum turns the counts into list
//! starts, and the attribute pass stores every fragment's depth, weight and attributes in its list.
//! Then each list is sorted, so later passes do not depend on the order in which fragments were
//! stored. Where the order of fragments at one depth is visible, they are in the order of their
//! surfels ([`order`](super::order)).
//!
//! **Memory.** The number of fragments is read before any is stored. If a band has more fragments
//! than a buffer holds, the counts of its rows say where to cut it into bands that fit, and the
//! frame begins again. No fragment is left out. Lists that are too long for one invocation are
//! sorted and composited in rounds ([`long_lists`](super::long_lists)).

use glam::DVec3;

use super::accumulate::{decision, terms_file};
use super::footprint::footprint;
use super::{Strip, attributes};
use crate::gpu::layout::TILE;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Look, Over, Part, Run, Stage, Step};
use crate::plan::{Band, FragmentLayout, Lists, Plan};
use crate::scene::kernel::LEAST_WEIGHT;

/// A fragment of the f64 twin.
#[derive(Clone, Copy, Debug)]
pub struct Fragment {
    /// The index of its surfel.
    pub surfel: u32,
    /// Camera-space z, world units.
    pub depth: f64,
    /// Whether it shows the back of a two-sided surface.
    pub back: bool,
    /// The shorter half-axis of its surfel, world units.
    pub radius: f64,
    /// The kernel's weight, times the low-pass's gain and the fade.
    pub weight: f64,
    /// Premultiplied linear colour, lit if splats are lit.
    pub color: [f64; 4],
    /// World space, unit length, turned toward the viewer.
    pub normal: DVec3,
    /// The rank of its surfel in the [`order`](super::order).
    pub rank: u32,
}

/// The fragments of a pixel.
#[derive(Clone, Debug)]
pub struct List {
    /// From front to back.
    pub fragments: Vec<Fragment>,
    /// The smallest relative distance to a decision of a fragment, or of a footprint that narrowly
    /// missed being one.
    pub decision: f64,
}

/// The f64 twin: the lists of the pixels of `strip`.
pub fn reference(strip: &Strip<'_>) -> Vec<List> {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let nothing = List { fragments: Vec::new(), decision: f64::INFINITY };
    let mut lists = vec![nothing; camera.width as usize * rows as usize];
    for splat in &strip.splats {
        let surfel = splat.surfel as usize;
        let color = attributes::color(scene, splat, camera, options);
        let radius = f64::from(scene.surfels[surfel].shorter());
        let rank = strip.ranks.map_or(0, |ranks| ranks[surfel]);
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            for x in splat.first[0]..=splat.last[0] {
                let Some((at, gain)) = footprint(splat, camera, options.low_pass, x, y) else { continue };
                let list = &mut lists[((y - first_row) * camera.width + x) as usize];
                list.decision = list.decision.min(decision(at, f64::INFINITY, camera.near));
                if at.hit(camera) {
                    let weight = (gain * options.weight(at.rho2)).max(LEAST_WEIGHT);
                    let (depth, back, normal) = (at.depth, splat.shows_back(&at), splat.normal_at(&at));
                    list.fragments.push(Fragment {
                        surfel: splat.surfel,
                        depth,
                        back,
                        radius,
                        weight,
                        color,
                        normal,
                        rank,
                    });
                }
            }
        }
    }
    for list in &mut lists {
        // At equal depth the front comes before the back.
        let key = |f: &Fragment| (f.depth, f.back, f.rank);
        list.fragments.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap_or(std::cmp::Ordering::Equal));
    }
    lists
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "fragments",
    files: |needs| {
        let ties = match needs.surface.lists() {
            None => return Vec::new(),
            Some(Lists::Layers) => "fragments_untied.wgsl",
            Some(Lists::Sorted) => "fragments_ranked.wgsl",
        };
        // With veils, fragments_veils.wgsl counts.
        let count = (!needs.surface.veils()).then_some("fragments_count.wgsl");
        let sort = ["fragments_sort.wgsl", "fragments_network.wgsl", ties];
        let all = ["fragments.wgsl", "compositing.wgsl", "layer_sums.wgsl"].into_iter().chain(sort);
        all.chain(count).chain([terms_file(needs)]).collect()
    },
    kernels: |needs| match needs.surface.lists() {
        None => Vec::new(),
        Some(_) => vec![OF_ROWS, START_ROWS, START_PIXELS, LIST, LIST_LARGE, SORT],
    },
    constants: |making| {
        let layout = FragmentLayout::of(making.needs);
        vec![
            ("FRAGMENT_ROWS", (layout.words / 4).into()),
            ("FRAGMENT_HAS_NORMAL", u32::from(making.needs.normal).into()),
            ("FRAGMENT_HAS_RADIUS", u32::from(layout.has_radius).into()),
            ("FRAGMENT_RANK", layout.rank.into()),
            ("FRAGMENT_COLOR", layout.color.into()),
            ("FRAGMENT_COLORS", layout.colors.into()),
            ("FRAGMENT_NORMAL", layout.normal.into()),
            ("FRAGMENT_RADIUS", layout.radius.into()),
        ]
    },
};

const OF_ROWS: Kernel = Kernel::new("fragments_of_rows");
const START_ROWS: Kernel = Kernel::of("start_rows", [1; 3]);
const START_PIXELS: Kernel = Kernel::new("start_pixels");
const LIST: Kernel = Kernel::new("list_fragments");
const LIST_LARGE: Kernel = Kernel::of("list_fragments_large", [TILE, TILE, 1]);
const SORT: Kernel = Kernel::new("sort_fragments");

/// The number of words of the buffer of list starts.
///
/// The buffer holds the total number of fragments and the most at one pixel; the start of each
/// row's lists and the end of the last row's; the same per pixel; and for each pixel the step of
/// depth at which its list ends ([`veils`](super::veils)).
pub fn start_words(band: &Band) -> u64 {
    2 + u64::from(band.rows) + 1 + band.pixels + 1 + band.pixels
}

/// The words of that buffer that hold the start of each of `pixels` lists and the end of the last.
pub fn pixel_starts(rows: u32, pixels: u64) -> std::ops::Range<u64> {
    let first = 2 + u64::from(rows) + 1;
    first..first + pixels + 1
}

/// The steps that compute where lists start, from the visibility pass's counts, and read how many
/// fragments there are.
pub fn starts(band: usize) -> [Step; 2] {
    let run = |kernel, over| Run { kernel, over };
    let runs = vec![run(OF_ROWS, Over::Rows), run(START_ROWS, Over::Once), run(START_PIXELS, Over::Rows)];
    [Step::Stage(Stage::new("bin", band, runs)), Step::Look(Look::Fragments(band))]
}

/// The stages that store the fragments in their lists, and that sort the lists.
pub fn steps(band: usize) -> [Stage; 2] {
    let run = |kernel, over| Run { kernel, over };
    let list = vec![run(LIST, Over::Slots(Part::All)), run(LIST_LARGE, Over::Large)];
    [Stage::new("accumulate", band, list), Stage::new("sort", band, vec![run(SORT, Over::Pixels)])]
}

/// Cuts a `band` with more fragments than the `most` that a buffer holds, and returns all bands of
/// the view after the cut.
///
/// `starts` are those of the band's rows of samples. The band is cut before the row of pixels with
/// which a piece would exceed `most`. Later bands get as many rows as the smallest piece, not
/// counting the last piece. Returns `None` if a single row of pixels exceeds `most`.
pub fn cut(plan: &Plan, band: usize, starts: &[u64], most: u64) -> Option<Vec<Band>> {
    let whole = plan.needs.samples.down as usize;
    let mut rows = Vec::new();
    let mut first = 0;
    let ends: Vec<usize> = (1..starts.len()).filter(|end| end % whole == 0 || end + 1 == starts.len()).collect();
    for pair in ends.windows(2) {
        if starts[pair[1]] - starts[first] > most {
            rows.push(pair[0] - first);
            first = pair[0];
        }
    }
    rows.push(starts.len() - 1 - first);
    let (mut at, mut fits) = (0, true);
    for of_cut in &rows {
        fits &= *of_cut > 0 && starts[at + of_cut] - starts[at] <= most;
        at += of_cut;
    }
    // The last piece is a remainder, so it does not count.
    let full = &rows[..rows.len().saturating_sub(1).max(1)];
    let least = full.iter().copied().min().filter(|_| fits)?.max(whole) as u32;
    let mut bands = plan.bands[..band].to_vec();
    let mut next = plan.bands[band].first;
    for of_cut in rows {
        bands.push(Band::of(plan.width, next, of_cut as u32));
        next += of_cut as u32;
    }
    let last = plan.bands.last()?;
    while next < last.first + last.rows {
        let of_cut = least.min(last.first + last.rows - next);
        bands.push(Band::of(plan.width, next, of_cut));
        next += of_cut;
    }
    Some(bands)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::gpu::sources::FILES;

    /// The comparators of the network that sorts sixteen keys, parsed from its WGSL.
    fn network(text: &str) -> Vec<[usize; 2]> {
        let number = |part: &str| part.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap();
        let pair = |line: &str| {
            let (_, keys) = line.split_once("ordered(k")?;
            let (a, b) = keys.split_once(", k")?;
            assert!(line.contains(&format!("k{} = o.xy; k{} = o.zw", number(a), number(b))), "{line}");
            Some([number(a), number(b)])
        };
        text.lines().filter_map(pair).collect()
    }

    /// Whether the network sorts every list of zeros and ones, and so every list (Knuth, 5.3.4,
    /// theorem Z).
    fn sorts(network: &[[usize; 2]]) -> bool {
        (0..1u32 << 16).all(|bits| {
            let sorted = network.iter().fold(bits, |bits, [a, b]| {
                let swaps = (bits >> a & 1) > (bits >> b & 1);
                if swaps { bits ^ (1 << a | 1 << b) } else { bits }
            });
            // As many ones as before, all behind the zeros.
            sorted == 0xffff & !(0xffff >> bits.count_ones())
        })
    }

    #[test]
    fn the_network_sorts_sixteen_keys() {
        let (_, text) = FILES.iter().find(|(name, _)| *name == "fragments_network.wgsl").unwrap();
        let network = network(text);
        assert_eq!(network.len(), 60);
        assert!(sorts(&network));
        // Without any one of its comparators it does not.
        for left_out in 0..network.len() {
            let others: Vec<_> =
                network.iter().enumerate().filter(|(k, _)| *k != left_out).map(|(_, pair)| *pair).collect();
            assert!(!sorts(&others), "{left_out}");
        }
    }
}
