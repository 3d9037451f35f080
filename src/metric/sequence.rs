//! A sequence of frames beside its reference, measured frame by frame.

use serde::{Deserialize, Serialize};

use super::causes::Changes;
use super::cpbd::cpbd;
use super::energy;
use super::flicker::{Flicker, FlickerMeter, Lag, Moment};
use super::flip::{Flip, PIXELS_PER_DEGREE};
use super::image::{Frame, Plane};
use super::psnr::psnr;
use super::relative_mse::relative_mse;
use super::rmse::mean_square;
use super::ssim::ssim;
use super::temporal::{Temporal, Unsteadiness};
use super::warp::Geometry;
use crate::{Error, Result};

/// What can be measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Root mean square error, of display and of linear values, and PSNR.
    Rmse,
    /// Relative mean squared error.
    RelativeMse,
    /// Energy ratio.
    Energy,
    /// Structural similarity.
    Ssim,
    /// FLIP.
    Flip,
    /// Sharpness.
    Cpbd,
    /// Standard deviation and second difference of the error over time.
    Temporal,
    /// Excess flicker and flicker error.
    Flicker,
}

impl Metric {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Rmse,
        Self::RelativeMse,
        Self::Energy,
        Self::Ssim,
        Self::Flip,
        Self::Cpbd,
        Self::Temporal,
        Self::Flicker,
    ];

    /// The name it is asked for by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rmse => "rmse",
            Self::RelativeMse => "relative-mse",
            Self::Energy => "energy",
            Self::Ssim => "ssim",
            Self::Flip => "flip",
            Self::Cpbd => "cpbd",
            Self::Temporal => "temporal",
            Self::Flicker => "flicker",
        }
    }
}

/// What is measured and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// What is measured. FLIP, CPBD and SSIM take most of the time.
    pub metrics: Vec<Metric>,
    /// Pixels a degree of visual angle, above 0, for FLIP.
    pub pixels_per_degree: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { metrics: Metric::ALL.to_vec(), pixels_per_degree: PIXELS_PER_DEGREE }
    }
}

/// One frame of the sequence.
#[derive(Debug, Clone, Copy)]
pub struct Step<'a> {
    /// What it is called in the report.
    pub name: &'a str,
    /// What is judged.
    pub frame: &'a Frame,
    /// How it should look.
    pub reference: &'a Frame,
    /// How surfaces moved since the last frame; without it there is no flicker to be told from motion.
    pub geometry: Option<&'a Geometry>,
    /// What happened to the samples of the frame, if known.
    pub changes: Option<&'a Changes>,
}

/// The measures of one frame; those that were not asked for are none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameRow {
    /// What the frame is called.
    pub frame: String,
    /// Single-image measures.
    #[serde(flatten)]
    pub errors: Errors,
    /// Excess flicker of lag 1, against the frame before.
    pub excess_flicker: Option<f64>,
    /// Flicker error of lag 1, against the frame before.
    pub flicker_error: Option<f64>,
}

/// Measures of an image, or of all images of a sequence. None stands for what was not asked for or does not exist, such as
/// the PSNR of equal images, which is infinite.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Mean FLIP, 0..=1.
    pub flip: Option<f64>,
    /// Of display values, 0..=1.
    pub rmse: Option<f64>,
    /// Of linear values.
    pub rmse_linear: Option<f64>,
    /// Of display values, in decibels.
    pub psnr: Option<f64>,
    /// Of linear values.
    pub relative_mse: Option<f64>,
    /// Of display values, -1..=1.
    pub ssim: Option<f64>,
    /// Sharpness of the frame, 0..=1.
    pub cpbd: Option<f64>,
    /// Sharpness of the reference, 0..=1.
    pub cpbd_reference: Option<f64>,
    /// Linear light over that of the reference.
    pub energy_ratio: Option<f64>,
}

/// Unsteadiness in both spaces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TemporalReport {
    /// Of display values.
    pub display: Unsteadiness,
    /// Of linear values.
    pub linear: Unsteadiness,
}

/// All that is known of a sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Pixels across and down.
    pub size: [usize; 2],
    /// How many frames there were.
    pub frames: usize,
    /// Plain means of the frames' values; but RMSE and PSNR are of the mean squared error of all frames, and the energy
    /// ratio is of all light.
    pub mean: Errors,
    /// Changes of the error at fixed places of the screen.
    pub temporal: Option<TemporalReport>,
    /// Changes along the motion; none if no motion was given.
    pub flicker: Option<Flicker>,
    /// Each frame.
    pub per_frame: Vec<FrameRow>,
}

/// Measures frames as they come.
#[derive(Debug)]
pub struct Sequence {
    options: Options,
    flip: Flip,
    size: Option<[usize; 2]>,
    rows: Vec<FrameRow>,
    /// Linear light of all frames and of all references.
    light: [f64; 2],
    display: Temporal,
    linear: Temporal,
    flicker: FlickerMeter,
}

impl Sequence {
    /// Nothing measured yet.
    ///
    /// # Errors
    /// [`Error::Setting`] for a number of pixels a degree that is not above 0.
    pub fn new(options: Options) -> Result<Self> {
        let ppd = options.pixels_per_degree;
        if !(ppd > 0.0 && ppd <= 1000.0) {
            let expected = "a number above 0 and up to 1000".to_owned();
            return Err(Error::Setting { name: "pixels per degree", value: ppd.to_string(), expected });
        }
        Ok(Self {
            flip: Flip::new(ppd),
            options,
            size: None,
            rows: Vec::new(),
            light: [0.0; 2],
            display: Temporal::default(),
            linear: Temporal::default(),
            flicker: FlickerMeter::default(),
        })
    }

