//! Each invariant, broken on purpose.

use super::*;
use crate::attributes::{Channel, Semantic, Wedges};
use crate::build::MeshInput;
use crate::topology::{EdgeUse, NO_FACE, Span};

/// ```text
///   3---2      edges: e0 = 0-1, e1 = 0-2, e2 = 0-3, e3 = 1-2, e4 = 2-3
///   |f1/|      faces: f0 = 0 1 2, f1 = 0 2 3
///   | / |      and vertex 4, isolated
///   |/f0|
///   0---1
/// ```
fn square() -> Mesh {
    let p = vec![[0.0, 0.0, 0.0f32], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [5.0, 5.0, 5.0]];
    let mesh = Mesh::from_triangles(p, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    assert_eq!(mesh.topology.edge_vertices(EdgeId(1)), [VertexId(0), VertexId(2)]);
    mesh
}

/// A quad and a triangle on one side of it.
fn house() -> Mesh {
    let p = vec![[0.0, 0.0, 0.0f32], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 2.0, 0.0]];
    let mesh = Mesh::from_polygons(p, &[4, 3], &[0, 1, 2, 3, 3, 2, 4]).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    mesh
}

/// Three triangles on edge e0 = 0-1, and three on the edge 5-6.
fn two_books() -> Mesh {
    let p: Vec<[f32; 3]> = (0..10).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let mesh =
        Mesh::from_triangles(p, &[[0, 1, 2], [0, 1, 3], [1, 0, 4], [5, 6, 7], [5, 6, 8], [5, 6, 9]]).unwrap();
    assert_eq!(mesh.check(), Ok(()));
    assert_eq!(mesh.topology.complex.len(), 2);
    mesh
}

fn broken(mesh: Mesh, by: impl FnOnce(&mut Mesh)) -> CheckError {
    let mut mesh = mesh;
    by(&mut mesh);
    mesh.check().expect_err("the invariant is broken")
}

const fn v(i: u32) -> VertexId {
    VertexId(i)
}
const fn e(i: u32) -> EdgeId {
    EdgeId(i)
}
const fn f(i: u32) -> FaceId {
    FaceId(i)
}

#[test]
fn storage() {
    assert_eq!(broken(square(), |m| m.topology.dead_edges.set(40)), CheckError::DeadSet("edges"));
    assert_eq!(
        broken(square(), |m| m.topology.corners.push(EdgeUse(0))),
        CheckError::TriangularLayout { corners: 7 }
    );
    assert_eq!(broken(square(), |m| m.topology.stars[1].capacity = 1), CheckError::StarSpan(v(1)));
    assert_eq!(broken(square(), |m| m.topology.stars[3].span.start = 9), CheckError::StarSpan(v(3)));
    assert_eq!(broken(square(), |m| m.topology.stars[1].span.start = 0), CheckError::StarOverlap(v(1)));
    assert_eq!(broken(house(), |m| m.topology.face_spans[1].len = 4), CheckError::FaceSpan(f(1)));
    assert_eq!(broken(house(), |m| m.topology.face_spans[1].start = 3), CheckError::FaceOverlap(f(1)));
    assert_eq!(broken(two_books(), |m| m.topology.complex.clear()), CheckError::ComplexSpan(e(0)));
    assert_eq!(
        broken(two_books(), |m| m.topology.complex[0] = Span { start: 4, len: 3 }),
        CheckError::ComplexSpan(e(0))
    );
    let second = broken(two_books(), |m| m.topology.complex[1].start = 2);
    assert!(matches!(second, CheckError::ComplexOverlap(x) if x != e(0)), "{second:?}");
}

#[test]
fn edges_and_stars() {
    let edge = |m: &mut Mesh, i: usize, to: [u32; 2]| m.topology.edges[i].vertices = to.map(VertexId);
    assert_eq!(
        broken(square(), |m| edge(m, 3, [1, 9])),
        CheckError::EdgeVertexRange { edge: e(3), vertex: v(9) }
    );
    assert_eq!(
        broken(square(), |m| m.topology.dead_vertices.set(2)),
        CheckError::EdgeVertexDead { edge: e(1), vertex: v(2) }
    );
    assert_eq!(broken(square(), |m| edge(m, 3, [1, 1])), CheckError::Loop(e(3)));
    let star = |m: &mut Mesh, x: usize, i: usize, to: u32| {
        let start = m.topology.stars[x].span.start as usize;
        m.topology.star_pool[start + i] = e(to);
    };
    assert_eq!(broken(square(), |m| star(m, 1, 0, 77)), CheckError::StarRange { vertex: v(1), edge: e(77) });
    assert_eq!(
        broken(square(), |m| m.topology.dead_edges.set(4)),
        CheckError::StarDead { vertex: v(2), edge: e(4) }
    );
    assert_eq!(broken(square(), |m| star(m, 1, 0, 4)), CheckError::StarForeign { vertex: v(1), edge: e(4) });
    assert_eq!(broken(square(), |m| star(m, 1, 1, 0)), CheckError::StarTwice { vertex: v(1), edge: e(0) });
    assert_eq!(
        broken(square(), |m| m.topology.stars[3].span.len = 1),
        CheckError::StarMissing { edge: e(4), vertex: v(3) }
    );
    // e2 = 0-3 moved onto 0-1, beside e0.
    let parallel = broken(square(), |m| edge(m, 2, [0, 1]));
    assert_eq!(parallel, CheckError::ParallelEdges(e(0), e(2)));
}

