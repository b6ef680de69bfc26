//! One vertex for every cell: where it goes, and with what attributes.

use super::grid::{Source, canonical};
use crate::options::{Options, Placement};
use crate::quadric::Quadric;
use glam::DVec3;
use progmesh_aif::{Bits, BuildOptions, Mesh, MeshInput, NONE, Positions, Semantic, VertexId, Wedges};
use std::collections::HashSet;

/// Optimal placement: pull towards the centroid, relative to the mean eigenvalue of the quadric.
const PULL: f64 = 1e-3;

impl Source<'_> {
    /// Replaces the mesh by its clusters in cells of this edge. Returns how far a vertex was moved at most (model units), and for
    /// every vertex of the result the nearest vertex of its cell (nothing when all vertices are kept).
    pub(super) fn replace(&mut self, edge: f64, options: &Options) -> (f64, Vec<u32>) {
        self.assign(edge);
        let placement = match options.keep_vertices {
            true => Placement::Endpoint,
            false => options.placement.unwrap_or(Placement::Optimal),
        };
        let mut places = self.places(edge, placement, options);
        let nearest = self.nearest(&places);
        if placement == Placement::Endpoint {
            places.iter_mut().zip(&nearest).for_each(|(p, &v)| *p = self.work.points[v as usize]);
        }
        let moved = (0..self.cell.len()).filter(|&v| self.cell[v] != NONE);
        let moved = moved.map(|v| self.work.points[v].distance_squared(places[self.cell[v] as usize]));
        let estimate = moved.fold(0.0, f64::max).sqrt() / self.work.scale;

        let (kept, triangles) = self.surviving();
        let wires = self.wires();
        let wedges = self.wedges(&kept, &places);
        let per_face = |old: &[u32]| match old {
            [] => Vec::new(),
            _ => kept.iter().map(|&i| old[self.faces[i as usize].index()]).collect(),
        };
        let mesh = &*self.work.mesh;
        let (material, group) = (per_face(mesh.face_materials()), per_face(mesh.face_groups()));
        let face_row = per_face(mesh.face_rows());
        let mut corners = triangles.into_flattened();
        let mut wires = wires;
        let mut origin = Vec::new();
        let positions = if options.keep_vertices {
            let name = |c: &mut u32| *c = nearest[*c as usize];
            corners.iter_mut().chain(wires.as_flattened_mut()).for_each(name);
            mesh.positions().clone()
        } else {
            // Cells that nothing uses any more have no vertex.
            let mut number = vec![NONE; self.cells];
            for c in corners.iter().chain(wires.as_flattened()) {
                number[*c as usize] = 0;
            }
            for (cell, n) in number.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
                *n = origin.len() as u32;
                origin.push(cell as u32);
            }
            corners.iter_mut().chain(wires.as_flattened_mut()).for_each(|c| *c = number[*c as usize]);
            let positions = self.stored(&origin, &places, &nearest, placement);
            origin.iter_mut().for_each(|c| *c = nearest[*c as usize]);
            positions
        };
        let input = MeshInput {
            positions,
            corners,
            wires,
            wedges,
            face_material: material,
            face_group: group,
            face_row,
            ..MeshInput::default()
        };
        // Indices are in range, places finite, arrays parallel: this builds.
        if let Ok((mesh, _)) = Mesh::build(input, &BuildOptions::default()) {
            *self.work.mesh = mesh;
        }
        (estimate, origin)
    }

    /// The places in the precision of the mesh; a vertex that has not moved keeps its bits.
    fn stored(&self, cells: &[u32], places: &[DVec3], nearest: &[u32], placement: Placement) -> Positions {
        let old = self.work.mesh.positions();
        let keeps =
            |c: usize| placement == Placement::Endpoint || self.work.points[nearest[c] as usize] == places[c];
        let mut positions = old.gather(&cells.iter().map(|&c| nearest[c as usize]).collect::<Vec<_>>());
        for (i, c) in cells.iter().map(|&c| c as usize).enumerate().filter(|&(_, c)| !keeps(c)) {
            positions.set(i, self.work.to_model(places[c]));
        }
        positions
    }

    /// Where the vertex of every cell goes: the centroid, or the least of its quadric.
    fn places(&self, edge: f64, placement: Placement, options: &Options) -> Vec<DVec3> {
        let points = &self.work.points;
        let weight = |v: usize| options.vertex_weights.get(v).map_or(1.0, |&w| w as f64);
        // The first vertex of a cell is its origin, for precision; it stands for the cell, too.
        let mut first = vec![NONE; self.cells];
        let mut sums = vec![(DVec3::ZERO, 0.0, DVec3::ZERO, 0.0); self.cells];
        for (v, &c) in self.cell.iter().enumerate().filter(|(_, c)| **c != NONE) {
            let c = c as usize;
            if first[c] == NONE {
                first[c] = v as u32;
            }
            let (d, w) = (points[v] - points[first[c] as usize], weight(v));
            let s = &mut sums[c];
            *s = (s.0 + d * w, s.1 + w, s.2 + d, s.3 + 1.0);
        }
        let centroids = first.iter().zip(&sums).map(|(&v, s)| {
            // All weights zero: as if all were one.
            points[v as usize] + if s.1 > 0.0 { s.0 / s.1 } else { s.2 / s.3 }
        });
        let centroids: Vec<DVec3> = centroids.collect();
        if placement == Placement::Midpoint {
            return centroids;
        }
        let mut quadrics = vec![Quadric::default(); self.cells];
        for t in &self.triangles {
            let v = t.map(|c| self.vertex[c as usize] as usize);
            let [a, b, c] = v.map(|v| points[v]);
            let n = (b - a).cross(c - a);
            let double_area = n.length();
            if double_area > 0.0 {
                let n = n / double_area;
                for v in v {
                    let cell = self.cell[v] as usize;
                    let q = &mut quadrics[cell];
                    let (d, k) = (n.dot(centroids[cell] - a), double_area * weight(v));
                    q.add_plane(n, k);
                    q.b += n * (k * d);
                    q.c += k * d * d;
                }
            }
        }
        let least = |c: usize| {
            let q = &quadrics[c];
            let step = q.minimise(DVec3::ZERO, PULL * q.trace() / 3.0).unwrap_or(DVec3::ZERO);
            let (low, high) = self.cell_box(first[c] as usize, edge);
            let to = centroids[c] + step;
            if to.is_finite() { to.max(low).min(high) } else { centroids[c] }
        };
        (0..self.cells).map(least).collect()
    }

    /// Of every cell the vertex nearest to its place; the first of equals.
    fn nearest(&self, places: &[DVec3]) -> Vec<u32> {
        let mut best = vec![(f64::INFINITY, NONE); places.len()];
        for (v, &c) in self.cell.iter().enumerate().filter(|(_, c)| **c != NONE) {
            let d = self.work.points[v].distance_squared(places[c as usize]);
            if d < best[c as usize].0 {
                best[c as usize] = (d, v as u32);
            }
        }
        best.into_iter().map(|b| b.1).collect()
    }

    /// The triangles that are left: their numbers, and their cells.
    fn surviving(&self) -> (Vec<u32>, Vec<[u32; 3]>) {
        let cells = |i: usize| self.triangles[i].map(|c| self.cell[self.vertex[c as usize] as usize]);
        let named = |i: usize| canonical(cells(i)).map(|t| (t, i as u32));
        let mut left: Vec<([u32; 3], u32)> = (0..self.triangles.len()).filter_map(named).collect();
        // Equal ones side by side, the first of them first.
        left.sort_unstable();
        left.dedup_by_key(|l| l.0);
        let mut kept: Vec<u32> = left.into_iter().map(|l| l.1).collect();
        kept.sort_unstable();
        let cells = kept.iter().map(|&i| cells(i as usize)).collect();
        (kept, cells)
    }

    /// Edges without a face between different cells, each once.
    fn wires(&self) -> Vec<[u32; 2]> {
        let t = self.work.mesh.topology();
        let mut seen = HashSet::new();
        t.edges()
            .filter(|&e| t.edge_faces(e).is_empty())
            .map(|e| t.edge_vertices(e).map(|v: VertexId| self.cell[v.index()]))
            .filter(|&[a, b]| a != b && seen.insert([a.min(b), a.max(b)]))
            .collect()
    }

    /// Attributes of the corners that are left.
    fn wedges(&self, kept: &[u32], places: &[DVec3]) -> Option<Wedges> {
        let old = self.work.mesh.wedges()?;
        let mut new = Wedges::new(old.channels().to_vec()).ok()?;
        let charts = self.charts();
        // Corners by cell and chart; corners of one run share a wedge.
        let mut order: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * self.triangles.len());
        let mut listed = Bits::new(self.vertex.len());
        for (i, t) in self.triangles.iter().enumerate() {
            for &c in t.iter().filter(|&&c| old.corner[c as usize] != NONE) {
                if !listed.get(c as usize) {
                    listed.set(c as usize);
                    let cell = self.cell[self.vertex[c as usize] as usize];
                    order.push((cell, charts[self.faces[i].index()], c));
                }
            }
        }
        order.sort_unstable();
        let mut of_corner = vec![NONE; self.vertex.len()];
        let mut average = Average::new(old);
        for run in order.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let place = places[run[0].0 as usize];
            let far = |c: u32| self.work.points[self.vertex[c as usize] as usize].distance_squared(place);
            let nearest = run.iter().map(|r| r.2).min_by(|&a, &b| far(a).total_cmp(&far(b)).then(a.cmp(&b)));
            let nearest = nearest.map_or(NONE, |c| old.corner[c as usize]);
            let wedge = average.push(&mut new, nearest, run.iter().map(|r| old.corner[r.2 as usize]));
            run.iter().for_each(|r| of_corner[r.2 as usize] = wedge);
        }
        let corners = kept.iter().flat_map(|&i| self.triangles[i as usize]);
        new.corner = corners.map(|c| of_corner[c as usize]).collect();
        Some(new)
    }

    /// Of every face the least face it hangs together with without crossing a seam.
    fn charts(&self) -> Vec<u32> {
        let t = self.work.mesh.topology();
        let mut parent: Vec<u32> = (0..t.face_slots() as u32).collect();
        fn find(parent: &mut [u32], mut f: usize) -> usize {
            while parent[f] as usize != f {
                parent[f] = parent[parent[f] as usize];
                f = parent[f] as usize;
            }
            f
        }
        for e in t.edges().filter(|e| !self.work.seams.get(e.index())) {
            if let &[f, g] = t.edge_faces(e) {
                let (f, g) = (find(&mut parent, f.index()), find(&mut parent, g.index()));
                parent[f.max(g)] = f.min(g) as u32;
            }
        }
        (0..parent.len()).map(|f| find(&mut parent, f) as u32).collect()
    }
}

