//! What pieces of the surface the nodes of a hierarchy stand for, and where splits cut them.

use super::TrulyError;
use super::mesh::{Gap, Mesh};
use crate::aif::{NONE, Positions};
use crate::hierarchy::{Forest, Hierarchy};
use crate::progressive::{Cursor, Explicit, Half, ProgressiveMesh, SplitKind, link_faces};
use glam::DVec3;
use std::collections::HashMap;

/// The static part of truly selective refinement: 47 B a vertex, with attributes about 50 B more.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    /// The split that made the vertex of each split; [`NONE`] for vertices of the base.
    up: Vec<u32>,
    /// The split that replaces each node; [`NONE`] for a leaf.
    split_of: Vec<u32>,
    /// Where each vertex of the finest mesh comes, when those of every node follow each other.
    order: Vec<u32>,
    /// Where the vertices of each vertex of the base end in that order.
    ends: Vec<u32>,
    /// The corners of every face in the finest mesh, by that order.
    leaves: Vec<[u32; 3]>,
    /// The split that parts the cut vertices of each; [`NONE`] if they never were one vertex, or there is one only.
    apart: Vec<u32>,
    /// A face at every vertex of the base; [`NONE`] for none.
    around: Vec<u32>,
    /// Normals of the vertices of the finest mesh, in that order, times 127.
    normals: Vec<[i8; 3]>,
    /// For splits of vertices with several fans a face of the fan that they open; ascending.
    elsewhere: Vec<(u32, u32)>,
    pub(super) wedges: Option<WedgePieces>,
}

/// The wedges of the finest mesh, and what they come of.
#[derive(Clone, Debug, Default)]
pub(super) struct WedgePieces {
    /// The wedges of every face at full detail.
    corners: Vec<[u32; 3]>,
    /// For every wedge the split that made it, and the wedge that it comes of; [`NONE`] for the base's.
    from: Vec<[u32; 2]>,
    /// The row of each at full detail.
    row: Vec<u32>,
    /// For every row the split that brings it, [`NONE`] for the base's, and the row that its wedge had before: itself for the first.
    brought: Vec<[u32; 2]>,
}

impl Pieces {
    /// O(n times the depth of the hierarchy).
    pub(super) fn new(h: &Hierarchy) -> Result<Pieces, TrulyError> {
        let (pm, forest) = (h.mesh(), &h.forest);
        let mut full = pm.cursor()?;
        let wedges = pm.wedges.is_some().then(|| WedgePieces::new(pm, forest, &mut full)).transpose()?;
        full.seek(usize::MAX)?;
        let corners: Vec<[u32; 3]> = full.indices().iter().map(|f| f.map(|w| full.wedge_vertex(w))).collect();
        let base = base_corners(pm);
        simple_edges(&base)?;
        let tree = Tree::new(pm, forest);
        let Line { order, ends, leaf } = Line::new(pm, forest, &tree.split_of);
        let mut apart = vec![NONE; forest.len()];
        for i in 0..forest.len() as u32 {
            let code = pm.splits.code[i as usize];
            if code.two_faces() {
                let first = forest.first_face(i) as usize;
                let [l, r] = [corners[first][code.left().0], corners[first + 1][code.right().0]];
                let by = parting(forest, &tree.parent, [leaf[l as usize], leaf[r as usize]]);
                // It is there when the split is made: else the recorded mesh would have its cut vertices in one.
                let by = by.filter(|&by| by == NONE || by < i).ok_or(TrulyError::Unfit(i as usize))?;
                apart[i as usize] = by;
            }
        }
        let mut around = vec![NONE; pm.base_vertices()];
        for (f, v) in (0u32..).zip(&base).flat_map(|(f, t)| t.iter().map(move |&v| (f, v))) {
            around[v as usize] = f;
        }
        let leaves = corners.iter().map(|f| f.map(|v| order[v as usize])).collect();
        let mut normals = vec![[0; 3]; order.len()];
        for (v, n) in vertex_normals(&corners, full.positions()).into_iter().enumerate() {
            normals[order[v] as usize] = (127.0 * n).round().to_array().map(|x| x as i8);
        }
        let up = tree.parent.iter().map(|&k| forest.maker(k)).collect();
        let split_of = tree.split_of;
        let mut pieces = Pieces {
            up,
            split_of,
            order,
            ends,
            leaves,
            apart,
            around,
            normals,
            elsewhere: Vec::new(),
            wedges,
        };
        pieces.go_through(h, &base)?;
        Ok(pieces)
    }

