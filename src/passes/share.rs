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
    share: Share,
}

impl ShareOfScene {
    /// The `share` of `scene`.
    pub fn new(scene: Arc<Scene>, share: Share) -> Self {
        Self { scene, share }
    }
}

impl Source for ShareOfScene {
    fn facts(&self) -> Facts {
        let own = self.share.range(self.scene.surfels.len()).len();
        Facts { share: Some(own as u64), ..Facts::of(&self.scene) }
    }

    fn pages<'a>(&'a self, needs: &SceneNeeds, most: usize, ordered: Option<&Facts>) -> Vec<Box<dyn Page + 'a>> {
        pages_of(&self.scene, needs, most, (ordered, Some(self.share)))
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
