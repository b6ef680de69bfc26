//! Which pixels a triangle covers, and at what depth.
//!
//! Corners are snapped to 1/256 pixel and coverage is decided by the signs of integer edge functions with the top-left rule, so that
//! of two triangles that share an edge exactly one covers a pixel on it: no cracks, no pixel twice.

use glam::DVec3;

/// Parts of a pixel that corners are snapped to.
const SUB: i64 = 256;

/// A corner in the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// Pixels from the left and from the top.
    pub(super) x: f64,
    pub(super) y: f64,
    /// Larger is nearer.
    pub(super) near: f64,
    /// 1 / w, for what is interpolated in perspective.
    pub(super) iw: f64,
    pub(super) normal: DVec3,
    /// In the world.
    pub(super) point: DVec3,
    /// True if the edge to the next corner is to be drawn.
    pub(super) edge: bool,
}

/// A pixel of a triangle.
pub(super) struct Fragment {
    pub(super) index: usize,
    pub(super) near: f32,
    /// Interpolated, not of unit length.
    pub(super) normal: DVec3,
    /// The point of the surface, in the world.
    pub(super) point: DVec3,
    /// Distance to the nearest edge that is to be drawn, pixels.
    pub(super) to_edge: f64,
}

/// One side of a triangle: `value(x, y) = at + dx * x + dy * y` in sub-pixels, positive inside.
#[derive(Clone, Copy)]
struct Side {
    at: i64,
    dx: i64,
    dy: i64,
    /// The least value that is inside: 0 for a top or left side, 1 for the others.
    least: i64,
    /// Sub-pixels squared to pixels of distance; 0 for an edge that is not drawn.
    length: f64,
}

impl Side {
    fn new(a: [i64; 2], b: [i64; 2], drawn: bool) -> Side {
        let (ex, ey) = (b[0] - a[0], b[1] - a[1]);
        // At the centre of pixel (0, 0).
        let at = ex * (SUB / 2 - a[1]) - ey * (SUB / 2 - a[0]);
        let top_left = ey < 0 || (ey == 0 && ex > 0);
        let length = if drawn { ((ex * ex + ey * ey) as f64).sqrt() * SUB as f64 } else { 0.0 };
        Side { at, dx: -ey * SUB, dy: ex * SUB, least: i64::from(!top_left), length }
    }
}