    /// Makes all splits, and finds out about fans; errors if the mesh at the end is not the finest.
    fn go_through(&mut self, h: &Hierarchy, base: &[[u32; 3]]) -> Result<(), TrulyError> {
        let pm = h.mesh();
        let mut fans = several_fans(base, pm.base_vertices());
        let (mut mesh, mut gap) = (Mesh::new(h, self), Gap::default());
        for i in 0..h.splits() as u32 {
            let vs = pm.splits.vertex[i as usize];
            let found = match fans.get_mut(&vs) {
                None => mesh.locate(h, self, i, self.face_at(h, i), &mut gap),
                Some(starts) => {
                    let at = starts.iter().position(|&f| mesh.locate(h, self, i, f, &mut gap));
                    if let Some(at) = at {
                        self.elsewhere.push((i, starts[at]));
                        starts[at] = h.forest.first_face(i);
                    }
                    at.is_some()
                }
            };
            if !found {
                return Err(TrulyError::Unfit(i as usize));
            }
            mesh.split(h, self, i, &gap);
        }
        let whole = |v: u32, leaf: &u32| self.order[v as usize] == *leaf;
        for (slot, &f) in mesh.face_in().iter().enumerate() {
            if f == NONE {
                continue;
            }
            let same = mesh.corners()[slot].iter().zip(&self.leaves[f as usize]).all(|(&v, l)| whole(v, l));
            if !same {
                return Err(TrulyError::Unfit(h.splits().saturating_sub(1)));
            }
        }
        Ok(())
    }

    /// Where a vertex comes in the order of the vertices of the finest mesh.
    #[inline]
    pub(super) fn order(&self, v: u32) -> u32 {
        self.order[v as usize]
    }

    /// Where the vertices of each vertex of the base end in that order.
    pub(super) fn ends(&self) -> &[u32] {
        &self.ends
    }

    /// The vertex, by that order, that corner `k` of face `f` has in the finest mesh.
    #[inline]
    pub(super) fn leaf(&self, f: u32, k: usize) -> u32 {
        self.leaves[f as usize][k]
    }

    /// Where face `f` looks at full detail: the sum of its vertices' normals there, of any length. 0 if that tells nothing.
    #[inline]
    pub(super) fn looks(&self, f: u32) -> DVec3 {
        let of = |leaf: u32| DVec3::from_array(self.normals[leaf as usize].map(f64::from));
        self.leaves[f as usize].into_iter().map(of).sum()
    }

    /// The split that parts the cut vertices of split `i`; [`NONE`] for none.
    #[inline]
    pub(super) fn apart(&self, i: u32) -> u32 {
        self.apart[i as usize]
    }

    /// A face at the vertex of split `i`, in the fan that it opens, in every mesh in which it may be applied; [`NONE`] if there cannot be.
    #[inline]
    pub(super) fn face_at(&self, h: &Hierarchy, i: u32) -> u32 {
        if let Ok(k) = self.elsewhere.binary_search_by_key(&i, |e| e.0) {
            return self.elsewhere[k].1;
        }
        match self.up(i) {
            NONE => self.around[h.mesh().splits.vertex[i as usize] as usize],
            // Made by a split, a vertex stays at that one's face until the next.
            p => h.forest.first_face(p),
        }
    }

    /// The split that made the vertex of split `i`; [`NONE`] for one of the base.
    #[inline]
    pub(super) fn up(&self, i: u32) -> u32 {
        self.up[i as usize]
    }

    /// The split that replaces node `k`; [`NONE`] for a leaf.
    #[inline]
    pub(super) fn split_of(&self, k: u32) -> u32 {
        self.split_of[k as usize]
    }

    /// The node that split `i` replaces.
    #[inline]
    pub(super) fn parent(&self, h: &Hierarchy, i: u32) -> u32 {
        let v = h.mesh().splits.vertex[i as usize];
        match self.up(i) {
            NONE => v,
            p => h.forest.nodes(p)[usize::from(v == h.forest.base_vertices + p)],
        }
    }

