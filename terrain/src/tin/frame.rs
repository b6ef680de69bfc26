//! Where parts of a grid meet: cuts along columns and rows, and the vertices on them, which both sides take as they are.
//!
//! What a cut looks like follows from the samples on it, the tolerance, where voids lie beside it, and the breaklines that reach it; never from
//! what is inside of a part. So parts can be made in any order, and fit.

use super::Control;
use super::delaunay::Triangulation;
use super::field::{Field, Tolerance};
use super::greedy::{Goal, refine};
use super::line;
use super::network::Network;
use super::parallel;
use super::region::Region;
use super::tiles::Cuts;
use crate::Window;
use std::collections::HashMap;

type Point = (i32, i32);

/// Cuts with their vertices.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub cuts: Cuts,
    /// Rows of the vertices on each cut by a column.
    columns: Vec<Vec<i32>>,
    /// Columns of those on each cut by a row.
    rows: Vec<Vec<i32>>,
    /// Breaklines in pieces, each within one part.
    lines: Vec<[Point; 2]>,
    /// Places where a breakline was led over the nearest sample of a cut.
    pub bent: usize,
}

/// What lies between cuts.
pub(super) struct Part {
    /// Column and row of its first sample.
    pub first: [usize; 2],
    pub field: Field,
    pub region: Region,
    /// The cuts' vertices, the outline of the valid region, and nothing else.
    pub mesh: Triangulation,
    /// Its breaklines, in its own columns and rows.
    pub lines: Vec<[Point; 2]>,
}

impl Frame {
    /// O(samples on cuts x the length of pieces).
    pub(super) fn new(
        (field, region): (&Field, &Region),
        cuts: Cuts,
        tolerance: Tolerance,
        spread: usize,
        lines: &[[Point; 2]],
    ) -> Self {
        let (lines, bent) = cut_lines(&cuts, lines);
        // Ends of pieces on cuts are vertices of them.
        let ends = |on: &dyn Fn(Point) -> Option<i32>| {
            let mut ends: Vec<i32> = lines.iter().flatten().filter_map(|&p| on(p)).collect();
            ends.sort_unstable();
            ends
        };
        let columns = cuts.columns.iter().map(|&x| {
            let x = x as i32;
            let ends = ends(&|p| (p.0 == x).then_some(p.1));
            let cut = Cut { across: &cuts.rows, ends: &ends, tolerance, spread };
            cut.vertices(&|y| field.at(x, y), &|y| region.beside_column(x, y))
        });
        let columns = columns.collect();
        let rows = cuts.rows.iter().map(|&y| {
            let y = y as i32;
            let ends = ends(&|p| (p.1 == y).then_some(p.0));
            let cut = Cut { across: &cuts.columns, ends: &ends, tolerance, spread };
            cut.vertices(&|x| field.at(x, y), &|x| region.beside_row(x, y))
        });
        let rows = rows.collect();
        Frame { columns, rows, lines, bent, cuts }
    }

    /// A part; `None` where no three neighbouring samples of it are valid, or where there is none.
    pub(super) fn part(&self, whole: &Field, [i, j]: [usize; 2]) -> Option<Part> {
        let [across, down] = self.cuts.tiles();
        if i >= across || j >= down {
            return None;
        }
        let Window { column: x0, row: y0, columns, rows } = self.cuts.window([i, j]);
        let [x1, y1] = [x0 + columns - 1, y0 + rows - 1];
        let field = whole.part([x0, y0].map(|c| c as i32), [x1, y1].map(|c| c as i32));
        let region = Region::new(&field);
        if region.triangles == 0 {
            return None;
        }
        let mut mesh = Triangulation::new(field.columns, field.rows);
        let within = |line: &[i32], from: usize, to: usize| -> Vec<i32> {
            let (from, to) = (from as i32, to as i32);
            let (start, end) = (line.partition_point(|&k| k < from), line.partition_point(|&k| k <= to));
            line[start..end].iter().map(|k| k - from).collect()
        };
        for (x, cut) in [(0, i), (field.columns - 1, i + 1)] {
            within(&self.columns[cut], y0, y1).into_iter().for_each(|y| _ = mesh.insert((x, y)));
        }
        for (y, cut) in [(0, j), (field.rows - 1, j + 1)] {
            within(&self.rows[cut], x0, x1).into_iter().for_each(|x| _ = mesh.insert((x, y)));
        }
        region.constrain(&mut mesh);
        mesh.border_stays = true;
        // Pieces lie in one part, so that their middle is within it, or on its border if they do, where they are sides already.
        let (ox, oy) = (x0 as i32, y0 as i32);
        let own = |&[a, b]: &[Point; 2]| {
            let inside = |low: i32, high: i32, sum: i32| 2 * low < sum && sum < 2 * high;
            inside(ox, x1 as i32, a.0 + b.0) && inside(oy, y1 as i32, a.1 + b.1)
        };
        let lines = self.lines.iter().filter(|line| own(line));
        let lines = lines.map(|line| line.map(|(x, y)| (x - ox, y - oy))).collect();
        Some(Part { first: [x0, y0], field, region, mesh, lines })
    }
}

