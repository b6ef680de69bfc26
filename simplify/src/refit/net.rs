//! The result as flat arrays: only what lives, numbered without gaps, so that searching and solving run over little memory.

use crate::validity::RingFace;
use crate::work::{Kind, Work};
use glam::DVec3;
use progmesh_aif::{FaceId, NONE, VertexId};

/// A vertex of more faces stays where it is, and no search goes through it: it would cost the whole star each time. Collapses leave
/// at most 32 edges at a vertex that was not worse before.
const HUB: usize = 64;

/// Triangles, their curves, and what lies around what. Ids without a type are numbers within these arrays.
pub(super) struct Net {
    /// Vertices that have a face.
    pub(super) vertices: Vec<VertexId>,
    pub(super) kinds: Vec<Kind>,
    /// Where they are, local frame.
    pub(super) points: Vec<DVec3>,
    pub(super) faces: Vec<FaceId>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// What spares looking at a face, as [`Net::refresh`] found it last.
    pub(super) cells: Vec<Cell>,
    /// The least height of each face.
    pub(super) heights: Vec<f64>,
    /// Faces at each vertex.
    pub(super) around: Lists,
    /// Faces that share a vertex with each face, hubs left out.
    pub(super) beside: Lists,
    /// Edges on borders and seams: their ends, and which is a border.
    pub(super) curves: Vec<([u32; 2], bool)>,
    /// Those at each vertex.
    pub(super) curves_at: Lists,
    /// Number of each vertex slot.
    number: Vec<u32>,
}

/// A ball and a plane that hold a face. One cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(super) struct Cell {
    centre: DVec3,
    radius: f64,
    /// Unit normal; zero if the face has none.
    pub(super) normal: DVec3,
    offset: f64,
}

impl Cell {
    fn of([a, b, c]: [DVec3; 3]) -> Self {
        let centre = (a + b + c) / 3.0;
        let far = |p: DVec3| p.distance_squared(centre);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        Cell { centre, radius: far(a).max(far(b)).max(far(c)).sqrt(), normal, offset: normal.dot(a) }
    }

    /// Whether the face may be nearer to `p` than `distance`, whose square is `d2`.
    #[inline]
    pub(super) fn may_be_nearer(&self, p: DVec3, distance: f64, d2: f64) -> bool {
        let reach = self.radius + distance;
        let height = self.normal.dot(p) - self.offset;
        self.centre.distance_squared(p) < reach * reach && height * height < d2
    }
}

/// Lists of numbers, one for each of a row of things.
pub(super) struct Lists {
    ends: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// `n` lists: of the things each item belongs to, the items, in order.
    fn new<I: Iterator<Item = u32>>(n: usize, owners: impl Iterator<Item = I> + Clone) -> Self {
        let mut ends = vec![0u32; n + 1];
        owners.clone().flatten().for_each(|o| ends[o as usize + 1] += 1);
        for i in 0..n {
            ends[i + 1] += ends[i];
        }
        let mut next = ends.clone();
        let mut items = vec![0; ends[n] as usize];
        for (i, mine) in owners.enumerate() {
            for o in mine {
                items[next[o as usize] as usize] = i as u32;
                next[o as usize] += 1;
            }
        }
        Lists { ends, items }
    }

    #[inline]
    pub(super) fn of(&self, i: u32) -> &[u32] {
        &self.items[self.ends[i as usize] as usize..self.ends[i as usize + 1] as usize]
    }
}

