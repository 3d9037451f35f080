//! Canny's edge detector (1986, *A Computational Approach to Edge Detection*), as `scikit-image` has it by default: standard
//! deviation 1, thresholds 0.1 and 0.2. CPBD runs it on values from 0 to 255, of which nearly every gradient is an edge.

use super::convolve::{Border, columns, gaussian, rows};

const SIGMA: f64 = 1.0;
/// Where the Gaussian is cut: four standard deviations.
const RADIUS: usize = 4;
/// What a pixel needs to belong to an edge, and what one of the edge's pixels needs.
const THRESHOLDS: [f64; 2] = [0.1, 0.2];

/// Whether each pixel is on an edge. The outermost pixels never are.
pub fn canny(image: &[f64], width: usize) -> Vec<bool> {
    let smooth = smoothed(image, width);
    let derivative = [-1.0, 0.0, 1.0];
    let average = [1.0, 2.0, 1.0];
    let dx = columns(&rows(&smooth, width, &derivative, Border::Clamp), width, &average, Border::Clamp);
    let dy = rows(&columns(&smooth, width, &derivative, Border::Clamp), width, &average, Border::Clamp);
    let magnitude: Vec<f64> = dx.iter().zip(&dy).map(|(x, y)| (x * x + y * y).sqrt()).collect();
    let height = image.len() / width;
    let mut thin = vec![0.0; image.len()];
    for y in 1..height.saturating_sub(1) {
        for i in y * width + 1..(y + 1) * width - 1 {
            if magnitude[i] >= THRESHOLDS[0] && is_ridge(&magnitude, width, i, dx[i], dy[i]) {
                thin[i] = magnitude[i];
            }
        }
    }
    grow(&thin, width)
}

/// Gaussian mean of the pixels inside the image.
fn smoothed(image: &[f64], width: usize) -> Vec<f64> {
    let weights = gaussian(SIGMA, RADIUS);
    let blur = |image: &[f64]| rows(&columns(image, width, &weights, Border::Zero), width, &weights, Border::Zero);
    let inside = blur(&vec![1.0; image.len()]);
    blur(image).iter().zip(&inside).map(|(sum, weight)| sum / (weight + f64::EPSILON)).collect()
}

/// Whether neither side along the gradient exceeds the pixel, with values interpolated between the two neighbours there.
fn is_ridge(magnitude: &[f64], width: usize, i: usize, dx: f64, dy: f64) -> bool {
    // Zero counts as negative on both axes.
    let (right, down) = (dx > 0.0, dy > 0.0);
    let (ax, ay) = (dx.abs(), dy.abs());
    let along_x = if right == down { ay <= ax } else { ay < ax };
    let weight = if along_x { ay / ax } else { ax / ay };
    let row = width as isize;
    let straight = if along_x {
        1
    } else if right == down {
        row
    } else {
        -row
    };
    let diagonal = if right == down { row + 1 } else { 1 - row };
    let at = |step: isize| i.checked_add_signed(step).map_or(0.0, |n| magnitude[n]);
    let side = |sign: isize| at(sign * diagonal) * weight + at(sign * straight) * (1.0 - weight);
    side(1) <= magnitude[i] && side(-1) <= magnitude[i]
}

/// Pixels that are connected, diagonals included, to one above the higher threshold.
fn grow(thin: &[f64], width: usize) -> Vec<bool> {
    let mut found: Vec<bool> = thin.iter().map(|m| *m >= THRESHOLDS[1]).collect();
    let mut open: Vec<usize> = (0..thin.len()).filter(|i| found[*i]).collect();
    while let Some(i) = open.pop() {
        // What is thin is never on the border, so all neighbours exist.
        for step in [1, width - 1, width, width + 1] {
            for n in [i - step, i + step] {
                if thin[n] > 0.0 && !found[n] {
                    found[n] = true;
                    open.push(n);
                }
            }
        }
    }
    found
}