/// Lines in pieces that lie within one part each, led over the nearest sample where they cross cuts, and how often that bends one.
fn cut_lines(cuts: &Cuts, lines: &[[Point; 2]]) -> (Vec<[Point; 2]>, usize) {
    let (mut pieces, mut bent) = (vec![], 0);
    let mut stops: Vec<(i128, Point)> = vec![];
    for &[a, b] in lines {
        let (dx, dy) = (i64::from(b.0) - i64::from(a.0), i64::from(b.1) - i64::from(a.1));
        stops.clear();
        // Where it stops: how far along, in parts of |dx dy| or of what is not nought.
        let whole = dx.abs().max(1) * dy.abs().max(1);
        let between = |c: usize, from: i32, to: i32| {
            let c = c as i64;
            i64::from(from.min(to)) < c && c < i64::from(from.max(to))
        };
        let nearest = |from: i32, d: i64, part: i64, parts: i64| {
            let round =
                (2 * i128::from(d) * i128::from(part) + i128::from(parts)).div_euclid(2 * i128::from(parts));
            let exact = (i128::from(d) * i128::from(part)) % i128::from(parts) == 0;
            (from + round as i32, exact)
        };
        for &c in cuts.columns.iter().filter(|&&c| between(c, a.0, b.0)) {
            let part = (c as i64 - i64::from(a.0)).abs();
            let (y, exact) = nearest(a.1, dy, part, dx.abs());
            bent += usize::from(!exact);
            stops.push((i128::from(part) * i128::from(whole / dx.abs()), (c as i32, y)));
        }
        for &c in cuts.rows.iter().filter(|&&c| between(c, a.1, b.1)) {
            let part = (c as i64 - i64::from(a.1)).abs();
            let (x, exact) = nearest(a.0, dx, part, dy.abs());
            bent += usize::from(!exact);
            stops.push((i128::from(part) * i128::from(whole / dy.abs()), (x, c as i32)));
        }
        stops.sort_unstable();
        let mut at = a;
        for p in stops.iter().map(|s| s.1).chain([b]) {
            if p != at {
                pieces.push([at, p]);
            }
            at = p;
        }
    }
    (pieces, bent)
}

/// A row or a column of samples that parts meet on.
struct Cut<'a> {
    /// Where other cuts cross it.
    across: &'a [usize],
    /// Where breaklines end on it, sorted.
    ends: &'a [i32],
    tolerance: Tolerance,
    /// No two vertices are farther apart.
    spread: usize,
}

impl Cut<'_> {
    /// The vertices along it: where parts meet, where what lies beside it begins or ends, where breaklines end, and the fewest between.
    fn vertices(&self, at: &dyn Fn(i32) -> i32, beside: &dyn Fn(i32) -> [bool; 2]) -> Vec<i32> {
        let mut vertices = vec![];
        for pair in self.across.windows(2) {
            let (mut from, last) = (pair[0] as i32, pair[1] as i32);
            while from < last {
                let kind = beside(from);
                let changes = |&k: &i32| beside(k) != kind || self.ends.binary_search(&k).is_ok();
                let to = (from + 1..last).find(changes).unwrap_or(last);
                if kind != [false, false] {
                    let heights: Vec<i32> = (from..=to).map(at).collect();
                    let kept = line::simplify(&heights, self.tolerance, self.spread);
                    vertices.extend(kept.into_iter().map(|k| from + k as i32));
                }
                from = to;
            }
        }
        vertices.dedup();
        vertices
    }
}

