//! Separable convolution, by rows and by columns.

use std::ops::{AddAssign, Mul};

use rayon::prelude::*;

/// What lies beyond the border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// The nearest pixel of the image.
    Clamp,
    /// Zero.
    Zero,
}

/// A real number that images are made of.
pub trait Real: Copy + Default + Send + Sync + AddAssign + Mul<Output = Self> {}
impl Real for f32 {}
impl Real for f64 {}

/// Correlates each row with `weights`, of which there is an odd number.
pub fn rows<T: Real>(image: &[T], width: usize, weights: &[T], border: Border) -> Vec<T> {
    let radius = weights.len() / 2;
    let mut out = vec![T::default(); image.len()];
    out.par_chunks_mut(width).zip(image.par_chunks(width)).for_each(|(out, row)| {
        let padded = pad(row, radius, border);
        // The inner loop runs along the row, so that it is done several pixels at a time.
        for (tap, &weight) in weights.iter().enumerate() {
            for (out, &value) in out.iter_mut().zip(&padded[tap..]) {
                *out += weight * value;
            }
        }
    });
    out
}

/// Correlates each column with `weights`, of which there is an odd number.
pub fn columns<T: Real>(image: &[T], width: usize, weights: &[T], border: Border) -> Vec<T> {
    let (radius, height) = ((weights.len() / 2) as isize, image.len() / width);
    let mut out = vec![T::default(); image.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (tap, &weight) in weights.iter().enumerate() {
            let wanted = y as isize + tap as isize - radius;
            let inside = wanted.clamp(0, height as isize - 1);
            if inside == wanted || border == Border::Clamp {
                let from = &image[inside as usize * width..][..width];
                for (out, &value) in out.iter_mut().zip(from) {
                    *out += weight * value;
                }
            }
        }
    });
    out
}

fn pad<T: Real>(row: &[T], radius: usize, border: Border) -> Vec<T> {
    let beyond = |end: Option<&T>| match border {
        Border::Clamp => end.copied().unwrap_or_default(),
        Border::Zero => T::default(),
    };
    let mut padded = vec![beyond(row.first()); radius];
    padded.extend_from_slice(row);
    padded.resize(row.len() + 2 * radius, beyond(row.last()));
    padded
}

/// A Gaussian of this standard deviation in pixels at `-radius..=radius`, with sum 1.
pub fn gaussian(sigma: f64, radius: usize) -> Vec<f64> {
    let at = |i: usize| (-0.5 * ((i as f64 - radius as f64) / sigma).powi(2)).exp();
    let weights: Vec<f64> = (0..=2 * radius).map(at).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|w| w / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_columns_do_the_same_to_a_transposed_image() {
        let image: Vec<f64> = (0..35).map(|i| f64::from((i * i) % 11)).collect();
        let transposed: Vec<f64> = (0..35).map(|i| image[(i % 5) * 7 + i / 5]).collect();
        let weights = [0.5, -2.0, 3.0, 0.25, 1.0];
        for border in [Border::Clamp, Border::Zero] {
            let across = rows(&image, 7, &weights, border);
            let down = columns(&transposed, 5, &weights, border);
            let back: Vec<f64> = (0..35).map(|i| down[(i % 7) * 5 + i / 7]).collect();
            assert_eq!(across, back, "{border:?}");
        }
    }

    #[test]
    fn borders() {
        let sum = |border| rows(&[1.0, 2.0, 4.0], 3, &[1.0; 5], border);
        assert_eq!(sum(Border::Clamp), [9.0, 12.0, 15.0]);
        assert_eq!(sum(Border::Zero), [7.0, 7.0, 7.0]);
    }

    #[test]
    fn a_gaussian_sums_to_one_and_falls_as_it_must() {
        let g = gaussian(1.5, 5);
        assert_eq!(g.len(), 11);
        assert!((g.iter().sum::<f64>() - 1.0).abs() < 11.0 * f64::EPSILON);
        assert!((g[6] / g[5] - (-0.5_f64 / 2.25).exp()).abs() < 4.0 * f64::EPSILON);
    }
}
