//! Line charts on logarithmic axes, as SVG.

use std::fmt::Write;

/// A line of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// What it shows.
    pub name: String,
    /// Its points; those that a logarithmic axis cannot show (0, negative, not finite) are left out.
    pub points: Vec<(f64, f64)>,
    /// Which colour of the palette.
    pub color: usize,
    /// Dashes, so that lines of one colour can be told apart: 0 none.
    pub dash: usize,
}

/// A chart with both axes logarithmic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// Below the horizontal axis.
    pub x: String,
    /// Beside the vertical axis.
    pub y: String,
    /// Its lines.
    pub series: Vec<Series>,
}

/// Told apart by people who see few colours, too (Okabe & Ito).
const COLORS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];
const DASHES: [&str; 3] = ["", "7 4", "2 3"];
/// Of a chart, pixels.
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 360.0;
/// Around the axes: left, top, right, bottom.
const MARGIN: [f64; 4] = [70.0, 40.0, 20.0, 52.0];

/// Charts side by side, as one SVG document without scripts or references.
pub fn svg(charts: &[Chart]) -> String {
    let width = WIDTH * charts.len().max(1) as f64;
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {HEIGHT}\" width=\"{width}\" height=\"{HEIGHT}\" \
         font-family=\"system-ui, sans-serif\" font-size=\"12\" fill=\"#333\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    for (i, chart) in charts.iter().enumerate() {
        // Writing to a String cannot fail.
        let _ = writeln!(s, "<g transform=\"translate({} 0)\">", WIDTH * i as f64);
        draw(chart, &mut s);
        s += "</g>\n";
    }
    s + "</svg>\n"
}

fn shows(p: &(f64, f64)) -> bool {
    p.0 > 0.0 && p.1 > 0.0 && p.0.is_finite() && p.1.is_finite()
}

/// An axis: the decimal logarithms of its ends, and the pixels they fall on.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Axis {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        values.for_each(|v| (low, high) = (low.min(v.log10()), high.max(v.log10())));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // A little room, and some width where all values are one.
        let room = (0.04 * (high - low)).max(0.05);
        Axis { low: low - room, high: high + room, from, to }
    }

    fn at(&self, v: f64) -> f64 {
        self.from + (v.log10() - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Where to write numbers: at powers of ten, and at 2 and 5 times those where there are few.
    fn ticks(&self) -> Vec<f64> {
        let decades = self.low.floor() as i32..=self.high.ceil() as i32;
        let inside = |v: &f64| (self.low..=self.high).contains(&v.log10());
        let with = |steps: &[f64]| -> Vec<f64> {
            let all = decades.clone().flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
            all.filter(inside).collect()
        };
        let plain = with(&[1.0]);
        if plain.len() >= 3 { plain } else { with(&[1.0, 2.0, 5.0]) }
    }
}

fn draw(chart: &Chart, s: &mut String) {
    let [left, top, right, bottom] = MARGIN;
    let points = || chart.series.iter().flat_map(|l| &l.points).filter(|p| shows(p));
    let x = Axis::new(points().map(|p| p.0), left, WIDTH - right);
    let y = Axis::new(points().map(|p| p.1), HEIGHT - bottom, top);
    let middle = (left + WIDTH - right) / 2.0;
    let _ = writeln!(
        s,
        "<text x=\"{middle}\" y=\"20\" text-anchor=\"middle\" font-size=\"14\" fill=\"#000\">{}</text>",
        escaped(&chart.title)
    );
    for v in x.ticks() {
        let at = x.at(v);
        let _ = writeln!(
            s,
            "<path d=\"M{at:.1} {top}V{:.1}\" stroke=\"#e4e4e4\"/><text x=\"{at:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\">{}</text>",
            HEIGHT - bottom,
            HEIGHT - bottom + 16.0,
            number(v)
        );
    }
    for v in y.ticks() {
        let at = y.at(v);
        let _ = writeln!(
            s,
            "<path d=\"M{left} {at:.1}H{:.1}\" stroke=\"#e4e4e4\"/><text x=\"{:.1}\" y=\"{:.1}\" \
             text-anchor=\"end\">{}</text>",
            WIDTH - right,
            left - 6.0,
            at + 4.0,
            number(v)
        );
    }
    let _ = writeln!(
        s,
        "<text x=\"{middle}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
         <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        HEIGHT - 12.0,
        escaped(&chart.x),
        (top + HEIGHT - bottom) / 2.0,
        escaped(&chart.y)
    );
    for (k, line) in chart.series.iter().enumerate() {
        let color = COLORS[line.color % COLORS.len()];
        let dash = DASHES[line.dash % DASHES.len()];
        let path: Vec<String> = line
            .points
            .iter()
            .filter(|p| shows(p))
            .map(|p| format!("{:.1} {:.1}", x.at(p.0), y.at(p.1)))
            .collect();
        if !path.is_empty() {
            let _ = writeln!(
                s,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"/>",
                path.join("L")
            );
        }
        for at in &path {
            let at = at.replace(' ', "\" cy=\"");
            let _ = writeln!(s, "<circle cx=\"{at}\" r=\"2.5\" fill=\"{color}\"/>");
        }
        let row = top + 12.0 + 16.0 * k as f64;
        let _ = writeln!(
            s,
            "<path d=\"M{} {row}h24\" stroke=\"{color}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\"/>\
             <text x=\"{}\" y=\"{}\">{}</text>",
            left + 10.0,
            left + 40.0,
            row + 4.0,
            escaped(&line.name)
        );
    }
}

/// `0.001`, `20`, `5k`, `1M`, `1e-7`.
fn number(v: f64) -> String {
    match v {
        _ if !(1e-4..1e9).contains(&v) => format!("{v:e}"),
        _ if v >= 1e6 => format!("{}M", (v / 1e6).round()),
        _ if v >= 1e3 => format!("{}k", (v / 1e3).round()),
        _ => super::short(v),
    }
}

fn escaped(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_control())
        .map(|c| match c {
            '&' => "&amp;".into(),
            '<' => "&lt;".into(),
            '>' => "&gt;".into(),
            '"' => "&quot;".into(),
            c => c.to_string(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> Chart {
        let line = Series { name: "a < b & c".into(), points: points.to_vec(), ..Default::default() };
        Chart { title: "t".into(), x: "x".into(), y: "y".into(), series: vec![line] }
    }

    #[test]
    fn points_lie_within_the_axes_and_names_are_text() {
        let s = svg(&[chart(&[(10.0, 0.5), (1000.0, 0.001)]), chart(&[(1.0, 1.0)])]);
        assert!(s.starts_with("<svg") && s.ends_with("</svg>\n") && s.contains("a &lt; b &amp; c"));
        assert_eq!(s.matches("<circle").count(), 3);
        for c in s.split("cx=\"").skip(1) {
            let x: f64 = c.split('"').next().unwrap().parse().unwrap();
            assert!((MARGIN[0]..=WIDTH - MARGIN[2]).contains(&x), "{x}");
        }
    }

    #[test]
    fn what_a_logarithm_cannot_show_is_left_out() {
        let s = svg(&[chart(&[(0.0, 1.0), (1.0, f64::NAN), (1.0, f64::INFINITY), (-1.0, 1.0)])]);
        assert!(!s.contains("<circle") && !s.contains("NaN") && !s.contains("inf"));
    }

    #[test]
    fn numbers_on_the_axes_are_short() {
        assert_eq!([0.5, 20.0, 5e3, 2e6, 1e-7].map(number), ["0.5", "20", "5k", "2M", "1e-7"]);
    }
}
