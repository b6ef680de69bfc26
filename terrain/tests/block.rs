//! The bounds of block hierarchies, by brute force: meshes of any closed set of splits, every sample looked at.

use progmesh_terrain::Grid;
use progmesh_terrain::block::{Block, Collapse, Layout, NONE, Relief, Sheet, Vertex, join, leaf};
use std::collections::HashMap;

/// All collapses of a hierarchy in one order, with numbers that hold for the whole grid: vertices are samples, faces those of the finest mesh.
struct Whole {
    columns: usize,
    vertices: HashMap<u32, Vertex>,
    faces: Vec<[u32; 3]>,
    collapses: Vec<Collapse>,
    /// Splits that each split needs.
    needs: Vec<Vec<usize>>,
    error: f64,
}

fn build(grid: &Grid, cells: usize, floor: f64, samples: usize) -> (Whole, Sheet) {
    let layout = Layout::new(grid.columns(), grid.rows(), cells).unwrap();
    let columns = grid.columns();
    let mut whole = Whole {
        columns,
        vertices: HashMap::new(),
        faces: vec![],
        collapses: vec![],
        needs: vec![],
        error: 0.0,
    };
    let mut below: HashMap<[usize; 2], (Sheet, Vec<u32>)> = HashMap::new();
    for level in 0..layout.levels() {
        let [across, down] = layout.blocks(level);
        let mut here = HashMap::new();
        for at in (0..down).flat_map(|y| (0..across).map(move |x| [x, y])) {
            let (block, faces) = if level == 0 {
                let block = leaf(grid, &layout, at, floor).unwrap();
                let first = whole.faces.len() as u32;
                let faces = (first..first + block.faces).collect::<Vec<_>>();
                whole.error = whole.error.max(block.error);
                (block, faces)
            } else {
                let (mut sheets, mut faces) = (vec![], vec![]);
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    if let Some((sheet, f)) = below.remove(&[2 * at[0] + dx, 2 * at[1] + dy]) {
                        sheets.push(sheet);
                        faces.extend(f);
                    }
                }
                let relief = Relief::read(grid, layout.window(level, at), samples).unwrap();
                (join(sheets, &relief, &layout.rules(level, at, 0)).unwrap(), faces)
            };
            assert_eq!(faces.len(), block.faces as usize);
            let left = whole.add(&block, &faces, level == 0);
            here.insert(at, (block.sheet, left));
        }
        below = here;
    }
    let root = below.remove(&[0, 0]).unwrap().0;
    whole.link();
    (whole, root)
}

impl Whole {
    fn add(&mut self, block: &Block, faces: &[u32], finest: bool) -> Vec<u32> {
        let id = |v: u32| {
            let v = block.vertices[v as usize];
            v.y as u32 * self.columns as u32 + v.x as u32
        };
        for &v in &block.vertices {
            self.vertices.insert(v.y as u32 * self.columns as u32 + v.x as u32, v);
        }
        for c in &block.collapses {
            let side = |s: u32| if s == NONE { NONE } else { 3 * faces[s as usize / 3] + s % 3 };
            self.collapses.push(Collapse {
                kept: id(c.kept),
                removed: id(c.removed),
                wings: c.wings.map(side),
                beside: c.beside.map(|b| b.map(side)),
                ..*c
            });
        }
        if finest {
            self.faces.extend(first_faces(block).iter().map(|t| t.map(id)));
        }
        block.faces_left.iter().map(|&f| faces[f as usize]).collect()
    }

    /// What splits need: the next collapse at the vertex kept, and at each cut the one that takes the first of both faces away.
    fn link(&mut self) {
        let mut killed: HashMap<u32, usize> = HashMap::new();
        for (j, c) in self.collapses.iter().enumerate() {
            for w in c.wings.into_iter().filter(|&w| w != NONE) {
                assert!(killed.insert(w / 3, j).is_none());
            }
        }
        let mut at: HashMap<u32, usize> = HashMap::new();
        self.needs = vec![vec![]; self.collapses.len()];
        for (j, c) in self.collapses.iter().enumerate().rev() {
            let mut on: Vec<usize> = at.get(&c.kept).copied().into_iter().collect();
            for b in c.beside {
                let first = b.into_iter().filter(|&s| s != NONE).filter_map(|s| killed.get(&(s / 3))).min();
                on.extend(first);
            }
            assert!(on.iter().all(|&d| d > j));
            self.needs[j] = on;
            at.insert(c.kept, j);
            at.insert(c.removed, j);
        }
    }

    fn close(&self, mut wanted: impl FnMut(usize, &Collapse) -> bool) -> Vec<bool> {
        let mut applied = vec![false; self.collapses.len()];
        for j in 0..self.collapses.len() {
            if applied[j] || wanted(j, &self.collapses[j]) {
                applied[j] = true;
                self.needs[j].iter().for_each(|&d| applied[d] = true);
            }
        }
        applied
    }