impl Net {
    /// What is left of the mesh. O(n).
    pub(super) fn new(work: &Work<'_>) -> Self {
        let t = work.mesh.topology();
        let faces: Vec<FaceId> = t.faces().collect();
        let mut number = vec![NONE; t.vertex_slots()];
        for &f in &faces {
            t.triangle(f).iter().for_each(|v| number[v.index()] = 0);
        }
        let vertices: Vec<VertexId> = t.vertices().filter(|v| number[v.index()] == 0).collect();
        vertices.iter().enumerate().for_each(|(i, v)| number[v.index()] = i as u32);
        let of = |v: VertexId| number[v.index()];
        let triangles: Vec<[u32; 3]> = faces.iter().map(|&f| t.triangle(f).map(of)).collect();
        let around = Lists::new(vertices.len(), triangles.iter().map(|t| t.iter().copied()));
        let curve = |e| {
            let border = t.edge_faces(e).len() == 1;
            (border || work.seams.get(e.index())).then(|| (t.edge_vertices(e).map(of), border))
        };
        let curves: Vec<([u32; 2], bool)> = t.edges().filter_map(curve).collect();
        let curves_at = Lists::new(vertices.len(), curves.iter().map(|c| c.0.iter().copied()));
        let mut kinds: Vec<Kind> = vertices.iter().map(|v| work.kinds[v.index()]).collect();
        for (v, kind) in kinds.iter_mut().enumerate() {
            if around.of(v as u32).len() > HUB {
                *kind = Kind::Pinned;
            }
        }
        let mut net = Net {
            cells: Vec::new(),
            heights: Vec::new(),
            points: vertices.iter().map(|v| work.points[v.index()]).collect(),
            beside: beside(&triangles, &around),
            kinds,
            vertices,
            faces,
            triangles,
            around,
            curves,
            curves_at,
            number,
        };
        net.refresh();
        net
    }

    /// To be called when points have changed. O(faces).
    pub(super) fn refresh(&mut self) {
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        cells.extend((0..self.triangles.len()).map(|f| Cell::of(self.corners(f as u32))));
        self.cells = cells;
        let mut heights = std::mem::take(&mut self.heights);
        heights.clear();
        heights.extend((0..self.triangles.len()).map(|f| {
            let [a, b, c] = self.corners(f as u32);
            let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a)).sqrt();
            if longest > 0.0 { (b - a).cross(c - a).length() / longest } else { 0.0 }
        }));
        self.heights = heights;
    }

    /// From the vertex that each was collapsed into, the number of the one it ended in, by slot; [`NONE`] for one that is not left, or a
    /// hub.
    pub(super) fn roots(&self, mut into: Vec<u32>) -> Vec<u32> {
        for v in 0..into.len() {
            let mut x = v;
            while into[x] as usize != x {
                into[x] = into[into[x] as usize];
                x = into[x] as usize;
            }
            into[v] = x as u32;
        }
        for x in &mut into {
            let n = self.number[*x as usize];
            *x = if n != NONE && self.around.of(n).len() <= HUB { n } else { NONE };
        }
        into
    }

    /// The corners of face `f`.
    #[inline]
    pub(super) fn corners(&self, f: u32) -> [DVec3; 3] {
        self.triangles[f as usize].map(|v| self.points[v as usize])
    }
}

/// Face `f` as one around its vertex `v`.
#[inline]
pub(super) fn ring_face(triangles: &[[u32; 3]], points: &[DVec3], f: u32, v: u32) -> RingFace {
    let [apex, x, y] = corners_from(triangles[f as usize], v).map(|v| points[v as usize]);
    RingFace { apex, x, y }
}

/// The corners of triangle `t` in their order, from its corner `v` on.
#[inline]
pub(super) fn corners_from(t: [u32; 3], v: u32) -> [u32; 3] {
    let [a, b, c] = t;
    if a == v {
        t
    } else if b == v {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// The faces that share a vertex with each, but for hubs.
fn beside(triangles: &[[u32; 3]], around: &Lists) -> Lists {
    let mut seen = vec![NONE; triangles.len()];
    let mut ends = Vec::with_capacity(triangles.len() + 1);
    let mut items = Vec::with_capacity(triangles.len() * 12);
    ends.push(0);
    for (f, t) in triangles.iter().enumerate() {
        seen[f] = f as u32;
        for &v in t {
            let list = around.of(v);
            if list.len() > HUB {
                continue;
            }
            for &g in list {
                if std::mem::replace(&mut seen[g as usize], f as u32) != f as u32 {
                    items.push(g);
                }
            }
        }
        ends.push(items.len() as u32);
    }
    Lists { ends, items }
}
