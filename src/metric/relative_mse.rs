//! Relative mean squared error of linear values: the mean of (f - r)² / (r² + 0.01), each channel by itself. Range 0
//! (equal) and up, no unit; lower is better.
//!
//! The measure of most papers on rendering (Rousselle et al. 2011, *Adaptive Sampling and Reconstruction using Greedy
//! Error Minimization*, section 5): an error counts by what it is of the light there.

use super::image::Rgb;

/// Keeps black reference pixels from dominating.
pub const EPSILON: f64 = 0.01;

/// Mean over pixels and channels of the relative squared error.
pub fn relative_mse(frame: &Rgb, reference: &Rgb) -> f64 {
    let relative = |(f, r): (&f32, &f32)| {
        let (f, r) = (f64::from(*f), f64::from(*r));
        (f - r).powi(2) / (r * r + EPSILON)
    };
    let sums = frame.iter().zip(reference).map(|(f, r)| f.iter().zip(r).map(relative).sum::<f64>());
    sums.sum::<f64>() / (3 * frame[0].len()).max(1) as f64
}
