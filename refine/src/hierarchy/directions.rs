//! Which way deviations lie (Hoppe 1997, section 4: uniform and directional error): along the line of sight they hardly show.
//!
//! A place p of the finest mesh is shown at its place q on the mesh. (Of a piece the corners have theirs on one face; in between, the same mean of these serves, so bodies, which are convex, hold for all of it.) The error of a split bounds the length of D = q - p. Its [`Direction`], an axis n and an angle phi, bounds the rest: with the
//! error E, D lies in the *body* of vectors that are no longer than E and whose part across n is at most E sin phi.
//!
//! **How large it looks.** Seen along the unit vector v, D counts as `sqrt(across^2 + (along / K)^2)`, with K = [`DEPTH`]: what deviates along the line of sight counts a K-th. (Nothing at all would be too little: another
//! place of the surface that happens to lie behind p would do for p.) For D of the body with an acute angle t between n and v the largest of that is
//!
//! `E sqrt(x^2 + (1 - x^2) / K^2)`, x = sin(min(t + phi, 90 degrees)).
//!
//! For it grows with the length of D and with its part across v. The length is E at most; and of D = a n + r, r across n, the part across v is at most `|a| sin t + |r| cos t` where r points the worst way and t + phi is at most 90
//! degrees (then the derivative by the way of r shows that this one is the worst), which over `a^2 + r^2 <= E^2, |r| <= E sin phi` is largest at `|r| = E sin phi`: E sin(t + phi). Beyond 90 degrees it is E at most as |D| is. Lines of sight to the places
//! of a sphere differ by at most the half angle of the cone about it, which is added to t.
//!
//! **Nested.** Of a direction m the part across of body (E, n, phi) is at most E sin(min(angle(n, m) + phi, 90 degrees)), by the same formula. So a body holds another if its E and E sin phi are at least the other's E and
//! part across its own axis. A split's body holds those of the splits below it ([`nested`]): then what counts of it from anywhere is at least what counts of them.

use super::forest::Forest;
use crate::aif::NONE;
use glam::{DMat3, DVec3};

/// Of a deviation along the line of sight such a part counts.
pub(crate) const DEPTH: f64 = 0.25;

/// An axis without a sign as a point of half an octahedron, 5 bits each way, and the sine of an angle in 63rds, 6 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Direction(pub(crate) u16);

/// The largest code of a coordinate.
const SIDE: f64 = 31.0;
/// The code of a sine of 1.
const ALL: u16 = 63;

impl Default for Direction {
    fn default() -> Self {
        Direction::ANY
    }
}

impl Direction {
    /// Nothing is known.
    pub(crate) const ANY: Direction = Direction(ALL << 10);

    /// The nearest axis that can be stored, with an angle of 0.
    pub(super) fn along(axis: DVec3) -> Direction {
        let sum = axis.abs().element_sum();
        if sum.is_nan() || sum <= 0.0 {
            return Direction(0);
        }
        let d = if axis.z < 0.0 { -axis } else { axis } / sum;
        // The upper half of an octahedron is a square, seen from above turned by 45 degrees.
        let code = |t: f64| ((t * 0.5 + 0.5) * SIDE).round() as u16;
        Direction(code(d.x + d.y) | code(d.x - d.y) << 5)
    }

    /// The same axis with an angle of at least that sine.
    fn with_sine(self, sine: f64) -> Direction {
        // NaN is all.
        let steps = if sine < 1.0 { (sine.max(0.0) * ALL as f64).ceil() as u16 } else { ALL };
        Direction(self.0 & 0x3ff | steps << 10)
    }

    /// Of unit length.
    #[inline]
    pub(crate) fn axis(self) -> DVec3 {
        let of = |c: u16| (c & 0x1f) as f64 * (2.0 / SIDE) - 1.0;
        let (u, v) = (of(self.0), of(self.0 >> 5));
        let (x, y) = (0.5 * (u + v), 0.5 * (u - v));
        DVec3::new(x, y, (1.0 - x.abs() - y.abs()).max(0.0)).normalize()
    }

    /// The sine of the angle.
    #[inline]
    pub(crate) fn sine(self) -> f64 {
        (self.0 >> 10) as f64 / ALL as f64
    }

    /// What an error of 1 in this direction counts at most, of all lines of sight within an angle, given by sine and cosine, of `line`.
    #[inline]
    pub(crate) fn counts(self, line: DVec3, (wide, narrow): (f64, f64)) -> f64 {
        let length = line.length();
        let sine = self.sine();
        if length <= 0.0 || self.0 >> 10 == ALL {
            return 1.0;
        }
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        // The angle of the body and that of the lines.
        let (s, c) = (wide * cosine + narrow * sine, narrow * cosine - wide * sine);
        let cos = (line.dot(self.axis()).abs() / length).min(1.0);
        let k = cos * c - (1.0 - cos * cos).sqrt() * s;
        if c <= 0.0 || k <= 0.0 { 1.0 } else { (1.0 - (1.0 - DEPTH * DEPTH) * k * k).sqrt() }
    }
}

