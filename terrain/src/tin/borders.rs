//! Checks that tiles fit. Plain on purpose: it looks at what was made, and shares no code with what makes it.

use super::Tin;
use crate::Window;
use std::collections::BTreeMap;

/// An end of a side: column, row, the bits of the height.
type End = (u32, u32, u64);

/// The sides of tiles on their borders, step by step along them.
#[derive(Clone, Debug, Default)]
pub struct Borders {
    /// From the two ends of a step to the first side seen over it, and how many there were.
    steps: BTreeMap<[[u32; 2]; 2], ([End; 2], usize)>,
    differ: usize,
}

impl Borders {
    /// Looks at the network of a tile, which has columns and rows of the whole grid. O(triangles + steps along its border x log).
    pub fn add(&mut self, tin: &Tin, window: Window) {
        let first = [window.column as u32, window.row as u32];
        let last = [first[0] + window.columns as u32 - 1, first[1] + window.rows as u32 - 1];
        let end = |v: u32| {
            let [x, y] = *tin.points.get(v as usize)?;
            Some((x, y, tin.heights.get(v as usize)?.to_bits()))
        };
        for t in &tin.triangles {
            for i in 0..3 {
                let (Some(a), Some(b)) = (end(t[i]), end(t[(i + 1) % 3])) else { continue };
                let side = [a.min(b), a.max(b)];
                let [[x0, y0], [x1, y1]] = side.map(|e| [e.0, e.1]);
                if x0 == x1 && (x0 == first[0] || x0 == last[0]) {
                    (y0..y1).for_each(|y| self.put([[x0, y], [x0, y + 1]], side));
                }
                if y0 == y1 && (y0 == first[1] || y0 == last[1]) {
                    (x0..x1).for_each(|x| self.put([[x, y0], [x + 1, y0]], side));
                }
            }
        }
    }

    fn put(&mut self, step: [[u32; 2]; 2], side: [End; 2]) {
        let entry = self.steps.entry(step).or_insert((side, 0));
        entry.1 += 1;
        self.differ += usize::from(entry.0 != side || entry.1 > 2);
    }

    /// Steps between samples along a border that two tiles cover by different sides, to the bit of the heights, or more than two tiles cover.
    #[must_use]
    pub fn differ(&self) -> usize {
        self.differ
    }

    /// Steps that two tiles cover.
    #[must_use]
    pub fn shared(&self) -> usize {
        self.steps.values().filter(|(_, count)| *count == 2).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_that_differs_is_seen() {
        let tin = |x: u32, height: f64| Tin {
            points: vec![[x, 0], [x + 2, 0], [x + 2, 2], [x, 2]],
            heights: vec![1.0, height, 3.0, 4.0],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mut borders = Borders::default();
        borders.add(&tin(0, 2.0), Window::new(0, 0, 3, 3));
        let mut other = tin(2, 0.0);
        (other.heights[0], other.heights[3]) = (2.0, 3.0);
        borders.add(&other, Window::new(2, 0, 3, 3));
        assert_eq!((borders.differ(), borders.shared()), (0, 2));
        other.heights[3] = 3.0f64.next_up();
        borders.add(&other, Window::new(2, 0, 3, 3));
        assert!(borders.differ() > 0);
    }
}
