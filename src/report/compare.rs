//! What is told of two folders of frames: a table, JSON, and maps of where the error is.

use std::path::Path;

use serde::Serialize;

use super::bench::Build;
use super::folder::Kind;
use super::openexr::{Channel, Exr};
use super::png::Picture;
use super::table::Table;
use crate::Result;
use crate::metric::causes::Causes;
use crate::metric::flicker::{Flicker, Lag};
use crate::metric::image::Plane;
use crate::metric::sequence::{Metric, Report};
use crate::metric::warp::Geometry;

/// RMS flicker, in display values, that the flicker map shows in its brightest colour.
pub const FLICKER_WHITE: f32 = 0.25;

/// What `stillray compare --json` writes.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// Version of this format.
    pub schema: u32,
    /// The program that measured.
    pub build: Build,
    /// The folder that is judged.
    pub frames_folder: String,
    /// The folder with what it should look like.
    pub reference_folder: String,
    /// What both have.
    pub kind: Kind,
    /// How it was measured.
    pub settings: Settings,
    /// Along which motion flicker was measured.
    pub motion: Motion,
    /// What was measured.
    #[serde(flatten)]
    pub report: Report,
}

/// How it was measured.
#[derive(Debug, Serialize)]
pub struct Settings {
    /// What was asked for.
    pub metrics: Vec<Metric>,
    /// Stops by which EXR frames are brightened before display values are made of them.
    pub exposure: f64,
    /// `HDR` or `LDR`.
    pub flip: &'static str,
    /// Pixels a degree of visual angle.
    pub flip_ppd: f64,
    /// Added to the squared reference.
    pub relative_mse_epsilon: f64,
}

/// Where motion comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Source {
    /// Read with the reference.
    #[serde(rename = "layers motion and depth of the reference")]
    Layers,
    /// The user says that nothing moves.
    #[serde(rename = "assumed static: --static")]
    Static,
    /// PNG files say nothing of motion.
    #[serde(rename = "assumed static: PNG files have no motion")]
    Png,
    /// Nothing is known, and nothing assumed.
    #[serde(rename = "none: the reference has no layers motion and depth")]
    None,
}

/// Along which motion flicker was measured.
#[derive(Debug, Clone, Serialize)]
pub struct Motion {
    /// Where it comes from.
    pub source: Source,
    /// Mean length of the vectors in pixels a frame, the first frame left out; 0 without any.
    pub mean_pixels: f64,
    /// The longest vector in pixels a frame.
    pub max_pixels: f64,
    /// How often numbers of frames were missing, so that vectors of the frame after lead nowhere.
    pub cuts: usize,
    #[serde(skip)]
    vectors: u64,
}

impl Motion {
    /// None seen so far.
    pub fn new(source: Source) -> Self {
        Self { source, mean_pixels: 0.0, max_pixels: 0.0, cuts: 0, vectors: 0 }
    }

    /// Adds a frame's vectors.
    pub fn add(&mut self, geometry: &Geometry) {
        for [x, y] in &geometry.motion {
            let length = f64::from(*x).hypot(f64::from(*y));
            self.vectors += 1;
            self.mean_pixels += (length - self.mean_pixels) / self.vectors as f64;
            self.max_pixels = self.max_pixels.max(length);
        }
    }

    fn text(&self) -> String {
        match self.source {
            Source::Layers => format!(
                "motion from the reference's layers, {:.2} pixels a frame in the mean and {:.2} at most",
                self.mean_pixels, self.max_pixels
            ),
            Source::Static => "motion: none assumed (--static)".to_owned(),
            Source::Png => "motion: none assumed, as PNG files have none".to_owned(),
            Source::None => "flicker was not measured: the reference has no layers motion and depth".to_owned(),
        }
    }
}

impl Comparison {
    /// For people to read: measures of images, then those of the sequence.
    pub fn text(&self) -> String {
        let report = &self.report;
        let [w, h] = report.size;
        let plural = if report.frames == 1 { "" } else { "s" };
        let folders = format!("{} against {}", self.frames_folder, self.reference_folder);
        let mut text = format!("{} frame{plural} of {w}x{h}, {folders}\n\n{}", report.frames, self.errors());
        if let Some(flicker) = &report.flicker {
            text += &format!("\n{}", flicker_table(flicker));
            if let Some(causes) = &flicker.causes {
                text += &format!("\n{}", causes_table(causes));
            }
        }
        if self.settings.metrics.contains(&Metric::Flicker) {
            text += &format!("\n{}\n", self.motion.text());
        }
        text
    }

