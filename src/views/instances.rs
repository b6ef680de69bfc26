//! Every instance of a mesh on its own.

use crate::aif::MeshInput;
use crate::scene::{LooseRows, Scene, SceneMesh};
use glam::DMat4;
use rustc_hash::FxHashMap;

/// What becomes of an instance.
pub(super) enum Fate {
    /// It shows its mesh as before.
    Keep,
    /// It shows nothing.
    Drop,
    /// It shows this instead.
    Replace(Box<MeshInput>),
}

/// Asks for the fate of every instance, and changes the scene accordingly. Instances of one mesh at the same place share one answer.
///
/// Meshes that were shown and no longer are go, so indices of meshes change. Meshes that no node shows stay.
pub(super) fn each<E>(
    scene: &mut Scene,
    mut fate: impl FnMut(&Scene, usize, &DMat4) -> Result<Fate, E>,
) -> Result<(), E> {
    if scene.nodes.is_empty() {
        let mut kept = Vec::new();
        for m in 0..scene.meshes.len() {
            match fate(scene, m, &DMat4::IDENTITY)? {
                Fate::Keep => kept.push(std::mem::take(&mut scene.meshes[m])),
                Fate::Drop => {}
                Fate::Replace(geometry) => {
                    let mut mesh = SceneMesh { geometry: *geometry, ..std::mem::take(&mut scene.meshes[m]) };
                    mesh.extras.loose = LooseRows::default();
                    kept.push(mesh);
                }
            }
        }
        scene.meshes = kept;
        return Ok(());
    }
    let shown = shown(scene);
    let mut known: FxHashMap<(usize, [u64; 16]), usize> = FxHashMap::default();
    let (mut fates, mut of_node) = (Vec::new(), Vec::new());
    for &(n, m, world) in &shown {
        let key = (m, world.to_cols_array().map(f64::to_bits));
        let k = match known.get(&key) {
            Some(&k) => k,
            None => {
                fates.push((m, Some(fate(scene, m, &world)?)));
                known.insert(key, fates.len() - 1);
                fates.len() - 1
            }
        };
        of_node.push((n, k));
    }
    // The mesh's own place goes to the first replacement, unless something still shows it as it was.
    let mut taken = vec![false; scene.meshes.len()];
    let mut users = vec![0usize; scene.meshes.len()];
    scene.nodes.iter().filter_map(|n| n.mesh.filter(|&m| m < taken.len())).for_each(|m| users[m] += 1);
    let mut was_shown = vec![false; scene.meshes.len()];
    for &(_, m, _) in &shown {
        users[m] -= 1;
        was_shown[m] = true;
    }
    for (m, fate) in &fates {
        taken[*m] |= users[*m] > 0 || matches!(fate, Some(Fate::Keep));
    }
    let mut target: Vec<Option<usize>> = Vec::new();
    for (m, fate) in &mut fates {
        target.push(match fate.take() {
            Some(Fate::Keep) => Some(*m),
            Some(Fate::Replace(geometry)) => Some(if std::mem::replace(&mut taken[*m], true) {
                let old = &scene.meshes[*m];
                let mut mesh = SceneMesh { geometry: *geometry, ..Default::default() };
                (mesh.name, mesh.groups) = (old.name.clone(), old.groups.clone());
                mesh.extras.of_faces = old.extras.of_faces.clone();
                scene.meshes.push(mesh);
                if let Some(source) = &mut scene.gltf {
                    source.copy_mesh(*m);
                }
                scene.meshes.len() - 1
            } else {
                scene.meshes[*m].geometry = *geometry;
                scene.meshes[*m].extras.loose = LooseRows::default();
                *m
            }),
            Some(Fate::Drop) | None => None,
        });
    }
    for (n, k) in of_node {
        scene.nodes[n].mesh = target[k];
        if let Some(source) = &mut scene.gltf {
            source.set_node_mesh(n, target[k]);
        }
    }
    let gone: Vec<bool> =
        (0..scene.meshes.len()).map(|m| m < taken.len() && was_shown[m] && !taken[m]).collect();
    remove(scene, &gone);
    Ok(())
}

/// Nodes that show a mesh, with it and their transform to the world.
fn shown(scene: &Scene) -> Vec<(usize, usize, DMat4)> {
    let world = scene.world_transforms();
    let mut reached = vec![false; scene.nodes.len()];
    let mut stack = scene.roots.clone();
    while let Some(n) = stack.pop() {
        let Some(node) = scene.nodes.get(n) else { continue };
        if !std::mem::replace(&mut reached[n], true) {
            stack.extend(&node.children);
        }
    }
    let mesh = |n: usize| scene.nodes[n].mesh.filter(|&m| m < scene.meshes.len());
    (0..scene.nodes.len()).filter(|&n| reached[n]).filter_map(|n| Some((n, mesh(n)?, world[n]))).collect()
}

fn remove(scene: &mut Scene, gone: &[bool]) {
    let mut gone = gone.to_vec();
    if let Some(source) = &mut scene.gltf {
        source.remove_meshes(&mut gone);
    }
    let mut map = Vec::with_capacity(gone.len());
    let mut count = 0;
    for &g in &gone {
        map.push((!g).then_some(count));
        count += !g as usize;
    }
    let mut m = 0;
    scene.meshes.retain(|_| {
        m += 1;
        !gone[m - 1]
    });
    for node in &mut scene.nodes {
        node.mesh = node.mesh.and_then(|m| map.get(m).copied().flatten());
    }
}

/// True if a mesh moves with a skin: where it is drawn is not where its vertices are.
pub(super) fn is_skinned(mesh: &SceneMesh) -> bool {
    let joints = |c: &crate::aif::Channel| matches!(c.semantic, crate::aif::Semantic::Joints(_));
    mesh.geometry.wedges.as_ref().is_some_and(|w| w.channels().iter().any(joints))
}
