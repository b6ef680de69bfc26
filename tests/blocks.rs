//! Progressive terrain: the splits are those of a progressive mesh, and their bounds hold for what views show.

use progmesh::blocks::{InMemory, Options, Store, blocks, build};
use progmesh::refine::format::{Chunk, ChunkType, EncodeOptions, Piece, RangeReader, decode, encode};
use progmesh::refine::paged::{PagedLimits, PagedView};
use progmesh::refine::selective::{Cull, Lens, Limits, View};
use progmesh::refine::view::{Camera, CameraParameters, Projection};
use progmesh::refine::{Hierarchy, ProgressiveMesh, hierarchy};
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
            assert!(pm.base_faces.len() <= 12);
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

/// A file written block by block.
fn file(grid: &Grid, options: &Options, store: &InMemory) -> Vec<u8> {
    let blocks = blocks(grid, options, store, &Quiet).unwrap();
    let mut bytes = vec![];
    let length = blocks.code().unwrap().write(b"scene", &[], &mut bytes).unwrap();
    assert_eq!(length, bytes.len() as u64);
    bytes
}

/// The triangles at full detail, by the bits of their corners.
fn full(pm: &ProgressiveMesh) -> Vec<[[u64; 3]; 3]> {
    let mut cursor = pm.cursor().unwrap();
    cursor.seek(usize::MAX).unwrap();
    let full = cursor.to_input();
    let at = |v: u32| full.positions.get(v as usize).to_array().map(f64::to_bits);
    let mut all: Vec<_> = full
        .corners
        .chunks(3)
        .map(|t| {
            let t = [0, 1, 2].map(|k| at(t[k]));
            [0, 1, 2].map(|k| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]).into_iter().min().unwrap()
        })
        .collect();
    all.sort_unstable();
    all
}

/// Spheres and cones hold the faces of the finest mesh around all vertices that come of a split: by plain search.
fn bounds_hold_what_is_below(pm: &ProgressiveMesh) {
    let bounds = pm.bounds.as_ref().unwrap();
    let n0 = pm.base_vertices();
    let mut cursor = pm.cursor().unwrap();
    cursor.seek(usize::MAX).unwrap();
    let corners = cursor.to_input().corners;
    let place = |v: u32| match (v as usize).checked_sub(n0) {
        None => pm.base_positions.get(v as usize),
        Some(k) => pm.new_positions.get(k),
    };
    let mut around: Vec<Vec<usize>> = vec![vec![]; pm.vertices()];
    corners.iter().enumerate().for_each(|(k, &v)| around[v as usize].push(k / 3));
    let mut below: Vec<Vec<u32>> = (0..pm.vertices() as u32).map(|v| vec![v]).collect();
    for (i, &v) in pm.splits.vertex.iter().enumerate().rev() {
        let new = std::mem::take(&mut below[n0 + i]);
        below[v as usize].extend(new);
        let (centre, radius, cone) = (place(v), bounds.radius(i), bounds.cone(i));
        for f in below[v as usize].iter().flat_map(|&v| &around[v as usize]) {
            let t = [0, 1, 2].map(|k| place(corners[3 * f + k]));
            assert!(t.iter().all(|p| p.distance(centre) <= radius));
            let normal = (t[1] - t[0]).cross(t[2] - t[0]);
            assert!(cone.axis().angle_between(normal) <= cone.half_angle());
        }
    }
}

#[test]
fn written_block_by_block_it_is_the_same_terrain() {
    // The last in blocks of which the tops are apart.
    for (size, cells, spacing, hole, floor) in [
        ((75, 50), 8, [1.0; 2], false, 0.0),
        ((75, 50), 8, [4.0, 6.0], true, 0.0),
        ((75, 50), 8, [1.0; 2], true, 3.0),
        ((120, 85), 64, [1.0; 2], true, 0.0),
    ] {
        let grid = landscape(size.0, size.1, hole);
        let options = Options::default().with_cells(cells).with_spacing(spacing).with_floor(floor);
        let built = build(&grid, &options, &InMemory::default(), &Quiet).unwrap();
        let store = InMemory::default();
        let bytes = file(&grid, &options, &store);
        let back = decode(&bytes).unwrap();
        let pm = &back.meshes[0];
        assert_eq!(full(pm), full(&built.mesh));
        assert_eq!(
            (&pm.base_faces, &pm.base_positions),
            (&built.mesh.base_faces, &built.mesh.base_positions)
        );
        // The same splits, by the vertices that they make, with the same errors but for rounding.
        let errors = |pm: &ProgressiveMesh| {
            let bounds = pm.bounds.as_ref().unwrap();
            let of =
                |i: usize| (pm.new_positions.get(i).to_array().map(f64::to_bits), bounds.error(i).to_bits());
            let mut all: Vec<_> = (0..pm.splits.len()).map(of).collect();
            all.sort_unstable();
            all
        };
        assert_eq!(errors(pm), errors(&built.mesh));
        bounds_hold_what_is_below(pm);
        // Every chunk is read alone.
        let reader = RangeReader::new(&bytes[..]).unwrap();
        let (head, _) = reader.base(0).unwrap();
        let chunks = &reader.directory().chunks;
        let mut first = 0;
        for c in chunks.iter().filter(|c| c.kind == ChunkType::DIRECT) {
            let Piece::Splits(block) = reader.read(c.index, Some(&head)).unwrap() else { panic!() };
            let all = first..first + block.splits.len();
            assert_eq!(block.splits.vertex, pm.splits.vertex[all.clone()]);
            assert_eq!(block.splits.left, pm.splits.left[all.clone()]);
            assert_eq!(block.splits.right, pm.splits.right[all.clone()]);
            assert_eq!(block.splits.code, pm.splits.code[all.clone()]);
            first = all.end;
        }
        assert_eq!(first, pm.splits.len());
        // What was put aside is not made again, and threads do not show.
        assert_eq!(file(&grid, &options, &store), bytes);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(pool.install(|| file(&grid, &options, &InMemory::default())), bytes);
    }
}

