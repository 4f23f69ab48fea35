//! Where a device gets its surfels from: a [`Scene`] in memory, or any other source that knows its
//! facts and provides pages. Only the f64 reference needs all surfels at once.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::branches::Branch;
use super::cull::ball;
use super::order::order;
use crate::gpu::layout::BATCH;
use crate::plan::{ColorNeed, Facts, SceneNeeds, SurfelLayout};
use crate::scene::color::srgb8;
use crate::scene::hierarchy::{Hierarchy, Node};
use crate::scene::{Cap, Clip, Colors, Fade, Mipmap, Provenance, Scene, Share, Surfel, Triangles, copies};

/// A source of surfels, page by page.
pub trait Source: Send + Sync {
    /// The number of surfels and the ranges of their values.
    fn facts(&self) -> Facts;

    /// Pages of at most `most` surfels, as a render with `needs` draws them.
    ///
    /// With `ordered`, surfels are sorted by [`order`]. If the render draws copies of a surfel
    /// once, the other copies are left out.
    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>>;

    /// The place of the first of these surfels in the stored order of the whole scene.
    fn first(&self) -> u32 {
        0
    }

    /// The surfels' textures, by their numbers in an [`Atlas`](crate::scene::Atlas).
    fn textures(&self) -> &[Mipmap] {
        &[]
    }

    /// The triangles of the scene.
    fn triangles(&self) -> Option<&Triangles> {
        None
    }

    /// The surfels' levels of detail.
    fn levels(&self) -> Option<&Hierarchy> {
        None
    }

    /// The surfels of a branch of the levels of detail, then one surfel per node of the branch, as
    /// a render with `needs` draws them. A leaf of one surfel is drawn as that surfel, which is
    /// then present twice.
    fn branch<'a>(&'a self, _needs: &SceneNeeds, _branch: &Branch) -> Option<Box<dyn Page + 'a>> {
        None
    }

    /// The input and the point that each surfel comes from, by the surfel's number
    /// ([`Page::numbers`]).
    fn provenance(&self) -> Cow<'_, Provenance> {
        Cow::Owned(Provenance::default())
    }

    /// All surfels in memory, for the f64 reference.
    fn whole(&self) -> Option<&Scene> {
        None
    }
}

/// Consecutive surfels of a [`Source`].
pub trait Page: Sync {
    /// The number of each surfel in the source.
    fn numbers(&self) -> Cow<'_, [u32]>;

    /// The surfels of a range.
    fn surfels(&self, range: Range<usize>) -> Vec<Surfel>;

    /// The attributes of a range, as records of [`SurfelLayout::words`].
    fn attributes(&self, range: Range<usize>) -> Vec<u32>;

    /// The bounding ball of each batch: centre and radius, world units relative to the scene's
    /// origin.
    fn balls(&self) -> Vec<[f32; 4]>;

    /// The number of surfels that the page stands for, copies included.
    fn stand_for(&self) -> u64;
}

/// Implements [`Source`] for pointers to a source.
macro_rules! leads_to_source {
    ($($other:ty),*) => {$(
        impl<S: Source + ?Sized> Source for $other {
            fn facts(&self) -> Facts {
                (**self).facts()
            }

            fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
                (**self).pages(needs, most, ordered)
            }

            fn first(&self) -> u32 {
                (**self).first()
            }

            fn textures(&self) -> &[Mipmap] {
                (**self).textures()
            }

            fn triangles(&self) -> Option<&Triangles> {
                (**self).triangles()
            }

            fn levels(&self) -> Option<&Hierarchy> {
                (**self).levels()
            }

            fn branch<'a>(&'a self, needs: &SceneNeeds, branch: &Branch) -> Option<Box<dyn Page + 'a>> {
                (**self).branch(needs, branch)
            }

            fn provenance(&self) -> Cow<'_, Provenance> {
                (**self).provenance()
            }

            fn whole(&self) -> Option<&Scene> {
                (**self).whole()
            }
        }
    )*};
}

leads_to_source!(&S, Arc<S>);

