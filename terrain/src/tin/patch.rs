//! A part of a network, small enough to work on alone: triangles with neighbours, vertices with free heights.

use super::field::{Field, Tolerance};
use super::scan::{Corner, area};

/// No triangle, no vertex.
pub(super) const NONE: u32 = u32::MAX;

/// Most corners of a hole that is triangulated anew.
pub(super) const MOST_CORNERS: usize = 12;

#[derive(Clone, Debug)]
pub(super) struct Vertex {
    pub at: Corner,
    /// A triangle of it; [`NONE`] for a vertex that is gone.
    pub triangle: u32,
    /// Neither moves nor goes: triangles outside of the patch share it.
    pub locked: bool,
    /// Does not go: a side that stays ends here.
    pub kept: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Patch<'a> {
    pub field: &'a Field,
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<[u32; 3]>,
    /// The triangle across the side from corner i to the next; [`NONE`] at a border.
    pub across: Vec<[u32; 3]>,
    /// One over the tolerance, in quanta.
    pub(super) scale: f64,
    free: Vec<u32>,
    pub rules: Rules,
    /// Sides that stay, the lower vertex first, sorted.
    pub kept: Vec<[u32; 2]>,
}

/// What a network keeps while it is improved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    pub tolerance: Tolerance,
    /// Whether the tolerance holds between samples too.
    pub surface: bool,
    /// Whether heights may change.
    pub free_heights: bool,
    /// Whether vertices on the border of the rectangle stay as they are: another network has them too.
    pub border_stays: bool,
    /// Vertices that stay, evenly spread.
    pub spread: Option<Spread>,
}

/// Samples whose column and row in the whole grid are multiples of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub step: usize,
    /// Column and row of the first sample in the whole grid.
    pub first: [usize; 2],
}

impl Spread {
    pub(super) fn has_column(&self, x: i32) -> bool {
        (self.first[0] + x as usize).is_multiple_of(self.step)
    }

    pub(super) fn has_row(&self, y: i32) -> bool {
        (self.first[1] + y as usize).is_multiple_of(self.step)
    }
}

/// The triangles around a vertex, to the left.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    /// Neighbours; one more than triangles at a border.
    pub vertices: Vec<u32>,
    pub triangles: Vec<u32>,
    pub closed: bool,
}

