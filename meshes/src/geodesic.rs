//! Geodesic spheres: the icosahedron, each face divided into `n * n` triangles, on the unit sphere.

use crate::sample::{Sample, triangle_mesh};
use glam::DVec3;

/// A geodesic unit sphere of about this many faces (20 n²).
pub(crate) fn sphere(faces: usize) -> Sample {
    let (points, triangles) = geodesic(frequency(faces));
    triangle_mesh(points, &triangles)
}

/// The frequency whose sphere has about this many faces.
pub(crate) fn frequency(faces: usize) -> u32 {
    ((faces as f64 / 20.0).sqrt().round() as u32).max(1)
}

/// Points and triangles of the geodesic sphere of frequency `n`.
pub(crate) fn geodesic(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (base, base_faces) = icosahedron();
    let mut points = base.clone();
    // The points inside an edge come once, from its lower to its higher corner.
    let mut edges: Vec<[u32; 2]> = Vec::with_capacity(30);
    for f in &base_faces {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            if a < b {
                edges.push([a, b]);
            }
        }
    }
    for &[a, b] in &edges {
        for i in 1..n {
            let t = i as f64 / n as f64;
            points.push(base[a as usize].lerp(base[b as usize], t).normalize());
        }
    }
    let on_edge = |a: u32, b: u32, i: u32| -> u32 {
        let (lo, hi, i) = if a < b { (a, b, i) } else { (b, a, n - i) };
        let e = edges.iter().position(|&e| e == [lo, hi]).unwrap_or(0) as u32;
        base.len() as u32 + e * (n - 1) + i - 1
    };
    let mut triangles = Vec::with_capacity(20 * n as usize * n as usize);
    let mut row = Vec::new();
    let mut last = Vec::new();
    for &[a, b, c] in &base_faces {
        // Row j runs parallel to a-b, from the edge a-c to the edge b-c.
        for j in 0..=n {
            row.clear();
            let len = n - j;
            for i in 0..=len {
                row.push(match (i, j) {
                    (0, 0) => a,
                    (0, _) if j == n => c,
                    (_, 0) if i == n => b,
                    (_, 0) => on_edge(a, b, i),
                    (0, _) => on_edge(a, c, j),
                    _ if i == len => on_edge(b, c, j),
                    _ => {
                        let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
                        let p =
                            base[a as usize] * (1.0 - u - v) + base[b as usize] * u + base[c as usize] * v;
                        points.push(p.normalize());
                        (points.len() - 1) as u32
                    }
                });
            }
            for i in 0..if j == 0 { 0 } else { last.len() - 1 } {
                triangles.push([last[i], last[i + 1], row[i]]);
                if i + 1 < row.len() {
                    triangles.push([last[i + 1], row[i + 1], row[i]]);
                }
            }
            std::mem::swap(&mut row, &mut last);
        }
    }
    (points, triangles)
}

/// The icosahedron on the unit sphere, faces counter-clockwise from outside.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0f64.sqrt()) / 2.0;
    let mut points = Vec::with_capacity(12);
    for axis in 0..3 {
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let mut p = DVec3::ZERO;
            p[axis] = s;
            p[(axis + 1) % 3] = t * golden;
            points.push(p.normalize());
        }
    }
    // Its faces are the triples of corners that lie pairwise at the least distance.
    let near = |i: usize, j: usize| points[i].distance_squared(points[j]) < 1.2;
    let mut faces = Vec::with_capacity(20);
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(k, i) {
                    let outward = (points[j] - points[i]).cross(points[k] - points[i]).dot(points[i]) > 0.0;
                    faces.push(if outward { [i, j, k] } else { [i, k, j] }.map(|x| x as u32));
                }
            }
        }
    }
    (points, faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_those_of_a_geodesic_sphere() {
        for n in [1u32, 2, 3, 7] {
            let (points, triangles) = geodesic(n);
            assert_eq!((points.len() as u32, triangles.len() as u32), (10 * n * n + 2, 20 * n * n));
        }
    }

    #[test]
    fn every_face_looks_outwards() {
        let (p, t) = geodesic(5);
        for [a, b, c] in t.iter().map(|t| t.map(|v| p[v as usize])) {
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }
}
