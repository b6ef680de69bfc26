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
        let mut triangles = Vec::with_capacity(mesh.triangles());
        triangles
            .extend((0..mesh.triangles() as u32).filter(|&t| !mesh.is_outside(t)).map(|t| mesh.corners(t)));
        let mut network = Network {
            // Vertices of none have no height; they go.
            vertices: mesh.points.iter().map(|&(x, y)| Corner { x, y, z: field.at(x, y) }).collect(),
            triangles,
            kept: mesh.inner_constraints(),
        };
        if !mesh.outside.is_empty() {
            network.compact();
        }
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

    /// Samples that are corners of valid triangles of the grid and of no triangle here. O(samples).
    pub(super) fn dropped(&self, field: &Field, region: &Region) -> usize {
        let mut covered = vec![false; field.h.len()];
        for &[a, b, c] in &self.triangles {
            let [a, b, c] = [a, b, c].map(|v| self.vertices[v as usize]);
            rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
                covered[field.index(x0, y)..=field.index(x1, y)].fill(true);
            });
        }
        let lost = |y: i32, x: i32| !covered[field.index(x, y)] && region.uses(x, y);
        (0..field.rows).map(|y| (0..field.columns).filter(|&x| lost(y, x)).count()).sum()
    }

    /// How far the samples lie from the triangles, in the grid's units. Samples on sides count for every triangle that has them.
    /// `anywhere`: sides on the outline may cross edges of the grid between samples. O(samples).
    pub(super) fn errors(&self, field: &Field, heights: &[f64], anywhere: bool) -> Errors {
        let parts = parallel::map(self.triangles.chunks(CHUNK).collect(), |chunk: &[[u32; 3]]| {
            let mut sum = Sum::default();
            for t in chunk {
                let corner = |i: usize| self.vertices[t[i] as usize];
                let corners = [corner(0), corner(1), corner(2)];
                sum.samples(field, heights, corners);
                for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                    // Once for both triangles of a side. Those of one only lie on the outline.
                    if t[i] < t[j] || anywhere {
                        sum.side(field, corners[i], corners[j]);
                    }
                }
            }
            sum
        });
        let mut all = Sum::default();
        for part in parts {
            all.greatest = all.greatest.max(part.greatest);
            all.between = all.between.max(part.between);
            all.squares += part.squares;
            all.count += part.count;
        }
        let Sum { greatest, between, squares, count } = all;
        let between = between * field.quantum;
        // Crossings are judged by rounded heights, which may be off by the rounding.
        let surface = if between > 0.0 { greatest.max(between + field.rounding) } else { greatest };
        Errors { max: greatest, rms: (squares / count.max(1) as f64).sqrt(), surface }
    }
}

/// Errors of some triangles.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    greatest: f64,
    squares: f64,
    count: usize,
    /// Where sides cross edges of the grid, in quanta.
    between: f64,
}

impl Sum {
    fn samples(&mut self, field: &Field, heights: &[f64], [a, b, c]: [Corner; 3]) {
        let plane = Plane::new(a, b, c);
        let part = field.quantum / plane.area as f64;
        let columns = field.columns as usize;
        rows((a.x, a.y), (b.x, b.y), (c.x, c.y), |y, x0, x1| {
            let mut s = plane.at + plane.dx * i64::from(x0 - a.x) + plane.dy * i64::from(y - a.y);
            let first = y as usize * columns + x0 as usize;
            let row = &heights[first..=first + (x1 - x0) as usize];
            for &h in row {
                let e = (s as f64 * part - h).abs();
                self.squares += e * e;
                if e > self.greatest {
                    // Divided last, what is exact stays so.
                    let exact = (s as f64 / plane.area as f64 * field.quantum - h).abs();
                    self.greatest = self.greatest.max(exact);
                }
                s += plane.dx;
            }
            self.count += row.len();
        });
    }

    fn side(&mut self, field: &Field, a: Corner, b: Corner) {
        crossings(field, a, b, |c| {
            self.between = self.between.max(c.miss.abs() as f64 / c.parts as f64);
        });
    }
}
