use super::*;
use crate::Mesh;

fn mesh(vertices: usize, triangles: &[[u32; 3]]) -> Topology {
    let p: Vec<[f32; 3]> = (0..vertices).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let mesh = Mesh::from_triangles(p, triangles).unwrap();
    mesh.check().unwrap();
    mesh.topology
}

fn polygons(vertices: usize, sizes: &[u32], corners: &[u32]) -> Topology {
    let p: Vec<[f32; 3]> = (0..vertices).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    Mesh::from_polygons(p, sizes, corners).unwrap().topology
}

fn ids(list: &[VertexId]) -> Vec<u32> {
    list.iter().map(|v| v.0).collect()
}

/// Same cyclic order, whatever the first.
fn cyclic(mut list: Vec<u32>) -> Vec<u32> {
    let least = (0..list.len()).min_by_key(|&i| list[i]).unwrap_or(0);
    list.rotate_left(least);
    list
}

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

#[test]
fn the_ring_of_an_inner_vertex_is_closed_and_counter_clockwise() {
    //   2---1
    //   |\ /|
    //   | 0 |
    //   |/ \|
    //   3---4
    let t = mesh(5, &[[0, 3, 4], [0, 1, 2], [0, 4, 1], [0, 2, 3]]);
    let ring = t.one_ring(VertexId(0)).unwrap();
    assert!(ring.closed);
    assert_eq!(cyclic(ids(&ring.neighbours)), [1, 2, 3, 4]);
    assert_eq!(ring.edges.len(), 4);
    // Each face lies between its edge and the next.
    for (i, &f) in ring.faces.iter().enumerate() {
        let of_face: Vec<_> = t.face_vertices(f).collect();
        assert!(of_face.contains(&ring.neighbours[i]) && of_face.contains(&ring.neighbours[(i + 1) % 4]));
    }
    let ring = t.one_ring(VertexId(1)).unwrap();
    assert!(!ring.closed);
    assert_eq!((ids(&ring.neighbours), ring.faces), (vec![2, 0, 4], vec![FaceId(1), FaceId(2)]));
}

#[test]
fn fans_of_a_bow_tie_and_of_a_book() {
    //   1   4
    //   |\ /|
    //   | 0 |
    //   |/ \|
    //   2   3
    let t = mesh(5, &[[0, 1, 2], [0, 3, 4]]);
    let fans = t.fans(VertexId(0));
    assert_eq!(fans.len(), 2);
    assert_eq!((ids(&fans[0].neighbours), fans[0].closed), (vec![1, 2], false));
    assert_eq!(ids(&fans[1].neighbours), [3, 4]);
    assert_eq!(t.one_ring(VertexId(0)), None);

    // Three pages on the spine 0-1: each is a fan of its own, and has the spine.
    let t = mesh(5, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]);
    let fans = t.fans(VertexId(0));
    assert_eq!(fans.len(), 3);
    assert!(fans.iter().all(|f| !f.closed && f.neighbours[0] == VertexId(1)));
}

#[test]
fn a_fan_with_a_turned_face_is_still_one_fan() {
    let t = mesh(5, &[[0, 1, 2], [0, 3, 2], [0, 3, 4]]);
    let fans = t.fans(VertexId(0));
    assert_eq!((fans.len(), ids(&fans[0].neighbours)), (1, vec![1, 2, 3, 4]));
    assert_eq!(t.misoriented_edges(), 2);
    assert!(t.is_orientable());
    // Both ends run into the vertex: no open end leaves it.
    let t = mesh(4, &[[0, 2, 1], [0, 2, 3]]);
    let fans = t.fans(VertexId(0));
    assert_eq!((fans.len(), ids(&fans[0].neighbours)), (1, vec![1, 2, 3]));
}

#[test]
fn the_link_is_what_bounds_the_star() {
    //   3---2---5     quads 0 1 2 3 and 1 4 5 2
    //   |   |   |
    //   0---1---4
    let t = polygons(6, &[4, 4], &[0, 1, 2, 3, 1, 4, 5, 2]);
    let link = t.link(VertexId(0));
    assert_eq!(ids(&link.vertices), [1, 2, 3]);
    assert_eq!(link.edges.len(), 2);
    assert_eq!(ids(&t.link(VertexId(1)).vertices), [0, 2, 3, 4, 5]);
    assert_eq!(t.link(VertexId(1)).edges.len(), 4);
    let closed = mesh(4, &TETRAHEDRON).link(VertexId(3));
    assert_eq!((ids(&closed.vertices), closed.edges.len()), (vec![0, 1, 2], 3));
}