    /// The mesh of a set of splits.
    fn mesh(&self, applied: &[bool]) -> Vec<[u32; 3]> {
        let mut faces = self.faces.clone();
        for (c, _) in self.collapses.iter().zip(applied).filter(|(_, a)| !**a) {
            for v in faces.as_flattened_mut() {
                if *v == c.removed {
                    *v = c.kept;
                }
            }
        }
        faces.retain(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
        faces
    }
}

/// The faces that a block began with: its collapses undone by plain search.
fn first_faces(block: &Block) -> Vec<[u32; 3]> {
    let mut faces = vec![[NONE; 3]; block.faces as usize];
    for (f, t) in block.faces_left.iter().zip(&block.sheet.faces) {
        faces[*f as usize] = t.map(|v| block.vertices_left[v as usize]);
    }
    for c in block.collapses.iter().rev() {
        // Where the side across ends, or begins, that is not at the vertex.
        let tips: Vec<u32> = (0..2)
            .filter(|&k| c.wings[k] != NONE)
            .map(|k| {
                let s = c.beside[k].into_iter().find(|&s| s != NONE).unwrap();
                let t = faces[s as usize / 3];
                let ends = [t[s as usize % 3], t[(s as usize + 1) % 3]];
                *ends.iter().find(|&&v| v != c.kept).unwrap()
            })
            .collect();
        let start = c.beside.iter().map(|b| b[1]).find(|&s| s != NONE).unwrap() / 3;
        let (mut fan, mut k) = (vec![start as usize], 0);
        while k < fan.len() {
            let of = faces[fan[k]];
            for (f, t) in faces.iter().enumerate() {
                let shares = |v: &u32| *v != c.kept && t.contains(v) && !tips.contains(v);
                if t.contains(&c.kept) && of.iter().any(shares) && !fan.contains(&f) {
                    fan.push(f);
                }
            }
            k += 1;
        }
        for f in fan {
            faces[f].iter_mut().filter(|v| **v == c.kept).for_each(|v| *v = c.removed);
        }
        let mut tips = tips.into_iter();
        for k in 0..2 {
            let s = c.wings[k] as usize;
            if c.wings[k] != NONE {
                let way = if k == 0 { [c.kept, c.removed] } else { [c.removed, c.kept] };
                faces[s / 3][s % 3] = way[0];
                faces[s / 3][(s + 1) % 3] = way[1];
                faces[s / 3][(s + 2) % 3] = tips.next().unwrap();
            }
        }
    }
    faces
}

fn landscape(seed: u64, columns: usize, rows: usize, voids: bool) -> Grid {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f64 / (1u64 << 24) as f64
    };
    let (a, b) = (random() * 0.4, random() * 0.4);
    let heights = (0..columns * rows).map(|i| {
        let (x, y) = ((i % columns) as f64, (i / columns) as f64);
        let h = ((x * a).sin() * (y * b).cos() * 40.0 + random() * 6.0).round();
        let hole = voids && ((x - 9.0).hypot(y - 8.0) < 3.5 || random() < 0.004);
        if hole { f64::NAN } else { h }
    });
    Grid::new(columns, rows, heights.collect()).unwrap()
}

