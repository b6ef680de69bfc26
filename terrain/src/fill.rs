//! Voids filled from their rims.

use crate::Grid;

/// What was filled, and what was not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Filled {
    /// Void samples that have a height now. None of these was measured: they are invented.
    pub samples: usize,
    /// Voids that they made up: samples beside each other along a row or a column.
    pub voids: usize,
    /// Void samples that stay: their voids reach the border of the grid.
    pub left: usize,
}

/// No number within a void.
const NONE: u32 = u32::MAX;

/// The residual at which a void is smooth enough, as a part of the range of its rim.
const SMOOTH: f64 = 1e-7;

/// Gives every void that does not reach the border of the grid the shape of a membrane stretched over its rim (Laplace's equation: every new
/// height is the mean of its four neighbours): smooth, without a peak or a pit of its own.
///
/// New heights are rounded to a power of two, a 2^20th of the greatest height, as they mean no more than that; so networks of whole heights stay
/// exact. O(void samples x the width of the void): conjugate gradients.
#[must_use]
pub fn fill_voids(grid: &Grid) -> (Grid, Filled) {
    let (columns, rows) = (grid.columns(), grid.rows());
    let mut heights = grid.heights().to_vec();
    let mut filled = Filled::default();
    let greatest = grid.range().map_or(0.0, |(low, high)| low.abs().max(high.abs()));
    let unit = if greatest > 0.0 { 2f64.powi((greatest.log2().ceil() as i32 - 20).max(-900)) } else { 1.0 };
    // Which unknown of its void a sample is.
    let mut number = vec![NONE; heights.len()];
    let mut seen = vec![false; heights.len()];
    for start in 0..heights.len() {
        if seen[start] || !grid.heights()[start].is_nan() {
            continue;
        }
        let (mut members, mut at, mut inside) = (vec![start], 0, true);
        seen[start] = true;
        while let Some(&i) = members.get(at) {
            at += 1;
            let (x, y) = (i % columns, i / columns);
            inside &= x > 0 && y > 0 && x + 1 < columns && y + 1 < rows;
            let beside = [
                (x > 0).then(|| i - 1),
                (x + 1 < columns).then_some(i + 1),
                (y > 0).then(|| i - columns),
                (y + 1 < rows).then_some(i + columns),
            ];
            for j in beside.into_iter().flatten() {
                if grid.heights()[j].is_nan() && !seen[j] {
                    seen[j] = true;
                    members.push(j);
                }
            }
        }
        if !inside {
            filled.left += members.len();
            continue;
        }
        members.sort_unstable();
        for (k, &i) in members.iter().enumerate() {
            number[i] = k as u32;
        }
        for (&i, h) in members.iter().zip(membrane(grid, &members, &number)) {
            heights[i] = (h / unit).round() * unit;
        }
        filled.samples += members.len();
        filled.voids += 1;
    }
    (Grid::of_finite(columns, rows, heights), filled)
}

/// Heights of the samples of a void: 4 h - the unknown neighbours = the known neighbours.
fn membrane(grid: &Grid, members: &[usize], number: &[u32]) -> Vec<f64> {
    let columns = grid.columns();
    let beside = |i: usize| [i - columns, i - 1, i + 1, i + columns];
    let known = |i: usize| beside(i).into_iter().filter(|&j| number[j] == NONE).map(|j| grid.heights()[j]);
    let (low, high) = members
        .iter()
        .flat_map(|&i| known(i))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| (low.min(h), high.max(h)));
    // About the middle of the rim, so that large heights lose no digits.
    let middle = low.midpoint(high);
    let links: Vec<[u32; 4]> = members.iter().map(|&i| beside(i).map(|j| number[j])).collect();
    let times = |x: &[f64], out: &mut Vec<f64>| {
        out.clear();
        out.extend(links.iter().zip(x).map(|(links, &h)| {
            let around: f64 = links.iter().filter(|&&j| j != NONE).map(|&j| x[j as usize]).sum();
            4.0 * h - around
        }));
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![0.0; members.len()];
    let mut r: Vec<f64> = members.iter().map(|&i| known(i).map(|h| h - middle).sum()).collect();
    let (mut p, mut ap) = (r.clone(), vec![]);
    let mut rr = dot(&r, &r);
    let enough = (SMOOTH * (high - low)).powi(2);
    // In exact arithmetic it ends after as many steps as there are samples.
    for _ in 0..members.len() + 10 {
        if rr <= enough {
            break;
        }
        times(&p, &mut ap);
        let step = rr / dot(&p, &ap);
        for k in 0..x.len() {
            x[k] += step * p[k];
            r[k] -= step * ap[k];
        }
        let next = dot(&r, &r);
        let share = next / rr;
        rr = next;
        for k in 0..p.len() {
            p[k] = r[k] + share * p[k];
        }
    }
    x.into_iter().map(|h| (h + middle).clamp(low, high)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(x: usize, y: usize) -> f64 {
        1000.0 + 3.0 * x as f64 - 5.0 * y as f64
    }

    #[test]
    fn a_hole_in_a_plane_is_mended_and_a_bay_stays() {
        let void = |x: usize, y: usize| (5..15).contains(&x) && (4..11).contains(&y) || x < 3 && y == 7;
        let height = |i: usize| if void(i % 20, i / 20) { f64::NAN } else { plane(i % 20, i / 20) };
        let grid = Grid::new(20, 16, (0..320).map(height).collect()).unwrap();
        let (mended, filled) = fill_voids(&grid);
        assert_eq!(filled, Filled { samples: 70, voids: 1, left: 3 });
        for (x, y) in (5..15).flat_map(|x| (4..11).map(move |y| (x, y))) {
            assert!((mended.height(x, y).unwrap() - plane(x, y)).abs() < 2e-3, "{x} {y}");
        }
        assert_eq!(mended.height(1, 7), None);
        let none = Grid::new(3, 2, vec![f64::NAN; 6]).unwrap();
        assert_eq!(fill_voids(&none).1, Filled { left: 6, ..Filled::default() });
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Known heights stay, new ones are the means of their neighbours.
        #[test]
        fn every_new_height_is_the_mean_around_it(
            heights in proptest::collection::vec(-100..100i32, 144),
            void in proptest::collection::vec(0..100u32, 144),
            share in 0..80u32,
        ) {
            let height = |i: usize| if void[i] < share { f64::NAN } else { f64::from(heights[i]) };
            let grid = Grid::new(12, 12, (0..144).map(height).collect()).unwrap();
            let (made, filled) = fill_voids(&grid);
            let still = made.heights().iter().filter(|h| h.is_nan()).count();
            let before = grid.heights().iter().filter(|h| h.is_nan()).count();
            prop_assert_eq!((filled.left, filled.samples), (still, before - still));
            for (x, y) in (0..12).flat_map(|x| (0..12).map(move |y| (x, y))) {
                match (grid.height(x, y), made.height(x, y)) {
                    (None, Some(h)) => {
                        let around = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
                            .map(|(x, y)| made.height(x, y).unwrap());
                        prop_assert!((around.iter().sum::<f64>() / 4.0 - h).abs() < 1e-3);
                    }
                    (known, now) => prop_assert_eq!(known, now),
                }
            }
        }
    }
}
