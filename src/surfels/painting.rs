//! Which of several textures paints which point.

use crate::io::Points;
use crate::scene::Atlas;
use crate::{Error, Result};

/// Numbers the points of all inputs by their textures, of which there are so many: one for all, or in the order of the inputs one for each, or as
/// many as the numbers of its points name.
pub(super) fn number(inputs: &mut [Points], textures: usize) -> Result<()> {
    let named: Vec<u64> = inputs.iter().map(named).collect();
    let all: u64 = named.iter().sum();
    if textures == 1 && named.iter().all(|named| *named <= 1) {
        return Ok(());
    }
    if all != textures as u64 {
        let given = if textures == 1 { "1 texture is".into() } else { format!("{textures} textures are") };
        let needed = if all == 1 { "one is".into() } else { format!("{all} are") };
        return Err(Error::Usage(format!(
            "{given} given, and {needed} needed: one for all, one for each input, or as many as the numbers of its points (texnumber) name"
        )));
    }
    let mut first = 0;
    for (input, named) in inputs.iter_mut().zip(named) {
        let count = input.positions.len();
        let numbers = input.texture_numbers.get_or_insert_with(|| vec![0; count]);
        numbers.iter_mut().for_each(|number| *number = number.saturating_add(first));
        // There are as many textures, which are in memory.
        first += named as u32;
    }
    Ok(())
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
