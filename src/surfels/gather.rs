//! All inputs as one set of points with finite coordinates.

use super::colors::ColorGatherer;
use super::{LARGEST_COORDINATE, Preparation};
use crate::io::points::{retain, retain_colors};
use crate::io::{Points, Up};
use crate::scene::{Clip, Colors, Provenance};
use crate::{Error, Result};

/// The usable points of all inputs, in order.
pub(crate) struct Gathered {
    /// World coordinates; none is -0.
    pub positions: Vec<[f64; 3]>,
    /// As given; zero where missing. None if no input has any.
    pub normals: Option<Vec<[f32; 3]>>,
    /// As given; zero where missing. None if no input has any.
    pub radii: Option<Vec<f32>>,
    /// As given; zero where missing. None if no input has any.
    pub axes: Option<Vec<[[f32; 3]; 2]>>,
    /// As given; [`Clip::NONE`] where missing. None if no input has any.
    pub clips: Option<Vec<Clip>>,
    /// As given; zero where missing. None if no input has any.
    pub texture: Option<Vec<[f32; 2]>>,
    /// The colours of the points. None if no input has any.
    pub colors: Option<Colors>,
    /// What the inputs say.
    pub up: Option<Up>,
    /// Each of them is closed, [`Points::closed`].
    pub closed: bool,
    /// Which they are.
    pub provenance: Provenance,
    /// The counts so far.
    pub preparation: Preparation,
}

/// Joins the inputs and drops points whose coordinates are unusable.
pub(crate) fn gather(inputs: Vec<Points>) -> Result<Gathered> {
    let mut preparation = Preparation::default();
    let mut positions = Vec::new();
    let (mut normals, mut radii, mut axes, mut clips, mut texture) = (None, None, None, None, None);
    let mut colors = ColorGatherer::new();
    let (mut up, mut provenance) = (None, Provenance::default());
    let closed = inputs.iter().all(|input| input.closed || input.positions.is_empty());
    let input_count = inputs.len();
    for mut input in inputs {
        let read = input.positions.len();
        preparation.points += read as u64;
        preparation.withheld += input.withheld;
        preparation.loose += input.loose;
        let keep: Vec<bool> = input.positions.iter().map(is_usable).collect();
        let kept = keep.iter().filter(|&&keep| keep).count();
        if kept < read {
            preparation.dropped_non_finite += (read - kept) as u64;
            input.retain(&keep);
        }
        let before = positions.len();
        provenance.push(before as u64, input.left_out, input.numbers);
        append(&mut normals, before, input.normals, kept);
        append(&mut radii, before, input.radii, kept);
        append(&mut axes, before, input.axes, kept);
        append(&mut clips, before, input.clips, kept);
        append(&mut texture, before, input.texture, kept);
        colors.append(input.colors, kept);
        if positions.is_empty() {
            positions = input.positions;
        } else {
            positions.append(&mut input.positions);
        }
        up = match (up, input.up) {
            (Some(Up::Z), _) | (_, Some(Up::Z)) => Some(Up::Z),
            (said, says) => said.or(says),
        };
    }
    if positions.is_empty() {
        let what = match (input_count, preparation.points) {
            (_, 0) if preparation.withheld > 0 => format!(
                "all of the {} points read are marked as withheld, which is deleted, so there is nothing to draw: \
                 --keep-withheld keeps them",
                preparation.withheld
            ),
            (0, _) => "no input was given, so there is nothing to draw".to_owned(),
            (_, 0) => "the input holds no points, so there is nothing to draw".to_owned(),
            (_, points) => format!(
                "none of the {points} points read has three finite coordinates of at most {LARGEST_COORDINATE:e} in \
                 size, so there is nothing to draw"
            ),
        };
        return Err(Error::EmptyScene(what));
    }
    for coordinate in positions.iter_mut().flatten() {
        // -0 + 0 is 0: one position, one bit pattern.
        *coordinate += 0.0;
    }
    preparation.replaced_colors = colors.replaced;
    Ok(Gathered {
        positions,
        normals,
        radii,
        axes,
        clips,
        texture,
        colors: colors.finish(),
        up,
        closed,
        provenance,
        preparation,
    })
}

impl Gathered {
    /// Keeps the points whose flag is set.
    pub fn retain(&mut self, keep: &[bool]) {
        retain(&mut self.positions, keep);
        self.normals.iter_mut().for_each(|all| retain(all, keep));
        self.radii.iter_mut().for_each(|all| retain(all, keep));
        self.axes.iter_mut().for_each(|all| retain(all, keep));
        self.clips.iter_mut().for_each(|all| retain(all, keep));
        self.texture.iter_mut().for_each(|all| retain(all, keep));
        self.colors.iter_mut().for_each(|all| retain_colors(all, keep));
        self.provenance.retain(keep);
    }
}

pub(crate) fn is_usable(position: &[f64; 3]) -> bool {
    position.iter().all(|c| c.abs() <= LARGEST_COORDINATE)
}

/// Appends `count` values to the `before` values of earlier inputs; what is missing on either side becomes default.
fn append<T: Clone + Default>(all: &mut Option<Vec<T>>, before: usize, added: Option<Vec<T>>, count: usize) {
    let Some(mut added) = added else {
        if let Some(all) = all {
            all.resize(before + count, T::default());
        }
        return;
    };
    added.resize(count, T::default());
    match all {
        Some(all) => all.append(&mut added),
        None if before == 0 => *all = Some(added),
        None => {
            let mut joined = vec![T::default(); before];
            joined.append(&mut added);
            *all = Some(joined);
        }
    }
}
