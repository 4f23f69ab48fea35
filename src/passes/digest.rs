//! A number that tells scenes apart: the sum of a hash of each surfel and triangle.
//!
//! It does not depend on the order of the surfels, as no picture does. The digests of shares of a
//! scene add up to that of the scene, so parts of a picture prove that they cover it once.

use rayon::prelude::*;

use super::order::content;
use crate::random::mixed;
use crate::scene::{Colors, Scene, Triangles};

/// The hash of a list of words.
fn hash(words: impl Iterator<Item = u32>) -> u64 {
    words.fold(0x9e37_79b9_7f4a_7c15, |hash, word| mixed(hash ^ u64::from(word)))
}

/// The digest of the surfels at `indices`.
pub fn of_surfels(scene: &Scene, indices: &[u32]) -> u64 {
    let of = |&index: &u32| {
        let (places, color, others) = content(scene, index as usize);
        let others = others.map(|other| other.map_or(u32::MAX, |word| word));
        let terms: &[u32] = match &scene.colors {
            Colors::Harmonics(harmonics) => bytemuck::cast_slice(harmonics.terms(index as usize)),
            _ => &[],
        };
        let words = places.into_iter().flatten().chain(color).chain(others);
        hash(words.chain(terms.iter().copied()))
    };
    indices.par_iter().map(of).reduce(|| 0, u64::wrapping_add)
}

/// The digest of all `triangles` and their textures.
pub fn of_triangles(triangles: &Triangles) -> u64 {
    let floats = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let of = |triangle: usize| {
        let mut words = Vec::new();
        for vertex in triangles.corners()[triangle] {
            words.extend(floats(&triangles.vertices()[vertex as usize]));
            words.extend(triangles.low().get(vertex as usize).iter().flat_map(|low| floats(*low)));
        }
        words.extend(triangles.normals().get(triangle).iter().flat_map(|normals| floats(normals.as_flattened())));
        // A single entry colours all triangles.
        let colors = triangles.colors().get(triangle).or(triangles.colors().first());
        words.extend(colors.iter().flat_map(|colors| floats(colors.as_flattened())));
        if let Some(painted) = triangles.paint().get(triangle) {
            words.extend(floats(painted.places.as_flattened()));
            words.push(painted.texture);
        }
        hash(words.into_iter())
    };
    // The halvings of an image follow from it.
    let images = triangles.textures().iter().map(|mipmap| &mipmap.levels()[0]).enumerate();
    let of_image = images.map(|(number, image)| {
        let [width, height] = image.size();
        let head = [number as u32, width, height, image.clamps().into()];
        hash(head.into_iter().chain(image.texels().iter().map(|code| u32::from_le_bytes(*code))))
    });
    let of_texels = of_image.fold(0, u64::wrapping_add);
    (0..triangles.len()).into_par_iter().map(of).reduce(|| of_texels, u64::wrapping_add)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Surfel, Up};
    use glam::{DVec3, Vec3};

    #[test]
    fn shares_add_up_and_a_changed_value_shows() {
        let surfels = (0..500).map(|k| Surfel::disk(Vec3::splat(k as f32), Vec3::Z, 0.1)).collect();
        let colors = Colors::Constant([1.0; 4]);
        let mut scene = Scene { origin: DVec3::ZERO, surfels, colors, up: Up::Y, ..Scene::default() };
        let all: Vec<u32> = (0..scene.surfels.len() as u32).collect();
        let whole = of_surfels(&scene, &all);
        let backward: Vec<u32> = all.iter().rev().copied().collect();
        assert_eq!(whole, of_surfels(&scene, &backward));
        let (one, other) = all.split_at(123);
        assert_eq!(whole, of_surfels(&scene, one).wrapping_add(of_surfels(&scene, other)));
        scene.surfels[77].t[1] += 1e-6;
        assert_ne!(whole, of_surfels(&scene, &all));
    }
}
