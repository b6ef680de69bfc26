//! Lines across pictures.

use super::picture::Picture;

impl Picture {
    /// Draws a line from one place to another, pixels from the left and from the top, as broad as `width` pixels; what lies outside is left out. Nothing is drawn where a number
    /// is not finite.
    pub fn stroke(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: [u8; 3]) {
        let reach = 0.5 * width + 1.0;
        let sides = [f64::from(self.width()), f64::from(self.height())];
        let Some([a, b]) = clipped(from, to, [-reach; 2], sides.map(|s| s + reach)) else { return };
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = along[0].hypot(along[1]);
        let unit = if length > 0.0 { along.map(|x| x / length) } else { [1.0, 0.0] };
        // Along the longer axis, pixel by pixel, and across as far as the line is broad.
        let steep = unit[1].abs() > unit[0].abs();
        let (long, short) = if steep { (1, 0) } else { (0, 1) };
        let ends = [a[long].min(b[long]), a[long].max(b[long])];
        let across = reach / unit[long].abs();
        let first = (ends[0] - reach).floor().max(0.0) as u32;
        let last = (ends[1] + reach).ceil().clamp(0.0, sides[long]) as u32;
        for i in first..last {
            let at = f64::from(i) + 0.5;
            let middle = a[short] + (at - a[long]) * unit[short] / unit[long];
            let (low, high) =
                ((middle - across).floor().max(0.0), (middle + across).ceil().min(sides[short]));
            if low >= high {
                continue;
            }
            for j in low as u32..high as u32 {
                let p = if steep { [j, i] } else { [i, j] };
                let d = [f64::from(p[0]) + 0.5 - a[0], f64::from(p[1]) + 0.5 - a[1]];
                let along = d[0] * unit[0] + d[1] * unit[1];
                let aside = (d[0] * unit[1] - d[1] * unit[0]).abs();
                let beyond = (-along).max(along - length).max(0.0);
                let part = (0.5 * width + 0.5 - aside.hypot(beyond)).clamp(0.0, 1.0);
                self.blend(p[0], p[1], color, part);
            }
        }
    }

    /// A frame of one pixel along the edge.
    pub fn outline(&mut self, color: [u8; 3]) {
        let (w, h) = (self.width(), self.height());
        self.fill([0, 0], [w, 1], color);
        self.fill([0, h.saturating_sub(1)], [w, 1], color);
        self.fill([0, 0], [1, h], color);
        self.fill([w.saturating_sub(1), 0], [1, h], color);
    }
}

/// The part of a segment in a rectangle (Liang & Barsky).
fn clipped(a: [f64; 2], b: [f64; 2], low: [f64; 2], high: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for k in 0..2 {
        // Halved, so that the difference is finite.
        let (p, d) = (0.5 * a[k], 0.5 * b[k] - 0.5 * a[k]);
        if !d.is_finite() {
            return None;
        }
        let (enter, leave) = ((0.5 * low[k] - p) / d, (0.5 * high[k] - p) / d);
        if d == 0.0 {
            if a[k] < low[k] || a[k] > high[k] {
                return None;
            }
            continue;
        }
        t0 = t0.max(enter.min(leave));
        t1 = t1.min(enter.max(leave));
    }
    let at = |t: f64| [0, 1].map(|k| (a[k] * (1.0 - t) + b[k] * t).clamp(low[k], high[k]));
    (t0 <= t1).then(|| [at(t0), at(t1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink(p: &Picture) -> Vec<[u32; 2]> {
        let all = (0..p.height()).flat_map(|y| (0..p.width()).map(move |x| [x, y]));
        all.filter(|&[x, y]| p.pixel(x, y).is_some_and(|c| c[0] < 128)).collect()
    }

    #[test]
    fn lines_cover_what_lies_on_them() {
        let mut p = Picture::new(20, 20, [255; 3]);
        p.stroke([2.0, 5.5], [10.0, 5.5], 1.0, [0; 3]);
        assert_eq!(ink(&p), (2..10).map(|x| [x, 5]).collect::<Vec<_>>());
        for (from, to) in [([0.5, 0.5], [19.5, 19.5]), ([19.5, 19.5], [0.5, 0.5])] {
            let mut p = Picture::new(20, 20, [255; 3]);
            p.stroke(from, to, 1.0, [0; 3]);
            assert!((0..20).all(|k| ink(&p).contains(&[k, k])) && ink(&p).len() < 40);
        }
    }

    #[test]
    fn what_lies_outside_is_left_out() {
        let mut p = Picture::new(8, 8, [255; 3]);
        p.stroke([-1e9, 4.5], [1e9, 4.5], 1.0, [0; 3]);
        assert_eq!(ink(&p).len(), 8);
        let before = p.clone();
        p.stroke([-1e300, 9e299], [1e300, 1e300], 1.0, [0; 3]);
        p.stroke([f64::NAN, 0.0], [3.0, 3.0], 1.0, [0; 3]);
        p.stroke([0.0, f64::INFINITY], [3.0, 3.0], 1.0, [0; 3]);
        p.stroke([-9.0, -9.0], [20.0, -9.0], 1.0, [0; 3]);
        assert_eq!(p, before);
        Picture::new(0, 0, [0; 3]).outline([1; 3]);
    }
}
