//! Plain counts of a sample's topology, by sorting: slow, obvious, and independent of progmesh-aif.
#![allow(dead_code, unreachable_pub)] // each test file uses some of it

use progmesh_meshes::Sample;
use std::collections::{BTreeMap, BTreeSet};

pub struct Topology {
    /// Undirected edge -> how often faces run along it upwards (lower to higher vertex) and downwards.
    pub edges: BTreeMap<(u32, u32), (usize, usize)>,
    pub used_vertices: usize,
    pub faces: usize,
}

impl Topology {
    pub fn of(sample: &Sample) -> Self {
        let mut edges: BTreeMap<(u32, u32), (usize, usize)> = BTreeMap::new();
        for face in sample.faces() {
            for (i, &a) in face.iter().enumerate() {
                let b = face[(i + 1) % face.len()];
                let uses = edges.entry((a.min(b), a.max(b))).or_default();
                if a < b { uses.0 += 1 } else { uses.1 += 1 }
            }
        }
        let used: BTreeSet<u32> = sample.corners.iter().copied().collect();
        Topology { edges, used_vertices: used.len(), faces: sample.face_count() }
    }

    pub fn euler(&self) -> i64 {
        self.used_vertices as i64 - self.edges.len() as i64 + self.faces as i64
    }

    /// Edges with this many faces.
    pub fn edges_of(&self, faces: usize) -> usize {
        self.edges.values().filter(|u| u.0 + u.1 == faces).count()
    }

    /// Every edge has two faces that run along it in opposite directions.
    pub fn is_closed_and_oriented(&self) -> bool {
        self.edges.values().all(|&u| u == (1, 1))
    }

    /// Every edge has one face, or two that run along it in opposite directions.
    pub fn is_oriented_surface(&self) -> bool {
        self.edges.values().all(|&(up, down)| up <= 1 && down <= 1)
    }

    /// Number of border loops, if the border is a set of simple closed loops.
    pub fn border_loops(&self) -> Option<usize> {
        let mut next: BTreeMap<u32, u32> = BTreeMap::new();
        for (&(a, b), &uses) in &self.edges {
            let (from, to) = match uses {
                (1, 0) => (a, b),
                (0, 1) => (b, a),
                _ => continue,
            };
            if next.insert(from, to).is_some() {
                return None;
            }
        }
        let mut loops = 0;
        while let Some((&start, _)) = next.iter().next() {
            let mut v = start;
            while let Some(to) = next.remove(&v) {
                v = to;
            }
            if v != start {
                return None;
            }
            loops += 1;
        }
        Some(loops)
    }
}

/// Twice the area of a triangle, as a vector, in f64.
pub fn area_vector(sample: &Sample, t: &[u32]) -> [f64; 3] {
    let [a, b, c] = [0, 1, 2].map(|k| sample.positions[t[k] as usize]);
    let (u, v): ([f64; 3], [f64; 3]) =
        (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

/// Six times the volume enclosed by a triangle mesh.
pub fn volume6(sample: &Sample) -> f64 {
    sample
        .faces()
        .map(|t| {
            let n = area_vector(sample, t);
            let a = sample.positions[t[0] as usize];
            a[0] * n[0] + a[1] * n[1] + a[2] * n[2]
        })
        .sum()
}
