//! The vertex hierarchy spelled out, for walks over all of it.

use crate::aif::NONE;
use crate::progressive::ProgressiveMesh;

/// For every split the node it replaces, and for every node the split that replaces it: 12 B a split. Views have the same from [`super::Forest`] in half of that.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    /// The node that each split replaces.
    pub(crate) parent: Vec<u32>,
    /// The split that replaces each node; [`NONE`] for a leaf.
    pub(crate) split_of: Vec<u32>,
}

impl Tree {
    /// Of a progressive mesh whose references are sound. O(n).
    pub(crate) fn new(pm: &ProgressiveMesh) -> Tree {
        let (n0, n) = (pm.base_vertices() as u32, pm.splits.len());
        let mut split_of = vec![NONE; n0 as usize + 2 * n];
        // The node that each vertex slot is at.
        let mut node: Vec<u32> = (0..n0).collect();
        let mut parent = Vec::with_capacity(n);
        for (i, &v) in (0u32..).zip(&pm.splits.vertex) {
            let at = node[v as usize];
            parent.push(at);
            split_of[at as usize] = i;
            node[v as usize] = n0 + 2 * i;
            node.push(n0 + 2 * i + 1);
        }
        Tree { parent, split_of }
    }
}
