//! Log-log plots as SVG: panels side by side with one legend.

use std::fmt::Write;

/// A mark of a plot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// Positive.
    pub(crate) x: f64,
    /// Positive.
    pub(crate) y: f64,
    /// Shown when the pointer rests on it.
    pub(crate) title: String,
    /// Shown beside it; empty for nothing.
    pub(crate) note: String,
}

/// Points of one kind, joined by a line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    pub(crate) label: String,
    pub(crate) style: Style,
    pub(crate) points: Vec<Point>,
}

/// How a series looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Style {
    pub(crate) colour: &'static str,
    pub(crate) shape: Shape,
    /// Marks are outlines.
    pub(crate) hollow: bool,
    pub(crate) width: f64,
}

/// The form of a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    Circle,
    Square,
    Diamond,
    Triangle,
    Cross,
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) x: &'static str,
    pub(crate) y: &'static str,
    pub(crate) series: Vec<Series>,
}

/// Of the area between the axes, pixels.
const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 320.0;
/// Room left of, above and below it.
const LEFT: f64 = 66.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 48.0;
const LEGEND: f64 = 370.0;
const LINE: f64 = 19.0;

/// The panels as one picture, white behind, with a legend on the right. Points that are not positive and finite are left out.
pub(crate) fn svg(panels: &[Panel]) -> String {
    let mut styles: Vec<(&str, Style)> = Vec::new();
    for s in panels.iter().flat_map(|p| &p.series).filter(|s| s.points.iter().any(drawn)) {
        if !styles.iter().any(|o| o.0 == s.label) {
            styles.push((&s.label, s.style));
        }
    }
    let each = LEFT + WIDTH + 14.0;
    let width = each * panels.len() as f64 + LEGEND;
    let height = (TOP + HEIGHT + BOTTOM).max(TOP + LINE * styles.len() as f64 + 10.0);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"system-ui,sans-serif\" font-size=\"12\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    for (i, panel) in panels.iter().enumerate() {
        let _ = writeln!(out, "<g transform=\"translate({} {TOP})\">", each * i as f64 + LEFT);
        draw(panel, &mut out);
        out += "</g>\n";
    }
    let _ = writeln!(out, "<g transform=\"translate({} {TOP})\">", each * panels.len() as f64 + 16.0);
    for (i, (label, style)) in styles.iter().enumerate() {
        let y = LINE * i as f64 + 6.0;
        let _ = writeln!(
            out,
            "<path d=\"M0 {y}h24\" stroke=\"{}\" stroke-width=\"{}\"/>{}<text x=\"32\" y=\"{}\">{}</text>",
            style.colour,
            style.width,
            mark(style, 12.0, y, ""),
            y + 4.0,
            escaped(label)
        );
    }
    out + "</g>\n</svg>\n"
}

fn drawn(p: &Point) -> bool {
    p.x > 0.0 && p.y > 0.0 && p.x.is_finite() && p.y.is_finite()
}

/// A logarithmic axis over some pixels.
#[derive(Clone, Copy, Debug)]
struct Axis {
    low: f64,
    high: f64,
    pixels: f64,
}

impl Axis {
    /// Over all values and a little more; one decade where there are none.
    fn over(values: impl Iterator<Item = f64>, pixels: f64) -> Axis {
        let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low.log10(), high.log10()) } else { (-1.0, 0.0) };
        let margin = (0.06 * (high - low)).max(0.08);
        Axis { low: low - margin, high: high + margin, pixels }
    }

    fn at(&self, value: f64) -> f64 {
        (value.log10() - self.low) / (self.high - self.low) * self.pixels
    }

    /// Places of lines, and whether each has a number: decades, and 2 and 5 of them where there are few.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let few = self.high - self.low < 2.2;
        let mut ticks = Vec::new();
        for decade in self.low.floor() as i32..=self.high.ceil() as i32 {
            for (k, digit) in [1.0, 2.0, 5.0].into_iter().enumerate() {
                let value = digit * 10f64.powi(decade);
                if (self.low..=self.high).contains(&value.log10()) {
                    ticks.push((value, k == 0 || few));
                }
            }
        }
        ticks
    }
}

fn draw(panel: &Panel, out: &mut String) {
    let points = || panel.series.iter().flat_map(|s| &s.points).filter(|p| drawn(p));
    let x = Axis::over(points().map(|p| p.x), WIDTH);
    let y = Axis::over(points().map(|p| p.y), HEIGHT);
    let _ = writeln!(
        out,
        "<text x=\"0\" y=\"-12\" font-size=\"14\" font-weight=\"600\">{}</text>",
        escaped(&panel.title)
    );
    for (value, number) in x.ticks() {
        let at = round(x.at(value));
        let _ = writeln!(out, "<path d=\"M{at} 0v{HEIGHT}\" stroke=\"#e4e4e4\"/>");
        if number {
            let _ = writeln!(
                out,
                "<text x=\"{at}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                HEIGHT + 16.0,
                short(value)
            );
        }
    }
    for (value, number) in y.ticks() {
        let at = round(HEIGHT - y.at(value));
        let _ = writeln!(out, "<path d=\"M0 {at}h{WIDTH}\" stroke=\"#e4e4e4\"/>");
        if number {
            let _ = writeln!(
                out,
                "<text x=\"-6\" y=\"{}\" text-anchor=\"end\">{}</text>",
                at + 4.0,
                short(value)
            );
        }
    }
    let _ = writeln!(
        out,
        "<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"#999\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\
         <text transform=\"translate(-50 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        WIDTH / 2.0,
        HEIGHT + 36.0,
        escaped(panel.x),
        HEIGHT / 2.0,
        escaped(panel.y)
    );
    for s in &panel.series {
        let places: Vec<(f64, f64, &Point)> = s
            .points
            .iter()
            .filter(|p| drawn(p))
            .map(|p| (round(x.at(p.x)), round(HEIGHT - y.at(p.y)), p))
            .collect();
        let line: Vec<String> = places.iter().map(|(x, y, _)| format!("{x},{y}")).collect();
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-opacity=\".75\"/>",
            line.join(" "),
            s.style.colour,
            s.style.width
        );
        for (x, y, p) in places {
            *out += &mark(&s.style, x, y, &p.title);
            if !p.note.is_empty() {
                let _ = write!(
                    out,
                    "<text x=\"{}\" y=\"{}\" font-size=\"10\" text-anchor=\"end\">{}</text>",
                    x - 6.0,
                    y + 12.0,
                    escaped(&p.note)
                );
            }
            out.push('\n');
        }
    }
}

