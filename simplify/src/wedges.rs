//! Attributes follow a collapse: every wedge of the kept vertex gets the values at its new place.

use crate::log::Notes;
use crate::work::{Roles, Work, wedge_at};
use glam::DVec3;
use progmesh_aif::{EdgeId, EdgeUse, FaceId, NONE, Semantic, Topology, VertexId, Wedges};

/// Merges wedges when an edge collapses.
pub(crate) struct WedgeMerge {
    active: bool,
    row: Vec<f32>,
    influences: Vec<(f32, f32)>,
    /// Corners of the removed vertex and their wedges, where nobody notes them.
    corners: Vec<(u32, u32)>,
}

/// A face on the edge: its wedges at the kept vertex, the removed vertex and the tip, and weights that give the new place.
pub(crate) struct Side {
    pub(crate) wedges: [u32; 3],
    pub(crate) weights: [f64; 3],
}

impl WedgeMerge {
    /// Gives every group of corners between seams a wedge of its own, so that values can change in place. O(n).
    pub(crate) fn new(work: &mut Work<'_>) -> Self {
        let Some(mut wedges) = work.mesh.wedges_mut().take() else {
            return WedgeMerge {
                active: false,
                row: Vec::new(),
                influences: Vec::new(),
                corners: Vec::new(),
            };
        };
        separate_groups(work, &mut wedges);
        let stride = wedges.stride();
        *work.mesh.wedges_mut() = Some(wedges);
        WedgeMerge { active: true, row: vec![0.0; stride], influences: Vec::new(), corners: Vec::new() }
    }

    /// Updates the wedges for the collapse of `e`, before the topology changes, and writes down what it overwrites. Corners of triangles on `e`, which
    /// vanish, stay as they are.
    pub(crate) fn merge(
        &mut self,
        work: &mut Work<'_>,
        e: EdgeId,
        roles: &Roles,
        to: DVec3,
        notes: Option<Notes<'_>>,
    ) {
        if !self.active {
            return;
        }
        let Some(mut wedges) = work.mesh.wedges_mut().take() else { return };
        let t = work.mesh.topology();
        let mut sides: [Option<Side>; 2] = [None, None];
        for (side, &f) in sides.iter_mut().zip(t.edge_faces(e)) {
            *side = Some(make_side(work, &wedges, f, e, roles, to));
        }
        // Where the edge is no seam, both sides have the same pair: the one whose triangle the new place lies over decides.
        if let [Some(x), Some(y)] = &sides
            && x.wedges[..2] == y.wedges[..2]
        {
            let drop = if x.weights[2] >= y.weights[2] { 1 } else { 0 };
            sides[drop] = None;
        }
        let mut own = std::mem::take(&mut self.corners);
        own.clear();
        let (corners, mut noted) = match notes {
            Some(Notes { corners, rows, values }) => (corners, Some((rows.len(), rows, values))),
            None => (&mut own, None),
        };
        let first = corners.len();
        gather_corners(t, &wedges.corner, e, roles.removed, corners);
        for side in sides.iter().flatten() {
            let [wk, wr, _] = side.wedges;
            if wk == NONE || wr == NONE {
                continue;
            }
            if !roles.fixed {
                self.interpolate(&wedges, side);
                let (had, has) = (wedges.present(wk), wedges.present(wk) | wedges.present(wr));
                let same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits();
                if had != has || !wedges.row(wk).iter().zip(&self.row).all(same) {
                    if let Some((start, rows, values)) = &mut noted
                        && rows[*start..].iter().all(|r| r.0 != wk)
                    {
                        rows.push((wk, had));
                        values.extend_from_slice(wedges.row(wk));
                    }
                    wedges.row_mut(wk).copy_from_slice(&self.row);
                    wedges.set_present(wk, has);
                }
            }
            for &(c, _) in &corners[first..] {
                let w = &mut wedges.corner[c as usize];
                if *w == wr {
                    *w = wk;
                }
            }
        }
        self.corners = own;
        *work.mesh.wedges_mut() = Some(wedges);
    }

    /// Whether there are wedges at all.
    pub(crate) fn active(&self) -> bool {
        self.active
    }