impl<'a> Patch<'a> {
    /// O(triangles log triangles).
    pub(super) fn new(
        field: &'a Field,
        rules: Rules,
        vertices: Vec<Vertex>,
        triangles: Vec<[u32; 3]>,
    ) -> Self {
        let mut patch = Patch {
            field,
            across: vec![[NONE; 3]; triangles.len()],
            vertices,
            triangles,
            scale: 1.0 / rules.tolerance.quanta().max(0.5),
            free: vec![],
            rules,
            kept: vec![],
        };
        let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * patch.triangles.len());
        for (t, corners) in patch.triangles.iter().enumerate() {
            for i in 0..3 {
                let (a, b) = (corners[i], corners[(i + 1) % 3]);
                sides.push((a.min(b), a.max(b), 3 * t as u32 + i as u32));
                patch.vertices[a as usize].triangle = t as u32;
            }
        }
        sides.sort_unstable();
        for pair in sides.windows(2) {
            if (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1) {
                let (s, o) = (pair[0].2, pair[1].2);
                patch.across[s as usize / 3][s as usize % 3] = o / 3;
                patch.across[o as usize / 3][o as usize % 3] = s / 3;
            }
        }
        // Where the valid region touches itself in a point, a ring is not all there is around it.
        let mut count = vec![0usize; patch.vertices.len()];
        for &v in patch.triangles.as_flattened() {
            count[v as usize] += 1;
        }
        let mut ring = Ring::default();
        for (v, &count) in count.iter().enumerate() {
            if count > 0 && !patch.vertices[v].locked {
                patch.ring(v as u32, &mut ring);
                patch.vertices[v].locked = ring.triangles.len() != count;
            }
        }
        patch
    }

    /// Where a vertex is.
    pub(super) fn corner(&self, v: u32) -> Corner {
        self.vertices[v as usize].at
    }

    /// Column and row.
    fn plan(&self, v: u32) -> (i32, i32) {
        let at = self.corner(v);
        (at.x, at.y)
    }

    /// Finds what lies around a vertex. O(its triangles).
    pub(super) fn ring(&self, v: u32, ring: &mut Ring) {
        ring.vertices.clear();
        ring.triangles.clear();
        ring.closed = true;
        let first = self.vertices[v as usize].triangle;
        // To the right, to the first triangle at a border.
        let mut t = first;
        loop {
            let i = self.index_of(t, v);
            match self.across[t as usize][i] {
                NONE => {
                    ring.closed = false;
                    break;
                }
                o if o == first => break,
                o => t = o,
            }
        }
        let start = t;
        loop {
            let i = self.index_of(t, v);
            ring.triangles.push(t);
            ring.vertices.push(self.triangles[t as usize][(i + 1) % 3]);
            let last = self.triangles[t as usize][(i + 2) % 3];
            match self.across[t as usize][(i + 2) % 3] {
                NONE => {
                    ring.vertices.push(last);
                    break;
                }
                o if o == start => break,
                o => t = o,
            }
        }
    }

    pub(super) fn index_of(&self, t: u32, v: u32) -> usize {
        let c = &self.triangles[t as usize];
        if c[0] == v {
            0
        } else if c[1] == v {
            1
        } else {
            2
        }
    }

    /// Replaces the triangles around a hole by others over the same area. `corners` of the hole to the left.
    pub(super) fn replace(&mut self, old: &[u32], hole: &[u32], new: &[[u8; 3]]) {
        // What lies across the sides of the hole.
        let n = hole.len();
        let mut beyond = [NONE; MOST_CORNERS];
        for &t in old {
            for i in 0..3 {
                let (a, o) = (self.triangles[t as usize][i], self.across[t as usize][i]);
                let b = self.triangles[t as usize][(i + 1) % 3];
                if let Some(k) = (0..n).find(|&k| hole[k] == a && hole[(k + 1) % n] == b) {
                    beyond[k] = o;
                }
            }
        }
        for &t in old {
            self.triangles[t as usize] = [NONE; 3];
            self.free.push(t);
        }
        let mut made = [NONE; MOST_CORNERS];
        for (m, c) in new.iter().enumerate() {
            let t = self.free.pop().unwrap_or_else(|| {
                self.triangles.push([NONE; 3]);
                self.across.push([NONE; 3]);
                self.triangles.len() as u32 - 1
            });
            made[m] = t;
            self.triangles[t as usize] = c.map(|i| hole[i as usize]);
            for &i in c {
                self.vertices[hole[i as usize] as usize].triangle = t;
            }
        }
        for (m, c) in new.iter().enumerate() {
            for i in 0..3 {
                let (a, b) = (c[i], c[(i + 1) % 3]);
                let o = if (a as usize + 1) % n == b as usize {
                    let o = beyond[a as usize];
                    if o != NONE {
                        let (va, vb) = (hole[a as usize], hole[b as usize]);
                        let k = (0..3).find(|&k| {
                            let c = self.triangles[o as usize];
                            c[k] == vb && c[(k + 1) % 3] == va
                        });
                        if let Some(k) = k {
                            self.across[o as usize][k] = made[m];
                        }
                    }
                    o
                } else {
                    let other = new.iter().position(|d| (0..3).any(|k| d[k] == b && d[(k + 1) % 3] == a));
                    other.map_or(NONE, |o| made[o])
                };
                self.across[made[m] as usize][i] = o;
            }
        }
    }

    /// Whether a side stays.
    pub(super) fn is_kept(&self, a: u32, b: u32) -> bool {
        self.vertices[a as usize].kept
            && self.vertices[b as usize].kept
            && self.kept.binary_search(&[a.min(b), a.max(b)]).is_ok()
    }

    /// Whether a border vertex lies on the straight line between its neighbours along the border.
    pub(super) fn is_straight(&self, v: u32, ring: &Ring) -> bool {
        let (Some(&a), Some(&b)) = (ring.vertices.first(), ring.vertices.last()) else { return false };
        area(self.plan(a), self.plan(v), self.plan(b)) == 0
    }
}
