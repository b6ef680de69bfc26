//! Tiles of small grids: each keeps the error, all together cover the grid, and borders are the same from both sides.

use progmesh_terrain::tin::{
    Contract, Cuts, Level, Made, Method, Options, Quiet, Tiling, Tin, TinError, lines_missing, triangulate,
    verify,
};
use progmesh_terrain::{Grid, Window};
use proptest::prelude::*;
use std::collections::BTreeMap;

fn part(grid: &Grid, w: Window) -> Grid {
    let rows = w.row..w.row + w.rows;
    let heights =
        rows.flat_map(|y| &grid.heights()[y * grid.columns() + w.column..][..w.columns]).copied().collect();
    Grid::new(w.columns, w.rows, heights).unwrap()
}

/// A tile's network with its own columns and rows.
fn own(tin: &Tin, w: Window) -> Tin {
    let mut tin = tin.clone();
    for p in &mut tin.points {
        *p = [p[0] - w.column as u32, p[1] - w.row as u32];
    }
    tin
}

/// Unit edges on the cuts, each with the side that covers it, by the tile that has it. Brute force over all sides.
type Borders = BTreeMap<([u32; 2], [u32; 2]), Vec<[(u32, u32, u64); 2]>>;

fn collect(tin: &Tin, w: Window, borders: &mut Borders) {
    let (x0, y0) = (w.column as u32, w.row as u32);
    let (x1, y1) = (x0 + w.columns as u32 - 1, y0 + w.rows as u32 - 1);
    for t in &tin.triangles {
        for i in 0..3 {
            let ends = [t[i], t[(i + 1) % 3]].map(|v| (tin.points[v as usize], tin.heights[v as usize]));
            let [mut a, mut b] = ends.map(|([x, y], h)| (x, y, h.to_bits()));
            if a > b {
                std::mem::swap(&mut a, &mut b);
            }
            let upright = a.0 == b.0 && (a.0 == x0 || a.0 == x1);
            let level = a.1 == b.1 && (a.1 == y0 || a.1 == y1);
            if upright {
                (a.1..b.1).for_each(|y| borders.entry(([a.0, y], [a.0, y + 1])).or_default().push([a, b]));
            }
            if level {
                (a.0..b.0).for_each(|x| borders.entry(([x, a.1], [x + 1, a.1])).or_default().push([a, b]));
            }
        }
    }
}