    /// The row at the place that `side` gives; its first wedge must be one.
    pub(crate) fn blend(&mut self, wedges: &Wedges, side: &Side) -> &mut [f32] {
        self.interpolate(wedges, side);
        &mut self.row
    }

    /// The row at the new place, into `self.row`.
    fn interpolate(&mut self, wedges: &Wedges, side: &Side) {
        for (k, channel) in wedges.channels().iter().enumerate() {
            let range = wedges.offset(k)..wedges.offset(k) + channel.width;
            // Of the three, those that have the channel; if none counts, the kept wedge's own value, or else the removed one's.
            let mut sum = 0.0;
            self.row[range.clone()].fill(0.0);
            let mut acc = [0.0f64; 16];
            let wide = channel.width > acc.len();
            for (&w, &weight) in side.wedges.iter().zip(&side.weights) {
                if let Some(values) = wedges.get(w, k).filter(|_| weight > 0.0) {
                    sum += weight;
                    if wide {
                        for (r, &x) in self.row[range.clone()].iter_mut().zip(values) {
                            *r += (weight * x as f64) as f32;
                        }
                    } else {
                        acc.iter_mut().zip(values).for_each(|(a, &x)| *a += weight * x as f64);
                    }
                }
            }
            if sum == 0.0 {
                let [kept, removed, _] = side.wedges;
                let values = wedges.get(kept, k).or(wedges.get(removed, k));
                self.row[range.clone()].copy_from_slice(values.unwrap_or(&wedges.row(kept)[range]));
                continue;
            }
            let out = &mut self.row[range.clone()];
            if wide {
                out.iter_mut().for_each(|x| *x /= sum as f32);
            } else {
                out.iter_mut().zip(acc).for_each(|(x, a)| *x = (a / sum) as f32);
            }
            match channel.semantic {
                Semantic::Normal => renormalise(&mut out[..], &wedges.row(side.wedges[0])[range]),
                Semantic::Tangent if channel.width == 4 => {
                    let kept = &wedges.row(side.wedges[0])[range];
                    out[3] = kept[3];
                    renormalise(&mut out[..3], &kept[..3]);
                }
                _ => {}
            }
        }
        self.blend_skins(wedges, side);
    }

    /// Joint influences: weights add up per joint, the strongest are kept and scaled to their old sum.
    fn blend_skins(&mut self, wedges: &Wedges, side: &Side) {
        let sets: Vec<(usize, usize)> = (0..wedges.channels().len())
            .filter_map(|j| match wedges.channels()[j].semantic {
                Semantic::Joints(k) => Some((j, wedges.channel(&Semantic::Weights(k))?)),
                _ => None,
            })
            .collect();
        if sets.is_empty() {
            return;
        }
        self.influences.clear();
        for (&w, &weight) in side.wedges.iter().zip(&side.weights) {
            for &(j, k) in &sets {
                let (Some(joints), Some(weights)) = (wedges.get(w, j), wedges.get(w, k)) else { continue };
                for (&joint, &x) in joints.iter().zip(weights) {
                    let x = x * weight as f32;
                    match self.influences.iter_mut().find(|i| i.0 == joint) {
                        Some(i) => i.1 += x,
                        None if x > 0.0 => self.influences.push((joint, x)),
                        None => {}
                    }
                }
            }
        }
        let total: f32 = self.influences.iter().map(|i| i.1).sum();
        // Strongest first; equal ones by joint, so that the result is one.
        self.influences.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
        self.influences.truncate(sets.iter().map(|s| wedges.channels()[s.0].width).sum());
        let kept: f32 = self.influences.iter().map(|i| i.1).sum();
        let scale = if kept > 0.0 { total / kept } else { 0.0 };
        let mut next = self.influences.iter();
        for &(j, k) in &sets {
            for i in 0..wedges.channels()[j].width {
                let (joint, x) = next.next().copied().unwrap_or((0.0, 0.0));
                self.row[wedges.offset(j) + i] = joint;
                if i < wedges.channels()[k].width {
                    self.row[wedges.offset(k) + i] = x * scale;
                }
            }
        }
    }
}

