//! Statistics of repeated runs, and who is better than whom.

/// Middle of the values (of an even number: the mean of the two in the middle); `None` for none.
pub(crate) fn median(values: &[f64]) -> Option<f64> {
    let mut v = values.to_vec();
    v.sort_by(f64::total_cmp);
    let n = v.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(v[n / 2]),
        _ => Some(0.5 * (v[n / 2 - 1] + v[n / 2])),
    }
}

/// Half the distance between the quartiles over the median: how noisy the runs were. 0 for fewer than two.
pub(crate) fn spread(values: &[f64]) -> f64 {
    let mut v = values.to_vec();
    v.sort_by(f64::total_cmp);
    let quartile = |share: f64| {
        let at = share * (v.len() - 1) as f64;
        let (lo, part) = (at.floor() as usize, at.fract());
        v[lo] + part * (v[(lo + 1).min(v.len() - 1)] - v[lo])
    };
    match median(values) {
        Some(m) if v.len() > 1 && m > 0.0 => 0.5 * (quartile(0.75) - quartile(0.25)) / m,
        _ => 0.0,
    }
}

/// Which of the points (both coordinates: less is better) no other point beats: at least as good in both and better in one.
pub(crate) fn front(points: &[[f64; 2]]) -> Vec<bool> {
    let beats = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    points.iter().map(|p| !points.iter().any(|q| beats(q, p))).collect()
}

/// How a peer stands to us at the same target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Standing {
    /// The peer is better in time and in error.
    LosesBoth,
    /// The peer is faster; we are as exact or better.
    LosesTime,
    /// The peer is more exact; we are as fast or faster.
    LosesError,
    /// The peer is better in neither.
    Wins,
}

impl Standing {
    /// `ours` and `peer`: seconds and error.
    pub(crate) fn of(ours: [f64; 2], peer: [f64; 2]) -> Standing {
        match (peer[0] < ours[0], peer[1] < ours[1]) {
            (true, true) => Standing::LosesBoth,
            (true, false) => Standing::LosesTime,
            (false, true) => Standing::LosesError,
            (false, false) => Standing::Wins,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(median(&[9.0, 1.0, 5.0]), Some(5.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 9.0]), Some(3.0));
    }

    #[test]
    fn the_spread_is_relative_and_forgives_one_stray_run() {
        assert_eq!(spread(&[2.0]), 0.0);
        assert_eq!(spread(&[1.0, 1.0, 1.0, 1.0, 100.0]), 0.0);
        assert!((spread(&[1.0, 2.0, 3.0, 4.0, 5.0]) - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [[1.0, 5.0], [2.0, 2.0], [5.0, 1.0], [2.0, 3.0], [6.0, 1.0], [2.0, 2.0]];
        assert_eq!(front(&points), [true, true, true, false, false, true]);
    }

    #[test]
    fn standings_name_what_is_lost() {
        assert_eq!(Standing::of([1.0, 1.0], [0.5, 0.5]), Standing::LosesBoth);
        assert_eq!(Standing::of([1.0, 1.0], [0.5, 1.0]), Standing::LosesTime);
        assert_eq!(Standing::of([1.0, 1.0], [2.0, 0.5]), Standing::LosesError);
        assert_eq!(Standing::of([1.0, 1.0], [1.0, 1.0]), Standing::Wins);
    }
}