/// Samples along the side of a part of [`greedy_in_parts`], about. Small enough for many threads, large enough for few vertices on cuts, most of which go when
/// the network is improved. With it and the rounds of `thin.rs` together, networks have 0 to 2 % more triangles than before both, 5 % more where they have
/// few (N57E011 at 20 m: 3,569).
const SIDE: usize = 256;

/// Whether a grid is worth cutting.
pub(super) fn has_parts(field: &Field) -> bool {
    field.columns.max(field.rows) as usize > SIDE + SIDE / 2
}

/// Passes on only whether to stop.
struct Stop<'a>(&'a dyn Control);

impl Control for Stop<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Greedy insertion part by part, for a network that will be improved: within the tolerance at the samples, vertices at their heights, more of them than
/// needed on the cuts. The same for any number of threads. `None` when cancelled.
pub(super) fn greedy_in_parts(
    field: &Field,
    region: &Region,
    tolerance: Tolerance,
    control: &dyn Control,
) -> Option<Network> {
    let cut = |samples: i32| {
        let samples = samples as usize;
        Cuts::even(samples, samples, (samples + SIDE / 2) / SIDE).columns
    };
    let cuts = Cuts { columns: cut(field.columns), rows: cut(field.rows) };
    let frame = Frame::new((field, region), cuts, tolerance, line::LONGEST, &[]);
    let [across, down] = frame.cuts.tiles();
    let goal = Goal { tolerance, surface: false, triangles: usize::MAX };
    let parts = (0..across * down).collect();
    let made = parallel::map(parts, |k: usize| {
        let Some(mut part) = frame.part(field, [k % across, k / across]) else { return Some(None) };
        refine(&part.field, &mut part.mesh, goal, &Stop(control))?;
        Some(Some((part.first, Network::of(&part.mesh, &part.field))))
    });
    let mut network = Network::default();
    let mut on_cuts: HashMap<Point, u32> = HashMap::new();
    let is_cut = |c: &[usize], at: i32| c.binary_search(&(at as usize)).is_ok();
    for part in made {
        let Some(([x0, y0], part)) = part? else { continue };
        let mut numbers = Vec::with_capacity(part.vertices.len());
        for mut v in part.vertices {
            (v.x, v.y) = (v.x + x0 as i32, v.y + y0 as i32);
            let mut new = || {
                network.vertices.push(v);
                network.vertices.len() as u32 - 1
            };
            let shared = is_cut(&frame.cuts.columns, v.x) || is_cut(&frame.cuts.rows, v.y);
            numbers.push(if shared { *on_cuts.entry((v.x, v.y)).or_insert_with(new) } else { new() });
        }
        let number = |v: u32| numbers[v as usize];
        network.triangles.extend(part.triangles.iter().map(|&[a, b, c]| [number(a), number(b), number(c)]));
    }
    Some(network)
}

#[cfg(test)]
mod tests {
    use super::super::Quiet;
    use super::super::scan::keeps;
    use super::*;
    use crate::Grid;
    use proptest::prelude::*;

