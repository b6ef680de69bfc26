//! Sample meshes as meshes, and what a simplification must not change.
#![allow(dead_code)]

pub(crate) mod distance;
pub(crate) mod soups;

use progmesh_aif::*;
use progmesh_meshes::{GenerateOptions, Sample, generate};
use proptest::prelude::*;

/// The arrays of a sample, with its normals and uvs as wedges.
pub(crate) fn input_of(s: &Sample) -> MeshInput {
    let mut channels = Vec::new();
    s.normals.iter().for_each(|_| channels.push(Channel::new(Semantic::Normal, 3)));
    s.uvs.iter().for_each(|_| channels.push(Channel::new(Semantic::TexCoord(0), 2)));
    let wedges = (!channels.is_empty()).then(|| {
        let mut w = Wedges::new(channels.clone()).unwrap();
        let mut known = std::collections::HashMap::new();
        let all = (1 << channels.len()) - 1;
        for c in 0..s.corners.len() {
            let key =
                (s.normals.as_ref().map(|n| n.corner[c]), s.uvs.as_ref().map(|u| u.corner[c]), s.corners[c]);
            let id = *known.entry(key).or_insert_with(|| {
                let mut row = Vec::new();
                s.normals.iter().for_each(|n| row.extend(n.values[n.corner[c] as usize]));
                s.uvs.iter().for_each(|u| row.extend(u.values[u.corner[c] as usize]));
                w.push(&row, all)
            });
            w.corner.push(id);
        }
        w
    });
    MeshInput {
        positions: Positions::from_f64(s.positions.clone()),
        face_sizes: s.face_sizes.clone(),
        corners: s.corners.clone(),
        wires: s.wires.clone(),
        wedges,
        face_material: s.face_material.clone(),
        ..Default::default()
    }
}

pub(crate) fn sample(name: &str, faces: usize, seed: u64) -> Mesh {
    let s = generate(name, &GenerateOptions::default().with_faces(faces).with_seed(seed)).unwrap();
    Mesh::build(input_of(&s), &BuildOptions::default()).unwrap().0
}

/// What collapses must keep: Euler characteristic, border loops, components, genus.
pub(crate) fn topology_of(m: &Mesh) -> (i64, usize, usize, Option<usize>) {
    let t = m.topology();
    (t.euler_characteristic(), t.border_loops().len(), t.face_components().count, t.genus())
}

/// The positions along every border loop, bit for bit, each loop from its least position, in order.
pub(crate) fn border(m: &Mesh) -> Vec<Vec<[u64; 3]>> {
    let mut loops: Vec<Vec<[u64; 3]>> = m
        .topology()
        .border_loops()
        .iter()
        .map(|l| {
            let mut p: Vec<_> = l.vertices.iter().map(|v| m.positions().bits(v.index())).collect();
            let least = (0..p.len()).min_by_key(|&i| p[i]).unwrap_or(0);
            if l.closed {
                p.rotate_left(least);
            }
            p
        })
        .collect();
    loops.sort();
    loops
}

/// A mesh drawn in text: letters are vertices, at their column and twice their row (rows go down); faces name them counter-clockwise.
pub(crate) fn drawn(art: &str, faces: &str) -> (Mesh, Vec<char>) {
    let (mut names, mut points) = (Vec::new(), Vec::new());
    for (y, line) in art.lines().enumerate() {
        for (x, c) in line.chars().enumerate().filter(|c| c.1.is_alphabetic()) {
            names.push(c);
            points.push([x as f32, -2.0 * y as f32, 0.0]);
        }
    }
    let faces: Vec<&str> = faces.split_whitespace().collect();
    let sizes: Vec<u32> = faces.iter().map(|f| f.len() as u32).collect();
    let id = |c: char| names.iter().position(|&n| n == c).unwrap() as u32;
    let corners: Vec<u32> = faces.iter().flat_map(|f| f.chars()).map(id).collect();
    (Mesh::from_polygons(points, &sizes, &corners).unwrap(), names)
}

/// Name, faces (fewer than `most`), seed.
pub(crate) fn any_sample(most: usize) -> impl Strategy<Value = (&'static str, usize, u64)> {
    let names = [
        "scan",
        "sphere",
        "torus",
        "terrain",
        "cad",
        "polygons",
        "quad-sphere",
        "nonmanifold",
        "squashed",
        "soup",
    ];
    (prop::sample::select(names.to_vec()), 30..most, 0u64..1000)
}