    pub(super) fn bytes(&self) -> usize {
        let tree = self.up.len() + self.split_of.len();
        let numbers = self.order.len() + self.ends.len() + self.apart.len() + self.around.len();
        let wedges = self
            .wedges
            .as_ref()
            .map_or(0, |w| 12 * w.corners.len() + 8 * (w.from.len() + w.brought.len()) + 4 * w.row.len());
        4 * (tree + numbers)
            + 3 * self.normals.len()
            + 12 * self.leaves.len()
            + 8 * self.elsewhere.len()
            + wedges
    }
}

/// Of unit length, or 0.
fn vertex_normals(faces: &[[u32; 3]], positions: &Positions) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for f in faces {
        let p = f.map(|v| positions.get(v as usize));
        let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        f.iter().for_each(|&v| sums[v as usize] += normal);
    }
    sums.iter().map(|n| n.normalize_or_zero()).collect()
}

/// The vertices of the base's faces.
pub(super) fn base_corners(pm: &ProgressiveMesh) -> Vec<[u32; 3]> {
    let vertex = |w: u32| pm.wedges.as_ref().map_or(w, |s| s.base_vertex[w as usize]);
    pm.base_faces.iter().map(|f| f.map(vertex)).collect()
}

/// Errors at an edge of three or more faces.
fn simple_edges(faces: &[[u32; 3]]) -> Result<(), TrulyError> {
    let edge = |f: &[u32; 3], k: usize| (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]));
    let mut all: Vec<(u32, u32)> = faces.iter().flat_map(|f| [edge(f, 0), edge(f, 1), edge(f, 2)]).collect();
    all.sort_unstable();
    match all.chunk_by(|a, b| a == b).find(|run| run.len() > 2) {
        Some(run) => Err(TrulyError::Edge(run[0].0, run[0].1, run.len())),
        None => Ok(()),
    }
}

/// For vertices with several fans a face in each.
fn several_fans(faces: &[[u32; 3]], vertices: usize) -> HashMap<u32, Vec<u32>> {
    let links = link_faces(faces, vertices);
    let mut seen = vec![[false; 3]; faces.len()];
    let mut starts: Vec<(u32, u32)> = Vec::new();
    let mut stack = Vec::new();
    for f in 0..faces.len() {
        for k in 0..3 {
            if seen[f][k] {
                continue;
            }
            let v = faces[f][k];
            starts.push((v, f as u32));
            stack.push((f, k));
            while let Some((f, k)) = stack.pop() {
                if std::mem::replace(&mut seen[f][k], true) {
                    continue;
                }
                let own = Half::new(f as u32, k as u32, true);
                for h in [own, own.turn()] {
                    let link = links[f][h.edge() as usize];
                    if let Some(o) = crate::progressive::links::across(h, link) {
                        stack.push((o.face() as usize, o.corner()));
                    }
                }
            }
        }
    }
    starts.sort_unstable();
    let several = starts.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1);
    several.map(|run| (run[0].0, run.iter().map(|s| s.1).collect())).collect()
}

/// The hierarchy spelled out.
struct Tree {
    /// The node that each split replaces.
    parent: Vec<u32>,
    /// The split that replaces each node; [`NONE`] for a leaf.
    split_of: Vec<u32>,
}

impl Tree {
    fn new(pm: &ProgressiveMesh, forest: &Forest) -> Tree {
        let mut node: Vec<u32> = (0..forest.base_vertices).collect();
        let mut split_of = vec![NONE; node.len() + 2 * forest.len()];
        let mut parent = Vec::with_capacity(forest.len());
        for (i, &v) in (0u32..).zip(&pm.splits.vertex) {
            let [old, new] = forest.nodes(i);
            let at = std::mem::replace(&mut node[v as usize], old);
            parent.push(at);
            split_of[at as usize] = i;
            node.push(new);
        }
        Tree { parent, split_of }
    }
}

/// The vertices of the finest mesh, those of every node together.
struct Line {
    order: Vec<u32>,
    ends: Vec<u32>,
    /// The last node of every vertex.
    leaf: Vec<u32>,
}

