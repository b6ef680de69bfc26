//! Errors of splits, roughly, to put the splits into an order: vertices of the finest mesh are followed from face to face while splits are undone; where a face has many, some are left out.

use super::Finest;
use super::deviation::keep_farthest;
use super::forest::Forest;
use super::nearest::{Reach, nearest};
use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;
use crate::selective::Front;

/// Vertices a face that are followed, on average.
const FEW: usize = 4;

/// For every split the largest distance of a vertex of the finest mesh that undoing it leads to. `front` is at full detail. O(n log n) for meshes whose hierarchy is as deep.
pub(super) fn errors(pm: &ProgressiveMesh, forest: &Forest, mut front: Front, finest: &Finest) -> Vec<f64> {
    let Finest { positions: vertices, corners, origin, .. } = finest;
    let mut positions = vertices.clone();
    // The first vertex on the face in each slot, the next of each, and how far it was when it was put there.
    let mut first = vec![NONE; corners.len()];
    let mut next = vec![NONE; vertices.len()];
    let mut distance = vec![0.0f32; vertices.len()];
    let mut seen = vec![false; vertices.len()];
    for (slot, f) in corners.iter().enumerate().filter(|(_, f)| f[0] != f[1]) {
        for &v in f {
            if !std::mem::replace(&mut seen[v as usize], true) {
                next[v as usize] = std::mem::replace(&mut first[slot], v);
            }
        }
    }
    let mut errors = vec![0.0f64; forest.len()];
    let (mut star, mut loose, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for i in (0..forest.len() as u32).rev() {
        star.clear();
        loose.clear();
        for h in front.middle(pm, i) {
            front.star(h, &mut star);
        }
        for &slot in &star {
            let mut v = std::mem::replace(&mut first[slot as usize], NONE);
            while v != NONE {
                loose.push(v);
                v = next[v as usize];
            }
        }
        let beside = front.beside(pm, i);
        front.unsplit(pm, forest, i);
        let vs = pm.splits.vertex[i as usize];
        positions[vs as usize] = forest.place_before(pm, vs, i) - *origin;
        star.clear();
        if let Some(h) = beside {
            front.star(h, &mut star);
        }
        keep_farthest(&mut loose, FEW * star.len(), |v| distance[v as usize]);
        let at = |w: u32| positions[front.wedge_vertex(w) as usize];
        triangles.clear();
        triangles.extend(star.iter().map(|&s| Reach::of(front.corners()[s as usize].map(at))));
        for &v in &loose {
            let (d, on) = nearest(vertices[v as usize], &triangles);
            let Some(&slot) = star.get(on) else { continue };
            next[v as usize] = std::mem::replace(&mut first[slot as usize], v);
            distance[v as usize] = d as f32;
            errors[i as usize] = errors[i as usize].max(d);
        }
    }
    errors
}