/// Of a large block; a small one has one chunk.
#[test]
fn the_largest_errors_of_a_block_have_a_chunk_of_their_own() {
    for (side, chunks) in [(60, 1), (90, 2), (128, 3)] {
        let grid = landscape(side, side, false);
        let bytes = file(&grid, &Options::default().with_cells(128), &InMemory::default());
        let reader = RangeReader::new(&bytes[..]).unwrap();
        let (head, _) = reader.base(0).unwrap();
        let all: Vec<_> =
            reader.directory().chunks.iter().filter(|c| c.kind == ChunkType::DIRECT).copied().collect();
        assert_eq!(all.len(), chunks);
        let errors = |of: &[Chunk]| {
            let block = |c: &Chunk| match reader.read(c.index, Some(&head)).unwrap() {
                Piece::Splits(block) => block.splits.error,
                _ => panic!(),
            };
            let mut errors: Vec<f32> = of.iter().flat_map(block).collect();
            errors.sort_by(f32::total_cmp);
            errors
        };
        if let [top, others @ ..] = &all[..]
            && chunks > 1
        {
            let (of_top, of_others) = (errors(&all[..1]), errors(others));
            // With what they depend on, which may have any.
            let n = of_others.len();
            assert!(of_top.len() > n / 30 && of_top.len() < n / 5, "{top:?} {others:?}");
            let greatest = of_others[n - 1];
            assert!(greatest < top.error && of_top[of_top.len() / 2] >= greatest);
        }
    }
}

#[test]
fn what_is_written_block_by_block_is_refined_out_of_core_as_in_memory() {
    refined_as_in_memory(60, 8);
    refined_as_in_memory(100, 64);
}

fn refined_as_in_memory(side: usize, cells: usize) {
    let grid = landscape(side, side, true);
    let bytes = file(&grid, &Options::default().with_cells(cells), &InMemory::default());
    let mesh = decode(&bytes).unwrap().meshes.remove(0);
    let h = Arc::new(Hierarchy::new(Arc::new(mesh), &hierarchy::Options::CUTS.with_rounds(0)).unwrap());
    let (centre, diagonal) = h.extent();
    let mut view = View::new(h.clone());
    let mut paged = PagedView::new(Arc::new(RangeReader::new(&bytes[..]).unwrap()), 0, 1 << 28).unwrap();
    assert_eq!(paged.extent(), (centre, diagonal));
    for k in 0..4 {
        let direction = glam::DVec3::new((0.9 * f64::from(k)).cos(), 0.5, (0.9 * f64::from(k)).sin());
        let camera = Camera::new(&CameraParameters {
            eye: centre + 0.6 * diagonal * direction,
            target: centre,
            up: glam::DVec3::Y,
            projection: Projection::Perspective { fov_y_deg: 45.0 },
            width: 640,
            height: 480,
            near: 1e-3 * diagonal,
            far: 1e3 * diagonal,
        })
        .unwrap();
        let lens = Lens::new(&h, &camera, &glam::DMat4::IDENTITY, 3.0, Cull::All).unwrap();
        let done = view.adapt(&lens, &Limits::default());
        let lens = paged.lens(&camera, &glam::DMat4::IDENTITY, 3.0, Cull::All).unwrap();
        let found = paged.adapt(&[lens], &PagedLimits::default()).unwrap().done;
        assert!(done.complete && (found.splits, found.collapses) == (done.splits, done.collapses));
        assert_eq!((view.face_count(), view.vertex_count()), (paged.face_count(), paged.vertex_count()));
        assert!(view.face_count() > 50 && view.face_count() < 2 * (side - 1).pow(2));
    }
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

/// A seed beside those of `refine/tests/format.rs`: a terrain in a few blocks, with a void.
#[test]
#[ignore = "writes refine/tests/corpus/terrain.pm anew, when the format has changed"]
fn the_corpus_is_written_anew() {
    let bytes = file(&landscape(22, 10, true), &Options::default().with_cells(6), &InMemory::default());
    std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/refine/tests/corpus/terrain.pm"), bytes).unwrap();
}
