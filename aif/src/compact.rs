//! Leaving removed elements out: compaction in place of ids, and export to flat arrays.

use crate::attributes::Wedges;
use crate::bits::Bits;
use crate::build::MeshInput;
use crate::ids::{EdgeId, FaceId, NONE, VertexId};
use crate::mesh::Mesh;
use crate::topology::{COMPLEX, EdgeRecord, EdgeUse, NO_FACE, Span, Star, Topology};

/// How to compact.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct CompactOptions {
    /// Leave vertices without an edge out as well.
    pub drop_isolated: bool,
}

impl CompactOptions {
    /// The default (isolated vertices are kept), with isolated vertices dropped or not.
    pub fn with_drop_isolated(drop_isolated: bool) -> Self {
        CompactOptions { drop_isolated }
    }
}

/// Where the elements went: old id -> new id, or [`NONE`] for those left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IdMaps {
    /// Of the vertex slots.
    pub vertex: Vec<u32>,
    /// Of the edge slots.
    pub edge: Vec<u32>,
    /// Of the face slots.
    pub face: Vec<u32>,
}

impl Mesh {
    /// Renumbers the live elements densely and forgets the removed ones: no earlier collapse can be undone afterwards.
    ///
    /// Only ids change. Vertices, edges, faces and wedges keep their order among themselves, a face its first corner, an edge
    /// its direction and the order of its faces, a vertex the order of its star; positions keep their bits. Wedges that no live
    /// corner has are dropped. A mesh whose faces have all become triangles takes the smaller triangular layout. O(n).
    pub fn compact(self, options: CompactOptions) -> (Mesh, IdMaps) {
        let t = &self.topology;
        let keep = |v: VertexId| t.has_vertex(v) && !(options.drop_isolated && t.star(v).is_empty());
        let (vertex, kept) = number(t.vertex_slots(), |i| keep(VertexId(i)));
        let (edge, kept_edges) = number(t.edge_slots(), |i| t.has_edge(EdgeId(i)));
        let (face, kept_faces) = number(t.face_slots(), |i| t.has_face(FaceId(i)));
        let maps = IdMaps { vertex, edge, face };

        let wedges = self.wedges.as_ref().map(|w| {
            let mut used = Bits::new(w.len());
            let slots = || kept_faces.iter().flat_map(|&f| t.corner_range(FaceId(f)));
            slots().map(|c| w.corner[c]).filter(|&x| x != NONE).for_each(|x| used.set(x as usize));
            let (map, old) = number(w.len(), |i| used.get(i as usize));
            w.gather(&old, slots().map(|c| map.get(w.corner[c] as usize).copied().unwrap_or(NONE)).collect())
        });
        let mesh = Mesh {
            topology: relabel(t, &maps, [&kept, &kept_edges, &kept_faces]),
            positions: self.positions.gather(&kept),
            wedges,
            face_material: gather(&self.face_material, &kept_faces),
            face_group: gather(&self.face_group, &kept_faces),
            face_row: gather(&self.face_row, &kept_faces),
        };
        (mesh, maps)
    }

    /// The live elements as flat arrays, as writers and other libraries take them; [`Mesh::build`] makes a mesh of them again.
    ///
    /// Vertices (isolated ones included) and faces keep their order, faces their first corner. Edges without a face become
    /// wires. Wedges are numbered in the order of their first use; unused ones are left out. O(n).
    pub fn to_input(&self) -> MeshInput {
        self.to_input_with_map().0
    }

    /// The wedges of [`Mesh::to_input`] alone. O(n).
    pub fn input_wedges(&self) -> Option<Wedges> {
        let (t, w) = (&self.topology, self.wedges.as_ref()?);
        let whole = t.is_triangular() && t.face_count() == t.face_slots();
        if whole && is_by_first_use(w) {
            return Some(w.clone());
        }
        if whole {
            return Some(by_first_use(w, 0..w.corner.len(), w.corner.len()));
        }
        let slots = t.faces().flat_map(|f| t.corner_range(f));
        Some(by_first_use(w, slots, w.corner.len()))
    }

