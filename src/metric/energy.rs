//! Energy ratio: the sum of all linear values over that of the reference. Above 0 for light; 1 means that as much light
//! arrives. No unit. It is blind to light in the wrong place.

use super::image::Rgb;

/// Sum over pixels and channels of the linear values.
pub fn energy(linear: &Rgb) -> f64 {
    linear.iter().map(|plane| plane.iter().map(|v| f64::from(*v)).sum::<f64>()).sum()
}

/// `frame / reference`, and none of a black reference.
pub fn ratio(frame: f64, reference: f64) -> Option<f64> {
    (reference != 0.0).then(|| frame / reference)
}