/// Appends the corners of `v` on faces that survive the collapse of `e`, each with its wedge. O(valence).
#[inline]
fn gather_corners(t: &Topology, wedge: &[u32], e: EdgeId, v: VertexId, out: &mut Vec<(u32, u32)>) {
    let gone = t.edge_faces(e);
    for &side in t.star(v) {
        // Each face once: at the edge by which it leaves `v`.
        let leaving = EdgeUse::new(side, t.edge_vertices(side)[0] != v);
        for &f in t.edge_faces(side) {
            let uses = t.face_edges(f);
            let Some(i) = uses.iter().position(|&u| u == leaving) else { continue };
            if uses.len() > 3 || !gone.contains(&f) {
                let c = t.corner_range(f).start + i;
                out.push((c as u32, wedge[c]));
            }
        }
    }
}

/// Makes `v` a unit vector; `instead` where it has vanished.
fn renormalise(v: &mut [f32], instead: &[f32]) {
    let length = v.iter().map(|&x| (x as f64).powi(2)).sum::<f64>().sqrt();
    if length > 1e-6 {
        v.iter_mut().for_each(|x| *x = (*x as f64 / length) as f32);
    } else {
        v.copy_from_slice(instead);
    }
}

/// The wedges of `f`, and the barycentric weights of the point of `f` (clamped) that lies nearest to `to`; of the nearest point of `e`
/// where that is a seam, so that what is equal on both sides stays equal.
fn make_side(work: &Work<'_>, wedges: &Wedges, f: FaceId, e: EdgeId, roles: &Roles, to: DVec3) -> Side {
    let t = work.mesh.topology();
    let tip = t.face_vertices(f).find(|&v| v != roles.kept && v != roles.removed).unwrap_or(roles.kept);
    let at = |v: VertexId| wedge_at(work.mesh, wedges, f, v);
    let p = |v: VertexId| work.points[v.index()];
    let (k, r, c) = (p(roles.kept), p(roles.removed), p(tip));
    let along = r - k;
    let n = along.cross(c - k);
    let area = n.length_squared();
    let mut weights = [1.0, 0.0, 0.0];
    let inside = t.corner_range(f).len() == 3 && !work.seams.get(e.index());
    // Height over the edge towards the tip; below it, only the edge counts.
    let height = if inside && area > 0.0 { along.cross(to - k).dot(n) / area } else { 0.0 };
    let height = height.clamp(0.0, 1.0);
    let length = along.length_squared();
    if length > 0.0 {
        let foot = to - (c - k) * height;
        let s = ((foot - k).dot(along) / length).clamp(0.0, 1.0 - height);
        weights = [1.0 - s - height, s, height];
    }
    Side { wedges: [at(roles.kept), at(roles.removed), at(tip)], weights }
}

/// Corners joined by edges that are no seams share one wedge, and no other corners have it.
fn separate_groups(work: &Work<'_>, wedges: &mut Wedges) {
    let mesh = &*work.mesh;
    let t = mesh.topology();
    let mut parent: Vec<u32> = (0..t.corner_slots() as u32).collect();
    fn find(parent: &mut [u32], mut c: u32) -> u32 {
        while parent[c as usize] != c {
            parent[c as usize] = parent[parent[c as usize] as usize];
            c = parent[c as usize];
        }
        c
    }
    let slot = |f: FaceId, v: VertexId| {
        t.corner_range(f).start + t.face_vertices(f).position(|x| x == v).unwrap_or(0)
    };
    for e in t.edges() {
        let &[f, g] = t.edge_faces(e) else { continue };
        if work.seams.get(e.index()) {
            continue;
        }
        for v in t.edge_vertices(e) {
            let (x, y) = (find(&mut parent, slot(f, v) as u32), find(&mut parent, slot(g, v) as u32));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let mut taken = vec![false; wedges.len()];
    let mut of_root = vec![NONE; t.corner_slots()];
    for f in t.faces() {
        for c in t.corner_range(f) {
            let old = wedges.corner[c];
            if old == NONE {
                continue;
            }
            let root = find(&mut parent, c as u32) as usize;
            if of_root[root] == NONE {
                of_root[root] = if std::mem::replace(&mut taken[old as usize], true) {
                    let (row, present) = (wedges.row(old).to_vec(), wedges.present(old));
                    taken.push(true);
                    wedges.push(&row, present)
                } else {
                    old
                };
            }
            wedges.corner[c] = of_root[root];
        }
    }
}
