//! Sample distributions as SVG: a part of a frame, pixel by pixel, with its samples on it (paper 1, figures 6 and 10).

use super::file::write_text;
use super::png::Picture;
use crate::Result;
use crate::samples::{SampleKind, SamplePoint};
use std::fmt::Write;
use std::path::Path;

/// Side of a pixel in the drawing's units.
const SIDE: u32 = 20;

/// A rectangle of a frame, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    /// Upper left corner.
    pub low: [u32; 2],
    /// Width and height.
    pub size: [u32; 2],
}

impl Area {
    /// A square around a point, moved so that it lies inside a frame that is at least as large.
    pub fn around(middle: [u32; 2], side: u32, frame: [u32; 2]) -> Self {
        let low = [0, 1].map(|i| middle[i].saturating_sub(side / 2).min(frame[i].saturating_sub(side)));
        Self { low, size: [side; 2] }
    }

    /// The part of a picture inside, with every pixel `scale` times as wide and high.
    pub fn cut(self, picture: &Picture, scale: u32) -> Picture {
        let [width, height] = self.size.map(|side| side * scale);
        let places = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        let rgb = places.flat_map(|[x, y]| pixel(picture, [self.low[0] + x / scale, self.low[1] + y / scale]));
        Picture { width, height, rgb: rgb.collect() }
    }
}

fn pixel(picture: &Picture, [x, y]: [u32; 2]) -> [u8; 3] {
    let first = 3 * (y as usize * picture.width as usize + x as usize);
    let at = |c: usize| picture.rgb.get(first + c).copied().unwrap_or(0);
    [at(0), at(1), at(2)]
}

/// Fill colours as in the paper: blue for what is seen, yellow for the environment behind it, red for what is hidden.
fn color(kind: SampleKind) -> &'static str {
    match kind {
        SampleKind::Surface => "#2b6cff",
        SampleKind::Environment => "#ffd21e",
        SampleKind::Occluded => "#e8261c",
    }
}

/// The drawing.
pub fn svg(picture: &Picture, samples: &[SamplePoint], area: Area) -> String {
    let [width, height] = area.size.map(|side| side * SIDE);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\">\n"
    );
    for y in 0..area.size[1] {
        for x in 0..area.size[0] {
            let [r, g, b] = pixel(picture, [area.low[0] + x, area.low[1] + y]);
            let (left, top) = (x * SIDE, y * SIDE);
            let _ = writeln!(
                text,
                "<rect x=\"{left}\" y=\"{top}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"#{r:02x}{g:02x}{b:02x}\" \
                 stroke=\"#808080\" stroke-width=\"0.5\"/>"
            );
        }
    }
    for sample in samples {
        let [x, y] = [0, 1].map(|i| (sample.at[i] - area.low[i] as f32) * SIDE as f32);
        if (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y) {
            let fill = color(sample.kind);
            let _ = writeln!(
                text,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{fill}\" stroke=\"white\" stroke-width=\"0.7\"/>"
            );
        }
    }
    text.push_str("</svg>\n");
    text
}

/// Writes the drawing; the file is whole or not there.
///
/// # Errors
/// [`crate::Error::Io`] with `path`.
pub fn write(path: &Path, picture: &Picture, samples: &[SamplePoint], area: Area) -> Result<()> {
    write_text(path, &svg(picture, samples, area))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Picture {
        Picture { width: 4, height: 3, rgb: (0..36).collect() }
    }

    #[test]
    fn areas_stay_inside() {
        let at = |middle| Area::around(middle, 4, [10, 8]);
        assert_eq!(at([5, 4]), Area { low: [3, 2], size: [4, 4] });
        assert_eq!(at([0, 9]), Area { low: [0, 4], size: [4, 4] });
    }

    #[test]
    fn parts_of_pictures_are_magnified() {
        let part = Area { low: [1, 2], size: [2, 1] }.cut(&picture(), 2);
        let (a, b) = ([27, 28, 29], [30, 31, 32]);
        assert_eq!((part.width, part.height), (4, 2));
        assert_eq!(part.rgb, [a, a, b, b, a, a, b, b].concat());
    }

    #[test]
    fn samples_in_the_area_are_drawn_in_their_colours() {
        let sample = |at, kind| SamplePoint { at, kind };
        let samples = [
            sample([1.5, 1.25], SampleKind::Surface),
            sample([2.0, 2.0], SampleKind::Occluded),
            sample([0.5, 1.5], SampleKind::Environment), // to the left of the area
        ];
        let text = svg(&picture(), &samples, Area { low: [1, 1], size: [2, 2] });
        assert_eq!(text.matches("<rect").count(), 4);
        assert!(text.contains("cx=\"10.0\" cy=\"5.0\" r=\"3\" fill=\"#2b6cff\""), "{text}");
        assert!(text.contains("cx=\"20.0\" cy=\"20.0\" r=\"3\" fill=\"#e8261c\""), "{text}");
        assert!(!text.contains("#ffd21e"), "{text}");
        // The first pixel of the area is the picture's sixth.
        assert!(text.contains("fill=\"#0f1011\""), "{text}");
    }
}
