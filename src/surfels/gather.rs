//! Joins all inputs into one set of points with finite coordinates.

use super::colors::ColorGatherer;
use super::mesh::color_vertices;
use super::{LARGEST_COORDINATE, Preparation, usable_axes};
use crate::io::points::Flattened;
use crate::io::{Points, Up, settle_colors};
use crate::scene::{Colors, Provenance};
use crate::{Error, Result};

/// The usable points of all inputs, in order.
pub(crate) struct Gathered {
    /// The points. If only some inputs have an attribute, it is zero, or
    /// [`Clip::NONE`](crate::scene::Clip::NONE), for the points of the other inputs. If no input
    /// has it, it is None. No coordinate is -0.
    pub points: Points,
    /// The input of each point, and the point's number in that input.
    pub provenance: Provenance,
    /// The counts so far.
    pub preparation: Preparation,
}

/// Joins the inputs, and leaves out points with unusable coordinates.
pub(crate) fn gather(inputs: Vec<Points>) -> Result<Gathered> {
    let mut inputs = inputs;
    settle_colors(&mut inputs);
    let (mut preparation, mut provenance) = (Preparation::default(), Provenance::default());
    let mut points = Points { closed: true, ..Points::default() };
    let (mut colors, mut flags, input_count) = (ColorGatherer::default(), Vec::new(), inputs.len());
    for mut input in inputs {
        color_vertices(&mut input);
        let mut keep: Vec<bool> = input.positions.iter().map(is_usable).collect();
        if input.encoded {
            for (index, keep) in keep.iter_mut().enumerate().filter(|(_, keep)| **keep) {
                *keep = has_shape(&input, index);
                preparation.shapeless += u64::from(!*keep);
            }
        }
        let kept = keep.iter().filter(|&&keep| keep).count();
        preparation.points += keep.len() as u64;
        preparation.withheld += input.withheld;
        preparation.unseen += input.unseen;
        preparation.filtered += input.filtered;
        preparation.loose += input.loose;
        preparation.told.append(&mut input.notes);
        preparation.unread.append(&mut input.unread);
        preparation.stranded += input.stranded;
        preparation.broken += input.broken;
        preparation.averaged += input.averaged;
        preparation.flattened = Flattened::of_both(preparation.flattened, input.flattened);
        provenance.push(flags.len() as u64, std::mem::take(&mut input.left_out), input.numbers.take());
        if kept < keep.len() {
            input.retain(&keep);
        }
        flags.extend(keep);
        colors.append(input.colors.take(), kept, input.encoded);
        join(&mut points, input);
    }
    let dropped = (flags.len() - points.positions.len()) as u64;
    preparation.dropped_non_finite = dropped - preparation.shapeless;
    if dropped > 0 {
        provenance.retain(&flags);
    }
    if points.positions.is_empty() {
        return Err(Error::EmptyScene(nothing_to_draw(input_count, &preparation)));
    }
    for coordinate in points.positions.iter_mut().flatten() {
        // -0 + 0 is 0, so equal positions have equal bits.
        *coordinate += 0.0;
    }
    let colors = colors.finish();
    (preparation.replaced_colors, preparation.clamped_alphas) = (colors.replaced, colors.clamped);
    (points.colors, points.encoded) = (colors.colors, colors.encoded);
    Ok(Gathered { points, provenance, preparation })
}

/// Appends the points of `input` to `all`, except colours, which [`ColorGatherer`] joins.
fn join(all: &mut Points, mut input: Points) {
    let (before, count) = (all.positions.len(), input.positions.len());
    append(&mut all.normals, before, input.normals, count);
    append(&mut all.radii, before, input.radii, count);
    append(&mut all.axes, before, input.axes, count);
    append(&mut all.clips, before, input.clips, count);
    append(&mut all.caps, before, input.caps, count);
    append(&mut all.thirds, before, input.thirds, count);
    append(&mut all.texture, before, input.texture, count);
    append(&mut all.texture_numbers, before, input.texture_numbers, count);
    all.tree = input.tree.filter(|_| before == 0).or(all.tree.take().filter(|_| count == 0));
    all.whole = input.whole.filter(|_| before == 0).or(all.whole.take().filter(|_| count == 0));
    all.unsided |= input.unsided;
    append(&mut all.texture_slopes, before, input.texture_slopes, count);
    all.closed &= input.closed || count == 0;
    if before == 0 {
        all.positions = input.positions;
    } else {
        all.positions.append(&mut input.positions);
    }
    all.up = match (all.up, input.up) {
        (Some(Up::Z), _) | (_, Some(Up::Z)) => Some(Up::Z),
        (said, says) => said.or(says),
    };
}

/// The reason why there is nothing to draw.
fn nothing_to_draw(inputs: usize, preparation: &Preparation) -> String {
    match (inputs, preparation.points) {
        (_, 0) if preparation.unseen > 0 => format!(
            "{} points are left out as their classes have the opacity 0, and {} as they are marked as withheld, so there is nothing to draw",
            preparation.unseen, preparation.withheld
        ),
        (_, 0) if preparation.filtered > 0 => format!(
            "none of the {} points read passes --where and --classes, so there is nothing to draw: epsplat info lists the ranges of attributes",
            preparation.filtered
        ),
        (_, 0) if preparation.withheld > 0 => format!(
            "all of the {} points read are marked as withheld, which is deleted, so there is nothing to draw: \
             --keep-withheld keeps them",
            preparation.withheld
        ),
        (0, _) => "no input was given, so there is nothing to draw".to_owned(),
        (_, 0) => "the input holds no points, so there is nothing to draw".to_owned(),
        (_, points) if preparation.shapeless > 0 => format!(
            "none of the {points} Gaussians read has a finite position, scales, rotation, opacity and colour and \
             a surface, so there is nothing to draw"
        ),
        (_, points) => format!(
            "none of the {points} points read has three finite coordinates of at most {LARGEST_COORDINATE:e} in \
             size, so there is nothing to draw"
        ),
    }
}

impl Gathered {
    /// Keeps the points whose flag is set.
    pub fn retain(&mut self, keep: &[bool]) {
        self.points.retain(keep);
        self.provenance.retain(keep);
    }
}

/// Whether a Gaussian has usable half-axes, opacity and colour. Other points' missing attributes
/// are estimated, but not those of Gaussians.
pub(crate) fn has_shape(points: &Points, index: usize) -> bool {
    let color = match &points.colors {
        Some(Colors::Linear(colors)) => colors.get(index),
        Some(Colors::Harmonics(harmonics)) => harmonics.colors().get(index),
        _ => None,
    };
    let axes = points.axes.as_ref().and_then(|axes| usable_axes(*axes.get(index)?));
    axes.is_some() && color.is_none_or(|color| color.iter().all(|c| c.is_finite()))
}

pub(crate) fn is_usable(position: &[f64; 3]) -> bool {
    position.iter().all(|c| c.abs() <= LARGEST_COORDINATE)
}

/// Appends `count` values to the `before` values of earlier inputs. Missing values on either side
/// become the default.
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
