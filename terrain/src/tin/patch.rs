//! A part of a network, small enough to work on alone: triangles with neighbours, vertices with free heights.

use super::field::{Field, Tolerance};
use super::scan::{Corner, area};

/// No triangle, no vertex.
pub(super) const NONE: u32 = u32::MAX;

/// Most corners of a hole that is triangulated anew, and so most neighbours of a vertex that goes: there are O(corners^3) triangles to look at. 8 to
/// 12 give the same number of triangles within 0.3 % (fuji, grandcanyon).
pub(super) const MOST_CORNERS: usize = 8;

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
    /// Energies of the triangles; NaN where that is not known.
    pub(super) energies: Vec<f64>,
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
    /// O(triangles), as long as no vertex has many.
    pub(super) fn new(
        field: &'a Field,
        rules: Rules,
        vertices: Vec<Vertex>,
        triangles: Vec<[u32; 3]>,
    ) -> Self {
        let mut patch = Patch {
            field,
            across: vec![[NONE; 3]; triangles.len()],
            energies: vec![f64::NAN; triangles.len()],
            vertices,
            triangles,
            scale: 1.0 / rules.tolerance.quanta().max(0.5),
            free: vec![],
            rules,
            kept: vec![],
        };
        // Sides by the vertex that they leave: where they lead, and whose they are.
        let mut starts = vec![0u32; patch.vertices.len() + 1];
        for &v in patch.triangles.as_flattened() {
            starts[v as usize + 1] += 1;
        }
        for v in 1..starts.len() {
            starts[v] += starts[v - 1];
        }
        let mut sides = vec![(NONE, NONE); 3 * patch.triangles.len()];
        let mut ends = starts.clone();
        for (t, corners) in patch.triangles.iter().enumerate() {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let a = corners[i] as usize;
                sides[ends[a] as usize] = (corners[j], t as u32);
                ends[a] += 1;
                patch.vertices[a].triangle = t as u32;
            }
        }
        for (corners, across) in patch.triangles.iter().zip(&mut patch.across) {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (corners[i], corners[j] as usize);
                let from_b = &sides[starts[b] as usize..starts[b + 1] as usize];
                if let Some(&(_, o)) = from_b.iter().find(|side| side.0 == a) {
                    across[i] = o;
                }
            }
        }
        // Where the valid region touches itself in a point, a ring is not all there is around it.
        let mut ring = Ring::default();
        for v in 0..patch.vertices.len() {
            let count = (starts[v + 1] - starts[v]) as usize;
            if count > 0 && !patch.vertices[v].locked {
                patch.ring(v as u32, &mut ring);
                patch.vertices[v].locked = ring.triangles.len() != count;
            }
        }
        patch
    }

    /// Where a vertex is.
    #[inline]
    pub(super) fn corner(&self, v: u32) -> Corner {
        self.vertices[v as usize].at
    }

    /// Column and row.
    #[inline]
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
            let (corners, across) = (&self.triangles[t as usize], &self.across[t as usize]);
            // The sides from v and back to it.
            let (first, last, back) = if corners[0] == v {
                (corners[1], corners[2], across[2])
            } else if corners[1] == v {
                (corners[2], corners[0], across[0])
            } else {
                (corners[0], corners[1], across[1])
            };
            ring.triangles.push(t);
            ring.vertices.push(first);
            match back {
                NONE => {
                    ring.vertices.push(last);
                    break;
                }
                o if o == start => break,
                o => t = o,
            }
        }
    }

    #[inline]
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
                self.energies.push(f64::NAN);
                self.triangles.len() as u32 - 1
            });
            made[m] = t;
            self.energies[t as usize] = f64::NAN;
            self.triangles[t as usize] = [hole[c[0] as usize], hole[c[1] as usize], hole[c[2] as usize]];
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
