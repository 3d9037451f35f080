//! Structural similarity of display values (Wang et al. 2004, *Image Quality Assessment: From Error Visibility to
//! Structural Similarity*). Range -1..=1, 1 for equal images; no unit; higher is better. Symmetric.
//!
//! An 11x11 Gaussian window with a standard deviation of 1.5, population covariances, K1 = 0.01, K2 = 0.03 for a range of 1,
//! each channel by itself. Means are over pixels whose window lies inside the image, as in `scikit-image`.

use rayon::prelude::*;

use super::convolve::{Border, columns, gaussian, rows};
use super::image::Frame;

const RADIUS: usize = 5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Mean structural similarity, or none where the image is smaller than the window.
pub fn ssim(frame: &Frame, reference: &Frame) -> Option<f64> {
    let [width, height] = frame.size();
    if width.min(height) < 2 * RADIUS + 1 {
        return None;
    }
    let window = gaussian(1.5, RADIUS);
    let channels: Vec<f64> = frame
        .display()
        .par_iter()
        .zip(reference.display())
        .map(|(f, r)| similarity(&widen(f), &widen(r), width, &window))
        .collect();
    Some(channels.iter().sum::<f64>() / 3.0)
}

fn widen(plane: &[f32]) -> Vec<f64> {
    plane.iter().map(|v| f64::from(*v)).collect()
}

fn similarity(f: &[f64], r: &[f64], width: usize, window: &[f64]) -> f64 {
    let blur = |image: &[f64]| columns(&rows(image, width, window, Border::Clamp), width, window, Border::Clamp);
    let product = |a: &[f64], b: &[f64]| blur(&a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>());
    let (mean_f, mean_r) = (blur(f), blur(r));
    let (ff, rr, fr) = (product(f, f), product(r, r), product(f, r));
    let at = |i: usize| {
        let (mf, mr) = (mean_f[i], mean_r[i]);
        let (vf, vr, cov) = (ff[i] - mf * mf, rr[i] - mr * mr, fr[i] - mf * mr);
        (2.0 * mf * mr + C1) * (2.0 * cov + C2) / ((mf * mf + mr * mr + C1) * (vf + vr + C2))
    };
    let height = f.len() / width;
    let inside = (RADIUS..height - RADIUS).flat_map(|y| (RADIUS..width - RADIUS).map(move |x| y * width + x));
    inside.map(at).sum::<f64>() / ((width - 2 * RADIUS) * (height - 2 * RADIUS)) as f64
}
