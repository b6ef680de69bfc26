//! Heat maps: what belongs to every place of a surface, as colours, with a legend.

use super::colormap::{heat_bytes, heat_color};
use super::picture::Picture;
use super::render::{Style, render, render_both};
use super::surface::Surface;
use super::table::short;
use super::view::View;
use crate::pipeline::thousands;
use glam::DVec3;

/// What colours stand for: 0 is the first colour, `top` and all above the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// The least value of the last colour. With 0, everything has the first colour.
    pub top: f64,
    /// The largest value there is, for the legend: beyond `top`, it says so.
    pub max: f64,
    /// What numbers are in, for people.
    pub unit: String,
}

impl Scale {
    /// 0 to 1 for values from 0 to `top`.
    pub fn part(&self, value: f64) -> f64 {
        if self.top > 0.0 { value / self.top } else { 0.0 }
    }

    /// Values for a legend, from 0 upwards at equal steps of 1, 2 or 5 times a power of ten, none above `top`; four to nine, the top among them
    /// only if it is such a number.
    pub fn ticks(&self) -> Vec<f64> {
        if !(self.top > 1e-290 && self.top.is_finite()) {
            return vec![0.0];
        }
        let mut power = 10f64.powi((self.top.log10().floor() as i32 - 1).max(-300));
        let step = loop {
            match [1.0, 2.0, 5.0].into_iter().find(|s| self.top / (s * power) < 9.0) {
                Some(s) => break s * power,
                None => power *= 10.0,
            }
        };
        (0..=9).map(|k| k as f64 * step).take_while(|&v| v <= self.top * (1.0 + 1e-9)).collect()
    }
}

/// A line above each panel.
#[derive(Clone, Copy, Debug)]
pub struct Titles<'a> {
    /// Of the first surface.
    pub a: &'a str,
    /// Of the second.
    pub b: &'a str,
    /// Of the heat map.
    pub heat: &'a str,
}

const WHITE: [u8; 3] = [255; 3];
const INK: [u8; 3] = [48; 3];
const PALE: [u8; 3] = [120; 3];
/// Pixels of a letter's dot, in titles and elsewhere.
const TITLE: f64 = 1.75;
const SMALL: f64 = 1.5;
/// Rows above a panel for its title and the line below that.
const HEAD: u32 = 50;
/// Columns of the legend beside the heat map.
const LEGEND: u32 = 132;
const BAR: u32 = 18;

/// Three panels from the same camera: A shaded, B shaded, and A in the colours of `field`, with a legend.
///
/// `field` gets points of A in the world and returns a value for each; it is asked once for each pixel that A covers, so the colours are
/// those of the places seen, whatever the triangles.
pub fn heat_panels(
    [a, b]: [&Surface; 2],
    titles: Titles<'_>,
    view: &View,
    scale: &Scale,
    field: impl Fn(&[DVec3]) -> Vec<f64> + Sync,
) -> Picture {
    let style = Style::default();
    let [plain, heat] = render_both(a, view, &style, |points| {
        field(points).into_iter().map(|v| drawn(heat_color(scale.part(v)))).collect()
    });
    let count = |s: &Surface| match s.triangle_count() {
        1 => "1 triangle".to_string(),
        n => format!("{} triangles", thousands(n)),
    };
    let legend = legend(scale, view.height());
    Picture::beside(
        &[
            titled(&plain, titles.a, &count(a)),
            titled(&render(b, view, &style), titles.b, &count(b)),
            titled(&heat, titles.heat, &scale.unit),
            titled(&legend, "", ""),
        ],
        WHITE,
    )
}

/// The light that becomes this colour in a picture, whose curve is a square.
fn drawn(color: [f64; 3]) -> [f32; 3] {
    color.map(|c| (c * c) as f32)
}

fn titled(picture: &Picture, title: &str, line: &str) -> Picture {
    let mut out = Picture::new(picture.width(), picture.height() + HEAD, WHITE);
    out.place(picture, 0, HEAD);
    let left = 12.0;
    let room = picture.width() as f64 - 2.0 * left;
    out.write(left, 12.0, TITLE, &fitted(title, TITLE, room), INK);
    out.write(left, 33.0, SMALL, &fitted(line, SMALL, room), PALE);
    out
}

/// The text, or its end after dots where there is no room for all: of a path, the end tells most.
fn fitted(text: &str, size: f64, room: f64) -> String {
    if Picture::text_width(text, size) <= room {
        return text.to_string();
    }
    let letters: Vec<char> = text.chars().collect();
    let fits = |&k: &usize| {
        let rest: String = letters[k..].iter().collect();
        Picture::text_width(&format!("...{rest}"), size) <= room
    };
    let from = (0..letters.len()).find(fits).unwrap_or(letters.len());
    format!("...{}", letters[from..].iter().collect::<String>())
}