    #[test]
    fn lines_are_cut_where_parts_meet() {
        let cuts = Cuts { columns: vec![0, 10, 20], rows: vec![0, 10, 20] };
        let cut = |a, b| cut_lines(&cuts, &[[a, b]]);
        assert_eq!(cut((1, 1), (9, 5)), (vec![[(1, 1), (9, 5)]], 0));
        assert_eq!(cut((2, 2), (18, 18)), (vec![[(2, 2), (10, 10)], [(10, 10), (18, 18)]], 0));
        // At column 10 it is at row 4.25, at row 10 at column 17.67.
        let pieces = vec![[(7, 2), (10, 4)], [(10, 4), (18, 10)], [(18, 10), (19, 11)]];
        assert_eq!(cut((7, 2), (19, 11)), (pieces, 2));
        assert_eq!(cut((10, 3), (10, 17)), (vec![[(10, 3), (10, 10)], [(10, 10), (10, 17)]], 0));
        assert_eq!(cut((5, 5), (5, 5)), (vec![], 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// Pieces lie in one part each, lead from end to end, and stay within a sample of the line.
        #[test]
        fn pieces_of_lines_stay_in_their_parts(p in proptest::array::uniform4(0..31i32)) {
            let cuts = Cuts { columns: vec![0, 7, 8, 30], rows: vec![0, 15, 30] };
            let (a, b) = ((p[0], p[1]), (p[2], p[3]));
            let (pieces, _) = cut_lines(&cuts, &[[a, b]]);
            let mut at = a;
            for &[from, to] in &pieces {
                prop_assert_eq!(from, at);
                at = to;
                let fits = |cuts: &[usize], u: i32, v: i32| cuts.windows(2).any(|w| {
                    [u, v].iter().all(|&c| w[0] as i32 <= c && c <= w[1] as i32)
                });
                prop_assert!(fits(&cuts.columns, from.0, to.0) && fits(&cuts.rows, from.1, to.1));
                let long = f64::from(b.0 - a.0).hypot(f64::from(b.1 - a.1));
                prop_assert!((super::super::scan::area(a, b, to) as f64).abs() <= 0.5 * long + 1e-9);
            }
            prop_assert_eq!(at, b);
        }

        /// Parts make one network: within the tolerance, every side has its other side but on the outline, and all is covered.
        #[test]
        fn parts_fit(
            heights in proptest::collection::vec(-30..30i32, 400),
            void in proptest::collection::vec(0..100u32, 400),
            share in prop_oneof![Just(0u32), Just(8), Just(30)],
            error in 0..40u32,
        ) {
            let height = |i: usize| if void[i] < share { f64::NAN } else { f64::from(heights[i]) };
            let grid = Grid::new(20, 20, (0..400).map(height).collect()).unwrap();
            let field = Field::new(&grid, f64::from(error));
            let tolerance = field.tolerance(f64::from(error)).unwrap();
            let region = Region::new(&field);
            let cuts = Cuts { columns: vec![0, 6, 13, 19], rows: vec![0, 9, 19] };
            let frame = Frame::new((&field, &region), cuts, tolerance, line::LONGEST, &[]);
            let goal = Goal { tolerance, surface: false, triangles: usize::MAX };
            let (mut sides, mut doubled) = (HashMap::new(), 0);
            for k in 0..6 {
                let Some(mut part) = frame.part(&field, [k % 3, k / 3]) else { continue };
                refine(&part.field, &mut part.mesh, goal, &Quiet).unwrap();
                let network = Network::of(&part.mesh, &part.field);
                for t in &network.triangles {
                    let corners = t.map(|v| network.vertices[v as usize]);
                    prop_assert!(keeps(&part.field, tolerance, false, corners));
                    let at = corners.map(|c| (c.x + part.first[0] as i32, c.y + part.first[1] as i32));
                    doubled += super::super::scan::area(at[0], at[1], at[2]);
                    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                        *sides.entry((at[i], at[j])).or_insert(0) += 1;
                    }
                }
            }
            prop_assert_eq!(doubled as usize, region.triangles);
            for (&(a, b), &count) in &sides {
                prop_assert_eq!(count, 1);
                // The middle of a side is on the outline, or the side is there from the other triangle.
                if !sides.contains_key(&(b, a)) {
                    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
                    let steps = dx.abs().max(dy.abs());
                    let step = (dx / steps, dy / steps);
                    prop_assert!(dx.abs() == dy.abs() && dx == dy || dx == 0 || dy == 0);
                    // One side of every step has a valid triangle, the other has none.
                    let outline = region.outline();
                    for k in 0..steps {
                        let p = (2 * (a.0 + k * step.0) + step.0, 2 * (a.1 + k * step.1) + step.1);
                        let on = |[u, v]: &[Point; 2]| {
                            let (u, v) = ((2 * u.0, 2 * u.1), (2 * v.0, 2 * v.1));
                            super::super::scan::area(u, v, p) == 0
                                && (u.0.min(v.0)..=u.0.max(v.0)).contains(&p.0)
                                && (u.1.min(v.1)..=u.1.max(v.1)).contains(&p.1)
                        };
                        prop_assert!(outline.iter().any(on), "{:?} {:?}", a, b);
                    }
                }
            }
        }
    }
}
