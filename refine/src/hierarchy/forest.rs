//! What a split hangs on and what hangs on it: the vertex hierarchy, in flat arrays as small as can be.

use super::offsets::Offsets;
use super::rings::Needs;
use super::rows::Rows;
use crate::aif::{NONE, Positions};
use crate::packed::{Packed, Ranks, Run};
use crate::progressive::ProgressiveMesh;
use glam::DVec3;

/// The vertex hierarchy of a progressive mesh.
///
/// A *node* is a vertex as it is between two splits: the base's are `0..n0`, split `i` makes `n0 + 2 i` (the old vertex from then on) and
/// `n0 + 2 i + 1` (the new one). Every node has at most one split that replaces it.
///
/// What replaces what follows from the *chain* of each vertex, its splits in their order: as many bits a split as numbers of splits have, and where the chain begins.
#[derive(Clone, Debug, Default)]
pub(crate) struct Forest {
    pub(crate) base_vertices: u32,
    base_faces: u32,
    faces: u32,
    starts: Offsets,
    chains: Packed,
    two_faces: Ranks,
    /// Of the faces of splits: those that are the first of theirs. Nothing where all splits make two.
    firsts: Ranks,
    moves: Ranks,
    /// What splits need by the rule of the hierarchy.
    pub(crate) needs: Needs,
    /// Where splits have their attributes; nothing without.
    pub(crate) rows: Option<Rows>,
}

impl Forest {
    /// Of a progressive mesh whose references are sound. O(n).
    pub(crate) fn new(pm: &ProgressiveMesh) -> Forest {
        let (vertices, n) = (pm.vertices(), pm.splits.len());
        let mut starts = vec![0u32; vertices + 1];
        pm.splits.vertex.iter().for_each(|&v| starts[v as usize + 1] += 1);
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let mut next = starts.clone();
        let mut chains = vec![0; n];
        for (i, &v) in (0u32..).zip(&pm.splits.vertex) {
            chains[next[v as usize] as usize] = i;
            next[v as usize] += 1;
        }
        let face = n + pm.splits.code.iter().filter(|c| c.two_faces()).count();
        let both = |two: bool| std::iter::once(true).chain(two.then_some(false));
        let base_faces = pm.base_faces.len() as u32;
        let two_faces = Ranks::new(pm.splits.code.iter().map(|c| c.two_faces()));
        let firsts = match two_faces.all() {
            true => Ranks::default(),
            false => Ranks::new(pm.splits.code.iter().flat_map(|c| both(c.two_faces()))),
        };
        Forest {
            base_vertices: pm.base_vertices() as u32,
            base_faces,
            faces: base_faces + face as u32,
            starts: Offsets::new(&starts),
            chains: Packed::of(&chains),
            two_faces,
            firsts,
            moves: Ranks::new(pm.splits.code.iter().map(|c| c.moves())),
            needs: Needs::default(),
            rows: Rows::new(pm),
        }
    }

