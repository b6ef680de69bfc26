//! The border of a tile: a row or a column of samples as few straight pieces, decided by these samples and the tolerance alone.

use super::field::Tolerance;

/// A piece is never longer than this many steps: so much work a sample is the most.
pub(super) const LONGEST: usize = 4096;

/// The samples that stay of a run without voids: both ends, and the fewest between them with which every sample lies within the tolerance of
/// the straight pieces; pieces are at most `longest` steps long, and 4,096. Whether a piece may be is decided in integers.
///
/// The fewest pieces are a shortest path (Imai & Iri 1988); which pieces may start at a sample follows from the range of slopes that the
/// samples passed leave. O(samples x the length of pieces).
pub(super) fn simplify(heights: &[i32], tolerance: Tolerance, longest: usize) -> Vec<usize> {
    let longest = longest.clamp(1, LONGEST);
    let n = heights.len();
    if n < 3 {
        return (0..n).collect();
    }
    let (error, one) = tolerance.fractions();
    let mut before = vec![(u32::MAX, 0usize); n];
    before[0].0 = 0;
    for i in 0..n - 1 {
        let pieces = before[i].0 + 1;
        // Slopes between these two fractions pass all samples up to j; in fractions of a quantum a step.
        let [mut low, mut high]: [Option<(i64, i64)>; 2] = [None; 2];
        for j in i + 1..n.min(i + 1 + longest) {
            let steps = (j - i) as i64;
            let rise = one * (i64::from(heights[j]) - i64::from(heights[i]));
            let above = low.is_none_or(|(r, s)| rise * s >= r * steps);
            let below = high.is_none_or(|(r, s)| rise * s <= r * steps);
            if above && below && pieces < before[j].0 {
                before[j] = (pieces, i);
            }
            if low.is_none_or(|(r, s)| (rise - error) * s > r * steps) {
                low = Some((rise - error, steps));
            }
            if high.is_none_or(|(r, s)| (rise + error) * s < r * steps) {
                high = Some((rise + error, steps));
            }
            if let (Some((l, ls)), Some((h, hs))) = (low, high)
                && l * hs > h * ls
            {
                break;
            }
        }
    }
    let mut kept = vec![n - 1];
    let mut at = n - 1;
    while at > 0 {
        at = before[at].1;
        kept.push(at);
    }
    kept.reverse();
    kept
}

#[cfg(test)]
mod tests {
    use super::super::field::Field;
    use super::*;
    use crate::Grid;
    use proptest::prelude::*;

    fn tolerance(error: f64) -> (Field, Tolerance) {
        let field = Field::new(&Grid::new(2, 1, vec![0.0, 100.0]).unwrap(), 100.0);
        let tolerance = field.tolerance(error).unwrap();
        (field, tolerance)
    }

    #[test]
    fn a_straight_line_is_one_piece_and_a_roof_two() {
        let (_, none) = tolerance(0.0);
        assert_eq!(simplify(&[0, 3, 6, 9, 12], none, LONGEST), [0, 4]);
        assert_eq!(simplify(&[0, 3, 6, 3, 0], none, LONGEST), [0, 2, 4]);
        assert_eq!(simplify(&[5], none, LONGEST), [0]);
        assert_eq!(simplify(&[], none, LONGEST), [0; 0]);
        assert_eq!(simplify(&[0; 9000], none, LONGEST).len(), 4, "pieces of 4,096");
        assert_eq!(simplify(&[0; 8], none, 3).len(), 4);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Every sample is kept within the error, and no choice of samples has fewer pieces.
        #[test]
        fn pieces_keep_the_error_and_are_the_fewest(
            heights in proptest::collection::vec(-20..20i32, 2..11),
            error in 0..12u32,
        ) {
            let (field, tolerance) = tolerance(f64::from(error));
            let quanta = (1.0 / field.quantum) as i32;
            let h: Vec<i32> = heights.iter().map(|h| h * quanta).collect();
            let good = |kept: &[usize]| kept.windows(2).all(|w| {
                let (i, j) = (w[0], w[1]);
                (i..j).all(|k| {
                    let on = f64::from(heights[i])
                        + f64::from(heights[j] - heights[i]) * (k - i) as f64 / (j - i) as f64;
                    (on - f64::from(heights[k])).abs() <= f64::from(error) + 1e-9
                })
            });
            let kept = simplify(&h, tolerance, LONGEST);
            prop_assert!(good(&kept) && kept[0] == 0 && kept[kept.len() - 1] == h.len() - 1);
            let inner = h.len() - 2;
            let least = (0..1u32 << inner).filter_map(|mask| {
                let mut choice: Vec<usize> = vec![0];
                choice.extend((0..inner).filter(|&k| mask >> k & 1 == 1).map(|k| k + 1));
                choice.push(h.len() - 1);
                good(&choice).then_some(choice.len())
            }).min();
            prop_assert_eq!(Some(kept.len()), least);
        }
    }
}
