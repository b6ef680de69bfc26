//! Links between faces across their edges.
//!
//! A link is `face << 3 | flip << 2 | edge`: the face across, which of its edges it is, and whether both faces run along it the same way
//! (as they do where the mesh is not oriented). Borders and edges of three and more faces have none.

use crate::aif::NONE;

/// An edge of a face, seen from a vertex at one of its ends, in one number: `face << 3 | starts << 2 | edge`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Half(u32);

/// The corner at the vertex, for each of the low three bits, four bits each.
const CORNER: u32 = 0x0210_0021;
/// The corner at the other end.
const FAR_CORNER: u32 = 0x0021_0210;
/// The low three bits of the face's other edge at the vertex.
const TURN: u32 = 0x0102_0465;

impl std::fmt::Debug for Half {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Half({}, {}, {})", self.face(), self.edge(), self.starts())
    }
}

impl Half {
    /// Edge `edge` of a face; `starts`: the face begins the edge at the vertex.
    #[inline]
    pub(crate) fn new(face: u32, edge: u32, starts: bool) -> Half {
        Half(face << 3 | (starts as u32) << 2 | edge)
    }

    #[inline]
    pub(crate) fn face(self) -> u32 {
        self.0 >> 3
    }

    #[inline]
    pub(crate) fn edge(self) -> u32 {
        self.0 & 3
    }

    /// The face begins the edge at the vertex.
    #[inline]
    pub(crate) fn starts(self) -> bool {
        self.0 & 4 != 0
    }

    #[inline]
    fn look_up(self, table: u32) -> u32 {
        table >> (4 * (self.0 & 7)) & 7
    }

    /// The corner of the face at the vertex.
    #[inline]
    pub(crate) fn corner(self) -> usize {
        self.look_up(CORNER) as usize
    }

    /// The corner of the face at the edge's other end.
    #[inline]
    pub(crate) fn far_corner(self) -> usize {
        self.look_up(FAR_CORNER) as usize
    }

    /// The face's other edge at the vertex.
    #[inline]
    pub(crate) fn turn(self) -> Half {
        Half(self.0 & !7 | self.look_up(TURN))
    }

    /// As references name it.
    #[inline]
    pub(crate) fn code(self) -> u32 {
        self.face() << 2 | self.edge()
    }
}

#[inline]
pub(crate) fn next(k: usize) -> usize {
    if k == 2 { 0 } else { k + 1 }
}

#[inline]
pub(crate) fn previous(k: usize) -> usize {
    if k == 0 { 2 } else { k - 1 }
}

/// The link that stands in the face of `from`, to `to`, both seen from the same vertex.
#[inline]
pub(crate) fn link(from: Half, to: Half) -> u32 {
    to.0 ^ (!from.0 & 4)
}

/// Where `link`, which stands at `from`, leads, seen from the same vertex.
#[inline]
pub(crate) fn across(from: Half, link: u32) -> Option<Half> {
    if link == NONE { None } else { Some(Half(link ^ (!from.0 & 4))) }
}

/// The links of faces given by the vertices of their corners. Edges of exactly two faces are linked. O(n log n) at worst.
pub(crate) fn link_faces(faces: &[[u32; 3]], vertices: usize) -> Vec<[u32; 3]> {
    // Half-edges in the buckets of their lower vertices, long buckets sorted.
    let mut starts = vec![0u32; vertices + 1];
    let low = |f: &[u32; 3], k: usize| f[k].min(f[next(k)]) as usize;
    for f in faces {
        (0..3).for_each(|k| starts[low(f, k) + 1] += 1);
    }
    for v in 0..vertices {
        starts[v + 1] += starts[v];
    }
    let mut at = starts.clone();
    // (higher vertex, face * 4 + edge)
    let mut entries = vec![(0u32, 0u32); 3 * faces.len()];
    for (i, f) in faces.iter().enumerate() {
        for k in 0..3 {
            let slot = &mut at[low(f, k)];
            entries[*slot as usize] = (f[k].max(f[next(k)]), (i as u32) << 2 | k as u32);
            *slot += 1;
        }
    }
    let mut links = vec![[NONE; 3]; faces.len()];
    for v in 0..vertices {
        let bucket = &mut entries[starts[v] as usize..starts[v + 1] as usize];
        bucket.sort_unstable();
        for run in bucket.chunk_by(|a, b| a.0 == b.0) {
            let &[(_, a), (_, b)] = run else { continue };
            let half = |code: u32| {
                let (face, edge) = (code >> 2, code & 3);
                Half::new(face, edge, faces[face as usize][edge as usize] as usize == v)
            };
            let (x, y) = (half(a), half(b));
            if x.face() != y.face() {
                links[x.face() as usize][x.edge() as usize] = link(x, y);
                links[y.face() as usize][y.edge() as usize] = link(y, x);
            }
        }
    }
    links
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_triangles_are_linked_and_know_how_they_run() {
        // Oriented alike, then one turned over.
        let links = link_faces(&[[0, 1, 2], [2, 1, 3]], 4);
        let (x, y) = (Half::new(0, 1, true), Half::new(1, 0, false));
        assert_eq!(links[0], [NONE, link(x, y), NONE]);
        assert_eq!(across(x, links[0][1]), Some(y));
        assert_eq!(across(y, links[1][0]), Some(x));
        let links = link_faces(&[[0, 1, 2], [1, 2, 3]], 4);
        let z = Half::new(1, 0, true);
        assert_eq!(across(x, links[0][1]), Some(z));
        assert_eq!(across(z, links[1][0]), Some(x));
    }

    #[test]
    fn an_edge_of_three_faces_has_no_links() {
        let links = link_faces(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]], 5);
        assert!(links.iter().flatten().all(|&l| l == NONE));
    }

    #[test]
    fn corners_and_turns_are_those_of_a_triangle() {
        for (edge, starts) in (0..3).flat_map(|e| [(e, false), (e, true)]) {
            let h = Half::new(11, edge, starts);
            assert_eq!((h.face(), h.edge(), h.starts(), h.code()), (11, edge, starts, 44 | edge));
            let (own, far) = if starts { (edge, (edge + 1) % 3) } else { ((edge + 1) % 3, edge) };
            assert_eq!((h.corner(), h.far_corner()), (own as usize, far as usize));
            let other = if starts { Half::new(11, (edge + 2) % 3, false) } else { Half::new(11, own, true) };
            assert_eq!(h.turn(), other);
            for (to, way) in (0..3).flat_map(|e| [(e, false), (e, true)]) {
                let to = Half::new(5, to, way);
                let own = link(h, to);
                assert_eq!(own, 5 << 3 | ((starts == way) as u32) << 2 | to.edge());
                assert_eq!(across(h, own), Some(to));
            }
        }
    }

    #[test]
    fn turning_about_a_vertex_meets_its_other_edge() {
        let h = Half::new(0, 2, true);
        assert_eq!(h.corner(), 2);
        assert_eq!(h.far_corner(), 0);
        assert_eq!(h.turn(), Half::new(0, 1, false));
        assert_eq!(h.turn().turn(), h);
    }
}