    /// Splits.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.chains.len()
    }

    /// Faces at full detail.
    pub(crate) fn faces(&self) -> usize {
        self.faces as usize
    }

    /// The splits of vertex `v`, ascending.
    #[inline(always)]
    pub(crate) fn chain(&self, v: u32) -> Run<'_> {
        self.chains.run(self.starts.run(v))
    }

    /// Reads what tells the chain of vertex `v`.
    #[inline(always)]
    pub(crate) fn fetch_chain(&self, v: u32) -> u32 {
        self.starts.fetch(v)
    }

    /// The chain of a vertex that is never split.
    #[inline]
    pub(crate) fn no_chain(&self) -> Run<'_> {
        self.chains.run(0..0)
    }

    /// How many splits of its vertex come before split `i`.
    #[inline]
    fn turn(&self, pm: &ProgressiveMesh, i: u32) -> usize {
        self.chain(pm.splits.vertex[i as usize]).partition_point(|j| j < i)
    }

    /// The node of vertex `v` after the first `k` splits of its chain.
    #[inline]
    pub(crate) fn node_after(&self, v: u32, k: usize) -> u32 {
        match (k.checked_sub(1), v.checked_sub(self.base_vertices)) {
            (Some(last), _) => self.base_vertices + 2 * self.chain(v).at(last),
            (None, Some(maker)) => self.base_vertices + 2 * maker + 1,
            (None, None) => v,
        }
    }

    /// The node that split `i` replaces. O(log chain).
    pub(crate) fn parent(&self, pm: &ProgressiveMesh, i: u32) -> u32 {
        self.node_after(pm.splits.vertex[i as usize], self.turn(pm, i))
    }

    /// For every split the one that made the node it replaces; [`NONE`] for nodes of the base. O(n).
    pub(crate) fn ups(&self) -> Vec<u32> {
        let mut ups = vec![NONE; self.len()];
        for v in 0..self.base_vertices + self.len() as u32 {
            let mut up = v.checked_sub(self.base_vertices).unwrap_or(NONE);
            for i in self.chain(v).iter() {
                ups[i as usize] = std::mem::replace(&mut up, i);
            }
        }
        ups
    }

    /// The split that made a node; [`NONE`] for the base's.
    #[inline]
    pub(crate) fn maker(&self, node: u32) -> u32 {
        node.checked_sub(self.base_vertices).map_or(NONE, |k| k >> 1)
    }

    /// The two nodes that split `i` makes: the old vertex's and the new one's.
    #[inline]
    pub(crate) fn nodes(&self, i: u32) -> [u32; 2] {
        let old = self.base_vertices + 2 * i;
        [old, old + 1]
    }

    /// Where the new vertex of split `i` stands; and the old one after it, if that moves it.
    #[inline]
    pub(crate) fn places_after(&self, pm: &ProgressiveMesh, i: u32) -> (DVec3, Option<DVec3>) {
        let moved = self.moves.get(i).then(|| pm.moved_positions.get(self.moves.before(i) as usize));
        (pm.new_positions.get(i as usize), moved)
    }

    /// The splits that replace those two nodes; [`NONE`] for a leaf.
    #[inline]
    pub(crate) fn below(&self, pm: &ProgressiveMesh, i: u32) -> [u32; 2] {
        let chain = self.chain(pm.splits.vertex[i as usize]);
        let old = chain.get(chain.partition_point(|j| j <= i));
        let new = self.chain(self.base_vertices + i).first();
        [old, new].map(|s| s.unwrap_or(NONE))
    }

    /// Split `i` makes two faces.
    #[inline]
    pub(crate) fn two_faces(&self, i: u32) -> bool {
        self.two_faces.get(i)
    }

    /// The first face that split `i` makes.
    #[inline]
    pub(crate) fn first_face(&self, i: u32) -> u32 {
        self.base_faces + i + self.two_faces.before(i)
    }

    /// The split that makes face `f`, and whether it is its second; `None` of a face of the base, or where there is none.
    #[inline]
    pub(crate) fn maker_of_face(&self, f: u32) -> Option<(u32, bool)> {
        if f >= self.faces {
            return None;
        }
        let k = f.checked_sub(self.base_faces)?;
        if self.two_faces.all() {
            return Some((k / 2, k % 2 == 1));
        }
        // As many splits have begun as faces that are the first of theirs.
        let first = self.firsts.get(k);
        Some((self.firsts.before(k) + u32::from(first) - 1, !first))
    }

    /// Some splits move the vertices that they split.
    #[inline]
    pub(crate) fn any_moves(&self) -> bool {
        !self.moves.none()
    }

    /// Where vertex `v` stands after splits of its chain, the first ones. O(those that do not move it).
    #[inline(always)]
    pub(crate) fn place_after(&self, pm: &ProgressiveMesh, v: u32, applied: Run<'_>) -> DVec3 {
        if self.any_moves()
            && let Some(j) = applied.iter().rev().find(|&j| self.moves.get(j))
        {
            return pm.moved_positions.get(self.moves.before(j) as usize);
        }
        match v.checked_sub(self.base_vertices) {
            None => pm.base_positions.get(v as usize),
            Some(i) => pm.new_positions.get(i as usize),
        }
    }

    /// Where vertex `v` stands after the first `k` splits of its chain. O(splits of it that do not move it).
    #[inline]
    pub(crate) fn place(&self, pm: &ProgressiveMesh, v: u32, k: usize) -> DVec3 {
        self.place_after(pm, v, self.chain(v).prefix(k))
    }

    /// Where vertex `v` stands before split `i`, one of its chain.
    #[inline]
    pub(crate) fn place_before(&self, pm: &ProgressiveMesh, v: u32, i: u32) -> DVec3 {
        self.place(pm, v, self.chain(v).partition_point(|j| j < i))
    }

    /// Where node `k`, which is vertex `v`, stands.
    pub(crate) fn position(&self, pm: &ProgressiveMesh, k: u32, v: u32) -> DVec3 {
        let after = match k.checked_sub(self.base_vertices) {
            Some(at) if at & 1 == 0 => self.chain(v).partition_point(|j| j <= at >> 1),
            _ => 0,
        };
        self.place(pm, v, after)
    }

    /// [`Forest::place`] in the stored precision, appended to `out`.
    pub(crate) fn append_place(&self, pm: &ProgressiveMesh, v: u32, k: usize, out: &mut Positions) {
        let place = self.place(pm, v, k);
        match out {
            // It was f32.
            Positions::F32(all) => all.push(place.as_vec3().to_array()),
            Positions::F64(all) => all.push(place.to_array()),
        }
    }

    /// Whether split `i` moves its vertex, and then where that goes among [`ProgressiveMesh::moved_positions`].
    #[inline(always)]
    pub(crate) fn moved(&self, i: u32) -> (bool, u32) {
        self.moves.find(i)
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.chains.bytes()
            + self.starts.bytes()
            + self.needs.bytes()
            + self.rows.as_ref().map_or(0, Rows::bytes)
            + self.two_faces.bytes()
            + self.firsts.bytes()
            + self.moves.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Tree;
    use super::*;
    use crate::progressive::{SplitCode, Splits};

    /// Splits of any vertices, of one face or two; some move theirs. No mesh: only what the forest looks at.
    fn any() -> ProgressiveMesh {
        let n = 400u32;
        let code = |i: u32| {
            let two = if i % 5 < 3 || i > 300 { SplitCode::TWO_FACES } else { 0 };
            SplitCode(two | if i % 3 == 1 { SplitCode::MOVES } else { 0 })
        };
        let code: Vec<SplitCode> = (0..n).map(code).collect();
        let moved = code.iter().filter(|c| c.moves()).count();
        let points = |n: usize, x: f32| Positions::F32((0..n).map(|k| [k as f32, x, 0.0]).collect());
        ProgressiveMesh {
            base_faces: vec![[0, 1, 2]; 7],
            base_positions: points(3, 1.0),
            new_positions: points(n as usize, 2.0).into(),
            moved_positions: points(moved, 3.0).into(),
            splits: Splits {
                vertex: (0..n).map(|i| i.wrapping_mul(2654435761) % (3 + i)).collect(),
                code,
                ..Default::default()
            },
            ..Default::default()
        }
    }

    #[test]
    fn chains_tell_what_the_tree_does() {
        let pm = any();
        let (f, tree) = (Forest::new(&pm), Tree::new(&pm));
        let ups = f.ups();
        let (mut face, mut moved) = (7, 0);
        let mut places: Vec<DVec3> = (0..3).map(|v| pm.base_positions.get(v)).collect();
        for i in 0..pm.splits.len() as u32 {
            let k = i as usize;
            let (code, v) = (pm.splits.code[k], pm.splits.vertex[k]);
            assert_eq!(f.parent(&pm, i), tree.parent[k]);
            assert_eq!(
                ups[k],
                tree.parent[k].checked_sub(pm.base_vertices() as u32).map_or(NONE, |p| p >> 1)
            );
            assert_eq!(f.below(&pm, i), f.nodes(i).map(|node| tree.split_of[node as usize]));
            assert_eq!(f.first_face(i), face);
            assert_eq!(f.maker_of_face(face), Some((i, false)));
            if code.two_faces() {
                assert_eq!(f.maker_of_face(face + 1), Some((i, true)));
            }
            face += 1 + code.two_faces() as u32;
            assert_eq!(f.position(&pm, tree.parent[k], v), places[v as usize]);
            assert_eq!(f.place_before(&pm, v, i), places[v as usize]);
            if code.moves() {
                places[v as usize] = pm.moved_positions.get(moved);
                moved += 1;
            }
            places.push(pm.new_positions.get(k));
            let [old, new] = f.nodes(i);
            assert_eq!(f.position(&pm, old, v), places[v as usize]);
            assert_eq!(f.position(&pm, new, 3 + i), places[3 + k]);
        }
        assert_eq!((f.maker_of_face(6), f.maker_of_face(face)), (None, None));
        // Of 12 B that the tree takes.
        assert!(f.bytes() < 8 * pm.splits.len(), "{}", f.bytes());
    }
}
