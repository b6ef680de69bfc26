//! The colours of heat maps.

/// Colours from small to large, as sRGB bytes, at equal steps.
///
/// A path of our own through OKLab (Ottosson 2020): violet over blue, teal and green to yellow, its lightness rising evenly from 0.27 to 0.94,
/// its points at equal distances along the path. So equal differences of a value look equal, the order of colours is plain to everyone
/// who sees light and dark, and it survives a print in grey.
const TABLE: [[u8; 3]; 17] = [
    [45, 3, 101],
    [46, 22, 125],
    [39, 41, 145],
    [24, 63, 152],
    [8, 83, 152],
    [16, 100, 149],
    [23, 117, 152],
    [29, 134, 156],
    [33, 152, 160],
    [37, 169, 161],
    [39, 186, 158],
    [52, 201, 148],
    [90, 214, 133],
    [136, 223, 117],
    [179, 230, 103],
    [219, 235, 96],
    [254, 239, 104],
];

/// The colour of `t`, 0 to 1, as sRGB, each channel 0 to 1. What is outside (or no number) has the colour of the nearer end (of 0).
pub fn heat_color(t: f64) -> [f64; 3] {
    let last = TABLE.len() - 1;
    let place = if t > 0.0 { t.min(1.0) * last as f64 } else { 0.0 };
    let k = (place as usize).min(last - 1);
    let part = place - k as f64;
    [0, 1, 2].map(|c| {
        let [a, b] = [TABLE[k][c], TABLE[k + 1][c]].map(f64::from);
        (a + part * (b - a)) / 255.0
    })
}

/// The same as sRGB bytes.
pub fn heat_bytes(t: f64) -> [u8; 3] {
    heat_color(t).map(|c| (255.0 * c).round() as u8)
}

/// sRGB to linear light, by the curve of IEC 61966-2-1.
pub(crate) fn linear(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OKLab of an sRGB colour.
    fn lab(rgb: [f64; 3]) -> [f64; 3] {
        let [r, g, b] = rgb.map(linear);
        let l = (0.412_221_470_8 * r + 0.536_332_536_3 * g + 0.051_445_992_9 * b).cbrt();
        let m = (0.211_903_498_2 * r + 0.680_699_545_1 * g + 0.107_396_956_6 * b).cbrt();
        let s = (0.088_302_461_9 * r + 0.281_718_837_6 * g + 0.629_978_700_5 * b).cbrt();
        [
            0.210_454_255_3 * l + 0.793_617_785 * m - 0.004_072_046_8 * s,
            1.977_998_495_1 * l - 2.428_592_205 * m + 0.450_593_709_9 * s,
            0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766 * s,
        ]
    }

    #[test]
    fn lightness_rises_and_equal_steps_look_equal() {
        let labs: Vec<_> = (0..=64).map(|i| lab(heat_color(i as f64 / 64.0))).collect();
        assert!(labs.windows(2).all(|w| w[1][0] > w[0][0]));
        let step =
            |k: usize| -> f64 { (0..3).map(|c| (labs[k + 4][c] - labs[k][c]).powi(2)).sum::<f64>().sqrt() };
        let steps: Vec<f64> = (0..=60).step_by(4).map(step).collect();
        let mean = steps.iter().sum::<f64>() / steps.len() as f64;
        assert!(steps.iter().all(|s| (s / mean - 1.0).abs() < 0.12), "{steps:?}");
    }

    #[test]
    fn the_ends_hold_what_lies_beyond() {
        assert_eq!(heat_bytes(0.0), TABLE[0]);
        assert_eq!(heat_bytes(1.0), TABLE[16]);
        assert_eq!(heat_bytes(0.5), TABLE[8]);
        assert_eq!([-1.0, f64::NAN, f64::NEG_INFINITY].map(heat_bytes), [TABLE[0]; 3]);
        assert_eq!([2.0, f64::INFINITY].map(heat_bytes), [TABLE[16]; 2]);
    }
}
