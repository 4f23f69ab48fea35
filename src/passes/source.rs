//! Where the surfels that a device draws come from: a [`Scene`] in memory, or whatever else can tell its facts and give its pages.
//! Nothing but the f64 reference needs all of them at once.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::cull::ball;
use super::order::order;
use crate::gpu::layout::BATCH;
use crate::plan::{ColorNeed, Facts, SceneNeeds, SurfelLayout};
use crate::scene::{Cap, Colors, Mipmap, Provenance, Scene, Surfel, Triangles, copies};

/// Surfels, page by page.
pub trait Source: Send + Sync {
    /// The ranges of their values, and their counts.
    fn facts(&self) -> Facts;

    /// Pages of at most `most` surfels as a render with `needs` draws them, in the [`order`] that draws well if they are to be `ordered`.
    /// Where a surfel stands for its copies these are left out.
    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>>;

    /// What paints them, by the numbers of an [`Atlas`](crate::scene::Atlas).
    fn textures(&self) -> &[Mipmap];

    /// The triangles beside them.
    fn triangles(&self) -> Option<&Triangles> {
        None
    }

    /// Which points of which inputs they are, by the numbers that pages give.
    fn provenance(&self) -> Cow<'_, Provenance>;

    /// All of them in memory, for the reference.
    fn whole(&self) -> Option<&Scene>;
}

/// Consecutive surfels of a [`Source`].
pub trait Page {
    /// The number of each in the source.
    fn numbers(&self) -> Cow<'_, [u32]>;

    /// The surfels of a range.
    fn surfels(&self, range: Range<usize>) -> Vec<Surfel>;

    /// The attributes of a range, as records of [`SurfelLayout::words`].
    fn attributes(&self, range: Range<usize>) -> Vec<u32>;

    /// The bounding ball of each batch: centre and radius, world units relative to the origin.
    fn balls(&self) -> Vec<[f32; 4]>;

    /// Surfels that they stand for together.
    fn stand_for(&self) -> u64;
}

/// A source that another value leads to is one too.
macro_rules! leads_to_source {
    ($($other:ty),*) => {$(
        impl<S: Source + ?Sized> Source for $other {
            fn facts(&self) -> Facts {
                (**self).facts()
            }

            fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
                (**self).pages(needs, most, ordered)
            }

            fn textures(&self) -> &[Mipmap] {
                (**self).textures()
            }

            fn triangles(&self) -> Option<&Triangles> {
                (**self).triangles()
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
        let given = || (0..self.surfels.len() as u32).collect();
        let mut order = ordered.map_or_else(given, |facts| order(self, &facts.core));
        let copies: Option<Arc<[u32]>> = needs.copies.then(|| copies(self).into());
        if let Some(copies) = &copies {
            order.retain(|&index| copies[index as usize] > 0);
        }
        let page = |indices: &[u32]| ScenePage {
            scene: self,
            needs: *needs,
            layout: SurfelLayout::of(needs),
            indices: indices.into(),
            copies: copies.clone(),
        };
        let of = |indices: &[u32]| Box::new(page(indices)) as Box<dyn Page>;
        if !needs.separate {
            return order.chunks(most).map(of).collect();
        }
        let own = self.provenance.ranges(self.surfels.len() as u64);
        let individual = own.map(|own| order.iter().copied().filter(|&index| own.contains(&index.into())).collect());
        individual.flat_map(|indices: Vec<u32>| indices.chunks(most).map(of).collect::<Vec<_>>()).collect()
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

    fn provenance(&self) -> Cow<'_, Provenance> {
        Cow::Borrowed(&self.provenance)
    }

    fn whole(&self) -> Option<&Scene> {
        Some(self)
    }
}

/// The surfels of a scene at `indices`.
struct ScenePage<'a> {
    scene: &'a Scene,
    needs: SceneNeeds,
    layout: SurfelLayout,
    indices: Box<[u32]>,
    /// Of every surfel of the scene; 0 of those that another stands for.
    copies: Option<Arc<[u32]>>,
}

impl ScenePage<'_> {
    fn write_attributes(&self, index: usize, into: &mut [u32]) {
        let bits = |vectors: &[[f32; 4]], into: &mut [u32]| {
            vectors.iter().flatten().zip(into).for_each(|(value, into)| *into = value.to_bits());
        };
        let low = self.scene.low.get(index);
        match (self.needs.color, &self.scene.colors) {
            (ColorNeed::Srgb8, Colors::Srgb8(codes)) => into[0] = u32::from_le_bytes(codes[index]),
            (ColorNeed::Linear, colors) => bits(&[colors.linear(index)], into),
            (ColorNeed::Harmonics(_), Colors::Harmonics(harmonics)) => {
                bits(&[harmonics.colors()[index]], into);
                harmonics.terms(index).iter().zip(&mut into[4..]).for_each(|(value, into)| *into = value.to_bits());
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
            let into = &mut into[self.layout.low as usize..];
            low.iter().zip(into).for_each(|(value, into)| *into = value.to_bits());
        }
        if let (true, Some(normal)) = (self.needs.own_normals, self.scene.normals.get(index)) {
            let into = &mut into[self.layout.normal as usize..];
            normal.iter().zip(into).for_each(|(value, into)| *into = value.to_bits());
        }
        if let (true, Some(clip)) = (self.needs.clips, self.scene.clips.get(index)) {
            let into = &mut into[self.layout.clip as usize..];
            clip.0.iter().flatten().zip(into).for_each(|(value, into)| *into = value.to_bits());
        }
        if let (true, Some(cap)) = (self.needs.curved, self.scene.caps.get(index)) {
            let into = &mut into[self.layout.cap as usize..];
            cap.0.iter().zip(into).for_each(|(value, into)| *into = value.to_bits());
        }
    }
}

impl Page for ScenePage<'_> {
    fn numbers(&self) -> Cow<'_, [u32]> {
        Cow::Borrowed(&self.indices)
    }

    fn surfels(&self, range: Range<usize>) -> Vec<Surfel> {
        self.indices[range].par_iter().map(|&index| self.scene.surfels[index as usize]).collect()
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
