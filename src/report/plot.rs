//! Lines over a parameter, as SVG.

use super::file::write_text;
use crate::Result;
use std::fmt::Write;
use std::path::Path;

/// Lines in one drawing.
#[derive(Debug, Clone)]
pub struct Plot {
    /// What runs to the right.
    pub across: String,
    /// What runs upwards, from 0.
    pub up: String,
    /// Whether the parameter, which is above 0 then, is shown by its logarithm.
    pub logarithmic: bool,
    /// Name and points of each line, from left to right.
    pub lines: Vec<(String, Vec<[f64; 2]>)>,
}

const SIZE: [f64; 2] = [480.0, 300.0];
/// Left, above, right, below.
const MARGINS: [f64; 4] = [56.0, 16.0, 120.0, 44.0];
const COLORS: [&str; 6] = ["#2b6cff", "#e8761c", "#1f9d55", "#b0228c", "#6b7280", "#c9a800"];

impl Plot {
    /// The drawing.
    pub fn svg(&self) -> String {
        let [width, height] = SIZE;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        );
        let points = || self.lines.iter().flat_map(|(_, points)| points);
        let mut values: Vec<f64> = points().map(|p| p[0]).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let top = round_up(points().map(|p| p[1]).fold(0.0, f64::max));
        self.axes(&mut text, &values, top);
        for (i, (name, points)) in self.lines.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let at: Vec<[f64; 2]> = points.iter().map(|p| self.place(*p, &values, top)).collect();
            let path: Vec<String> = at.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            let path = path.join(" ");
            let _ =
                writeln!(text, "<polyline points=\"{path}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\"/>");
            for [x, y] in &at {
                let _ = writeln!(text, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{color}\"/>");
            }
            let (x, y) = (width - MARGINS[2] + 12.0, MARGINS[1] + 12.0 + 16.0 * i as f64);
            let _ = writeln!(text, "<text x=\"{x}\" y=\"{y}\" fill=\"{color}\">{name}</text>");
        }
        text.push_str("</svg>\n");
        text
    }

    fn axes(&self, text: &mut String, values: &[f64], top: f64) {
        let [left, above, right, below] = MARGINS;
        let (end, bottom) = (SIZE[0] - right, SIZE[1] - below);
        for step in 0..=4 {
            let value = top * f64::from(step) / 4.0;
            let y = bottom - (bottom - above) * f64::from(step) / 4.0;
            let _ = writeln!(text, "<line x1=\"{left}\" y1=\"{y}\" x2=\"{end}\" y2=\"{y}\" stroke=\"#dddddd\"/>");
            let _ = writeln!(text, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{value}</text>", left - 6.0, y + 4.0);
        }
        for value in values {
            let [x, _] = self.place([*value, 0.0], values, top);
            let y = bottom + 14.0;
            let _ = writeln!(text, "<text x=\"{x:.1}\" y=\"{y}\" text-anchor=\"middle\">{value}</text>");
        }
        let middle = [f64::midpoint(left, end), SIZE[1] - 10.0];
        let _ = writeln!(
            text,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            middle[0], middle[1], self.across
        );
        let y = f64::midpoint(above, bottom);
        let _ = writeln!(
            text,
            "<text x=\"14\" y=\"{y}\" text-anchor=\"middle\" transform=\"rotate(-90 14 {y})\">{}</text>",
            self.up
        );
    }

    /// Where a point is drawn.
    fn place(&self, [x, y]: [f64; 2], values: &[f64], top: f64) -> [f64; 2] {
        let [left, above, right, below] = MARGINS;
        let (end, bottom) = (SIZE[0] - right, SIZE[1] - below);
        let scale = |x: f64| if self.logarithmic { x.ln() } else { x };
        let (low, high) = (values.first().map_or(0.0, |v| scale(*v)), values.last().map_or(1.0, |v| scale(*v)));
        let part = if high > low { (scale(x) - low) / (high - low) } else { 0.5 };
        [left + (end - left) * part, bottom - (bottom - above) * if top > 0.0 { y / top } else { 0.0 }]
    }

    /// Writes the drawing; the file is whole or not there.
    ///
    /// # Errors
    /// [`crate::Error::Io`] with `path`.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_text(path, &self.svg())
    }
}

/// The next of 1, 2, 4 and 8 times a power of ten, whose quarters are short numbers.
fn round_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let power = 10.0_f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 4.0, 8.0, 10.0].map(|step| step * power);
    steps.into_iter().find(|step| *step >= value).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_span_the_drawing_from_zero() {
        let lines = vec![("a".to_owned(), vec![[32.0, 0.0], [256.0, 3.0], [2048.0, 4.0]])];
        let plot = Plot { across: "exponent".into(), up: "triangles".into(), logarithmic: true, lines };
        let values = [32.0, 256.0, 2048.0];
        let [x, y] = plot.place([256.0, 2.0], &values, 4.0);
        assert!((x - f64::midpoint(56.0, 360.0)).abs() < 1e-9 && (y - f64::midpoint(16.0, 256.0)).abs() < 1e-9);
        let text = plot.svg();
        assert!(text.contains("56.0,256.0") && text.contains("360.0,16.0") && text.contains(">exponent<"), "{text}");
        assert_eq!(text.matches("<circle").count(), 3);
    }

    #[test]
    fn axes_end_at_short_numbers() {
        for (value, end) in [(3.2, 4.0), (4.1, 8.0), (81.0, 100.0), (0.02, 0.02), (0.0, 1.0), (f64::NAN, 1.0)] {
            assert!((round_up(value) - end).abs() <= 1e-12 * end, "{value}");
        }
    }
}
