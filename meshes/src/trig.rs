//! Sine and cosine of our own: those of the standard library differ between platforms in the last bit.

/// Sine and cosine of an angle in turns (1 = full circle), to about 1e-16. Exact at the quarters.
pub(crate) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let quarter = (turns * 4.0).round();
    // Within an eighth of a turn either way: the series converge fast.
    let x = (turns - quarter / 4.0) * std::f64::consts::TAU;
    let y = x * x;
    let series = |first: f64| {
        let mut term = 1.0;
        let mut sum = 1.0;
        for k in 0..10 {
            let n = first + 2.0 * k as f64;
            term *= -y / (n * (n + 1.0));
            sum += term;
        }
        sum
    };
    let (s, c) = (x * series(2.0), series(1.0));
    match (quarter as i64).rem_euclid(4) {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

#[cfg(test)]
mod tests {
    use super::sin_cos_turns;

    #[test]
    fn agrees_with_the_standard_library() {
        for i in -2000..2000 {
            let t = i as f64 / 777.0;
            let (s, c) = sin_cos_turns(t);
            let a = t * std::f64::consts::TAU;
            assert!((s - a.sin()).abs() < 4e-15 && (c - a.cos()).abs() < 4e-15, "{t}");
        }
    }

    #[test]
    fn quarters_are_exact() {
        assert_eq!(
            [0.0, 0.25, 0.5, 0.75].map(sin_cos_turns),
            [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]
        );
    }
}