fn legend(scale: &Scale, height: u32) -> Picture {
    let mut out = Picture::new(LEGEND, height, WHITE);
    let (top, bottom) = (36.min(height / 4), height.saturating_sub(24).max(height / 2));
    let rows = bottom.saturating_sub(top).max(1);
    for y in 0..rows {
        let t = 1.0 - (y as f64 + 0.5) / rows as f64;
        let t = if scale.top > 0.0 { t } else { 0.0 };
        out.fill([4, top + y], [BAR, 1], heat_bytes(t));
    }
    let half = 3.5 * SMALL;
    for tick in scale.ticks() {
        let y = bottom as f64 - scale.part(tick).min(1.0) * rows as f64;
        out.fill([4 + BAR, (y.round() as u32).min(bottom - 1)], [5, 1], INK);
        out.write((4 + BAR + 11) as f64, y - half, SMALL, &plain(tick), INK);
    }
    let word = if scale.max > scale.top { "up to" } else { "max" };
    let text = format!("{word} {}", short(scale.max));
    out.write(4.0, (top as f64 - 25.0).max(0.0), SMALL, &text, INK);
    out
}

/// A round number without the zeros that tell how many digits are known.
fn plain(tick: f64) -> String {
    let text = short(tick);
    match text.split_once('e') {
        Some((digits, power)) => format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.')),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aif::MeshInput;
    use crate::scene::{Scene, SceneMesh};

    fn scale(top: f64) -> Scale {
        Scale { top, max: top, unit: "model units".into() }
    }

    #[test]
    fn ticks_are_round_and_end_below_the_top() {
        let near = |top: f64, want: &[f64]| {
            let ticks = scale(top).ticks();
            assert_eq!(ticks.len(), want.len(), "{top}: {ticks:?}");
            assert!(ticks.iter().zip(want).all(|(a, b)| (a - b).abs() <= 1e-9 * top), "{top}: {ticks:?}");
        };
        near(1.0, &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        near(0.0317, &[0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03]);
        near(0.0, &[0.0]);
        for top in [1e-280, 3e-7, 0.9, 8.99, 9.0, 1e12, 1e300] {
            assert!((4..=10).contains(&scale(top).ticks().len()), "{top}");
        }
        assert_eq!(scale(f64::INFINITY).ticks(), [0.0]);
        assert_eq!([8e-4, 1.5e-7, 0.02, 0.0].map(plain), ["8e-4", "1.5e-7", "0.02", "0"]);
    }

    #[test]
    fn every_pixel_has_the_colour_of_its_place() {
        // A square of two triangles, coloured by x: a vertex-wise map would do that too; and by a bump inside, which it would miss.
        let points = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let geometry = MeshInput::triangles(points, &[[0, 1, 2], [0, 2, 3]]);
        let surface = Surface::of(&Scene::from_mesh(SceneMesh { geometry, ..Default::default() })).unwrap();
        let view = View::fit(surface.bounds(), DVec3::NEG_Z, DVec3::Y, 100, 100);
        let bump = |p: &[DVec3]| -> Vec<f64> {
            p.iter().map(|p| if (p.x - 0.5).abs() < 0.25 && p.y > 0.5 { 1.0 } else { 0.0 }).collect()
        };
        let titles = Titles { a: "a", b: "b", heat: "h" };
        let picture = heat_panels([&surface; 2], titles, &view, &scale(1.0), bump);
        assert_eq!((picture.width(), picture.height()), (300 + LEGEND, 100 + HEAD));
        let hue = |x: u32, y: u32| {
            let [r, _, b] = picture.pixel(200 + x, HEAD + y).unwrap();
            r > b
        };
        assert_eq!([hue(50, 30), hue(40, 40), hue(50, 70), hue(15, 30)], [true, true, false, false]);
        // The two shaded panels are the same.
        assert!((HEAD..150).all(|y| (0..100).all(|x| picture.pixel(x, y) == picture.pixel(x + 100, y))));
    }

    #[test]
    fn long_names_show_their_ends() {
        assert_eq!(fitted("abc", 1.0, 100.0), "abc");
        assert_eq!(fitted("abcdefghij", 1.0, 36.0), "...hij");
        assert_eq!(fitted("abcdefghij", 1.0, 1.0), "...");
    }
}
