//! Makes surfels of points that may have textures: numbers the points by their textures, and leaves
//! inputs without images to [`build_within`].

use std::collections::HashMap;
use std::sync::Arc;

use super::build::{build_within, built_in_texture};
use super::gather::gather;
use super::mesh::{By, Painting, of_mesh};
use super::{Limits, Preparation, texture};
use crate::io::{Paint, Points, Texture, settle_colors};
use crate::scene::mipmap::half;
use crate::scene::{Atlas, Colors, Scene};
use crate::{Error, Progress, Result};

/// The largest number of textures in a scene: coordinates in their common plane are then precise
/// enough for a texture of 16384 texels.
const MOST: u64 = 1024;

/// Numbers the points of all inputs by their textures. There is one texture for all inputs, or one
/// for each, or as many as the texture numbers of the points name, in the order of the inputs.
///
/// # Errors
///
/// [`Error::Usage`] if the number of textures is none of these three, or no input has texture
/// coordinates.
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
    if textures as u64 > MOST {
        return Err(Error::Usage(format!("{textures} textures are given, and a scene has {MOST} at most")));
    }
    // With a single input, textures that no point names may be left over.
    if all != textures as u64 && !(inputs.len() == 1 && all < textures as u64) {
        let given = if textures == 1 { "1 texture is given".into() } else { format!("{textures} textures are given") };
        let needed = match one_each {
            true => format!("1 is needed for all inputs, or {all}, one for each"),
            false => format!("{all} are needed: as many as the numbers of points (texnumber) name"),
        };
        return Err(Error::Usage(format!("{given}, and {needed}")));
    }
    offset(inputs, &named);
    Ok(())
}

/// Gives the points of inputs without texture coordinates the number [`u32::MAX`], which means no
/// texture, so that they keep their colours beside painted points. Returns whether there are such
/// inputs.
///
/// # Errors
///
/// [`Error::Usage`] if no input has texture coordinates.
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

/// Numbers the points of several inputs by their textures if any input has texture numbers;
/// otherwise all of them have the same texture.
///
/// # Errors
///
/// [`Error::Usage`] for a number that is too large.
pub(super) fn number_together(inputs: &mut [Points]) -> Result<()> {
    let named = named_by_all(inputs)?;
    if inputs.iter().any(|input| input.texture_numbers.is_some()) {
        offset(inputs, &named);
    }
    Ok(())
}

/// The largest total number of texels of the material images that surfels are painted with. Images
/// of this size and their mipmaps fit into 128 MiB, which any device can bind.
const MOST_TEXELS: u64 = 1 << 24;

/// The images that the materials of inputs name.
#[derive(Debug, Default)]
struct Own {
    /// The images, each multiplied by the colour of a material.
    textures: Vec<Arc<Texture>>,
    /// Whether each input has images.
    has_images: Vec<bool>,
    /// The number of images that were halved.
    halved: u64,
}

/// Collects the images that the materials of the inputs' meshes name, and numbers the triangles by
/// them.
///
/// The result is empty if there are more images than a scene can have, or if there are Gaussians,
/// whose colours are sRGB codes.
fn own(inputs: &mut [Points]) -> Own {
    fn painted(input: &mut Points) -> Option<&mut Paint> {
        let paint = input.faces.as_mut().filter(|_| input.of_mesh)?.paint.as_deref_mut();
        paint.filter(|paint| paint.has_images())
    }
    if inputs.iter().any(|input| input.encoded) {
        return Own::default();
    }
    let (mut images, mut known) = (Vec::new(), HashMap::new());
    let mut numbers: Vec<Option<Vec<u32>>> = Vec::new();
    for input in inputs.iter_mut() {
        numbers.push(painted(input).map(|paint| {
            let mut number = |triangle: usize| {
                let texture = paint.textures.get(paint.number(triangle)? as usize)?;
                let factor = paint.colors.get(triangle).copied().unwrap_or([1.0; 4]);
                Some(*known.entry((Arc::as_ptr(texture), factor.map(f32::to_bits))).or_insert_with(|| {
                    images.push((texture.clone(), factor));
                    images.len() as u32 - 1
                }))
            };
            (0..paint.numbers.len()).map(|triangle| number(triangle).unwrap_or(u32::MAX)).collect()
        }));
    }
    if images.len() as u64 > MOST {
        return Own::default();
    }
    let has_images = numbers.iter().map(Option::is_some).collect();
    for (input, numbers) in inputs.iter_mut().zip(numbers) {
        if let Some((paint, numbers)) = painted(input).zip(numbers) {
            (paint.numbers, paint.textures) = (numbers, Vec::new());
        }
    }
    let halvings = halvings(&images.iter().map(|(texture, _)| texture.size()).collect::<Vec<_>>());
    let halved = halvings.iter().filter(|count| **count > 0).count() as u64;
    let made = |((texture, factor), halvings): ((Arc<Texture>, [f32; 4]), u32)| {
        let texture = (0..halvings).fold(texture, |of, _| half(&of).map_or(of, Arc::new));
        if factor == [1.0; 4] { texture } else { Arc::new(texture.times(factor)) }
    };
    Own { textures: images.into_iter().zip(halvings).map(made).collect(), has_images, halved }
}