impl Source for Scene {
    fn facts(&self) -> Facts {
        Facts::of(self)
    }

    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        pages_of(self, needs, most, (ordered, None))
    }

    fn textures(&self) -> &[Mipmap] {
        match &self.colors {
            Colors::Textured(textured) => textured.mipmaps(),
            _ => &[],
        }
    }

    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.triangles).filter(|triangles| !triangles.is_empty())
    }

    fn levels(&self) -> Option<&Hierarchy> {
        self.hierarchy.as_deref()
    }

    fn branch<'a>(&'a self, needs: &SceneNeeds, branch: &Branch) -> Option<Box<dyn Page + 'a>> {
        let first = self.surfels.len() as u32;
        // A leaf of one surfel is drawn as that surfel, with its clip lines and its cap.
        let of_node = |index: usize| branch.only_surfel(index).unwrap_or(first + branch.numbers[index]);
        let records = branch.surfels.len() + branch.numbers.len();
        let surfels = branch.surfels.clone();
        let of = |record: usize| match record.checked_sub(surfels.len()) {
            Some(node) => of_node(node),
            None => surfels.start + record as u32,
        };
        let indices: Vec<u32> = (0..records).into_par_iter().with_min_len(4096).map(of).collect();
        Some(Box::new(ScenePage {
            scene: self,
            nodes: self.levels(),
            needs: *needs,
            layout: SurfelLayout::of(needs),
            indices: indices.into(),
            copies: None,
        }))
    }

    fn provenance(&self) -> Cow<'_, Provenance> {
        Cow::Borrowed(&self.provenance)
    }

    fn whole(&self) -> Option<&Scene> {
        Some(self)
    }
}

/// Pages of at most `most` surfels of `scene`, or of a `share` of it, as [`Source::pages`] returns
/// them.
pub(super) fn pages_of<'a>(
    scene: &'a Scene,
    needs: &SceneNeeds,
    most: usize,
    (ordered, share): (Option<&Facts>, Option<Share>),
) -> Vec<Box<dyn Page + 'a>> {
    let count = scene.surfels.len();
    let given = || share.map_or(0..count, |share| share.range(count)).map(|index| index as u32).collect();
    let mut order = ordered.map_or_else(given, |facts| order(scene, &facts.core, share));
    let copies: Option<Arc<[u32]>> = needs.surface.copies().then(|| copies(scene).into());
    if let Some(copies) = &copies {
        order.retain(|&index| copies[index as usize] > 0);
    }
    let page = |indices: &[u32]| ScenePage {
        scene,
        nodes: None,
        needs: *needs,
        layout: SurfelLayout::of(needs),
        indices: indices.into(),
        copies: copies.clone(),
    };
    let of = |indices: &[u32]| Box::new(page(indices)) as Box<dyn Page>;
    if !needs.surface.separate() {
        return order.chunks(most).map(of).collect();
    }
    let own = scene.provenance.ranges(scene.surfels.len() as u64);
    let individual = own.map(|own| order.iter().copied().filter(|&index| own.contains(&index.into())).collect());
    individual.flat_map(|indices: Vec<u32>| indices.chunks(most).map(of).collect::<Vec<_>>()).collect()
}

/// The surfels of a scene at `indices`; indices past the last surfel are nodes.
struct ScenePage<'a> {
    scene: &'a Scene,
    nodes: Option<&'a Hierarchy>,
    needs: SceneNeeds,
    layout: SurfelLayout,
    indices: Box<[u32]>,
    /// The number of copies of every surfel of the scene; 0 if an equal surfel is drawn instead.
    copies: Option<Arc<[u32]>>,
}

/// Copies the bits of floats into words.
fn write(values: &[f32], into: &mut [u32]) {
    values.iter().zip(into).for_each(|(value, into)| *into = value.to_bits());
}

