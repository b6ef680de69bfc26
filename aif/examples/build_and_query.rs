//! Builds a mesh of two quads and a triangle, and asks what it is.
use progmesh_aif::{Mesh, VertexId};

fn main() -> Result<(), progmesh_aif::BuildError> {
    //   3---2---5
    //   |   |   | \
    //   0---1---4--6
    let points =
        [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1], [3, 0]].map(|[x, y]| [x as f32, y as f32, 0.0]);
    let mesh = Mesh::from_polygons(points.to_vec(), &[4, 4, 3], &[0, 1, 2, 3, 1, 4, 5, 2, 4, 6, 5])?;
    let t = mesh.topology();
    println!("{:?}", t.count_kinds());
    println!("border: {:?}", t.border_loops()[0].vertices);
    println!("around vertex 1: {:?}", t.one_ring(VertexId(1)).map(|ring| ring.neighbours));
    println!("Euler characteristic {}, genus {:?}", t.euler_characteristic(), t.genus());
    println!("as triangles: {:?}", mesh.triangulate()?.mesh.triangles());
    Ok(())
}
