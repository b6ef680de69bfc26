//! Collapses an edge of a tetrahedron with one face cut in three, and takes it back.
use progmesh_aif::{Marks, Mesh, VertexId};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let points = vec![[0.0, 0.0, 0.0f32], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0], [1.0, 1.0, 0.0]];
    let faces = [[0, 4, 1], [1, 4, 2], [2, 4, 0], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let mut mesh = Mesh::from_triangles(points, &faces)?;
    let edge = mesh.topology().find_edge(VertexId(0), VertexId(4)).ok_or("no such edge")?;
    let record = mesh.collapse_edge(edge, VertexId(0), mesh.position(VertexId(0)), &mut Marks::default())?;
    println!("collapsed: {} faces, {:?}", mesh.face_count(), mesh.triangles());
    let (small, maps) = mesh.clone().compact(Default::default());
    println!("compacted: {} vertices, vertex ids {:?}", small.vertex_count(), maps.vertex);
    mesh.split_vertex(&record);
    println!("split: {} faces, {:?}", mesh.face_count(), mesh.triangles());
    Ok(mesh.check()?)
}
