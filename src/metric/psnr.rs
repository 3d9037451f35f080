//! Peak signal-to-noise ratio of display values, in decibels, for a peak of 1. Infinite for equal images; higher is better.
//!
//! Over a sequence it is that of the mean squared error of all frames.

/// The ratio for a mean squared error; `None` stands for infinity.
pub fn psnr(mean_square: f64) -> Option<f64> {
    (mean_square > 0.0).then(|| -10.0 * mean_square.log10())
}