/// What is wrong with a mesh of some splits, sample by sample; the greatest part of a bound that is used up.
fn check(grid: &Grid, whole: &Whole, applied: &[bool]) -> f64 {
    let faces = whole.mesh(applied);
    let mut sides: HashMap<(u32, u32), usize> = HashMap::new();
    let mut worst = 0.0f64;
    let mut covered = vec![0.0f64; grid.heights().len()];
    let mut area_sum = 0.0;
    let pending: Vec<(&Collapse, Vertex)> = whole
        .collapses
        .iter()
        .zip(applied)
        .filter(|(_, a)| !**a)
        .map(|(c, _)| (c, whole.vertices[&c.kept]))
        .collect();
    for t in &faces {
        (0..3).for_each(|k| *sides.entry((t[k], t[(k + 1) % 3])).or_default() += 1);
        let v = t.map(|v| whole.vertices[&v]);
        let side = |p: Vertex, q: Vertex, x: i32, y: i32| {
            f64::from(q.x - p.x) * f64::from(y - p.y) - f64::from(q.y - p.y) * f64::from(x - p.x)
        };
        let area = side(v[0], v[1], v[2].x, v[2].y);
        area_sum += area;
        // Each lies the right way round, and all together cover no more than there is.
        assert!(area > 0.0);
        let (x0, x1) = (v.iter().map(|v| v.x).min().unwrap(), v.iter().map(|v| v.x).max().unwrap());
        let (y0, y1) = (v.iter().map(|v| v.y).min().unwrap(), v.iter().map(|v| v.y).max().unwrap());
        for (x, y) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y))) {
            let w = [side(v[1], v[2], x, y), side(v[2], v[0], x, y), side(v[0], v[1], x, y)];
            if w.iter().any(|&w| w * area < 0.0) {
                continue;
            }
            let z: f64 = (0..3).map(|k| w[k] / area * f64::from(v[k].z)).sum();
            let h = grid.heights()[y as usize * grid.columns() + x as usize];
            // A void sample is covered only by triangles that lie over others.
            let Some(h) = Some(h).filter(|h| !h.is_nan()) else { continue };
            covered[y as usize * grid.columns() + x as usize] = 1.0;
            let error = (z - h).abs();
            if error <= whole.error + 1e-9 {
                continue;
            }
            let holds = |c: &Collapse, at: Vertex| {
                let (dx, dy, dz) = (f64::from(at.x - x), f64::from(at.y - y), f64::from(at.z) - z);
                (dx * dx + dy * dy + dz * dz).sqrt() <= f64::from(c.radius) * 1.000001
            };
            let bound = pending.iter().filter(|(c, at)| holds(c, *at)).map(|(c, _)| f64::from(c.bound));
            let bound = bound.fold(0.0, f64::max);
            assert!(error <= bound + 1e-9, "at {x}, {y}: {error} against {bound}");
            worst = worst.max(error / bound);
        }
    }
    // No cracks: every side has its other, or lies on the outline of the finest mesh.
    let mut outline = 0.0;
    for &(a, b) in sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a))) {
        let (a, b) = (whole.vertices[&a], whole.vertices[&b]);
        outline += f64::from(a.x) * f64::from(b.y) - f64::from(b.x) * f64::from(a.y);
    }
    assert!(sides.values().all(|&n| n == 1));
    // What the outline encloses is what the triangles cover, and that is the same in every mesh.
    let full: f64 = whole
        .faces
        .iter()
        .map(|t| {
            let [p, q, r] = t.map(|v| whole.vertices[&v]);
            f64::from(q.x - p.x) * f64::from(r.y - p.y) - f64::from(q.y - p.y) * f64::from(r.x - p.x)
        })
        .sum();
    assert_eq!((area_sum, outline), (full, full));
    worst
}

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
fn a_grid_of_one_block_goes_down_to_its_base_like_any_other() {
    for slope in [0.0, 2.0] {
        let plane = Grid::new(33, 30, (0..33 * 30).map(|i| slope * f64::from(i % 33)).collect()).unwrap();
        let whole = landscape(5, 33, 30, false);
        for (grid, most) in [(plane, 4), (whole, 40)] {
            for cells in [16, 32, 64] {
                let (_, root) = build(&grid, cells, 0.0, 1 << 20);
                assert!(root.faces.len() <= most, "{slope} {cells}: {}", root.faces.len());
            }
        }
    }
}

#[test]
fn bounds_hold_for_any_closed_set_of_splits() {
    let mut used: Vec<f64> = vec![];
    for (seed, columns, rows, cells, floor, voids, samples) in [
        (1, 33, 33, 8, 0.0, false, usize::MAX),
        (2, 30, 41, 8, 0.0, true, usize::MAX),
        (3, 35, 29, 16, 4.0, false, usize::MAX),
        (4, 34, 31, 8, 3.0, true, usize::MAX),
        (5, 33, 33, 8, 0.0, false, 40),
    ] {
        let grid = landscape(seed, columns, rows, voids);
        let (whole, root) = build(&grid, cells, floor, samples);
        assert!(whole.error <= floor, "{}", whole.error);
        if !voids {
            // Two triangles, or a few where another would make faces turn over.
            assert!(root.faces.len() <= 12, "{}", root.faces.len());
        }
        let n = whole.collapses.len();
        // All, none, and in the order of the collapses.
        let nothing = vec![false; n];
        assert_eq!(whole.mesh(&nothing).len(), root.faces.len());
        check(&grid, &whole, &nothing);
        check(&grid, &whole, &vec![true; n]);
        let mut state = seed;
        for k in 0..24 {
            let tau = 2.0 + 60.0 * random(&mut state).powi(2);
            let (x, y) = (random(&mut state) * columns as f64, random(&mut state) * rows as f64);
            let mut coin = state;
            let applied = whole.close(|j, c| match k % 3 {
                // As views do, by distance; as a walk does; at random.
                0 => {
                    let v = whole.vertices[&c.kept];
                    let far = (f64::from(v.x) - x).hypot(f64::from(v.y) - y) - f64::from(c.radius);
                    f64::from(c.bound) > tau * (far.max(0.5) / 8.0)
                }
                1 => j > (n as f64 * y / rows as f64) as usize,
                _ => random(&mut coin) < 0.05,
            });
            used.push(check(&grid, &whole, &applied));
        }
    }
    // They are not far from what is there.
    used.sort_by(f64::total_cmp);
    assert!(used[used.len() / 2] > 0.4, "{}", used[used.len() / 2]);
}

#[test]
fn bounds_nest_along_what_splits_need() {
    let grid = landscape(7, 40, 37, true);
    let (whole, _) = build(&grid, 8, 0.0, usize::MAX);
    for (j, c) in whole.collapses.iter().enumerate() {
        assert!(whole.needs[j].iter().all(|&d| whole.collapses[d].bound >= c.bound));
    }
}