    fn errors(&self) -> Table {
        let (mean, mut table) = (&self.report.mean, Table::new(["measure", "value", "equal frames"]));
        let mut row = |name: &str, value: Option<f64>, equal: &str| {
            if let Some(value) = value {
                table.row([name.to_owned(), format!("{value:.5}"), equal.to_owned()]);
            }
        };
        row(&format!("{}-FLIP", self.settings.flip), mean.flip, "0");
        row("RMSE, display", mean.rmse, "0");
        row("RMSE, linear", mean.rmse_linear, "0");
        row("PSNR, display, dB", mean.rmse.map(|_| mean.psnr.unwrap_or(f64::INFINITY)), "inf");
        row("relative MSE, linear", mean.relative_mse, "0");
        row("SSIM, display", mean.ssim, "1");
        row("energy ratio, linear", mean.energy_ratio, "1");
        let sharp = mean.cpbd_reference.map(|v| format!("{v:.5}")).unwrap_or_default();
        row("CPBD sharpness", mean.cpbd, &sharp);
        if let Some(temporal) = &self.report.temporal {
            row("error's deviation over time, display", temporal.display.std, "0");
            row("error's deviation over time, linear", temporal.linear.std, "0");
            row("error's second difference, display", temporal.display.second_difference, "0");
            row("error's second difference, linear", temporal.linear.second_difference, "0");
        }
        table
    }
}

fn flicker_table(flicker: &Flicker) -> Table {
    let lags = &flicker.lags;
    let titles = ["along the motion".to_owned(), "mean".to_owned()];
    let mut table = Table::new(titles.into_iter().chain(lags.iter().map(|l| format!("lag {}", l.lag))));
    let mut row = |name: &str, mean: String, of: &dyn Fn(&Lag) -> String| {
        table.row([name.to_owned(), mean].into_iter().chain(lags.iter().map(of)));
    };
    let five = |v: f64| format!("{v:.5}");
    let percent = |v: f64| format!("{:.1} %", 100.0 * v);
    row("flicker error", five(flicker.flicker_error), &|l| five(l.flicker_error));
    row("excess flicker", five(flicker.excess_flicker), &|l| five(l.excess_flicker));
    row("change of the frames", "-".to_owned(), &|l| five(l.frames));
    row("change of the reference", "-".to_owned(), &|l| five(l.reference));
    row("valid pixels", percent(flicker.valid), &|l| percent(l.valid));
    table
}

fn causes_table(causes: &Causes) -> Table {
    let mut table = Table::new(["flicker error of lag 1 by cause", "share of its square"]);
    let parts = [
        ("new samples", causes.new_sample),
        ("evicted samples", causes.evicted_sample),
        ("visibility changed", causes.visibility_changed),
        ("light changed", causes.light_changed),
        ("unattributed", causes.unattributed),
    ];
    for (name, part) in parts {
        let share = if causes.mean_square > 0.0 { part / causes.mean_square } else { 0.0 };
        table.row([name.to_owned(), format!("{:.1} %", 100.0 * share)]);
    }
    table
}

/// A picture of a plane in the perceptually even colours of Matplotlib's magma, black for 0, brightest from `white` on.
pub fn colored(plane: &Plane, white: f32) -> Picture {
    let color = |value: &f32| {
        let colorous::Color { r, g, b } = colorous::MAGMA.eval_continuous(f64::from((value / white).clamp(0.0, 1.0)));
        [r, g, b]
    };
    Picture { width: plane.width as u32, height: plane.height as u32, rgb: plane.data.iter().flat_map(color).collect() }
}

/// Writes a map as `NAME.png`, coloured, and as `NAME.exr` with the values in channel Y.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Image`] with the file.
pub fn write_map(folder: &Path, name: &str, plane: &Plane, white: f32, layers: &[(&str, &Plane)]) -> Result<()> {
    colored(plane, white).write(&folder.join(format!("{name}.png")))?;
    let channel = |name: &str, plane: &Plane| Channel { name: name.to_owned(), half: false, data: plane.data.clone() };
    let rest = layers.iter().map(|(name, plane)| channel(name, plane));
    let channels = std::iter::once(channel("Y", plane)).chain(rest).collect();
    let exr = Exr { width: plane.width as u32, height: plane.height as u32, fps: None, channels };
    exr.write(&folder.join(format!("{name}.exr")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_go_from_black_to_bright_and_stay_there() {
        let plane = Plane { width: 4, height: 1, data: vec![0.0, 0.05, 0.1, 9.0] };
        let picture = colored(&plane, 0.1);
        let sums: Vec<u32> = picture.rgb.chunks(3).map(|p| p.iter().map(|c| u32::from(*c)).sum()).collect();
        assert!(sums[0] < 10 && sums[0] < sums[1] && sums[1] < sums[2] && sums[2] == sums[3], "{sums:?}");
    }

    #[test]
    fn motion_is_averaged_over_all_vectors() {
        let mut motion = Motion::new(Source::Layers);
        let geometry = |x, y| Geometry { motion: vec![[x, y], [0.0, 0.0]], depth: Plane::zeros(2, 1) };
        motion.add(&geometry(3.0, 4.0));
        motion.add(&geometry(0.0, -1.0));
        assert_eq!((motion.mean_pixels, motion.max_pixels), (1.5, 5.0));
    }
}