    /// As [`Mesh::to_input`], with the map of vertex slots to the vertices of the result ([`NONE`] for removed ones).
    pub fn to_input_with_map(&self) -> (MeshInput, Vec<u32>) {
        let t = &self.topology;
        let (vertex, kept) = number(t.vertex_slots(), |i| t.has_vertex(VertexId(i)));
        let faces: Vec<u32> = t.faces().map(|f| f.0).collect();
        let total = faces.iter().map(|&f| t.corner_range(FaceId(f)).len()).sum();
        let mut corners = Vec::with_capacity(total);
        for &f in &faces {
            corners.extend(t.face_vertices(FaceId(f)).map(|v| vertex[v.index()]));
        }
        let size = |&f: &u32| t.corner_range(FaceId(f)).len() as u32;
        let triangles = t.is_triangular() || faces.iter().all(|f| size(f) == 3);
        let slots = faces.iter().flat_map(|&f| t.corner_range(FaceId(f)));
        let wires = t.edges().filter(|&e| t.edge_faces(e).is_empty());
        let input = MeshInput {
            positions: self.positions.gather(&kept),
            face_sizes: (!triangles).then(|| faces.iter().map(size).collect()),
            corners,
            wires: wires.map(|e| t.edge_vertices(e).map(|v| vertex[v.index()])).collect(),
            wedges: self.wedges.as_ref().map(|w| by_first_use(w, slots, total)),
            face_material: gather(&self.face_material, &faces),
            face_group: gather(&self.face_group, &faces),
            face_row: gather(&self.face_row, &faces),
        };
        (input, vertex)
    }
}

/// Numbers those of `0..n` that are kept: old -> new, and new -> old.
fn number(n: usize, keep: impl Fn(u32) -> bool) -> (Vec<u32>, Vec<u32>) {
    let mut old = Vec::new();
    let map = (0..n as u32)
        .map(|i| {
            if !keep(i) {
                return NONE;
            }
            old.push(i);
            old.len() as u32 - 1
        })
        .collect();
    (map, old)
}

/// The entries of the kept faces; an absent array stays absent.
fn gather(per_face: &[u32], kept: &[u32]) -> Vec<u32> {
    if per_face.is_empty() { Vec::new() } else { kept.iter().map(|&f| per_face[f as usize]).collect() }
}

/// Whether the corners, one after the other, use the wedges 0, 1, 2 and so on for the first time in this order, and all of them.
fn is_by_first_use(w: &Wedges) -> bool {
    let mut next = 0;
    for &x in &w.corner {
        if x == next {
            next += 1;
        } else if x > next && x != NONE {
            return false;
        }
    }
    next as usize == w.len()
}

fn by_first_use(w: &Wedges, slots: impl Iterator<Item = usize>, corners: usize) -> Wedges {
    let (mut map, mut old) = (vec![NONE; w.len()], Vec::new());
    let mut corner = Vec::with_capacity(corners);
    corner.extend(slots.map(|c| {
        let x = w.corner[c];
        let Some(to) = map.get_mut(x as usize) else { return NONE };
        if *to == NONE {
            *to = old.len() as u32;
            old.push(x);
        }
        *to
    }));
    w.gather(&old, corner)
}