#[test]
fn border_loops_run_with_the_surface_on_the_left() {
    let t = polygons(6, &[4, 4], &[0, 1, 2, 3, 1, 4, 5, 2]);
    let loops = t.border_loops();
    assert_eq!(loops.len(), 1);
    assert!(loops[0].closed);
    assert_eq!(ids(&loops[0].vertices), [0, 1, 4, 5, 2, 3]);
    for (i, &e) in loops[0].edges.iter().enumerate() {
        let (a, b) = (loops[0].vertices[i], loops[0].vertices[(i + 1) % 6]);
        assert_eq!(t.find_edge(a, b), Some(e));
    }
    assert_eq!(mesh(4, &TETRAHEDRON).border_loops(), []);
}

#[test]
fn borders_that_touch_at_a_vertex_do_not_cross() {
    let t = mesh(5, &[[0, 1, 2], [0, 3, 4]]);
    let loops: Vec<_> = t.border_loops().iter().map(|l| cyclic(ids(&l.vertices))).collect();
    assert_eq!(loops, [[0, 1, 2], [0, 3, 4]]);
}

#[test]
fn borders_end_at_complex_edges() {
    // Three pages on 0-1: each has an open border of two edges.
    let t = mesh(5, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]);
    let mut loops = t.border_loops();
    assert!(loops.iter().all(|l| !l.closed && l.edges.len() == 2 && l.vertices.len() == 3));
    loops.iter_mut().for_each(|l| {
        for (i, &e) in l.edges.iter().enumerate() {
            assert_eq!(t.find_edge(l.vertices[i], l.vertices[i + 1]), Some(e));
        }
    });
    let walks: Vec<_> = loops.iter().map(|l| ids(&l.vertices)).collect();
    assert_eq!(walks, [[1, 2, 0], [1, 3, 0], [1, 4, 0]]);
    assert_eq!(t.genus(), None);
}

#[test]
fn components_by_edge_and_by_vertex() {
    // Two triangles on an edge, one at a vertex of them, one apart; vertex 10 isolated.
    let t = mesh(11, &[[7, 8, 9], [0, 1, 2], [0, 2, 3], [3, 4, 5]]);
    let faces = t.face_components();
    assert_eq!((faces.of, faces.count), (vec![0, 1, 1, 2], 3));
    let vertices = t.vertex_components();
    assert_eq!((vertices.of, vertices.count), (vec![0, 0, 0, 0, 0, 0, 1, 2, 2, 2, 3], 4));
}

/// A torus of n x m quads.
fn torus(n: u32, m: u32) -> (usize, Vec<u32>, Vec<u32>) {
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let mut corners = Vec::new();
    for i in 0..n {
        for j in 0..m {
            corners.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    ((n * m) as usize, vec![4; (n * m) as usize], corners)
}

#[test]
fn euler_and_genus() {
    let t = mesh(4, &TETRAHEDRON);
    assert_eq!((t.euler_characteristic(), t.genus()), (2, Some(0)));
    let (n, sizes, corners) = torus(4, 5);
    let t = polygons(n, &sizes, &corners);
    assert_eq!((t.euler_characteristic(), t.genus(), t.misoriented_edges()), (0, Some(1), 0));
    // A hole in it changes nothing, nor does an isolated vertex.
    let t = polygons(n + 1, &sizes[1..], &corners[4..]);
    assert_eq!((t.border_loops().len(), t.genus(), t.euler_characteristic()), (1, Some(1), 0));
    // Two spheres that touch at vertex 3.
    let two = [TETRAHEDRON, TETRAHEDRON.map(|f| f.map(|v| v + 3))].concat();
    assert_eq!(mesh(7, &two).genus(), Some(0));
    assert_eq!(mesh(3, &[]).genus(), Some(0));
}

#[test]
fn a_moebius_strip_has_one_side_and_one_border() {
    //  0--2--4--1
    //  | /| /| /|     the right side is the left one turned
    //  1--3--5--0
    let t = mesh(6, &[[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5], [4, 5, 1], [1, 5, 0]]);
    assert!(!t.is_orientable());
    assert_eq!(t.misoriented_edges(), 1);
    assert_eq!(t.genus(), None);
    assert_eq!(t.border_loops().len(), 1);
    assert_eq!(t.euler_characteristic(), 0);
}