/// How fast [`Direction::counts`] changes with an angle, at most: (1 - DEPTH) is the largest derivative of sqrt(x^2 + DEPTH^2 (1 - x^2)) by asin x.
pub(crate) const CHANGE: f64 = 1.0 - DEPTH;

/// All vectors no longer than `length`, whose part across an axis is at most `across`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub(super) length: f64,
    axis: Direction,
    across: f64,
}

impl Default for Body {
    fn default() -> Self {
        Body { length: 0.0, axis: Direction(0), across: 0.0 }
    }
}

impl Body {
    /// A body of `vectors`, about the axis that their squares lie nearest to; of none about `otherwise`.
    pub(super) fn around(vectors: &[DVec3], otherwise: DVec3) -> Body {
        let longest = vectors.iter().map(|d| d.length()).fold(0.0, f64::max);
        if longest <= 0.0 {
            return Body { axis: Direction::along(otherwise), ..Body::default() };
        }
        let mut sum = DMat3::ZERO;
        for d in vectors.iter().map(|&d| d / longest) {
            sum += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        // The eigenvector of the largest eigenvalue, roughly: any axis will do.
        let mut axis = otherwise.normalize_or(DVec3::Z) + 1e-3;
        for _ in 0..12 {
            axis = (sum * axis).normalize_or(axis);
        }
        let axis = Direction::along(axis);
        let n = axis.axis();
        let across = vectors.iter().map(|d| d.cross(n).length()).fold(0.0, f64::max);
        Body { length: longest, axis, across }
    }

    /// As if its vectors were longer by a factor.
    pub(super) fn scaled(self, by: f64) -> Body {
        Body { length: self.length * by, across: self.across * by, ..self }
    }

    /// As it comes back when its length is stored as `length`, which is no less, and that direction.
    pub(super) fn stored(length: f64, axis: Direction) -> Body {
        Body { length, axis, across: length * axis.sine() }
    }

    /// With vectors that are longer by `by`, any way.
    pub(super) fn grown(self, by: f64) -> Body {
        Body { length: self.length + by, across: self.across + by, ..self }
    }

    /// The direction to store it with, if its length is stored as `length`, which is no less.
    pub(super) fn direction(&self, length: f64) -> Direction {
        self.axis.with_sine(if length > 0.0 { self.across / length * (1.0 + 1e-12) } else { 0.0 })
    }

    /// The most of its vectors across another axis.
    fn across(&self, axis: Direction) -> f64 {
        if axis.0 & 0x3ff == self.axis.0 & 0x3ff {
            return self.across;
        }
        let (n, m) = (self.axis.axis(), axis.axis());
        let sine = if self.length > 0.0 { (self.across / self.length).min(1.0) } else { 0.0 };
        let (c, s) = (n.dot(m).abs(), n.cross(m).length());
        let cosine = (1.0 - sine * sine).sqrt();
        let sum = s * cosine + c * sine;
        // Beyond 90 degrees.
        if c * cosine - s * sine <= 0.0 { self.length } else { (sum * self.length).min(self.length) }
    }

    /// All of another body's vectors are of this one, but for rounding.
    pub(super) fn holds(&self, other: &Body) -> bool {
        other.across(self.axis) <= self.across * (1.0 + 1e-9) && other.length <= self.length
    }

    /// The smaller of two bodies about the axis of one of them that hold both.
    pub(super) fn join(self, other: Body) -> Body {
        let about = |axis: Direction| self.across(axis).max(other.across(axis));
        let (own, theirs) = (about(self.axis), about(other.axis));
        let (axis, across) = if theirs < own { (other.axis, theirs) } else { (self.axis, own) };
        Body { length: self.length.max(other.length), axis, across }
    }
}

/// Directions for splits whose lengths (errors) are stored already, raised to nest: what a split is stored with holds its body and what those below it are stored with. O(n).
pub(super) fn nested(
    forest: &Forest,
    mut bodies: Vec<Body>,
    length: impl Fn(usize) -> f64,
) -> Vec<Direction> {
    let ups = forest.ups();
    let mut out = vec![Direction::ANY; bodies.len()];
    for i in (0..bodies.len()).rev() {
        let stored = length(i);
        out[i] = bodies[i].direction(stored);
        if ups[i] != NONE {
            let up = &mut bodies[ups[i] as usize];
            *up = up.join(Body::stored(stored, out[i]));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit(x: [f64; 3]) -> DVec3 {
        DVec3::from_array(x).normalize_or(DVec3::Z)
    }

    /// What a deviation counts, seen along a unit vector.
    fn seen(d: DVec3, v: DVec3) -> f64 {
        let along = d.dot(v);
        ((d - v * along).length_squared() + (DEPTH * along).powi(2)).sqrt()
    }

    fn vectors(n: std::ops::Range<usize>) -> impl Strategy<Value = Vec<DVec3>> {
        let one = (prop::array::uniform3(-1.0..1.0f64), 0.0..1.0f64, prop::array::uniform3(-0.2..0.2f64));
        type One = ([f64; 3], f64, [f64; 3]);
        let of = |(main, all): ([f64; 3], Vec<One>)| {
            let about = |(any, t, off): One| {
                let line = DVec3::from_array(main) * (2.0 * t - 1.0) + DVec3::from_array(off);
                if t > 0.95 { DVec3::from_array(any) } else { line }
            };
            all.into_iter().map(about).collect()
        };
        (prop::array::uniform3(-1.0..1.0f64), prop::collection::vec(one, n)).prop_map(of)
    }

    #[test]
    fn axes_come_back_within_five_degrees() {
        for k in 0..2000 {
            let t = k as f64;
            let d = DVec3::new((t * 0.37).sin(), (t * 0.71).cos(), (t * 0.11).sin()).normalize();
            let back = Direction::along(d).axis();
            assert!((back.length() - 1.0).abs() < 1e-12 && back.dot(d).abs() > 5f64.to_radians().cos());
        }
        assert_eq!(Direction::along(DVec3::NAN), Direction(0));
        assert_eq!(Direction(5).with_sine(f64::NAN).sine(), 1.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn no_vector_of_a_body_counts_more_than_its_direction_says(
            all in vectors(1..8),
            line in prop::array::uniform3(-1.0..1.0f64),
            off in prop::array::uniform3(-1.0..1.0f64),
            wide in 0.0..0.9f64,
        ) {
            let body = Body::around(&all, DVec3::Z);
            let stored = body.length * 1.002;
            let direction = body.direction(stored);
            let line = unit(line);
            // A line of sight within the angle.
            let side = (DVec3::from_array(off).cross(line)).normalize_or_zero();
            let at = |t: f64| (line * (1.0 - t * t).sqrt() + side * t).normalize();
            let most = stored * direction.counts(3.0 * line, (wide, (1.0 - wide * wide).sqrt()));
            for v in [line, at(wide), at(-wide), at(0.5 * wide)] {
                for &d in &all {
                    prop_assert!(seen(d, v) <= most * (1.0 + 1e-9), "{} {most}", seen(d, v));
                }
            }
            // It is reached: by the vector of the body that lies worst.
            let (n, s) = (direction.axis(), direction.sine());
            let across = (line - n * line.dot(n)).normalize_or(n.any_orthonormal_vector());
            let worst = (0..=1000).map(|k| {
                let a = (k as f64 / 500.0 - 1.0) * s.asin();
                stored * seen(n * a.cos() + across * a.sin(), line)
            });
            let exact = stored * direction.counts(line, (0.0, 1.0));
            let reached = worst.fold(0.0, f64::max);
            prop_assert!(reached <= exact * (1.0 + 1e-9) && reached >= exact * 0.99, "{reached} {exact}");
        }

        #[test]
        fn what_holds_a_body_counts_no_less_from_anywhere(
            a in vectors(1..6),
            b in vectors(1..6),
            scale in 0.01..1.0f64,
            line in prop::array::uniform3(-1.0..1.0f64),
            wide in 0.0..0.9f64,
        ) {
            let (vectors, other) = (a, b);
            let (a, b) = (Body::around(&vectors, DVec3::X), Body::around(&other, DVec3::Y).scaled(scale));
            let inner = Body::stored(b.length * 1.003, b.direction(b.length * 1.003));
            let joined = a.join(inner);
            let outer = joined.direction(joined.length);
            let line = unit(line);
            let counts = |d: Direction| d.counts(line, (wide, (1.0 - wide * wide).sqrt()));
            let most = joined.length * counts(outer) * (1.0 + 1e-9);
            prop_assert!(most <= joined.length * (1.0 + 1e-6));
            prop_assert!(inner.length * counts(inner.axis) <= most);
            prop_assert!(vectors.iter().all(|&d| seen(d, line) <= most));
            prop_assert!(other.iter().all(|&d| seen(d * scale, line) <= most));
        }
    }
}
