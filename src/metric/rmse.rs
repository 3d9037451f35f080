//! Root mean square error. Range 0 (equal) and up, in the unit of the values; lower is better.
//!
//! Over all pixels and channels alike, of display values or of linear ones. Over a sequence it is the root of the mean of
//! the squares of all frames, not a mean of roots.

use super::image::Rgb;

/// Mean over pixels and channels of the squared difference.
pub fn mean_square(frame: &Rgb, reference: &Rgb) -> f64 {
    let square = |(f, r): (&f32, &f32)| (f64::from(*f) - f64::from(*r)).powi(2);
    let sums = frame.iter().zip(reference).map(|(f, r)| f.iter().zip(r).map(square).sum::<f64>());
    sums.sum::<f64>() / (3 * frame[0].len()).max(1) as f64
}
