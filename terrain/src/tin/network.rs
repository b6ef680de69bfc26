//! A whole network in quanta, and how far it lies from the samples.

use super::delaunay::Triangulation;
use super::field::Field;
use super::parallel;
use super::region::Region;
use super::scan::{Corner, Plane, crossings, farthest, rows};
use super::{Errors, Tin};

#[derive(Clone, Debug, Default)]
pub(super) struct Network {
    pub vertices: Vec<Corner>,
    pub triangles: Vec<[u32; 3]>,
    /// Sides that stay, the lower vertex first, sorted; their vertices stay too.
    pub kept: Vec<[u32; 2]>,
}

/// Triangles measured by one thread at a time.
const CHUNK: usize = 4096;

impl Network {
    /// The triangles of a triangulation that lie within the valid region, with the heights of their samples.
    pub(super) fn of(mesh: &Triangulation, field: &Field) -> Self {
        let within = (0..mesh.triangles() as u32).filter(|&t| !mesh.is_outside(t));
        let mut network = Network {
            // Vertices of none have no height; they go.
            vertices: mesh.points.iter().map(|&(x, y)| Corner { x, y, z: field.at(x, y) }).collect(),
            triangles: within.map(|t| mesh.corners(t)).collect(),
            kept: mesh.inner_constraints(),
        };
        network.compact();
        network
    }

    /// Every triangle of the grid in the valid region.
    pub(super) fn full(field: &Field, region: &Region) -> Self {
        let columns = field.columns as usize;
        let vertices = (0..field.h.len())
            .map(|i| Corner { x: (i % columns) as i32, y: (i / columns) as i32, z: field.h[i] })
            .collect();
        let triangles = region.grid_triangles();
        let mut network = Network { vertices, triangles, kept: vec![] };
        network.compact();
        network
    }

    /// Drops vertices of no triangle; the others keep their order.
    pub(super) fn compact(&mut self) {
        let mut new = vec![u32::MAX; self.vertices.len()];
        for &v in self.triangles.as_flattened() {
            new[v as usize] = 0;
        }
        let mut count = 0;
        for (v, new) in new.iter_mut().enumerate() {
            if *new == 0 {
                *new = count;
                self.vertices[count as usize] = self.vertices[v];
                count += 1;
            }
        }
        self.vertices.truncate(count as usize);
        // Vertices keep their order, so sides do.
        for v in self.triangles.as_flattened_mut().iter_mut().chain(self.kept.as_flattened_mut()) {
            *v = new[*v as usize];
        }
    }

    /// The same in the grid's units, its first sample at this column and row of another grid.
    pub(super) fn into_tin(self, field: &Field, [x, y]: [u32; 2]) -> Tin {
        Tin {
            points: self.vertices.iter().map(|v| [v.x as u32 + x, v.y as u32 + y]).collect(),
            heights: self.vertices.iter().map(|v| f64::from(v.z) * field.quantum).collect(),
            triangles: self.triangles,
        }
    }

    /// The greatest distance of a sample, in the grid's units, without what rounding changed.
    pub(super) fn greatest(&self, field: &Field) -> f64 {
        let parts = parallel::map(self.triangles.chunks(CHUNK).collect(), |chunk: &[[u32; 3]]| {
            let far = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| self.vertices[v as usize]);
                let far = farthest(field, a, b, c);
                far.miss as f64 / far.area as f64
            };
            chunk.iter().map(far).fold(0.0, f64::max)
        });
        parts.into_iter().fold(0.0, f64::max) * field.quantum
    }

    /// How far the samples lie from the triangles, in the grid's units. Samples on sides count for every triangle that has them.
    /// O(samples).
    pub(super) fn errors(&self, field: &Field, heights: &[f64]) -> Errors {
        let columns = field.columns as usize;
        let parts = parallel::map(self.triangles.chunks(CHUNK).collect(), |chunk: &[[u32; 3]]| {
            let (mut greatest, mut sum, mut count, mut between) = (0.0f64, 0.0, 0usize, 0.0f64);
            for t in chunk {
                let [a, b, c] = t.map(|v| self.vertices[v as usize]);
                let plane = Plane::new(a, b, c);
                rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
                    let mut s = plane.at + plane.dx * i64::from(x0 - a.x) + plane.dy * i64::from(y - a.y);
                    for x in x0..=x1 {
                        let z = s as f64 / plane.area as f64 * field.quantum;
                        let e = (z - heights[y as usize * columns + x as usize]).abs();
                        greatest = greatest.max(e);
                        sum += e * e;
                        count += 1;
                        s += plane.dx;
                    }
                });
                for (p, q) in [(a, b), (b, c), (c, a)] {
                    crossings(field, p, q, |c| {
                        let side = c.miss as f64 / c.parts as f64 * field.quantum;
                        between = between.max(side.abs());
                    });
                }
            }
            (greatest, sum, count, between)
        });
        let (mut greatest, mut sum, mut count, mut between) = (0.0f64, 0.0, 0, 0.0f64);
        for (g, s, c, b) in parts {
            greatest = greatest.max(g);
            between = between.max(b);
            sum += s;
            count += c;
        }
        // Crossings are judged by rounded heights, which may be off by the rounding.
        let surface = if between > 0.0 { greatest.max(between + field.rounding) } else { greatest };
        Errors { max: greatest, rms: (sum / count.max(1) as f64).sqrt(), surface }
    }
}
