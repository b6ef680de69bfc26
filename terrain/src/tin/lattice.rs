//! The samples within a triangle, row by row.

/// Twice the area of a triangle in the plan; positive when it turns from the x axis (columns) to the y axis (rows).
#[inline]
pub(crate) fn area(a: (i32, i32), b: (i32, i32), c: (i32, i32)) -> i64 {
    let (ux, uy) = (i64::from(b.0 - a.0), i64::from(b.1 - a.1));
    let (vx, vy) = (i64::from(c.0 - a.0), i64::from(c.1 - a.1));
    ux * vy - uy * vx
}

/// The corners in the order of their rows, and of their columns within a row. Without branches: which is which cannot be foretold.
#[inline(always)]
fn by_rows(a: (i32, i32), b: (i32, i32), c: (i32, i32)) -> [(i32, i32); 3] {
    let key = |p: (i32, i32)| i64::from(p.1) << 32 | i64::from(p.0);
    let (a, b, c) = (key(a), key(b), key(c));
    let (low, b) = (a.min(b), a.max(b));
    let (b, high) = (b.min(c), b.max(c));
    let (low, mid) = (low.min(b), low.max(b));
    let point = |k: i64| (k as i32, (k >> 32) as i32);
    [point(low), point(mid), point(high)]
}

/// Calls `f(y, x0, x1)` for every row of samples in the triangle, borders included. Columns and rows are not negative. No division but one for each
/// side.
#[inline(always)]
pub(crate) fn rows(a: (i32, i32), b: (i32, i32), c: (i32, i32), mut f: impl FnMut(i32, i32, i32)) {
    let [low, mid, high] = by_rows(a, b, c);
    if low.1 == high.1 {
        return f(low.1, low.0, high.0);
    }
    let long_is_left = area(low, high, mid) <= 0;
    let mut long = Side::new(low, high, long_is_left);
    let mut between = |y: i32, long: &Side, short: &Side| {
        let (l, r) = if long_is_left { (long.at, short.at) } else { (short.at, long.at) };
        if l <= r {
            f(y, l, r);
        }
    };
    if low.1 < mid.1 {
        let mut short = Side::new(low, mid, !long_is_left);
        for y in low.1..mid.1 {
            between(y, &long, &short);
            long.step();
            short.step();
        }
    }
    if mid.1 == high.1 {
        return f(mid.1, mid.0, high.0);
    }
    let mut short = Side::new(mid, high, !long_is_left);
    for y in mid.1..=high.1 {
        between(y, &long, &short);
        long.step();
        short.step();
    }
}

/// The same for a triangle with an area, without its corners.
#[inline(always)]
pub(crate) fn rows_between_corners(
    a: (i32, i32),
    b: (i32, i32),
    c: (i32, i32),
    mut f: impl FnMut(i32, i32, i32),
) {
    let [low, mid, high] = by_rows(a, b, c);
    let mut row = |y: i32, l: i32, r: i32| {
        if l <= r {
            f(y, l, r);
        }
    };
    if low.1 == mid.1 {
        row(low.1, low.0 + 1, mid.0 - 1);
    }
    if high.1 - low.1 > 1 {
        let long_is_left = area(low, high, mid) <= 0;
        let mut long = Side::new(low, high, long_is_left);
        let mut between = |y: i32, long: &Side, short: i32| {
            if long_is_left { row(y, long.at, short) } else { row(y, short, long.at) }
        };
        if low.1 + 1 < mid.1 {
            let mut short = Side::new(low, mid, !long_is_left);
            for y in low.1 + 1..mid.1 {
                long.step();
                short.step();
                between(y, &long, short.at);
            }
        }
        if low.1 < mid.1 && mid.1 < high.1 {
            long.step();
            between(mid.1, &long, if long_is_left { mid.0 - 1 } else { mid.0 + 1 });
        }
        if mid.1 + 1 < high.1 {
            let mut short = Side::new(mid, high, !long_is_left);
            for y in mid.1 + 1..high.1 {
                long.step();
                short.step();
                between(y, &long, short.at);
            }
        }
    }
    if mid.1 == high.1 {
        row(high.1, mid.0 + 1, high.0 - 1);
    }
}

/// Where a side crosses one row after the other, rounded into the triangle.
struct Side {
    /// The column of the row reached: rounded up on the left of the triangle, down on the right.
    at: i32,
    rest: i32,
    rows: i32,
    step_whole: i32,
    step_rest: i32,
}

impl Side {
    #[inline(always)]
    fn new(from: (i32, i32), to: (i32, i32), is_left: bool) -> Self {
        let (dx, rows) = (to.0 - from.0, to.1 - from.1);
        let (step_whole, step_rest) = whole_and_rest(dx, rows);
        // Rounded up is rounded down with almost one more.
        let rest = if is_left { rows - 1 } else { 0 };
        Side { at: from.0, rest, rows, step_whole, step_rest }
    }

    #[inline(always)]
    fn step(&mut self) {
        let rest = self.rest + self.step_rest;
        let carry = rest >= self.rows;
        self.at += self.step_whole + i32::from(carry);
        self.rest = if carry { rest - self.rows } else { rest };
    }
}

/// `d / parts`, rounded down, and what is left. One division, and no branch that guesses would get wrong half the time.
#[inline(always)]
pub(super) fn whole_and_rest(d: i32, parts: i32) -> (i32, i32) {
    let (whole, rest) = (d / parts, d % parts);
    let down = rest >> 31;
    (whole + down, rest + (parts & down))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// Rows are the lattice points that three half planes hold.
        #[test]
        fn rows_hold_every_sample(p in proptest::array::uniform6(0..13i32)) {
            let (a, b, c) = ((p[0], p[1]), (p[2], p[3]), (p[4], p[5]));
            let (b, c) = if area(a, b, c) < 0 { (c, b) } else { (b, c) };
            prop_assume!(area(a, b, c) != 0);
            let mut seen = vec![];
            rows(a, b, c, |y, x0, x1| seen.extend((x0..=x1).map(|x| (x, y))));
            let inside = |p| area(a, b, p) >= 0 && area(b, c, p) >= 0 && area(c, a, p) >= 0;
            let mut all: Vec<_> =
                (0..13).flat_map(|y| (0..13).map(move |x| (x, y))).filter(|&p| inside(p)).collect();
            prop_assert_eq!(&seen, &all);
            seen.clear();
            rows_between_corners(a, b, c, |y, x0, x1| seen.extend((x0..=x1).map(|x| (x, y))));
            all.retain(|&p| p != a && p != b && p != c);
            prop_assert_eq!(seen, all);
        }
    }
}