#[test]
fn faces() {
    let short = broken(house(), |m| {
        m.topology.face_spans[1].len = 2;
    });
    assert_eq!(short, CheckError::FaceSize { face: f(1), corners: 2 });
    assert_eq!(
        broken(square(), |m| m.topology.corners[4] = EdgeUse::new(e(50), false)),
        CheckError::FaceEdgeRange { face: f(1), edge: e(50) }
    );
    // An edge removed from both stars, but not from its face.
    let dead = broken(square(), |m| {
        m.topology.dead_edges.set(4);
        m.topology.stars[2].span.len -= 1;
        m.topology.stars[3].span.len -= 1;
    });
    assert_eq!(dead, CheckError::FaceEdgeDead { face: f(1), edge: e(4) });
    assert_eq!(
        broken(square(), |m| m.topology.corners[0].0 ^= 1),
        CheckError::FaceOpen { face: f(0), corner: 0 }
    );
    // 0-1-2-0-3... as one face: bow tie of two triangles at vertex 0.
    let p: Vec<[f32; 3]> = (0..6).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let hexagon = Mesh::from_polygons(p, &[3, 3, 6], &[0, 1, 2, 0, 3, 4, 0, 1, 2, 5, 3, 4]).unwrap();
    assert_eq!(hexagon.check(), Ok(()));
    let bow = broken(hexagon, |m| {
        for i in 0..6 {
            m.topology.corners[6 + i] = m.topology.corners[i];
        }
    });
    assert_eq!(bow, CheckError::FaceRepeats { face: f(2), vertex: v(0) });
}

#[test]
fn faces_of_edges() {
    let set = |m: &mut Mesh, i: usize, to: [FaceId; 2]| m.topology.edges[i].faces = to;
    assert_eq!(
        broken(square(), |m| set(m, 1, [f(0), f(9)])),
        CheckError::EdgeFaceRange { edge: e(1), face: f(9) }
    );
    // "No face" before a face: the list reads as one face that does not exist.
    assert_eq!(
        broken(square(), |m| set(m, 1, [NO_FACE, f(1)])),
        CheckError::EdgeFaceRange { edge: e(1), face: NO_FACE }
    );
    assert_eq!(
        broken(square(), |m| m.topology.dead_faces.set(1)),
        CheckError::EdgeFaceDead { edge: e(1), face: f(1) }
    );
    assert_eq!(
        broken(square(), |m| set(m, 1, [f(0), f(0)])),
        CheckError::EdgeFaceTwice { edge: e(1), face: f(0) }
    );
    assert_eq!(
        broken(square(), |m| set(m, 0, [f(1), NO_FACE])),
        CheckError::EdgeFaceForeign { edge: e(0), face: f(1) }
    );
    assert_eq!(
        broken(square(), |m| set(m, 1, [f(1), NO_FACE])),
        CheckError::EdgeFaceMissing { edge: e(1), face: f(0) }
    );
    assert_eq!(
        broken(two_books(), |m| m.topology.complex[0].len = 2),
        CheckError::EdgeFaceMissing { edge: e(0), face: f(2) }
    );
}

#[test]
fn a_short_overflow_list_is_allowed() {
    // Edits may shrink a complex edge's list in place.
    let mut m = two_books();
    let t = &mut m.topology;
    assert_eq!(t.edges[0].faces[1], COMPLEX);
    t.dead_faces.set(2);
    t.complex[0].len = 2;
    t.dead_vertices.set(4);
    for x in [0, 1] {
        let last = *t.star(v(x)).last().unwrap();
        assert_eq!(t.edge_vertices(last), [v(x), v(4)]);
        t.stars[x as usize].span.len -= 1;
        t.dead_edges.set(last.index());
    }
    assert_eq!(m.check(), Ok(()));
}

#[test]
fn parallel_arrays() {
    assert_eq!(
        broken(square(), |m| m.face_material = vec![0]),
        CheckError::Length { array: "face materials", len: 1, want: 2 }
    );
    assert_eq!(
        broken(square(), |m| m.face_group = vec![0; 3]),
        CheckError::Length { array: "face groups", len: 3, want: 2 }
    );
    assert_eq!(
        broken(square(), |m| m.face_row = vec![0; 3]),
        CheckError::Length { array: "face rows", len: 3, want: 2 }
    );
    assert_eq!(
        broken(square(), |m| m.positions = vec![[0.0f32; 3]; 4].into()),
        CheckError::Length { array: "positions", len: 4, want: 5 }
    );
    assert_eq!(
        broken(square(), |m| m.positions.set(2, glam::DVec3::new(0.0, f64::NAN, 0.0))),
        CheckError::NotFinite(v(2))
    );
}

#[test]
fn wedges() {
    let mut w = Wedges::new(vec![Channel::new(Semantic::Custom("heat".into()), 1)]).unwrap();
    w.push(&[0.5], 1);
    w.corner = vec![0, NONE, 0];
    let mut input = MeshInput::triangles(vec![[0.0f32; 3]; 3], &[[0, 1, 2]]);
    input.wedges = Some(w);
    let mesh = Mesh::build(input, &Default::default()).unwrap().0;
    assert_eq!(mesh.check(), Ok(()));
    let wedge = |m: &mut Mesh, by: fn(&mut Vec<u32>)| by(&mut m.wedges.as_mut().unwrap().corner);
    assert_eq!(
        broken(mesh.clone(), |m| wedge(m, |c| c[1] = 1)),
        CheckError::WedgeRange { corner: 1, wedge: 1 }
    );
    assert_eq!(
        broken(mesh, |m| wedge(m, |c| c.truncate(2))),
        CheckError::Length { array: "wedges.corner", len: 2, want: 3 }
    );
}
