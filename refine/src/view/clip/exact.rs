//! Signs that rounding cannot change: floating-point filters, and expansions (Shewchuk 1997) where they cannot tell.

use glam::{DVec2, DVec3, DVec4};

/// Half a unit in the last place of 1.
const U: f64 = f64::EPSILON / 2.0;

/// On which side of a plane a point is: their dot product, rounded, but of exact sign; 0 only if the point is on the plane.
#[inline]
pub fn side(plane: DVec4, p: DVec4) -> f64 {
    let t = plane * p;
    let s = (t.x + t.y) + (t.z + t.w);
    let a = t.abs();
    // Four products and three sums round, each by a relative U of at most the sum of magnitudes.
    if s.abs() > 8.0 * U * ((a.x + a.y) + (a.z + a.w)) {
        s
    } else {
        exact_dot(&plane.to_array(), &p.to_array())
    }
}

/// As [`side`], of a line and a point of a plane.
#[inline]
pub(super) fn side3(line: DVec3, p: DVec3) -> f64 {
    let t = line * p;
    let (s, a) = (t.x + t.y + t.z, t.abs());
    if s.abs() > 8.0 * U * (a.x + a.y + a.z) { s } else { exact_dot(&line.to_array(), &p.to_array()) }
}

#[cold]
fn exact_dot(a: &[f64], b: &[f64]) -> f64 {
    dot(a, b).estimate()
}

fn dot(a: &[f64], b: &[f64]) -> Expansion {
    let mut sum = Expansion::default();
    for (&x, &y) in a.iter().zip(b) {
        let (hi, lo) = two_product(x, y);
        sum.grow(lo);
        sum.grow(hi);
    }
    sum
}

/// The determinant of three points of a plane, of exact sign: positive if they turn to the left.
pub(super) fn det3(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let d = a.dot(b.cross(c));
    let (a_, b_, c_) = (a.abs(), b.abs(), c.abs());
    let cross = DVec3::new(b_.y * c_.z + b_.z * c_.y, b_.z * c_.x + b_.x * c_.z, b_.x * c_.y + b_.y * c_.x);
    if d.abs() > 16.0 * U * a_.dot(cross) { d } else { exact_det(&of(a), &of(b), &of(c)).estimate() }
}

/// As [`det3`], for points of w = 1: positive if a, b, c turn to the left.
pub(super) fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let (p, q) = (b - a, c - a);
    let (l, r) = (p.x * q.y, p.y * q.x);
    // The differences round too.
    if (l - r).abs() > 8.0 * U * (l.abs() + r.abs()) && l.is_finite() && r.is_finite() {
        return l - r;
    }
    exact_det(&of(a.extend(1.0)), &of(b.extend(1.0)), &of(c.extend(1.0))).estimate()
}

fn of(p: DVec3) -> [Expansion; 3] {
    p.to_array().map(Expansion::from)
}

fn exact_det(a: &[Expansion; 3], b: &[Expansion; 3], c: &[Expansion; 3]) -> Expansion {
    let mut sum = Expansion::default();
    for (k, a) in a.iter().enumerate() {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let minor = b[i].times(&c[j]).minus(&b[j].times(&c[i]));
        sum = sum.plus(&a.times(&minor));
    }
    sum
}

/// A point on a line of a plane: a vertex, or where an edge crosses it, which no f64 may hold.
#[derive(Clone, Copy, Debug)]
pub(super) enum OnLine {
    /// At a vertex.
    Vertex(DVec3),
    /// Where the edge between two points on either side crosses.
    Crossing(DVec3, DVec3),
}

impl OnLine {
    /// The point, rounded; scaled by a positive number.
    pub(super) fn rounded(&self, line: DVec3) -> DVec3 {
        match *self {
            OnLine::Vertex(p) => p,
            OnLine::Crossing(a, b) => {
                let (sa, sb) = (side3(line, a), side3(line, b));
                crossing(a, sa, b, sb)
            }
        }
    }

    /// Bound on the magnitudes that go into the point, as [`OnLine::scaled`] computes it.
    fn magnitude(&self, line: DVec3) -> DVec3 {
        match *self {
            OnLine::Vertex(p) => p.abs(),
            OnLine::Crossing(a, b) => {
                let (l, a, b) = (line.abs(), a.abs(), b.abs());
                l.dot(b) * a + l.dot(a) * b
            }
        }
    }

    /// |s_b| a + |s_a| b.
    fn scaled(&self, line: DVec3) -> DVec3 {
        match *self {
            OnLine::Vertex(p) => p,
            OnLine::Crossing(a, b) => line.dot(b).abs() * a + line.dot(a).abs() * b,
        }
    }

    fn exact(&self, line: DVec3) -> [Expansion; 3] {
        match *self {
            OnLine::Vertex(p) => of(p),
            OnLine::Crossing(a, b) => {
                let s = |p: DVec3| {
                    let s = dot(&line.to_array(), &p.to_array());
                    if s.estimate() < 0.0 { Expansion::default().minus(&s) } else { s }
                };
                let (sa, sb, a, b) = (s(a), s(b), of(a), of(b));
                [0, 1, 2].map(|k| sb.times(&a[k]).plus(&sa.times(&b[k])))
            }
        }
    }
}

/// The turn from `p` to `q`, both on the line, about it, of exact sign: positive if `q` comes within half a turn after `p` on the way that has
/// the line's positive side on its left.
pub(super) fn turn(line: DVec3, p: &OnLine, q: &OnLine) -> f64 {
    let d = line.dot(p.scaled(line).cross(q.scaled(line)));
    let (l, p_, q_) = (line.abs(), p.magnitude(line), q.magnitude(line));
    let cross = DVec3::new(p_.y * q_.z + p_.z * q_.y, p_.z * q_.x + p_.x * q_.z, p_.x * q_.y + p_.y * q_.x);
    // About twenty roundings on the longest way.
    if d.abs() > 64.0 * U * l.dot(cross) && d.is_finite() {
        return d;
    }
    exact_det(&of(line), &p.exact(line), &q.exact(line)).estimate()
}