fn mark(style: &Style, x: f64, y: f64, title: &str) -> String {
    let fill = if style.hollow { "#fff" } else { style.colour };
    let paint = format!("fill=\"{fill}\" stroke=\"{}\" stroke-width=\"1.6\"", style.colour);
    let title = if title.is_empty() { String::new() } else { format!("<title>{}</title>", escaped(title)) };
    let path = match style.shape {
        Shape::Circle => return format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"4.2\" {paint}>{title}</circle>"),
        Shape::Square => "m-3.8-3.8h7.6v7.6h-7.6z",
        Shape::Diamond => "m0-5.2l5.2 5.2l-5.2 5.2l-5.2-5.2z",
        Shape::Triangle => "m0-5l4.8 8.6h-9.6z",
        Shape::Cross => "m-4-4l8 8m0-8l-8 8",
    };
    format!("<path d=\"M{x} {y}{path}\" {paint}>{title}</path>")
}

/// To a hundredth of a pixel.
fn round(x: f64) -> f64 {
    (100.0 * x).round() / 100.0
}

/// A number of an axis: 0.02, 5, 20k.
fn short(value: f64) -> String {
    match value {
        v if v >= 1e6 => format!("{}M", v / 1e6),
        v if v >= 1e4 => format!("{}k", (v / 1e3).round()),
        v if v >= 1.0 => format!("{}", v.round()),
        v => {
            let digits = (-v.log10().floor()).max(0.0) as usize;
            format!("{v:.digits$}")
        }
    }
}

/// Text as XML has it.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(label: &str, points: &[[f64; 2]]) -> Series {
        let style = Style { colour: "#123456", shape: Shape::Square, hollow: false, width: 1.0 };
        let point =
            |p: &[f64; 2]| Point { x: p[0], y: p[1], title: format!("<{}>", p[0]), note: String::new() };
        Series { label: label.into(), style, points: points.iter().map(point).collect() }
    }

    fn panel(series: Vec<Series>) -> Panel {
        Panel { title: "a & b".into(), x: "seconds", y: "rms", series }
    }

    #[test]
    fn equal_factors_are_equal_distances() {
        let axis = Axis::over([0.01, 1.0].into_iter(), 100.0);
        let step = axis.at(0.1) - axis.at(0.01);
        assert!((axis.at(1.0) - axis.at(0.1) - step).abs() < 1e-9 && step > 0.0);
        assert!(axis.at(0.01) > 0.0 && axis.at(1.0) < 100.0);
    }

    #[test]
    fn ticks_lie_within_and_some_have_numbers() {
        for (low, high) in [(0.001, 100.0), (0.3, 0.4), (5.0, 5.0)] {
            let axis = Axis::over([low, high].into_iter(), 100.0);
            let ticks = axis.ticks();
            assert!(ticks.iter().all(|t| (0.0..=100.0).contains(&axis.at(t.0))), "{low} {high}");
        }
        let wide = Axis::over([0.001, 100.0].into_iter(), 100.0).ticks();
        assert_eq!(wide.iter().filter(|t| t.1).count(), 6);
    }

    #[test]
    fn points_that_no_logarithm_has_are_left_out() {
        let bad = series("bad", &[[0.0, 1.0], [1.0, f64::NAN], [-1.0, 1.0], [1.0, f64::INFINITY]]);
        let text = svg(&[panel(vec![bad, series("good", &[[1.0, 2.0], [10.0, 0.5]])])]);
        assert!(
            !text.contains(">bad<")
                && text.contains(">good<")
                && !text.contains("NaN")
                && !text.contains("inf")
        );
        // Two marks and the one of the legend.
        assert_eq!(text.matches("h7.6v7.6").count(), 3);
        assert_eq!(svg(&[panel(vec![])]).matches("<circle").count(), 0);
    }

    #[test]
    fn text_is_escaped_and_a_series_of_two_panels_has_one_legend() {
        let s = || panel(vec![series("one", &[[1.0, 2.0]])]);
        let text = svg(&[s(), s()]);
        assert!(text.contains("a &amp; b") && text.contains("<title>&lt;1&gt;</title>"));
        assert_eq!(text.matches(">one<").count(), 1);
        assert_eq!(text.matches("<g ").count(), text.matches("</g>").count());
    }

    #[test]
    fn numbers_of_axes_are_short() {
        let all = [0.001, 0.02, 0.5, 1.0, 200.0, 5000.0, 20_000.0, 500_000.0, 2e6].map(short);
        assert_eq!(all, ["0.001", "0.02", "0.5", "1", "200", "5000", "20k", "500k", "2M"]);
    }
}
