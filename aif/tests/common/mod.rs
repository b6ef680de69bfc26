//! Random polygon soups: degenerate faces, repeated vertices, complex edges, wires, coincident points.
#![allow(dead_code, unreachable_pub)]

use progmesh_aif::{Mesh, MeshInput};
use proptest::prelude::*;

#[derive(Clone, Debug)]
pub struct Soup {
    pub points: Vec<[f32; 3]>,
    pub faces: Vec<Vec<u32>>,
    pub wires: Vec<[u32; 2]>,
}

impl Soup {
    pub fn input(&self) -> MeshInput {
        let sizes: Vec<u32> = self.faces.iter().map(|f| f.len() as u32).collect();
        let mut input = MeshInput::polygons(self.points.clone(), &sizes, &self.faces.concat());
        input.wires = self.wires.clone();
        input.face_group = (0..self.faces.len() as u32).collect();
        input
    }
}

/// Any faces over few vertices: mostly non-manifold.
pub fn soup() -> impl Strategy<Value = Soup> {
    (1u32..14).prop_flat_map(|n| {
        let points = prop::collection::vec([0i8..3, 0i8..3, 0i8..3], n as usize);
        let faces = prop::collection::vec(prop::collection::vec(0..n, 0..8), 0..16);
        let wires = prop::collection::vec([0..n, 0..n], 0..4);
        (points, faces, wires).prop_map(|(points, faces, wires)| Soup {
            points: points.into_iter().map(|p| p.map(|x| x as f32)).collect(),
            faces,
            wires,
        })
    })
}

/// A grid of quads and triangles with some faces left out or turned: a surface with holes, islands and cut vertices.
pub fn patch() -> impl Strategy<Value = Soup> {
    (2u32..7, 2u32..7).prop_flat_map(|(w, h)| {
        prop::collection::vec(0u8..8, (w * h) as usize).prop_map(move |kinds| {
            let at = |x: u32, y: u32| y * (w + 1) + x;
            let mut faces = Vec::new();
            for (i, kind) in kinds.into_iter().enumerate() {
                let (x, y) = (i as u32 % w, i as u32 / w);
                let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
                match kind {
                    0 => {}
                    1 => faces.push(vec![a, b, d]),
                    2 => faces.push(vec![d, c, b, a]),
                    3 | 4 => faces.push(vec![a, b, c, d]),
                    5 => faces.extend([vec![a, b, d], vec![b, c, d]]),
                    _ => faces.extend([vec![a, b, c], vec![a, c, d]]),
                }
            }
            let points = (0..(w + 1) * (h + 1)).map(|i| [(i % (w + 1)) as f32, (i / (w + 1)) as f32, 0.0]);
            Soup { points: points.collect(), faces, wires: Vec::new() }
        })
    })
}

pub fn either() -> impl Strategy<Value = Soup> {
    prop_oneof![soup(), patch()]
}

pub fn faces_of(mesh: &Mesh) -> Vec<Vec<u32>> {
    let t = mesh.topology();
    t.faces().map(|f| t.face_vertices(f).map(|v| v.0).collect()).collect()
}