/// Calls `visit` for every pixel of a `width` x `height` picture whose centre the triangle covers, row by row.
///
/// Coordinates must be below 2^20 pixels. A triangle without area covers nothing; orientation does not matter.
pub(super) fn fill(corners: [Spot; 3], width: u32, height: u32, mut visit: impl FnMut(Fragment)) {
    let [a, mut b, mut c] = corners;
    let snap = |s: &Spot| [(s.x * SUB as f64).round() as i64, (s.y * SUB as f64).round() as i64];
    let (pa, mut pb, mut pc) = (snap(&a), snap(&b), snap(&c));
    let mut area = (pb[0] - pa[0]) * (pc[1] - pa[1]) - (pb[1] - pa[1]) * (pc[0] - pa[0]);
    let mut drawn = [a.edge, b.edge, c.edge];
    if area == 0 {
        return;
    }
    if area < 0 {
        area = -area;
        std::mem::swap(&mut b, &mut c);
        std::mem::swap(&mut pb, &mut pc);
        drawn = [drawn[2], drawn[1], drawn[0]];
    }
    // The side opposite to a corner weighs it.
    let sides = [Side::new(pb, pc, drawn[1]), Side::new(pc, pa, drawn[2]), Side::new(pa, pb, drawn[0])];
    let rows = [pa[1], pb[1], pc[1]];
    let first = (rows.iter().min().copied().unwrap_or(0) - SUB / 2).div_euclid(SUB).max(0);
    let last = (rows.iter().max().copied().unwrap_or(0) - SUB / 2).div_euclid(SUB).min(height as i64 - 1);
    for y in first..=last {
        let (mut from, mut to) = (0, width as i64 - 1);
        for s in &sides {
            let start = s.at + s.dy * y;
            match s.dx {
                0 if start < s.least => to = -1,
                0 => {}
                dx if dx > 0 => from = from.max(-(start - s.least).div_euclid(dx)),
                dx => to = to.min((start - s.least).div_euclid(-dx)),
            }
        }
        for x in from..=to {
            let value = sides.map(|s| s.at + s.dx * x + s.dy * y);
            let [la, lb, lc] = value.map(|v| v as f64 / area as f64);
            let (wa, wb, wc) = (la * a.iw, lb * b.iw, lc * c.iw);
            let mut to_edge = f64::INFINITY;
            for (s, v) in sides.iter().zip(value).filter(|(s, _)| s.length > 0.0) {
                to_edge = to_edge.min(v as f64 / s.length);
            }
            let all = wa + wb + wc;
            visit(Fragment {
                index: y as usize * width as usize + x as usize,
                near: (la * a.near + lb * b.near + lc * c.near) as f32,
                normal: (a.normal * wa + b.normal * wb + c.normal * wc) / all,
                // Divided first: the sum of large coordinates may overflow.
                point: a.point * (wa / all) + b.point * (wb / all) + c.point * (wc / all),
                to_edge,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(x: f64, y: f64) -> Spot {
        Spot { x, y, near: x, iw: 1.0, normal: DVec3::Z, point: DVec3::ZERO, edge: true }
    }

    #[test]
    fn triangles_round_a_point_cover_each_pixel_once() {
        // A fan of slivers and large triangles whose rim lies on pixel centres, turned both ways.
        let rim: Vec<(f64, f64)> = vec![
            (0.5, 0.5),
            (9.5, 0.5),
            (19.5, 0.5),
            (19.5, 7.3),
            (19.5, 19.5),
            (3.2, 19.5),
            (0.5, 19.5),
            (0.5, 19.4),
        ];
        for middle in [(7.5, 7.5), (10.03, 4.01), (1.0, 18.5)] {
            let mut count = vec![0; 20 * 20];
            for i in 0..rim.len() {
                let (p, q) = (rim[i], rim[(i + 1) % rim.len()]);
                let mut t = [spot(middle.0, middle.1), spot(p.0, p.1), spot(q.0, q.1)];
                if i % 2 == 0 {
                    t.swap(0, 2);
                }
                fill(t, 20, 20, |f| count[f.index] += 1);
            }
            // Top and left rim in, bottom and right rim out.
            for y in 0..20 {
                for x in 0..20 {
                    assert_eq!(count[y * 20 + x], i32::from(x < 19 && y < 19), "{middle:?} {x} {y}");
                }
            }
        }
    }

    #[test]
    fn what_lies_outside_is_cut_at_the_pictures_edge() {
        let mut n = 0;
        fill([spot(-1000.0, -1000.0), spot(3000.0, -1000.0), spot(-1000.0, 3000.0)], 16, 8, |_| n += 1);
        assert_eq!(n, 128);
        fill([spot(20.0, 0.0), spot(30.0, 0.0), spot(20.0, 10.0)], 16, 8, |_| n += 1);
        fill([spot(2.0, 2.0), spot(4.0, 4.0), spot(8.0, 8.0)], 16, 8, |_| n += 1);
        assert_eq!(n, 128);
    }

    #[test]
    fn values_and_distances_are_those_of_the_pixels_centre() {
        fill([spot(0.0, 0.0), spot(0.0, 8.0), spot(8.0, 0.0)], 8, 8, |f| {
            let (x, y) = ((f.index % 8) as f64 + 0.5, (f.index / 8) as f64 + 0.5);
            assert!((f.near as f64 - x).abs() < 1e-6);
            let want = x.min(y).min((8.0 - x - y) / 2f64.sqrt());
            assert!((f.to_edge - want).abs() < 1e-9, "{} {want}", f.to_edge);
        });
    }
}
