//! What the tests of this crate share: sample meshes, and comparison bit for bit.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its part")]

use progmesh_meshes::{GenerateOptions, Sample, generate};
use progmesh_refine::aif::*;
use progmesh_refine::progressive::same_positions;
use progmesh_refine::simplify::{Method, Options, Placement};

/// The well-formed samples.
pub const NAMES: [&str; 8] =
    ["sphere", "torus", "scan", "terrain", "polygons", "quad-sphere", "cad", "nonmanifold"];

/// The sample with normals and uvs as wedges, one for each pair of values: shared across seams, so that NSA must part them.
pub fn input_of(s: &Sample) -> MeshInput {
    let mut input = MeshInput {
        positions: Positions::from_f64(s.positions.clone()),
        face_sizes: s.face_sizes.clone(),
        corners: s.corners.clone(),
        wires: s.wires.clone(),
        face_material: s.face_material.clone(),
        ..Default::default()
    };
    if let Some(n) = &s.normals {
        let mut channels = vec![Channel::new(Semantic::Normal, 3)];
        s.uvs.iter().for_each(|_| channels.push(Channel::new(Semantic::TexCoord(0), 2)));
        let all = (1 << channels.len()) - 1;
        let mut w = Wedges::new(channels).unwrap();
        let mut known = std::collections::HashMap::new();
        for c in 0..s.corners.len() {
            let uv = s.uvs.as_ref().map(|u| u.corner[c]);
            let id = *known.entry((n.corner[c], uv)).or_insert_with(|| {
                let mut row = n.values[n.corner[c] as usize].to_vec();
                s.uvs.iter().for_each(|u| row.extend(u.values[u.corner[c] as usize]));
                w.push(&row, all)
            });
            w.corner.push(id);
        }
        input.wedges = Some(w);
    }
    input
}

pub fn mesh_of(s: &Sample) -> Mesh {
    Mesh::build(input_of(s), &BuildOptions::default()).unwrap().0
}

pub fn sample(name: &str, faces: usize, seed: u64) -> Mesh {
    mesh_of(&generate(name, &GenerateOptions::default().with_faces(faces).with_seed(seed)).unwrap())
}

pub fn options(method: Method, placement: Option<Placement>) -> Options {
    let mut o = Options::default();
    (o.method, o.placement) = (method, placement);
    o
}

/// Every array, bit for bit.
pub fn assert_same(a: &MeshInput, b: &MeshInput) {
    assert!(same_positions(&a.positions, &b.positions), "positions");
    assert_eq!(a.face_sizes, b.face_sizes);
    assert_eq!(a.corners, b.corners);
    assert_eq!(a.wires, b.wires);
    assert_eq!(a.face_material, b.face_material);
    assert_eq!(a.face_group, b.face_group);
    assert_eq!(a.wedges.is_some(), b.wedges.is_some());
    let bits = |w: &Wedges| -> Vec<(u64, Vec<u32>)> {
        (0..w.len() as u32).map(|i| (w.present(i), w.row(i).iter().map(|x| x.to_bits()).collect())).collect()
    };
    if let (Some(x), Some(y)) = (&a.wedges, &b.wedges) {
        assert_eq!(x.channels(), y.channels());
        assert_eq!(x.corner, y.corner);
        assert_eq!(bits(x), bits(y));
    }
}