/// Where a segment crosses, from its positive end, so that it is the same for a and b exchanged. One of `sa`, `sb` is positive, the other negative.
/// Coordinates in which the ends agree are kept to the bit.
#[inline]
pub(super) fn crossing<V>(a: V, sa: f64, b: V, sb: f64) -> V
where
    V: Copy + std::ops::Add<Output = V> + std::ops::Sub<Output = V> + std::ops::Mul<f64, Output = V>,
{
    let (from, to, t) = fraction(a, sa, b, sb);
    from + (to - from) * t
}

/// The positive end, the other, and how far from the one to the other the crossing is.
#[inline]
pub(super) fn fraction<T>(a: T, sa: f64, b: T, sb: f64) -> (T, T, f64) {
    if sa > 0.0 { (a, b, sa / (sa - sb)) } else { (b, a, sb / (sb - sa)) }
}

fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    (p, a.mul_add(b, -p))
}

/// A sum of f64 that do not overlap, of increasing magnitude, without zeros: exact.
#[derive(Clone, Debug, Default)]
pub(super) struct Expansion(Vec<f64>);

impl From<f64> for Expansion {
    fn from(x: f64) -> Self {
        Expansion(if x == 0.0 { vec![] } else { vec![x] })
    }
}

impl Expansion {
    /// Adds one number.
    fn grow(&mut self, b: f64) {
        let (mut carry, mut kept) = (b, 0);
        for i in 0..self.0.len() {
            let (sum, error) = two_sum(carry, self.0[i]);
            if error != 0.0 {
                self.0[kept] = error;
                kept += 1;
            }
            carry = sum;
        }
        self.0.truncate(kept);
        if carry != 0.0 {
            self.0.push(carry);
        }
    }

    fn plus(&self, other: &Expansion) -> Expansion {
        let mut sum = self.clone();
        other.0.iter().for_each(|&x| sum.grow(x));
        sum
    }

    fn minus(&self, other: &Expansion) -> Expansion {
        let mut sum = self.clone();
        other.0.iter().for_each(|&x| sum.grow(-x));
        sum
    }

    fn times(&self, other: &Expansion) -> Expansion {
        let mut sum = Expansion::default();
        for &x in &self.0 {
            for &y in &other.0 {
                let (hi, lo) = two_product(x, y);
                sum.grow(lo);
                sum.grow(hi);
            }
        }
        sum
    }

    /// The largest component: of the sum's sign, and within a rounding of it.
    fn estimate(&self) -> f64 {
        self.0.last().copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_exact_where_rounding_is_not() {
        // What f64 holds for 0.1, 0.2 and 0.3.
        let plane = DVec4::new(0.1, 0.2, -0.3, 0.0);
        assert!(side(plane, DVec4::ONE) > 0.0);
        let big = DVec4::new(1e16, 1.0, -1e16, 0.0);
        assert_eq!(side(big, DVec4::ONE), 1.0);
        assert_eq!(side(big, DVec4::new(1.0, 0.0, 1.0, 5.0)), 0.0);
        // 1/3 rounded, three times, is not 1 but for rounding.
        let third = DVec4::new(1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, -1.0);
        assert!(side(third, DVec4::ONE) < 0.0 && third.dot(DVec4::ONE) == 0.0);
    }

    #[test]
    fn turns_are_exact() {
        // A grid of nearly collinear points: the sign is that of integers.
        let (b, c) = (DVec2::new(12.0, 12.0), DVec2::new(24.0, 24.0));
        for i in 0..32 {
            for j in 0..32 {
                let a = DVec2::new(0.5 + i as f64 * f64::EPSILON / 2.0, 0.5 + j as f64 * f64::EPSILON / 2.0);
                let want: i32 = j - i;
                assert_eq!(orient(a, b, c).partial_cmp(&0.0).unwrap() as i32, want.signum(), "{i} {j}");
                let d = det3(a.extend(1.0), b.extend(1.0), c.extend(1.0));
                assert_eq!(d.partial_cmp(&0.0).unwrap() as i32, want.signum(), "{i} {j}");
            }
        }
    }

    #[test]
    fn crossings_are_ordered_exactly() {
        // Edges that cross y = 0.1 x at places a last bit apart, or at the same.
        let line = DVec3::new(-0.1, 1.0, 0.0);
        let edge = |x: f64, h: f64| {
            OnLine::Crossing(DVec3::new(x, 0.1 * x + h, 1.0), DVec3::new(x, 0.1 * x - h, 1.0))
        };
        let x = 3.0_f64;
        let (p, q) = (edge(x, 1.0), edge(x.next_up(), 1.0));
        assert!(turn(line, &p, &q) > 0.0 && turn(line, &q, &p) < 0.0);
        let same = OnLine::Crossing(DVec3::new(0.0, 3.0, 1.0), DVec3::new(0.0, -5.0, 1.0));
        let again = OnLine::Crossing(DVec3::new(0.0, -0.7, 1.0), DVec3::new(0.0, 0.1, 1.0));
        let origin = OnLine::Vertex(DVec3::new(0.0, 0.0, 2.0));
        for (a, b) in [(&same, &again), (&again, &origin), (&origin, &same)] {
            assert_eq!(turn(line, a, b), 0.0);
        }
    }
}