impl ScenePage<'_> {
    /// The node of an index past the last surfel, with its number.
    fn node(&self, index: usize) -> Option<(usize, &Node)> {
        let number = index.checked_sub(self.scene.surfels.len())?;
        Some((number, self.nodes?.nodes.get(number)?))
    }

    fn surfel(&self, index: usize) -> Surfel {
        self.node(index).map_or_else(|| self.scene.surfels[index], |(_, node)| node.surfel)
    }

    /// Writes the attributes of a node, which has no clip lines.
    fn write_node(&self, (number, node): (usize, &Node), into: &mut [u32]) {
        match self.needs.color {
            ColorNeed::Srgb8 => into[0] = u32::from_le_bytes(srgb8(node.color)),
            ColorNeed::Linear => write(&node.color, into),
            _ => {}
        }
        if let (true, Some(low)) = (self.needs.doubled, self.nodes.and_then(|nodes| nodes.low.get(number))) {
            write(low, &mut into[self.layout.low as usize..]);
        }
        if self.needs.own_normals {
            let normal = node.surfel.normal().normalize_or_zero();
            write(&normal.to_array(), &mut into[self.layout.normal as usize..]);
        }
        if self.needs.clips {
            write(Clip::NONE.0.as_flattened(), &mut into[self.layout.clip as usize..]);
        }
        if self.needs.curved {
            let cap = if self.needs.node_caps { node.cap } else { Cap::FLAT };
            write(&cap.0, &mut into[self.layout.cap as usize..]);
        }
    }

    fn write_attributes(&self, index: usize, into: &mut [u32]) {
        if self.needs.numbers_surfels() {
            into[self.layout.number as usize] = index as u32;
        }
        if let Some(node) = self.node(index) {
            return self.write_node(node, into);
        }
        let bits = |vectors: &[[f32; 4]], into: &mut [u32]| write(vectors.as_flattened(), into);
        let low = self.scene.low.get(index);
        match (self.needs.color, &self.scene.colors) {
            (ColorNeed::Srgb8, Colors::Srgb8(codes)) => into[0] = u32::from_le_bytes(codes[index]),
            (ColorNeed::Srgb8, Colors::Linear(colors)) => into[0] = u32::from_le_bytes(srgb8(colors[index])),
            (ColorNeed::Linear, colors) => bits(&[colors.linear(index)], into),
            (ColorNeed::Harmonics(_), Colors::Harmonics(harmonics)) => {
                bits(&[harmonics.colors()[index]], into);
                write(harmonics.terms(index), &mut into[4..]);
            }
            (ColorNeed::Textured, Colors::Textured(textured)) => {
                let [center, u_slope, v_slope] = textured.mapped(index, low);
                bits(&[textured.colors()[index], center, u_slope, v_slope], into);
            }
            _ => {}
        }
        if let Some(copies) = &self.copies {
            into[self.layout.copies as usize] = copies[index];
        }
        if let (true, Some(low)) = (self.needs.doubled, low) {
            write(low, &mut into[self.layout.low as usize..]);
        }
        if let (true, Some(normal)) = (self.needs.own_normals, self.scene.normals.get(index)) {
            write(normal, &mut into[self.layout.normal as usize..]);
        }
        if let (true, Some(clip)) = (self.needs.clips, self.scene.clips.get(index)) {
            write(clip.0.as_flattened(), &mut into[self.layout.clip as usize..]);
        }
        if let (true, Some(cap)) = (self.needs.curved, self.scene.caps.get(index)) {
            write(&cap.0, &mut into[self.layout.cap as usize..]);
        }
        if let (true, Some(third)) = (self.needs.solid, self.scene.thirds.get(index)) {
            write(&[*third], &mut into[self.layout.third as usize..]);
        }
        // In a tree a fade belongs to a cut, not to a surfel.
        if let Some(fade) = into.get_mut(self.layout.fade as usize) {
            *fade = self.scene.fades.get(index).copied().unwrap_or(Fade::WHOLE).word();
        }
    }
}

impl Page for ScenePage<'_> {
    fn numbers(&self) -> Cow<'_, [u32]> {
        Cow::Borrowed(&self.indices)
    }

    fn surfels(&self, range: Range<usize>) -> Vec<Surfel> {
        self.indices[range].par_iter().map(|&index| self.surfel(index as usize)).collect()
    }

    fn attributes(&self, range: Range<usize>) -> Vec<u32> {
        let words = self.layout.words as usize;
        let mut values = vec![0; range.len() * words];
        let records = values.par_chunks_exact_mut(words.max(1)).zip(&self.indices[range]);
        records.for_each(|(into, index)| self.write_attributes(*index as usize, into));
        values
    }

    fn balls(&self) -> Vec<[f32; 4]> {
        let disk = |&index: &u32| {
            let index = index as usize;
            let height = self.scene.caps.get(index).map_or(0.0, Cap::highest);
            (self.scene.center(index), &self.scene.surfels[index], height)
        };
        self.indices.par_chunks(BATCH as usize).map(|batch| ball(batch.iter().map(disk))).collect()
    }

    fn stand_for(&self) -> u64 {
        let all = self.indices.len() as u64;
        let of = |copies: &Arc<[u32]>| self.indices.iter().map(|&index| u64::from(copies[index as usize])).sum();
        self.copies.as_ref().map_or(all, of)
    }
}
