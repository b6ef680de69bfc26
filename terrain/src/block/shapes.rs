//! Small triangles by their shape: which samples one has, found once and kept.
//!
//! Most triangles that collapses of a full grid come by are a few steps wide, and there are few shapes of these: walking along their sides would take most of the time that measuring them does.

use crate::tin::scan::rows_between_corners;

/// Triangles at most so many steps wide and high are kept. Of those measured at the finest level of Grand Canyon 95 % are no larger; with wider ones the table takes more of the processor's cache than it spares time.
const WIDE: i32 = 5;
const SIDE: i32 = 2 * WIDE + 1;
const SHAPES: usize = (SIDE * SIDE * SIDE * SIDE) as usize;
/// Bits for how many samples a shape has: at most 11 * 11.
const COUNT: u32 = 8;
const UNKNOWN: u32 = u32::MAX;

/// A sample of a triangle, seen from its first corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Inside {
    /// Columns and rows to go.
    pub x: f32,
    pub y: f32,
    /// Samples to go in memory.
    pub offset: i32,
}

/// The samples of small triangles, without the corners, for windows of one width.
#[derive(Clone, Debug)]
pub(super) struct Shapes {
    /// Samples in a row of the window.
    across: i32,
    /// Of each shape where its samples begin, and how many they are.
    known: Vec<u32>,
    all: Vec<Inside>,
}

impl Shapes {
    /// For windows with so many samples in a row.
    pub(super) fn new(across: usize) -> Self {
        Shapes { across: across as i32, known: vec![UNKNOWN; SHAPES], all: vec![] }
    }

    /// The samples of the triangle whose second and third corner lie so far from the first, and which is not flat; `None` if it is too large.
    #[inline]
    pub(super) fn of(&mut self, u: [i32; 2], v: [i32; 2]) -> Option<&[Inside]> {
        let at = |d: i32| u32::try_from(d + WIDE).ok().filter(|d| *d < SIDE as u32);
        let [a, b, c, d] = [at(u[0])?, at(u[1])?, at(v[0])?, at(v[1])?];
        let side = SIDE as u32;
        let shape = (((a * side + b) * side + c) * side + d) as usize;
        let known = match *self.known.get(shape)? {
            UNKNOWN => self.walk(shape, u, v),
            known => known,
        };
        let first = (known >> COUNT) as usize;
        self.all.get(first..first + (known & ((1 << COUNT) - 1)) as usize)
    }

    #[cold]
    fn walk(&mut self, shape: usize, u: [i32; 2], v: [i32; 2]) -> u32 {
        let first = self.all.len() as u32;
        let (b, c) = if u[0] * v[1] < u[1] * v[0] { (v, u) } else { (u, v) };
        // Columns and rows are not negative there.
        let corner = |p: [i32; 2]| (p[0] + WIDE, p[1] + WIDE);
        rows_between_corners(corner([0, 0]), corner(b), corner(c), |y, x0, x1| {
            let y = y - WIDE;
            self.all.extend((x0 - WIDE..=x1 - WIDE).map(|x| Inside {
                x: x as f32,
                y: y as f32,
                offset: y * self.across + x,
            }));
        });
        let known = first << COUNT | (self.all.len() as u32 - first);
        self.known[shape] = known;
        known
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn samples_are_those_inside_and_too_large_ones_are_refused(p in proptest::array::uniform4(-9i32..10)) {
            let (u, v) = ([p[0], p[1]], [p[2], p[3]]);
            let area = u[0] * v[1] - u[1] * v[0];
            prop_assume!(area != 0);
            let mut shapes = Shapes::new(100);
            for _ in 0..2 {
                let Some(found) = shapes.of(u, v) else {
                    prop_assert!(p.iter().any(|d| d.abs() > WIDE));
                    continue;
                };
                let mut want = vec![];
                for (x, y) in (-9..10).flat_map(|y| (-9..10).map(move |x| (x, y))) {
                    let (b, c) = ((x * v[1] - y * v[0]) * area.signum(), (u[0] * y - u[1] * x) * area.signum());
                    let corner = [[0, 0], u, v].contains(&[x, y]);
                    if b >= 0 && c >= 0 && b + c <= area.abs() && !corner {
                        want.push(Inside { x: x as f32, y: y as f32, offset: 100 * y + x });
                    }
                }
                prop_assert_eq!(found, &want[..]);
            }
        }
    }
}
