//! How few triangles a surface can have.

use crate::aif::Mesh;

/// What is known of a component.
#[derive(Clone, Copy, Default)]
struct Component {
    vertices: i64,
    edges: i64,
    faces: i64,
    /// It has an edge that is not between two faces.
    open: bool,
    /// It has a vertex that is not inside or at the border of one sheet.
    singular: bool,
}

/// The fewest triangles that a surface of the topology of `mesh` can have: 1 for an open component, 4 for a closed one, and more where it has
/// handles (Heawood's bound on the vertices of a triangulation). A lower bound. O(n).
pub(super) fn triangles(mesh: &Mesh) -> usize {
    let t = mesh.topology();
    let components = t.face_components();
    let of = |f: crate::aif::FaceId| components.of[f.index()] as usize;
    let mut all = vec![Component::default(); components.count];
    for f in t.faces() {
        all[of(f)].faces += 1;
    }
    for e in t.edges() {
        if let Some(&f) = t.edge_faces(e).first() {
            let c = &mut all[of(f)];
            c.edges += 1;
            c.open |= t.edge_faces(e).len() != 2;
        }
    }
    let mut around = Vec::new();
    for v in t.vertices() {
        around.clear();
        around.extend(t.star(v).iter().flat_map(|&e| t.edge_faces(e)).map(|&f| of(f)));
        around.sort_unstable();
        around.dedup();
        for &c in &around {
            all[c].vertices += 1;
            all[c].singular |= !t.is_regular(v);
        }
    }
    all.iter().map(least).sum()
}

fn least(c: &Component) -> usize {
    let euler = c.vertices - c.edges + c.faces;
    match (c.open, c.singular) {
        (true, _) => 1,
        (false, true) => 4,
        (false, false) => {
            let vertices = ((7.0 + (49.0 - 24.0 * euler.min(2) as f64).sqrt()) / 2.0).ceil() as i64;
            (2 * (vertices - euler.min(2))).max(4) as usize
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::{BuildOptions, Mesh};
    use crate::meshes::{GenerateOptions, generate};

    #[test]
    fn a_sphere_has_four_a_torus_fourteen_and_a_sheet_one() {
        for (name, least) in
            [("sphere", 4), ("torus", 14), ("terrain", 1), ("single-triangle", 1), ("empty", 0)]
        {
            let sample = generate(name, &GenerateOptions::default().with_faces(300)).unwrap();
            let scene = crate::samples::scene(sample, name);
            let (mesh, _) = Mesh::build(scene.meshes[0].geometry.clone(), &BuildOptions::default()).unwrap();
            assert_eq!(triangles(&mesh), least, "{name}");
        }
    }
}
