//! Queries over random meshes against their definitions.

mod common;

use common::{either, faces_of};
use progmesh_aif::{BuildOptions, EdgeKind, FaceId, Mesh, NONE, VertexId, VertexKind};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Groups of `items` under "shares", by repeated search.
fn groups(items: Vec<usize>, shares: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut left = items;
    let mut groups = Vec::new();
    while !left.is_empty() {
        let mut group = vec![left.remove(0)];
        let mut at = 0;
        while at < group.len() {
            let (near, far) = left.iter().partition(|&&x| shares(group[at], x));
            left = far;
            let near: Vec<usize> = near;
            group.extend(near);
            at += 1;
        }
        groups.push(group);
    }
    groups
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(384))]

    #[test]
    fn fans_cover_the_faces_of_a_vertex(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let t = mesh.topology();
        let kinds = t.classify_vertices();
        for v in t.vertices() {
            let fans = t.fans(v);
            let mut faces: Vec<FaceId> = fans.iter().flat_map(|f| f.faces.clone()).collect();
            faces.sort_unstable();
            let mut want: Vec<FaceId> = t.vertex_faces(v).collect();
            want.sort_unstable();
            prop_assert_eq!(faces, want);
            for fan in &fans {
                prop_assert_eq!(fan.edges.len(), fan.faces.len() + !fan.closed as usize);
                for (i, f) in fan.faces.iter().enumerate() {
                    let after = (i + 1) % fan.edges.len();
                    for e in [fan.edges[i], fan.edges[after]] {
                        prop_assert!(t.edge_faces(e).contains(f));
                    }
                    prop_assert_ne!(fan.edges[i], fan.edges[after]);
                    if i > 0 || fan.closed {
                        prop_assert_eq!(t.edge_faces(fan.edges[i]).len(), 2);
                    }
                }
                if !fan.closed {
                    let ends = [fan.edges[0], fan.edges[fan.faces.len()]];
                    prop_assert!(ends.iter().all(|&e| t.edge_faces(e).len() != 2));
                }
            }
            let ring = t.one_ring(v);
            prop_assert_eq!(ring.is_some(), kinds[v.index()].is_regular());
            prop_assert_eq!(ring.is_some(), t.is_regular(v));
            if let Some(ring) = ring {
                prop_assert_eq!(fans, std::slice::from_ref(&ring));
                prop_assert_eq!(ring.closed, kinds[v.index()] == VertexKind::Interior);
                prop_assert_eq!(ring.edges.len(), t.star(v).len());
            }
        }
    }

    #[test]
    fn kinds_follow_their_definitions(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let t = mesh.topology();
        let kinds = t.classify_vertices();
        for v in t.vertices() {
            let star = t.star(v);
            let shares = |a: usize, b: usize| t.edge_faces(star[a]).iter().any(|f| t.edge_faces(star[b]).contains(f));
            let pieces = groups((0..star.len()).collect(), shares).len();
            let faces = |n: fn(usize) -> bool| star.iter().any(|&e| n(t.edge_faces(e).len()));
            let want = match pieces {
                0 => VertexKind::Isolated,
                1 if faces(|n| n == 0) => VertexKind::Dangling,
                1 if faces(|n| n > 2) => VertexKind::Complex,
                1 if faces(|n| n == 1) => VertexKind::Border,
                1 => VertexKind::Interior,
                _ => VertexKind::Cut,
            };
            prop_assert_eq!(kinds[v.index()], want, "{}", v);
        }
        let n = t.count_kinds();
        prop_assert_eq!(
            n.isolated_vertices + n.cut_vertices + n.dangling_vertices + n.complex_vertices + n.border_vertices
                + n.interior_vertices,
            t.vertex_count()
        );
        prop_assert_eq!(n.border_edges, t.edges().filter(|&e| t.edge_kind(e) == EdgeKind::Border).count());
    }

    #[test]
    fn border_walks_partition_the_border(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let t = mesh.topology();
        let mut seen = BTreeSet::new();
        for walk in t.border_loops() {
            prop_assert_eq!(walk.vertices.len(), walk.edges.len() + !walk.closed as usize);
            for (i, &e) in walk.edges.iter().enumerate() {
                prop_assert!(seen.insert(e));
                let (a, b) = (walk.vertices[i], walk.vertices[(i + 1) % walk.vertices.len()]);
                prop_assert_eq!(t.find_edge(a, b), Some(e));
            }
            if !walk.closed {
                for end in [walk.vertices[0], walk.vertices[walk.edges.len()]] {
                    prop_assert!(t.star(end).iter().any(|&e| t.edge_faces(e).len() > 2));
                }
            }
        }
        prop_assert!(seen.into_iter().eq(t.edges().filter(|&e| t.edge_faces(e).len() == 1)));
    }

    #[test]
    fn components_are_what_a_search_reaches(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let t = mesh.topology();
        let share_edge = |a: usize, b: usize| {
            t.face_edges(FaceId(a as u32)).iter().any(|u| t.edge_faces(u.edge()).contains(&FaceId(b as u32)))
        };
        let joined = |a: usize, b: usize| t.find_edge(VertexId(a as u32), VertexId(b as u32)).is_some();
        let cases = [
            (t.face_components(), groups((0..t.face_slots()).collect(), share_edge)),
            (t.vertex_components(), groups((0..t.vertex_slots()).collect(), joined)),
        ];
        for (got, want) in cases {
            prop_assert_eq!(got.count, want.len());
            let mut of = vec![NONE; got.of.len()];
            for (k, group) in want.iter().enumerate() {
                group.iter().for_each(|&x| of[x] = k as u32);
            }
            prop_assert_eq!(got.of, of);
        }
    }

    #[test]
    fn the_link_is_the_closed_star_less_the_open_star(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let t = mesh.topology();
        let faces = faces_of(&mesh);
        for v in t.vertices() {
            let link = t.link(v);
            let mut vertices: BTreeSet<u32> = t.star(v).iter().map(|&e| t.other(e, v).0).collect();
            faces.iter().filter(|f| f.contains(&v.0)).for_each(|f| vertices.extend(f));
            vertices.remove(&v.0);
            prop_assert!(link.vertices.iter().map(|x| x.0).eq(vertices));
            let edges = t.edges().filter(|&e| {
                !t.edge_vertices(e).contains(&v) && t.edge_faces(e).iter().any(|f| faces[f.index()].contains(&v.0))
            });
            prop_assert!(link.edges.iter().copied().eq(edges));
        }
    }

    #[test]
    fn turning_what_is_misoriented_needs_orientability(soup in either()) {
        let mesh = Mesh::build(soup.input(), &BuildOptions::default()).unwrap().0;
        let t = mesh.topology();
        let mut count = 0;
        for e in t.edges() {
            let sides: Vec<usize> = t.edge_faces(e).iter().flat_map(|&f| t.face_edges(f))
                .filter(|u| u.edge() == e).map(|u| u.side()).collect();
            count += (sides.len() == 2 && sides[0] == sides[1]) as usize;
        }
        prop_assert_eq!(t.misoriented_edges(), count);
        // Brute force over all turnings where that is few.
        let faces = t.face_slots();
        if faces <= 8 {
            let orientable = (0u32..1 << faces).any(|turned| t.edges().all(|e| {
                let &[f, g] = t.edge_faces(e) else { return true };
                let side = |f: FaceId| t.face_edges(f).iter().find(|u| u.edge() == e).map_or(0, |u| u.side())
                    ^ (turned >> f.0 & 1) as usize;
                side(f) != side(g)
            }));
            prop_assert_eq!(t.is_orientable(), orientable);
        }
    }
}