impl Line {
    fn new(pm: &ProgressiveMesh, forest: &Forest, split_of: &[u32]) -> Line {
        let (n0, n) = (forest.base_vertices, pm.vertices());
        let mut line = Line { order: vec![0; n], ends: Vec::new(), leaf: vec![NONE; n] };
        let (mut next, mut stack) = (0, Vec::new());
        for v in 0..n0 {
            stack.push((v, v));
            while let Some((k, v)) = stack.pop() {
                match split_of[k as usize] {
                    NONE => {
                        (line.order[v as usize], line.leaf[v as usize]) = (next, k);
                        next += 1;
                    }
                    i => {
                        // The old vertex's come first: it is the first of all its nodes.
                        let [old, new] = forest.nodes(i);
                        stack.extend([(new, n0 + i), (old, v)]);
                    }
                }
            }
            line.ends.push(next);
        }
        line
    }
}

/// The split below which two nodes first are apart; [`NONE`] if they come of different vertices of the base; `None` if one comes of the other.
fn parting(forest: &Forest, parent: &[u32], [mut a, mut b]: [u32; 2]) -> Option<u32> {
    loop {
        let (x, y) = (forest.maker(a), forest.maker(b));
        if a == b {
            return None;
        }
        if x == y {
            return Some(x);
        }
        // The later-made of the two is not above the other.
        if y == NONE || (x != NONE && x > y) {
            a = parent[x as usize];
        } else {
            b = parent[y as usize];
        }
    }
}

impl WedgePieces {
    /// `cursor` is at the base, and at full detail afterwards.
    fn new(
        pm: &ProgressiveMesh,
        forest: &Forest,
        cursor: &mut Cursor<&ProgressiveMesh>,
    ) -> Result<Self, TrulyError> {
        let Some(streams) = &pm.wedges else { return Ok(WedgePieces::default()) };
        let base = streams.base_vertex.len() as u32;
        let mut from = vec![[NONE; 2]; base as usize];
        let mut row: Vec<u32> = (0..base).collect();
        let mut brought: Vec<[u32; 2]> = (0..streams.present.len() as u32).map(|r| [NONE, r]).collect();
        for (i, rows) in (0u32..).zip(pm.rows_of_splits()) {
            let (code, first) = (pm.splits.code[i as usize], forest.first_face(i) as usize);
            let wedge = cursor.wedge_count() as u32;
            cursor.refine()?;
            // The wedge of a new face at the old vertex.
            let old = |face: usize, (tip, vu_next): (usize, bool)| {
                cursor.indices()[face][if vu_next { (tip + 2) % 3 } else { (tip + 1) % 3 }]
            };
            let l = old(first, code.left());
            let r = if code.two_faces() { old(first + 1, code.right()) } else { l };
            let (pairs, changed) = match code.kind() {
                SplitKind::Plain => (vec![(l, wedge)], vec![l]),
                SplitKind::Seam => (vec![(l, wedge), (r, wedge + 1)], vec![l, r]),
                SplitKind::Explicit => {
                    let at = rows.explicit.start;
                    let e =
                        Explicit::read(&streams.explicit, at, code.two_faces(), wedge).unwrap_or_default();
                    (e.pairs, e.changed)
                }
            };
            from.resize(cursor.wedge_count(), [i, NONE]);
            pairs.iter().filter(|p| p.1 >= wedge).for_each(|p| from[p.1 as usize][1] = p.0);
            let changed = if code.changes_rows() { &changed[..] } else { &[] };
            let mut at = rows.first_row as u32;
            for _ in 0..rows.new {
                row.push(at);
                brought[at as usize][0] = i;
                at += 1;
            }
            for &c in changed {
                brought[at as usize] = [i, std::mem::replace(&mut row[c as usize], at)];
                at += 1;
            }
        }
        Ok(WedgePieces { corners: cursor.indices().to_vec(), from, row, brought })
    }

    /// The wedge of corner `k` of face `f` where splits are applied as `applied` says: the one it has at full detail, or what that came of.
    pub(super) fn wedge(&self, f: u32, k: usize, applied: impl Fn(u32) -> bool) -> u32 {
        let mut w = self.corners[f as usize][k];
        loop {
            match self.from[w as usize] {
                [by, before] if by != NONE && before != NONE && !applied(by) => w = before,
                _ => return w,
            }
        }
    }

    /// The row of wedge `w`: the last that an applied split brought, or its first.
    pub(super) fn row(&self, w: u32, applied: impl Fn(u32) -> bool) -> u32 {
        let mut row = self.row[w as usize];
        loop {
            let [by, before] = self.brought[row as usize];
            if by == NONE || before == row || applied(by) {
                return row;
            }
            row = before;
        }
    }
}
