//! Progressive terrain: the splits are those of a progressive mesh, and their bounds hold for what views show.

use progmesh::blocks::{InMemory, Options, Store, build};
use progmesh::refine::format::{EncodeOptions, decode, encode};
use progmesh::refine::{Hierarchy, hierarchy, selective::View};
use progmesh::terrain::Grid;
use progmesh::terrain::tin::Quiet;
use std::sync::Arc;

fn landscape(columns: usize, rows: usize, hole: bool) -> Grid {
    let heights = (0..columns * rows).map(|i| {
        let (x, y) = ((i % columns) as f64, (i / columns) as f64);
        let rough = ((i * 7919) % 101) as f64 * 0.1;
        let h = ((x * 0.21).sin() * (y * 0.17).cos() * 30.0 + rough).round();
        if hole && (x - 20.0).hypot(y - 11.0) < 6.0 { f64::NAN } else { h }
    });
    Grid::new(columns, rows, heights.collect()).unwrap()
}

#[test]
fn full_detail_is_the_grid() {
    for hole in [false, true] {
        let grid = landscape(41, 37, hole);
        let built = build(&grid, &Options::default().with_cells(8), &InMemory::default(), &Quiet).unwrap();
        assert_eq!((built.levels, built.blocks, built.error), (4, 25 + 9 + 4 + 1, 0.0));
        let pm = &built.mesh;
        let mut cursor = pm.cursor().unwrap();
        if !hole {
            assert_eq!((pm.base_vertices(), pm.base_faces.len()), (4, 2));
        }
        cursor.seek(usize::MAX).unwrap();
        let full = cursor.to_input();
        let mut seen = vec![0; 41 * 37];
        for i in 0..full.positions.len() {
            let p = full.positions.get(i);
            assert_eq!(grid.height(p.x as usize, p.z as usize), Some(p.y));
            seen[p.z as usize * 41 + p.x as usize] += 1;
        }
        assert!(seen.iter().zip(grid.heights()).all(|(&n, h)| n <= 1 && (n == 1 || h.is_nan())));
        // Faces look up, and cover what the grid does.
        let area: f64 = full
            .corners
            .chunks(3)
            .map(|t| {
                let [a, b, c] = [t[0], t[1], t[2]].map(|v| full.positions.get(v as usize));
                let up = (b - a).cross(c - a).y;
                assert!(up == 1.0, "{up}");
                up
            })
            .sum();
        assert!(hole || area == 2.0 * 40.0 * 36.0);
        // Coarser meshes all along are sound.
        for k in (0..=pm.splits.len()).step_by(101) {
            cursor.seek(k).unwrap();
        }
    }
}

#[test]
fn what_was_put_aside_is_not_made_again_and_threads_do_not_show() {
    let grid = landscape(50, 33, true);
    let options = Options::default().with_cells(16).with_floor(3.0);
    let store = InMemory::default();
    let first = build(&grid, &options, &store, &Quiet).unwrap();
    assert_eq!(first.found, 0);
    assert!(first.error <= 3.0 && first.error > 0.0);
    let again = build(&grid, &options, &store, &Quiet).unwrap();
    assert_eq!((again.found, &again.mesh), (again.blocks, &first.mesh));
    assert!(store.has("0-0-0.block").unwrap());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let other = pool.install(|| build(&grid, &options, &InMemory::default(), &Quiet)).unwrap();
    assert_eq!(other.mesh, first.mesh);
}

#[test]
fn it_can_be_written_so_that_chunks_are_read_alone() {
    let grid = landscape(65, 65, false);
    let built = build(&grid, &Options::default().with_cells(16), &InMemory::default(), &Quiet).unwrap();
    let bytes = encode(&[built.mesh], &[], &[], &EncodeOptions::default().with_alone(true)).unwrap();
    let back = decode(&bytes).unwrap();
    let mut cursor = back.meshes[0].cursor().unwrap();
    cursor.seek(usize::MAX).unwrap();
    assert_eq!(cursor.to_input().corners.len(), 3 * 2 * 64 * 64);
}

/// Any set of splits that a view may hold: at every sample the mesh is as near as the bounds of the splits not made say.
#[test]
fn bounds_hold_in_views() {
    // Steps of rows half as long again as those of columns, which are 4 units of height.
    bounds_hold_with([1.0, 1.0]);
    bounds_hold_with([4.0, 6.0]);
}

fn bounds_hold_with(spacing: [f64; 2]) {
    let grid = landscape(49, 49, false);
    let options = Options::default().with_cells(16).with_spacing(spacing);
    let built = build(&grid, &options, &InMemory::default(), &Quiet).unwrap();
    let (step, unit) = (spacing[1] / spacing[0], 1.0 / spacing[0]);
    let pm = Arc::new(built.mesh);
    let options = hierarchy::Options::CUTS.with_rounds(0);
    let hierarchy = Arc::new(Hierarchy::new(pm.clone(), &options).unwrap());
    let n = pm.splits.len();
    for round in 0..6 {
        let mut view = View::new(hierarchy.clone());
        for k in 0..60 * round {
            view.split((k * 7919 + round * 31) % n);
        }
        let places: Vec<_> = (0..n).map(|i| hierarchy.bounds(i).centre).collect();
        let corners: Vec<[u32; 3]> = view.indices().iter().copied().filter(|t| t[0] != t[1]).collect();
        for t in &corners {
            let v = t.map(|v| match (v as usize).checked_sub(pm.base_vertices()) {
                None => pm.base_positions.get(v as usize),
                Some(i) => pm.new_positions.get(i),
            });
            let side = |p: glam::DVec3, q: glam::DVec3, x: f64, z: f64| {
                (q.x - p.x) * (z - p.z) - (q.z - p.z) * (x - p.x)
            };
            let area = side(v[0], v[1], v[2].x, v[2].z);
            let (lo, hi) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
            for z in (lo.z / step) as usize..=(hi.z / step) as usize {
                for x in lo.x as usize..=hi.x as usize {
                    let (fx, fz) = (x as f64, z as f64 * step);
                    let w = [side(v[1], v[2], fx, fz), side(v[2], v[0], fx, fz), side(v[0], v[1], fx, fz)];
                    if area == 0.0 || w.iter().any(|&w| w * area < 0.0) {
                        continue;
                    }
                    let y: f64 = (0..3).map(|k| w[k] / area * v[k].y).sum();
                    let miss = (y - grid.height(x, z).unwrap() * unit).abs();
                    if miss < 1e-9 {
                        continue;
                    }
                    let at = glam::DVec3::new(fx, y, fz);
                    let bound = (0..n)
                        .filter(|&i| {
                            !view.is_applied(i) && places[i].distance(at) <= hierarchy.bounds(i).radius
                        })
                        .map(|i| hierarchy.bounds(i).error)
                        .fold(0.0, f64::max);
                    assert!(miss <= bound + 1e-9, "{miss} at {x}, {z}: {bound}");
                }
            }
        }
    }
}