/// The relations under new ids. `kept` lists the old vertices, edges and faces, in order.
fn relabel(t: &Topology, maps: &IdMaps, [vertices, edges, faces]: [&[u32]; 3]) -> Topology {
    let new_edge = |e: EdgeId| EdgeId(maps.edge[e.index()]);
    let mut star_pool = Vec::with_capacity(2 * edges.len());
    let mut stars = Vec::with_capacity(vertices.len());
    for &v in vertices {
        let (start, star) = (star_pool.len() as u32, t.star(VertexId(v)));
        star_pool.extend(star.iter().map(|&e| new_edge(e)));
        let len = star.len() as u32;
        stars.push(Star { span: Span { start, len }, capacity: len });
    }
    let (mut complex, mut complex_pool) = (Vec::new(), Vec::new());
    let mut records = Vec::with_capacity(edges.len());
    for &e in edges {
        let old = t.edge_faces(EdgeId(e));
        let new = |f: FaceId| FaceId(maps.face[f.index()]);
        let faces = match *old {
            [] => [NO_FACE; 2],
            [f] => [new(f), NO_FACE],
            [f, g] => [new(f), new(g)],
            _ => {
                let span = Span { start: complex_pool.len() as u32, len: old.len() as u32 };
                complex_pool.extend(old.iter().map(|&f| new(f)));
                complex.push(span);
                [FaceId(complex.len() as u32 - 1), COMPLEX]
            }
        };
        let vertices = t.edge_vertices(EdgeId(e)).map(|v| VertexId(maps.vertex[v.index()]));
        records.push(EdgeRecord { vertices, faces });
    }
    let triangles = faces.iter().all(|&f| t.corner_range(FaceId(f)).len() == 3);
    let mut face_spans = Vec::with_capacity(if triangles { 0 } else { faces.len() });
    let mut corners = Vec::with_capacity(3 * faces.len());
    for &f in faces {
        let uses = t.face_edges(FaceId(f));
        if !triangles {
            face_spans.push(Span { start: corners.len() as u32, len: uses.len() as u32 });
        }
        corners.extend(uses.iter().map(|&u| EdgeUse::new(new_edge(u.edge()), u.side() == 1)));
    }
    Topology {
        stars,
        star_pool,
        edges: records,
        corners,
        face_spans,
        complex,
        complex_pool,
        dead_vertices: Bits::new(vertices.len()),
        dead_edges: Bits::new(edges.len()),
        dead_faces: Bits::new(faces.len()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::{Channel, Semantic};

    /// ```text
    ///   3---2---5     f0 = 0 1 2, f1 = 0 2 3, f2 = 1 4 5 2
    ///   |f1/|   |     a wire 4-6, and vertex 7 isolated
    ///   | / | f2|
    ///   |/f0|   |
    ///   0---1---4---6
    /// ```
    fn strip() -> Mesh {
        let p: Vec<[f32; 3]> = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1], [3, 0], [9, 9]]
            .map(|[x, y]: [i32; 2]| [x as f32, y as f32, 0.0])
            .to_vec();
        let mut input = MeshInput::polygons(p, &[3, 3, 4], &[0, 1, 2, 0, 2, 3, 1, 4, 5, 2]);
        input.wires = vec![[4, 6]];
        input.face_material = vec![7, NONE, 9];
        let mut w = Wedges::new(vec![Channel::new(Semantic::Custom("id".into()), 1)]).unwrap();
        for i in 0..5 {
            w.push(&[i as f32], 1);
        }
        w.corner = vec![3, 3, 1, NONE, 1, 1, 0, 0, 0, 4];
        input.wedges = Some(w);
        Mesh::build(input, &Default::default()).unwrap().0
    }

    /// Removes face 2 as an edit would: relations of what stays are put right.
    fn without_the_quad() -> Mesh {
        let mut m = strip();
        let t = &mut m.topology;
        let edge = |t: &Topology, a, b| t.find_edge(VertexId(a), VertexId(b)).unwrap();
        let shared = edge(t, 1, 2);
        let faces = &mut t.edges[shared.index()].faces;
        assert_eq!(*faces, [FaceId(0), FaceId(2)]);
        faces[1] = NO_FACE;
        t.dead_faces.set(2);
        for (a, b) in [(1, 4), (4, 5), (2, 5)] {
            let e = edge(t, a, b);
            t.dead_edges.set(e.index());
            for v in [a, b] {
                let s = &mut t.stars[v as usize].span;
                let run = &mut t.star_pool[s.range()];
                let at = run.iter().position(|&x| x == e).unwrap();
                run[at..].rotate_left(1);
                s.len -= 1;
            }
        }
        t.dead_vertices.set(5);
        assert_eq!(m.check(), Ok(()));
        m
    }

    #[test]
    fn compacting_a_fresh_mesh_changes_nothing() {
        let (before, after) = (strip(), strip().compact(CompactOptions::default()));
        let (mesh, maps) = after;
        assert_eq!(mesh.check(), Ok(()));
        assert_eq!(maps.vertex, (0..8).collect::<Vec<_>>());
        assert_eq!(maps.face, [0, 1, 2]);
        assert_eq!(mesh.topology.star_pool, before.topology.star_pool);
        assert_eq!(mesh.topology.edges, before.topology.edges);
        assert_eq!(mesh.topology.corners, before.topology.corners);
        assert_eq!(mesh.positions, before.positions);
        // Wedge 2 was used by no corner.
        let w = mesh.wedges().unwrap();
        assert_eq!(w.corner, [2, 2, 1, NONE, 1, 1, 0, 0, 0, 3]);
        assert_eq!((0..4).map(|i| w.row(i)[0]).collect::<Vec<_>>(), [0.0, 1.0, 3.0, 4.0]);
    }

    #[test]
    fn removed_elements_go_and_the_rest_keeps_its_order() {
        let (mesh, maps) = without_the_quad().compact(CompactOptions::with_drop_isolated(true));
        assert_eq!(mesh.check(), Ok(()));
        assert_eq!(maps.vertex, [0, 1, 2, 3, 4, NONE, 5, NONE]);
        assert_eq!(maps.face, [0, 1, NONE]);
        assert!(mesh.topology.is_triangular());
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.face_materials(), [7, NONE]);
        assert_eq!((mesh.vertex_count(), mesh.topology.edge_count()), (6, 6));
        let w = mesh.wedges().unwrap();
        assert_eq!((w.len(), &w.corner[..]), (2, &[1, 1, 0, NONE, 0, 0][..]));
    }

    #[test]
    fn wedges_are_numbered_by_first_use_whatever_their_numbers_were() {
        let channels = || vec![Channel::new(Semantic::Custom("id".into()), 1)];
        for corner in
            [[0, 1, 2, 2, NONE, 0], [2, 1, 0, 0, NONE, 2], [0, 1, 1, 1, NONE, 0], [0, 2, 1, 1, 2, 0]]
        {
            let mut m = Mesh::from_triangles(
                vec![[0.0f32; 3], [1.0; 3], [2.0; 3], [3.0; 3]],
                &[[0, 1, 2], [2, 1, 3]],
            )
            .unwrap();
            let mut w = Wedges::new(channels()).unwrap();
            (0..3).for_each(|i| _ = w.push(&[i as f32], 1));
            w.corner = corner.to_vec();
            *m.wedges_mut() = Some(w.clone());
            let found = m.input_wedges().unwrap();
            assert_eq!(Some(&found), m.to_input().wedges.as_ref(), "{corner:?}");
            let mut seen = 0;
            for (&x, &old) in found.corner.iter().zip(&corner) {
                assert_eq!(x == NONE, old == NONE);
                if x != NONE {
                    assert!(x <= seen, "{corner:?}");
                    seen = seen.max(x + 1);
                    assert_eq!(found.row(x), w.row(old));
                }
            }
            assert_eq!(found.len(), seen as usize);
        }
    }

    #[test]
    fn export_holds_what_lives_and_builds_the_same() {
        let (input, map) = without_the_quad().to_input_with_map();
        assert_eq!(map, [0, 1, 2, 3, 4, NONE, 5, 6]);
        assert_eq!(input.face_sizes, None);
        assert_eq!(input.corners, [0, 1, 2, 0, 2, 3]);
        assert_eq!(input.wires, [[4, 5]]);
        let w = input.wedges.as_ref().unwrap();
        assert_eq!(w.corner, [0, 0, 1, NONE, 1, 1]);
        assert_eq!((w.row(0), w.row(1)), (&[3.0f32][..], &[1.0f32][..]));
        let again = Mesh::build(input, &Default::default()).unwrap().0;
        assert_eq!(again.check(), Ok(()));
        assert_eq!(again.to_input().corners, [0, 1, 2, 0, 2, 3]);

        let polygons = strip().to_input();
        assert_eq!(polygons.face_sizes, Some(vec![3, 3, 4]));
        assert_eq!(polygons.corners, [0, 1, 2, 0, 2, 3, 1, 4, 5, 2]);
    }
}