/// Returns how often images of these sizes are halved until they have at most [`MOST_TEXELS`]
/// together. Each time, the largest image is halved.
fn halvings(sizes: &[[u32; 2]]) -> Vec<u32> {
    let mut halvings = vec![0; sizes.len()];
    let texels =
        |k: usize, halvings: u32| sizes[k].iter().map(|side| u64::from((side >> halvings).max(1))).product::<u64>();
    let mut total: u64 = (0..sizes.len()).map(|k| texels(k, 0)).sum();
    while total > MOST_TEXELS {
        let Some(largest) = (0..sizes.len()).max_by_key(|&k| texels(k, halvings[k])) else { break };
        total -= texels(largest, halvings[largest]) - texels(largest, halvings[largest] + 1);
        halvings[largest] += 1;
    }
    halvings
}

/// Returns the surfels of an input for a scene in which some inputs are painted. Surfels of an
/// input without images get no texture.
fn beside_painted(mut points: Points, has_images: bool) -> Points {
    if !has_images || points.texture_slopes.is_none() {
        let count = points.positions.len();
        (points.texture, points.texture_numbers) = (Some(vec![[0.0; 2]; count]), Some(vec![u32::MAX; count]));
        points.texture_slopes = None;
    }
    points
}

/// Builds a scene as [`build_within`] does, but painted with the images that the materials of the
/// inputs' meshes name; surfels of other inputs have their colours.
///
/// Without such images, or with more than a scene can have, the result is that of [`build_within`]:
/// a surfel has the mean of the image over its triangles.
///
/// # Errors
///
/// The errors of [`build_within`].
pub fn build_painted(
    mut inputs: Vec<Points>,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<(Scene, Preparation)> {
    limits.check()?;
    settle_colors(&mut inputs);
    let own = own(&mut inputs);
    if own.textures.is_empty() {
        return build_within(inputs, Vec::new(), limits, progress);
    }
    let made = |(input, has_images)| beside_painted(of_mesh(input, By::Looks, Painting::Own), has_images);
    let inputs = inputs.into_iter().zip(own.has_images).map(made).collect();
    let (scene, preparation) = painted(inputs, own.textures, limits, progress)?;
    Ok((scene, Preparation { halved_images: own.halved, ..preparation }))
}

/// Builds the scene of points whose texture numbers are indices of `textures`.
pub(super) fn painted(
    inputs: Vec<Points>,
    textures: Vec<Arc<Texture>>,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<(Scene, Preparation)> {
    let gathered = gather(inputs)?;
    let (mut scene, preparation, places) = built_in_texture(gathered, textures.len() as u32, limits, progress)?;
    // Nodes have no texture coordinates.
    scene.hierarchy = None;
    scene.colors = Colors::Textured(texture::painted(&scene, textures, &places, progress)?);
    Ok((scene, preparation))
}

/// Adds to the texture numbers of each input the number of textures of the inputs before it.
fn offset(inputs: &mut [Points], textures: &[u64]) {
    let mut first = 0;
    for (input, own) in inputs.iter_mut().zip(textures) {
        let count = input.positions.len();
        let numbers = input.texture_numbers.get_or_insert_with(|| vec![0; count]);
        // The addition saturates, so u32::MAX still means no texture.
        numbers.iter_mut().for_each(|number| *number = number.saturating_add(first));
        // A number of textures is at most MOST.
        first = first.saturating_add(*own as u32);
    }
}

/// The number of textures that each input needs.
fn named_by_all(inputs: &[Points]) -> Result<Vec<u64>> {
    let named: Vec<u64> = inputs.iter().map(named).collect();
    match named.iter().find(|named| **named > MOST) {
        Some(named) => {
            Err(Error::Usage(format!("a point names texture {} (texnumber), but there are at most {MOST}", named - 1)))
        }
        None => Ok(named),
    }
}

/// The number of textures that an input needs.
fn named(input: &Points) -> u64 {
    match &input.texture_numbers {
        Some(numbers) => last(numbers).map_or(0, |last| u64::from(last) + 1),
        None => u64::from(!input.positions.is_empty()),
    }
}

/// The largest texture number that points name.
fn last(numbers: &[u32]) -> Option<u32> {
    numbers.iter().copied().filter(|&number| number != u32::MAX).max()
}

/// Sets the coordinates of points without a texture to 0, so that they do not widen the common
/// plane.
pub(super) fn clear_bare(points: &mut Points) {
    let (Some(numbers), Some(places)) = (&points.texture_numbers, &mut points.texture) else { return };
    let bare = numbers.iter().zip(places).filter(|(number, _)| **number == u32::MAX);
    bare.for_each(|(_, place)| *place = [0.0; 2]);
}

/// Moves the coordinates of points into the common plane of at least `at_least` textures.
pub(super) fn join(points: &mut Points, at_least: u32) -> Atlas {
    let (Some(numbers), Some(places)) = (points.texture_numbers.take(), &mut points.texture) else { return Atlas::ONE };
    let textures = last(&numbers).map_or(0, |last| last + 1).max(at_least).max(1);
    let atlas = Atlas::of(textures, numbers.iter().copied().zip(places.iter().copied()));
    if atlas != Atlas::ONE {
        places.iter_mut().zip(numbers).for_each(|(place, number)| *place = atlas.joint(number, *place));
    }
    atlas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_images_are_halved_until_they_fit() {
        assert_eq!(halvings(&[[4096, 2048], [1024, 1024]]), [0, 0]);
        assert_eq!(halvings(&[[4096, 4096], [16, 16]]), [1, 0]);
        assert_eq!(halvings(&[[16384, 16384]]), [2]);
        assert_eq!(halvings(&[[8192, 4096], [8192, 4096]]), [1, 1]);
        // Both halves fill the limit exactly, and a small third image exceeds it.
        assert_eq!(halvings(&[[8192, 4096], [8192, 4096], [64, 64]]), [1, 2, 0]);
        assert!(halvings(&[]).is_empty());
    }
}
