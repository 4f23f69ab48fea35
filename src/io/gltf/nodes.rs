//! The nodes of a scene: which meshes it shows, and where.

use glam::DAffine3;

use super::document::{Document, malformed};
use crate::io::fault::Fault;

/// A mesh in its place.
pub(super) struct Placed {
    /// The index of the mesh.
    pub(super) mesh: usize,
    pub(super) to_world: DAffine3,
    pub(super) has_skin: bool,
    pub(super) has_instances: bool,
}

/// The meshes of the default scene; of all nodes if no scene is the default.
pub(super) fn placed(document: &Document) -> Result<Vec<Placed>, Fault> {
    let nodes = &document.root.nodes;
    let mut is_visited = vec![false; nodes.len()];
    let mut placed = Vec::new();
    // A stack, as a chain of nodes may be longer than recursion can be deep.
    let mut left: Vec<(usize, DAffine3)> =
        roots(document)?.into_iter().map(|node| (node, DAffine3::IDENTITY)).collect();
    left.reverse();
    while let Some((number, parent)) = left.pop() {
        let (Some(node), Some(own)) = (nodes.get(number), document.transforms.get(number)) else {
            return Err(malformed(format!("it names the node {number}, which does not exist")));
        };
        if std::mem::replace(&mut is_visited[number], true) {
            return Err(malformed(format!("the node {number} has two parents or is below itself")));
        }
        let to_world = parent * *own;
        if let Some(mesh) = node.mesh {
            let others = node.extensions.as_ref().map(|extensions| &extensions.others);
            let has_instances = others.is_some_and(|others| others.contains_key("EXT_mesh_gpu_instancing"));
            placed.push(Placed { mesh: mesh.value(), to_world, has_skin: node.skin.is_some(), has_instances });
        }
        let children = node.children.iter().flatten().rev();
        left.extend(children.map(|child| (child.value(), to_world)));
    }
    Ok(placed)
}

/// The nodes that have no parent.
fn roots(document: &Document) -> Result<Vec<usize>, Fault> {
    let root = &document.root;
    if let Some(scene) = root.scene {
        let number = scene.value();
        let scene = root.scenes.get(number);
        let scene = scene.ok_or_else(|| malformed(format!("it names the scene {number}, which does not exist")))?;
        return Ok(scene.nodes.iter().map(|node| node.value()).collect());
    }
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        is_child.get_mut(child.value()).into_iter().for_each(|flag| *flag = true);
    }
    let roots: Vec<usize> = (0..is_child.len()).filter(|node| !is_child[*node]).collect();
    if roots.is_empty() && !is_child.is_empty() {
        return Err(malformed("each of its nodes is below another one"));
    }
    Ok(roots)
}
