//! How much the error changes over time at fixed places of the screen, with e = frame - reference of each pixel and channel.
//!
//! - Standard deviation: the mean over pixels and channels of e's standard deviation over time (population). It sees slow
//!   drifts as well as what alternates.
//! - Second difference: the mean over pixels, channels and frames of |e(t+1) - 2 e(t) + e(t-1)|, blind to an error that is
//!   constant or drifts evenly, and most sensitive to one that alternates.
//!
//! Range 0 (steady) and up, in the unit of the values; lower is better. Since the reference is taken away first, a moving
//! picture without error has none. An error that is attached to a moving surface, however, counts as unsteady here: that is
//! what [`flicker`](super::flicker) tells apart.

use serde::{Deserialize, Serialize};

use super::image::Rgb;

/// Both measures of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Unsteadiness {
    /// Mean standard deviation over time; none of fewer than two frames.
    pub std: Option<f64>,
    /// Mean second difference; none of fewer than three frames.
    pub second_difference: Option<f64>,
}

/// Sums over the frames so far, in one space.
#[derive(Debug, Clone, Default)]
pub struct Temporal {
    frames: usize,
    pixels: Vec<Moments>,
    second_differences: f64,
}

/// A channel of a pixel over time.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    mean: f64,
    /// Sum of squared deviations from the mean.
    squares: f64,
    last: f64,
    before_last: f64,
}

impl Temporal {
    /// Adds a frame, of the same size as those before.
    pub fn push(&mut self, frame: &Rgb, reference: &Rgb) {
        self.frames += 1;
        self.pixels.resize(3 * frame[0].len(), Moments::default());
        let errors = frame.iter().flatten().zip(reference.iter().flatten()).map(|(f, r)| f64::from(f - r));
        let mut bend = 0.0;
        for (pixel, error) in self.pixels.iter_mut().zip(errors) {
            // Welford's update: no difference of large sums.
            let deviation = error - pixel.mean;
            pixel.mean += deviation / self.frames as f64;
            pixel.squares += deviation * (error - pixel.mean);
            bend += (error - 2.0 * pixel.last + pixel.before_last).abs();
            (pixel.before_last, pixel.last) = (pixel.last, error);
        }
        if self.frames >= 3 {
            self.second_differences += bend / self.pixels.len().max(1) as f64;
        }
    }

    /// The measures of what was added.
    pub fn finish(&self) -> Unsteadiness {
        let n = self.frames as f64;
        let std = || self.pixels.iter().map(|p| (p.squares / n).sqrt()).sum::<f64>() / self.pixels.len().max(1) as f64;
        Unsteadiness {
            std: (self.frames >= 2).then(std),
            second_difference: (self.frames >= 3).then(|| self.second_differences / (n - 2.0)),
        }
    }
}
