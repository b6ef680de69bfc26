//! Vertices to cells, and how many triangles a grid would leave.

use crate::locks::locked_vertices;
use crate::options::{MaxError, Options, SimplifyError};
use crate::work::Work;
use glam::DVec3;
use progmesh_aif::{Bits, FaceId, Mesh, NONE, triangulate_polygon};

/// Cells along an axis, at most.
pub(super) const MAX_RESOLUTION: u32 = 1 << 20;
/// A cell's key has 21 bits an axis; keys from here on are those of locked vertices.
const OWN_CELL: u64 = 1 << 63;
/// No cell has this key.
const EMPTY: u64 = u64::MAX;

/// A mesh as clustering sees it.
pub(super) struct Source<'m> {
    pub(super) work: Work<'m>,
    /// Corner slots of the triangles, those cut from polygons included.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The face of every triangle.
    pub(super) faces: Vec<FaceId>,
    /// The vertex of every corner slot.
    pub(super) vertex: Vec<u32>,
    /// Vertices with an edge.
    used: Bits,
    /// Vertices with a cell to themselves.
    own: Bits,
    /// Longest side of the bounds, in world units.
    pub(super) extent: f64,
    /// World units -> local units.
    local: f64,
    low: DVec3,
    high: DVec3,
    /// Polygons that were cut.
    pub(super) cut: usize,
    /// Of every vertex its cell, by number; [`NONE`] for a vertex without an edge.
    pub(super) cell: Vec<u32>,
    pub(super) cells: usize,
    table: Table,
    left: Vec<[u32; 3]>,
}

impl<'m> Source<'m> {
    /// Changes nothing. O(n).
    pub(super) fn new(mesh: &'m mut Mesh, options: &Options, scale: f64) -> Result<Self, SimplifyError> {
        let work = Work::new(mesh, options)?;
        let t = work.mesh.topology();
        let mut own = locked_vertices(work.mesh, options);
        let mut used = Bits::new(t.vertex_slots());
        for e in t.edges() {
            for v in t.edge_vertices(e) {
                used.set(v.index());
                if options.lock_border && t.edge_faces(e).len() == 1 {
                    own.set(v.index());
                }
            }
        }
        let mut vertex = vec![NONE; t.corner_slots()];
        let (mut triangles, mut faces) =
            (Vec::with_capacity(work.triangles), Vec::with_capacity(work.triangles));
        let (mut points, mut local, mut cut) = (Vec::new(), Vec::new(), 0);
        for f in t.faces() {
            let range = t.corner_range(f);
            let start = range.start as u32;
            range.clone().zip(t.face_vertices(f)).for_each(|(c, v)| vertex[c] = v.0);
            if range.len() == 3 {
                triangles.push([start, start + 1, start + 2]);
            } else {
                points.clear();
                points.extend(t.face_vertices(f).map(|v| work.points[v.index()]));
                local.clear();
                triangulate_polygon(&points, &mut local);
                triangles.extend(local.iter().map(|t| t.map(|i| start + i)));
                cut += 1;
            }
            faces.resize(triangles.len(), f);
        }
        let (low, high) = progmesh_aif::positions::bounds(
            (0..work.points.len()).filter(|&v| used.get(v)).map(|v| work.points[v]),
        )
        .unwrap_or_default();
        let scale = if scale > 0.0 && scale.is_finite() { scale } else { 1.0 };
        Ok(Source {
            extent: (high - low).max_element() / work.scale * scale,
            local: work.scale / scale,
            low,
            high,
            cell: vec![NONE; work.points.len()],
            cells: 0,
            table: Table::default(),
            left: Vec::new(),
            triangles,
            faces,
            vertex,
            used,
            own,
            cut,
            work,
        })
    }

    /// Vertices without an edge.
    pub(super) fn isolated(&self) -> usize {
        self.work.mesh.vertex_count() - self.used.count()
    }

    /// Edge of the cells whose diagonal is this bound, in world units.
    pub(super) fn cell_for(&self, bound: MaxError) -> f64 {
        let world = self.work.scale / self.local;
        self.work.model_bound(bound, world) * world / 3f64.sqrt()
    }

