//! Links between faces across their edges.
//!
//! A link is `face << 3 | flip << 2 | edge`: the face across, which of its edges it is, and whether both faces run along it the same way
//! (as they do where the mesh is not oriented). Borders and edges of three and more faces have none.

use crate::aif::NONE;

/// An edge of a face, seen from a vertex at one of its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Half {
    pub(crate) face: u32,
    pub(crate) edge: u32,
    /// The face begins the edge at that vertex.
    pub(crate) starts: bool,
}

impl Half {
    /// The corner of the face at the vertex.
    #[inline]
    pub(crate) fn corner(self) -> usize {
        if self.starts { self.edge as usize } else { next(self.edge as usize) }
    }

    /// The corner of the face at the edge's other end.
    #[inline]
    pub(crate) fn far_corner(self) -> usize {
        if self.starts { next(self.edge as usize) } else { self.edge as usize }
    }

    /// The face's other edge at the vertex.
    #[inline]
    pub(crate) fn turn(self) -> Half {
        let c = self.corner();
        if self.starts {
            Half { edge: previous(c) as u32, starts: false, ..self }
        } else {
            Half { edge: c as u32, starts: true, ..self }
        }
    }

    /// As references name it.
    #[inline]
    pub(crate) fn code(self) -> u32 {
        self.face << 2 | self.edge
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
    to.face << 3 | ((from.starts == to.starts) as u32) << 2 | to.edge
}

/// Where `link`, which stands at `from`, leads, seen from the same vertex.
#[inline]
pub(crate) fn across(from: Half, link: u32) -> Option<Half> {
    let to = Half { face: link >> 3, edge: link & 3, starts: from.starts == (link >> 2 & 1 == 1) };
    Some(to).filter(|_| link != NONE)
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
                Half { face, edge, starts: faces[face as usize][edge as usize] as usize == v }
            };
            let (x, y) = (half(a), half(b));
            if x.face != y.face {
                links[x.face as usize][x.edge as usize] = link(x, y);
                links[y.face as usize][y.edge as usize] = link(y, x);
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
        let (x, y) = (Half { face: 0, edge: 1, starts: true }, Half { face: 1, edge: 0, starts: false });
        assert_eq!(links[0], [NONE, link(x, y), NONE]);
        assert_eq!(across(x, links[0][1]), Some(y));
        assert_eq!(across(y, links[1][0]), Some(x));
        let links = link_faces(&[[0, 1, 2], [1, 2, 3]], 4);
        let z = Half { face: 1, edge: 0, starts: true };
        assert_eq!(across(x, links[0][1]), Some(z));
        assert_eq!(across(z, links[1][0]), Some(x));
    }

    #[test]
    fn an_edge_of_three_faces_has_no_links() {
        let links = link_faces(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]], 5);
        assert!(links.iter().flatten().all(|&l| l == NONE));
    }

    #[test]
    fn turning_about_a_vertex_meets_its_other_edge() {
        let h = Half { face: 0, edge: 2, starts: true };
        assert_eq!(h.corner(), 2);
        assert_eq!(h.far_corner(), 0);
        assert_eq!(h.turn(), Half { face: 0, edge: 1, starts: false });
        assert_eq!(h.turn().turn(), h);
    }
}
