//! Sources of a frame that several processes draw together: a share of a scene's surfels, and none
//! of them for the process that merges.
//!
//! A picture depends on facts of the whole scene, such as the range of its colours and its largest
//! radius, so these sources have the [`Facts`] of the whole scene.

use std::borrow::Cow;
use std::sync::Arc;

use super::source::{Page, Source, pages_of};
use crate::plan::{Facts, SceneNeeds};
use crate::scene::{Mipmap, Provenance, Scene, Share, Triangles};

/// A share of a scene's surfels, with all of its triangles.
pub struct ShareOfScene {
    scene: Arc<Scene>,
    /// The share that is drawn; None if the scene has no other surfels, but the facts of all.
    share: Option<Share>,
}

impl ShareOfScene {
    /// The `share` of `scene`.
    pub fn new(scene: Arc<Scene>, share: Share) -> Self {
        Self { scene, share: Some(share) }
    }

    /// All surfels of `scene`, which is a share of what its [`part_of`](Scene::part_of) describes.
    pub fn whole(scene: Arc<Scene>) -> Self {
        Self { scene, share: None }
    }
}

/// The facts of all surfels of which a scene has a share: those that its
/// [`part_of`](Scene::part_of) states, and nothing that depends on the share.
pub fn facts_of_all(scene: &Scene) -> Facts {
    let facts = Facts::of(scene);
    Facts { individuals: vec![facts.surfels], copies: false, sample: Vec::new(), ..facts }
}

impl Source for ShareOfScene {
    fn facts(&self) -> Facts {
        let count = self.scene.surfels.len();
        match self.share {
            Some(share) => Facts { share: Some(share.range(count).len() as u64), ..Facts::of(&self.scene) },
            None => Facts { share: Some(count as u64), ..facts_of_all(&self.scene) },
        }
    }

    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        pages_of(&self.scene, needs, most, (ordered, self.share))
    }

    fn first(&self) -> u32 {
        self.share.map_or(0, |share| share.range(self.scene.surfels.len()).start as u32)
    }

    fn textures(&self) -> &[Mipmap] {
        self.scene.textures()
    }

    fn triangles(&self) -> Option<&Triangles> {
        Source::triangles(&*self.scene)
    }

    fn provenance(&self) -> Cow<'_, Provenance> {
        Cow::Borrowed(&self.scene.provenance)
    }
}

/// No surfels and no triangles, with the facts of a scene.
pub struct NoneOfScene(Facts);

impl NoneOfScene {
    /// Nothing of the scene that `facts` describe.
    pub fn new(facts: Facts) -> Self {
        Self(Facts { share: Some(0), ..facts })
    }
}

impl Source for NoneOfScene {
    fn facts(&self) -> Facts {
        self.0.clone()
    }

    fn pages<'a>(&'a self, _: &SceneNeeds, _: usize, _: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        Vec::new()
    }
}