/// Makes all tiles of a level and checks them by other code; the number of triangles.
fn check(grid: &Grid, level: &Level<'_>, error: f64, contract: Contract) -> usize {
    let (mut borders, mut triangles) = (Borders::new(), 0);
    let [across, down] = level.cuts().tiles();
    for tile in (0..down).flat_map(|j| (0..across).map(move |i| [i, j])) {
        let window = level.cuts().window(tile);
        let grid = part(grid, window);
        let Some(Made { tin, errors, .. }) = level.tile(tile, &Quiet).unwrap() else {
            let empty = triangulate(&grid, &Options::default(), &Quiet);
            assert_eq!(empty.unwrap_err(), TinError::Nothing);
            continue;
        };
        let verdict = verify(&grid, &own(&tin, window), error, contract);
        assert!(verdict.is_good() && verdict.exact, "{tile:?}: {verdict:?}");
        assert!((verdict.max_error - errors.max).abs() <= 1e-9 * verdict.max_error.max(1.0));
        if contract == Contract::Surface {
            assert!(verdict.surface_error <= errors.surface + 1e-9 * errors.surface.max(1.0));
        }
        collect(&tin, window, &mut borders);
        triangles += tin.triangles.len();
    }
    for (edge, sides) in &borders {
        assert!(sides.len() <= 2 && sides.windows(2).all(|w| w[0] == w[1]), "{edge:?}: {sides:?}");
    }
    triangles
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Any heights, any voids, any cuts.
    #[test]
    fn borders_are_the_same_from_both_sides(
        columns in 3..16usize,
        rows in 3..16usize,
        across in 1..5usize,
        heights in proptest::collection::vec(-30..30i32, 256),
        void in proptest::collection::vec(0..100u32, 256),
        share in prop_oneof![Just(0u32), Just(8), Just(35)],
        tenths in prop_oneof![Just(0u32), 1..300u32],
        kind in 0..3u8,
        between in any::<bool>(),
    ) {
        let height = |i: usize| if void[i] < share { f64::NAN } else { f64::from(heights[i]) / 10.0 };
        let grid = Grid::new(columns, rows, (0..columns * rows).map(height).collect()).unwrap();
        let error = f64::from(tenths) / 10.0 + 1e-3;
        let method = if kind == 0 { Method::Greedy } else { Method::Best };
        let contract = if between { Contract::Surface } else { Contract::Samples };
        let options = Options::default().with_method(method).with_on_samples(kind == 1).with_contract(contract);
        let tiling = match Tiling::new(&grid, &options, 4.0 * error) {
            Ok(tiling) => tiling,
            Err(e) => {
                prop_assert_eq!(e, TinError::Nothing);
                return Ok(());
            }
        };
        let mut cuts = Cuts::even(columns, rows, across);
        for k in 0..3 {
            let error = error * 2f64.powi(k);
            check(&grid, &tiling.level(cuts.clone(), error).unwrap(), error, contract);
            cuts = cuts.halved();
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Whatever lines there are, tiles keep the error and fit; where no line was led aside, sides follow all of them through the tiles.
    #[test]
    fn breaklines_go_through_tiles(
        heights in proptest::collection::vec(-30..30i32, 17 * 17),
        void in proptest::collection::vec(0..100u32, 17 * 17),
        share in prop_oneof![Just(0u32), Just(10)],
        lines in proptest::collection::vec(proptest::array::uniform2(proptest::array::uniform2(0..17u32)), 1..6),
        across in 1..5usize,
        error in 1..40u32,
        greedy in any::<bool>(),
    ) {
        let height = |i: usize| if void[i] < share { f64::NAN } else { f64::from(heights[i]) };
        let grid = Grid::new(17, 17, (0..289).map(height).collect()).unwrap();
        let method = if greedy { Method::Greedy } else { Method::Best };
        let options = Options::default().with_method(method).with_breaklines(lines.clone());
        let Ok(tiling) = Tiling::new(&grid, &options, f64::from(error)) else { return Ok(()) };
        let level = tiling.level(Cuts::even(17, 17, across), f64::from(error)).unwrap();
        check(&grid, &level, f64::from(error), Contract::Samples);
        let (mut all, mut aside) = (Tin::default(), level.bent());
        for tile in (0..across).flat_map(|j| (0..across).map(move |i| [i, j])) {
            let Some(made) = level.tile(tile, &Quiet).unwrap() else { continue };
            let first = all.points.len() as u32;
            all.points.extend(made.tin.points);
            all.triangles.extend(made.tin.triangles.iter().map(|t| t.map(|v| v + first)));
            aside += made.bent + made.outside;
        }
        if share == 0 && aside == 0 {
            prop_assert_eq!(lines_missing(&all, &lines), 0);
        }
        if share == 0 && across == 1 && lines.len() == 1 {
            prop_assert_eq!(aside, 0);
        }
    }
}

fn hills(n: usize) -> Grid {
    let height = |i: usize| {
        let (x, y) = ((i % n) as f64, (i / n) as f64);
        20.0 * (x * 0.11).sin() * (y * 0.07).cos() + 6.0 * (x * 0.4 + y * 0.3).sin() + 2.0 * (y * 0.9).cos()
    };
    Grid::new(n, n, (0..n * n).map(height).collect()).unwrap()
}

#[test]
fn tiles_take_few_more_triangles_than_one_network() {
    let grid = hills(161);
    let options = Options::default().with_max_error(1.0);
    let one = triangulate(&grid, &options, &Quiet).unwrap().tin.triangles.len();
    let tiling = Tiling::new(&grid, &options, 1.0).unwrap();
    let tiles = check(&grid, &tiling.level(Cuts::even(161, 161, 4), 1.0).unwrap(), 1.0, Contract::Samples);
    assert!(tiles * 100 < one * 140, "{tiles} instead of {one}");
}

#[test]
fn a_border_follows_from_its_samples_alone() {
    // Whatever happens inside of the tiles, the borders stay.
    let grid = hills(65);
    let mut heights = grid.heights().to_vec();
    for (i, h) in heights.iter_mut().enumerate() {
        if !(i % 65).is_multiple_of(32) && !(i / 65).is_multiple_of(32) {
            *h *= 0.5;
        }
    }
    let other = Grid::new(65, 65, heights).unwrap();
    let borders = [&grid, &other].map(|grid| {
        let tiling = Tiling::new(grid, &Options::default(), 2.0).unwrap();
        let level = tiling.level(Cuts::even(65, 65, 2), 2.0).unwrap();
        let mut borders = Borders::new();
        for tile in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let made = level.tile(tile, &Quiet).unwrap().unwrap();
            collect(&made.tin, level.cuts().window(tile), &mut borders);
        }
        borders
    });
    assert_eq!(borders[0], borders[1]);
    assert_eq!(borders[0].len(), 6 * 64);
}

#[test]
fn vertices_can_be_spread_evenly() {
    let grid = Grid::new(65, 65, vec![3.0; 65 * 65]).unwrap();
    let tiling = Tiling::new(&grid, &Options::default(), 1.0).unwrap();
    let cuts = Cuts::even(65, 65, 2);
    assert_eq!(check(&grid, &tiling.level(cuts.clone(), 1.0).unwrap(), 1.0, Contract::Samples), 8);
    let spread = tiling.level_with(cuts, 1.0, 8).unwrap();
    assert_eq!(check(&grid, &spread, 1.0, Contract::Samples), 2 * 64, "cells of 8 x 8");
    let tin = spread.tile([1, 1], &Quiet).unwrap().unwrap().tin;
    let side = |a: u32, b: u32| {
        let [p, q] = [a, b].map(|v| tin.points[v as usize]);
        p[0].abs_diff(q[0]).max(p[1].abs_diff(q[1]))
    };
    assert!(tin.triangles.iter().all(|&[a, b, c]| side(a, b).max(side(b, c)).max(side(c, a)) <= 8));
}

#[test]
fn cuts_are_even_and_halve_down_to_one_tile() {
    let mut cuts = Cuts::even(101, 7, 8);
    assert_eq!(cuts.columns, [0, 12, 25, 37, 50, 62, 75, 87, 100]);
    assert_eq!(cuts.rows, [0, 1, 2, 3, 4, 5, 6]);
    let mut counts = vec![];
    while cuts.tiles() != [1, 1] {
        counts.push(cuts.tiles());
        cuts = cuts.halved();
    }
    assert_eq!(counts, [[8, 6], [4, 3], [2, 2]]);
    assert_eq!(cuts, Cuts { columns: vec![0, 100], rows: vec![0, 6] });
}

#[test]
fn what_cannot_be_is_said() {
    let grid = hills(9);
    let tiling = |options: Options, error| Tiling::new(&grid, &options, error).map(|_| ()).unwrap_err();
    assert_eq!(tiling(Options::default().with_method(Method::Regular), 1.0), TinError::NoTiles);
    assert_eq!(tiling(Options::default().with_outline_tolerance(1.0), 1.0), TinError::NoTiles);
    assert_eq!(tiling(Options::default(), f64::NAN), TinError::BadError);
    let tiling = Tiling::new(&grid, &Options::default(), 1.0).unwrap();
    for columns in [vec![], vec![0], vec![0, 4], vec![1, 8], vec![0, 4, 4, 8], vec![0, 9]] {
        let cuts = Cuts { columns, rows: vec![0, 8] };
        assert_eq!(tiling.level(cuts, 1.0).map(|_| ()).unwrap_err(), TinError::BadCuts);
    }
    let level = tiling.level(Cuts::even(9, 9, 2), 1.0).unwrap();
    assert_eq!(level.tile([2, 0], &Quiet).unwrap_err(), TinError::BadCuts);
    let void = Grid::new(3, 3, vec![f64::NAN; 9]).unwrap();
    assert_eq!(Tiling::new(&void, &Options::default(), 1.0).unwrap_err(), TinError::Nothing);
}