/// The mean of wedges.
struct Average<'w> {
    old: &'w Wedges,
    sums: Vec<f64>,
    counts: Vec<u32>,
    row: Vec<f32>,
}

impl<'w> Average<'w> {
    fn new(old: &'w Wedges) -> Self {
        let (stride, channels) = (old.stride(), old.channels().len());
        Average { old, sums: vec![0.0; stride], counts: vec![0; channels], row: vec![0.0; stride] }
    }

    /// Adds the mean of `all` to `new`; what cannot be averaged is that of `nearest`.
    fn push(&mut self, new: &mut Wedges, nearest: u32, all: impl Iterator<Item = u32>) -> u32 {
        let old = self.old;
        self.sums.fill(0.0);
        self.counts.fill(0);
        for w in all {
            for k in 0..self.counts.len() {
                if let Some(values) = old.get(w, k) {
                    let sums = &mut self.sums[old.offset(k)..];
                    sums.iter_mut().zip(values).for_each(|(s, &x)| *s += x as f64);
                    self.counts[k] += 1;
                }
            }
        }
        self.row.copy_from_slice(old.row(nearest));
        let mut present = 0;
        for (k, channel) in old.channels().iter().enumerate() {
            let taken = matches!(channel.semantic, Semantic::Joints(_) | Semantic::Weights(_));
            if taken {
                present |= old.present(nearest) & 1 << k;
                continue;
            }
            if self.counts[k] == 0 {
                continue;
            }
            present |= 1 << k;
            let range = old.offset(k)..old.offset(k) + channel.width;
            let (sums, row) = (&self.sums[range.clone()], &mut self.row[range]);
            let unit = match channel.semantic {
                Semantic::Normal => channel.width,
                // The fourth is a sign.
                Semantic::Tangent => channel.width.min(3),
                _ => 0,
            };
            let length = sums[..unit].iter().map(|s| s * s).sum::<f64>().sqrt();
            for (i, (x, s)) in row.iter_mut().zip(sums).enumerate() {
                if i < unit && length > 1e-6 {
                    *x = (s / length) as f32;
                } else if unit == 0 {
                    *x = (s / self.counts[k] as f64) as f32;
                }
            }
        }
        new.push(&self.row, present)
    }
}