    /// Puts every vertex into a cell of this edge (world units). O(n).
    pub(super) fn assign(&mut self, edge: f64) {
        let Source { work, cell, table, .. } = self;
        let edge = edge * self.local;
        let inverse = if edge > 0.0 { 1.0 / edge } else { 0.0 };
        let last = last_cell(self.high - self.low, edge);
        let (points, low, used, own) = (&work.points, self.low, &self.used, &self.own);
        table.clear(points.len());
        self.cells = 0;
        for (v, (p, cell)) in points.iter().zip(cell.iter_mut()).enumerate() {
            if !used.get(v) {
                continue;
            }
            let key = if own.get(v) { OWN_CELL | v as u64 } else { key(((*p - low) * inverse).min(last)) };
            *cell = table.number(key, &mut self.cells);
        }
    }

    /// The cell of `p`, as its low corner and its edge, local units; a locked vertex's is itself.
    pub(super) fn cell_box(&self, v: usize, edge: f64) -> (DVec3, DVec3) {
        let p = self.work.points[v];
        let edge = edge * self.local;
        if self.own.get(v) || edge <= 0.0 || !edge.is_finite() {
            return (p, p);
        }
        let index = ((p - self.low) / edge).min(last_cell(self.high - self.low, edge)).floor();
        let low = self.low + index * edge;
        // Rounding may put a vertex a hair outside.
        (low.min(p), (low + DVec3::splat(edge)).max(p))
    }

    /// The triangles that cells of this edge would leave; equal ones may count twice if all together are at most `enough`.
    /// O(n), O(k log k) in those left.
    pub(super) fn count(&mut self, edge: f64, enough: usize) -> usize {
        self.assign(edge);
        let Source { left, triangles, vertex, cell, .. } = self;
        left.clear();
        left.extend(triangles.iter().filter_map(|t| canonical(t.map(|c| cell[vertex[c as usize] as usize]))));
        if left.len() > enough {
            left.sort_unstable();
            left.dedup();
        }
        left.len()
    }
}

/// The triangle from its least corner on, so that equal ones of one orientation are equal; `None` if it is degenerate.
#[inline]
pub(super) fn canonical([a, b, c]: [u32; 3]) -> Option<[u32; 3]> {
    if a == b || b == c || c == a {
        return None;
    }
    Some(if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    })
}

/// The last cell along each axis, which has the high side of the bounds too.
fn last_cell(size: DVec3, edge: f64) -> DVec3 {
    if edge > 0.0 { ((size / edge - DVec3::splat(1e-9)).ceil() - 1.0).max(DVec3::ZERO) } else { DVec3::ZERO }
}

/// Three coordinates of 21 bits.
#[inline]
fn key(q: DVec3) -> u64 {
    let at = |x: f64| (x as u64).min((1 << 21) - 1);
    at(q.x) | at(q.y) << 21 | at(q.z) << 42
}

/// Numbers keys in the order of their first use: open addressing, reused from grid to grid.
#[derive(Default)]
struct Table {
    slots: Vec<(u64, u32)>,
    shift: u32,
}

impl Table {
    /// Empties it, with room for `n` keys.
    fn clear(&mut self, n: usize) {
        let size = (2 * n).next_power_of_two().max(16);
        self.shift = 64 - size.trailing_zeros();
        self.slots.clear();
        self.slots.resize(size, (EMPTY, 0));
    }

    #[inline]
    fn number(&mut self, key: u64, next: &mut usize) -> u32 {
        let mask = self.slots.len() - 1;
        // Fibonacci hashing; folded first, as the z bits lie high.
        let mut i = ((key ^ key >> 32).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> self.shift) as usize;
        loop {
            let slot = &mut self.slots[i & mask];
            if slot.0 == key {
                return slot.1;
            }
            if slot.0 == EMPTY {
                *slot = (key, *next as u32);
                *next += 1;
                return slot.1;
            }
            i += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_one_by_rotation_but_not_by_reflection() {
        assert_eq!(canonical([5, 2, 9]), Some([2, 9, 5]));
        assert_eq!(canonical([9, 5, 2]), Some([2, 9, 5]));
        assert_eq!(canonical([2, 5, 9]), Some([2, 5, 9]));
        assert_eq!(canonical([2, 5, 2]), None);
    }

    #[test]
    fn keys_are_numbered_in_order_of_first_use() {
        let mut t = Table::default();
        for _ in 0..2 {
            t.clear(3);
            let mut n = 0;
            let got = [7, 1 << 42, 7, OWN_CELL | 7, 1 << 42].map(|k| t.number(k, &mut n));
            assert_eq!((got, n), ([0, 1, 0, 2, 1], 3));
        }
    }
}
