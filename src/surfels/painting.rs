//! Which of several textures paints which point.

use crate::io::Points;
use crate::scene::Atlas;
use crate::{Error, Result};

/// The most textures of a scene: then coordinates in their plane keep the digits that a texture of 16384 texels needs.
const MOST: u64 = 1024;

/// Numbers the points of all inputs by their textures, of which there are so many: one for all, one for each input, or in the order of the inputs
/// as many as the numbers of its points name.
///
/// # Errors
///
/// [`Error::Usage`] if there are more or fewer textures than that, or no input has texture coordinates.
pub(super) fn number(inputs: &mut [Points], textures: usize) -> Result<()> {
    let bare = bare_inputs(inputs)?;
    let named = named_by_all(inputs)?;
    let (all, one_each) = (named.iter().sum::<u64>(), named.iter().all(|named| *named <= 1));
    if textures == 1 && one_each {
        return Ok(());
    }
    if textures == inputs.len() && one_each && !bare {
        offset(inputs, &vec![1; inputs.len()]);
        return Ok(());
    }
    // What no point has comes last in a single input.
    if all != textures as u64 && !(inputs.len() == 1 && all < textures as u64) || textures as u64 > MOST {
        let given = if textures == 1 { "1 texture is".into() } else { format!("{textures} textures are") };
        let needed = if all == 1 { "one is".into() } else { format!("{all} are") };
        return Err(Error::Usage(format!(
            "{given} given, and {needed} needed: one for all, one for each input, or as many as the numbers of its points (texnumber) name, \
             and no more than {MOST}"
        )));
    }
    offset(inputs, &named);
    Ok(())
}

/// Gives the points of inputs without texture coordinates the number of no texture, so that they
/// keep their colours beside painted ones; and tells whether there are such inputs.
///
/// # Errors
///
/// [`Error::Usage`] if none has any.
fn bare_inputs(inputs: &mut [Points]) -> Result<bool> {
    let lacks = |input: &Points| input.texture.is_none() && !input.positions.is_empty();
    let bare = inputs.iter().any(lacks);
    if bare && inputs.iter().all(|input| input.texture.is_none()) {
        let what = "a texture paints points that have texture coordinates, and none has any: leave --texture out, or take an input \
                    with coordinates, as `epsplat sample` gives surfels of a mesh";
        return Err(Error::Usage(what.into()));
    }
    for input in inputs.iter_mut().filter(|_| bare) {
        let (count, bare) = (input.positions.len(), lacks(input));
        if bare {
            input.texture = Some(vec![[0.0; 2]; count]);
            input.texture_numbers = Some(vec![u32::MAX; count]);
        } else {
            input.texture_numbers.get_or_insert_with(|| vec![0; count]);
        }
    }
    Ok(bare)
}

/// Numbers the points of several inputs by their textures, if any of them has numbers: else all are taken to be in one.
///
/// # Errors
///
/// [`Error::Usage`] for a number that no texture has.
pub(super) fn number_together(inputs: &mut [Points]) -> Result<()> {
    let named = named_by_all(inputs)?;
    if inputs.iter().any(|input| input.texture_numbers.is_some()) {
        offset(inputs, &named);
    }
    Ok(())
}

/// Moves the numbers of each input past those of the inputs before it, which have so many.
fn offset(inputs: &mut [Points], textures: &[u64]) {
    let mut first = 0;
    for (input, own) in inputs.iter_mut().zip(textures) {
        let count = input.positions.len();
        let numbers = input.texture_numbers.get_or_insert_with(|| vec![0; count]);
        // The number of no texture saturates, and stays.
        numbers.iter_mut().for_each(|number| *number = number.saturating_add(first));
        // None of them is more than MOST.
        first = first.saturating_add(*own as u32);
    }
}

/// The textures that each input needs.
fn named_by_all(inputs: &[Points]) -> Result<Vec<u64>> {
    let named: Vec<u64> = inputs.iter().map(named).collect();
    match named.iter().find(|named| **named > MOST) {
        Some(named) => {
            Err(Error::Usage(format!("a point is in texture {} (texnumber), and there are at most {MOST}", named - 1)))
        }
        None => Ok(named),
    }
}

/// The textures that an input needs.
fn named(input: &Points) -> u64 {
    match &input.texture_numbers {
        Some(numbers) => last(numbers).map_or(0, |last| u64::from(last) + 1),
        None => u64::from(!input.positions.is_empty()),
    }
}

/// The last texture that points name.
fn last(numbers: &[u32]) -> Option<u32> {
    numbers.iter().copied().filter(|&number| number != u32::MAX).max()
}

/// Points that no texture paints have coordinates of no matter, which shall not widen the plane.
pub(super) fn clear_bare(points: &mut Points) {
    let (Some(numbers), Some(places)) = (&points.texture_numbers, &mut points.texture) else { return };
    let bare = numbers.iter().zip(places).filter(|(number, _)| **number == u32::MAX);
    bare.for_each(|(_, place)| *place = [0.0; 2]);
}

/// Moves the coordinates of points into the plane of their textures, of which there are so many at least.
pub(super) fn join(points: &mut Points, at_least: u32) -> Atlas {
    let (Some(numbers), Some(places)) = (points.texture_numbers.take(), &mut points.texture) else { return Atlas::ONE };
    let textures = last(&numbers).map_or(0, |last| last + 1).max(at_least).max(1);
    let atlas = Atlas::of(textures, numbers.iter().copied().zip(places.iter().copied()));
    if atlas != Atlas::ONE {
        places.iter_mut().zip(numbers).for_each(|(place, number)| *place = atlas.joint(number, *place));
    }
    atlas
}