    /// Measures the next frame. Returns FLIP's error map, if FLIP is asked for.
    ///
    /// # Errors
    /// [`Error::Frames`] if a size differs or the frame and its reference are not of one dynamic range. The sequence is
    /// then as before.
    pub fn push(&mut self, step: &Step<'_>) -> Result<Option<Plane>> {
        self.check(step)?;
        self.size = Some(step.frame.size());
        let map = self.wants(Metric::Flip).then(|| self.flip.compare(step.frame, step.reference));
        let errors = self.errors(step, map.as_ref());
        if self.wants(Metric::Temporal) {
            self.display.push(step.frame.display(), step.reference.display());
            self.linear.push(step.frame.linear(), step.reference.linear());
        }
        let lag = self.change(step);
        self.rows.push(FrameRow {
            frame: step.name.to_owned(),
            errors,
            excess_flicker: lag.map(|l| l.excess_flicker),
            flicker_error: lag.map(|l| l.flicker_error),
        });
        Ok(map)
    }

    /// The next frame has nothing to do with the last one (a cut, or frames that are missing): flicker starts afresh.
    pub fn cut(&mut self) {
        self.flicker.cut();
    }

    /// Pixels across and down of the frames so far; none before the first.
    pub fn size(&self) -> Option<[usize; 2]> {
        self.size
    }

    /// RMS over time of the flicker error of each pixel, 0..=2, and how many changes were measured there.
    pub fn flicker_map(&self) -> Option<[Plane; 2]> {
        self.flicker.map()
    }

    /// All that was measured.
    pub fn finish(self) -> Report {
        let temporal = TemporalReport { display: self.display.finish(), linear: self.linear.finish() };
        Report {
            size: self.size.unwrap_or_default(),
            frames: self.rows.len(),
            mean: self.mean(),
            temporal: self.wants(Metric::Temporal).then_some(temporal),
            flicker: self.flicker.finish(),
            per_frame: self.rows,
        }
    }

    fn wants(&self, metric: Metric) -> bool {
        self.options.metrics.contains(&metric)
    }

    fn check(&self, step: &Step<'_>) -> Result<()> {
        let size = step.frame.size();
        let expected = [Some(step.reference.size()), self.size];
        let wrong = |message: String| Err(Error::Frames { message: format!("frame {}: {message}", step.name) });
        if let Some([w, h]) = expected.into_iter().flatten().find(|s| *s != size) {
            return wrong(format!("has {}x{} pixels instead of {w}x{h}", size[0], size[1]));
        }
        let pixels = size[0] * size[1];
        let moved = step.geometry.map_or(pixels, |g| g.motion.len().min(g.depth.data.len()));
        let changed = step.changes.map_or(pixels, |c| c.counts.iter().map(Vec::len).min().unwrap_or(0));
        if moved != pixels || changed != pixels {
            return wrong("motion, depth or changes have not a value for each pixel".to_owned());
        }
        if step.frame.range() != step.reference.range() {
            return wrong("the frame and its reference are not both scene-linear or both display values".to_owned());
        }
        Ok(())
    }

    fn errors(&mut self, step: &Step<'_>, map: Option<&Plane>) -> Errors {
        let (frame, reference) = (step.frame, step.reference);
        let mut errors = Errors { flip: map.map(Plane::mean), ..Errors::default() };
        if self.wants(Metric::Rmse) {
            let display = mean_square(frame.display(), reference.display());
            errors.rmse = Some(display.sqrt());
            errors.rmse_linear = Some(mean_square(frame.linear(), reference.linear()).sqrt());
            errors.psnr = psnr(display);
        }
        if self.wants(Metric::Energy) {
            let light = [frame, reference].map(|f| energy::energy(f.linear()));
            errors.energy_ratio = energy::ratio(light[0], light[1]);
            self.light.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
        }
        errors.relative_mse = self.wants(Metric::RelativeMse).then(|| relative_mse(frame.linear(), reference.linear()));
        errors.ssim = self.wants(Metric::Ssim).then(|| ssim(frame, reference)).flatten();
        if self.wants(Metric::Cpbd) {
            (errors.cpbd, errors.cpbd_reference) = rayon::join(|| cpbd(frame), || cpbd(reference));
        }
        errors
    }

    fn change(&mut self, step: &Step<'_>) -> Option<Lag> {
        let geometry = step.geometry.filter(|_| self.wants(Metric::Flicker))?;
        let (frame, reference) = rayon::join(|| step.frame.display_luminance(), || step.reference.display_luminance());
        self.flicker.push(&Moment { frame: &frame, reference: &reference, geometry, changes: step.changes })
    }

    fn mean(&self) -> Errors {
        let plain = |of: fn(&Errors) -> Option<f64>| mean(self.rows.iter().filter_map(|row| of(&row.errors)));
        let pooled = |of: fn(&Errors) -> Option<f64>| {
            mean(self.rows.iter().filter_map(|row| of(&row.errors)).map(|root| root * root))
        };
        let display = pooled(|e| e.rmse);
        Errors {
            flip: plain(|e| e.flip),
            rmse: display.map(f64::sqrt),
            rmse_linear: pooled(|e| e.rmse_linear).map(f64::sqrt),
            psnr: display.and_then(psnr),
            relative_mse: plain(|e| e.relative_mse),
            ssim: plain(|e| e.ssim),
            cpbd: plain(|e| e.cpbd),
            cpbd_reference: plain(|e| e.cpbd_reference),
            energy_ratio: energy::ratio(self.light[0], self.light[1]),
        }
    }
}

/// Arithmetic mean, and none of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u64), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / count as f64)
}
