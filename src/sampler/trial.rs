//! How well strategies integrate: the error of the mean over 4 × 4 pixels, against closed forms.
//!
//! What is integrated is what a distribution ray tracer meets: an edge between light and shadow, across all dimensions of a
//! path at once ([`Shape::Edge`]), and smooth products ([`Shape::Smooth`]), each a little different from pixel to pixel.

use super::{Sampler, Strategy, Tiling};
use crate::oracle::random::{hash_combine, hash_uint};
use serde::Serialize;

/// What is integrated over the unit cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// 1 on one side of a plane, and 0 on the other.
    Edge,
    /// A product of straight lines, with the mean 1.
    Smooth,
}

/// A root mean square error with half the width of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measured {
    /// Root mean square over trials.
    pub rmse: f64,
    /// Half the width of the interval.
    pub half_width: f64,
}

/// An integrand of one trial.
struct Integrand {
    shape: Shape,
    /// Of the plane's normal, 0.2 to 1; or slopes, -1 to 1.
    weights: Vec<f64>,
    /// Where the plane lies in the first pixel, and by how much farther in pixels across and down.
    place: f64,
    step: [f64; 2],
}

impl Integrand {
    fn new(shape: Shape, dimensions: u32, trial: u32) -> Self {
        let random = |k: u32| f64::from(hash_combine(hash_combine(0x7ea1, trial), k)) / 4_294_967_296.0;
        let weights: Vec<f64> = match shape {
            Shape::Edge => (0..dimensions).map(|i| 0.2 + 0.8 * random(i)).collect(),
            Shape::Smooth => (0..dimensions).map(|i| 2.0 * random(i) - 1.0).collect(),
        };
        let sum: f64 = weights.iter().sum();
        let step = [random(100), random(101)].map(|r| 0.02 * (r - 0.5) * sum);
        Self { shape, place: sum * (0.3 + 0.4 * random(102)), step, weights }
    }

    fn place(&self, [x, y]: [u32; 2]) -> f64 {
        self.place + self.step[0] * f64::from(x) + self.step[1] * f64::from(y)
    }

    fn value(&self, pixel: [u32; 2], at: impl Fn(u32) -> f64) -> f64 {
        let terms = self.weights.iter().zip(0..);
        match self.shape {
            Shape::Edge => f64::from(u8::from(terms.map(|(w, d)| w * at(d)).sum::<f64>() < self.place(pixel))),
            Shape::Smooth => terms.map(|(w, d)| 1.0 + w * (2.0 * at(d) - 1.0)).product(),
        }
    }

    fn exact(&self, pixel: [u32; 2]) -> f64 {
        match self.shape {
            Shape::Edge => volume(&self.weights, self.place(pixel)),
            Shape::Smooth => 1.0,
        }
    }
}

/// The part of the unit cube where the weighted sum of the coordinates is less than `limit`, for positive weights: the volume
/// of a simplex, less those that stick out of the cube, by inclusion and exclusion over the cube's corners.
pub fn volume(weights: &[f64], limit: f64) -> f64 {
    let n = weights.len();
    let corner = |set: u32| {
        let inside = weights.iter().enumerate().filter(|(i, _)| set >> i & 1 != 0).map(|(_, w)| w).sum::<f64>();
        let sign = if set.count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * (limit - inside).max(0.0).powi(n as i32)
    };
    let scale: f64 = weights.iter().zip(1..).map(|(w, i)| w * f64::from(i)).product();
    ((0..1_u32 << n).map(corner).sum::<f64>() / scale).clamp(0.0, 1.0)
}

/// The error of a strategy at `count` samples a pixel: of the mean over 4 × 4 pixels, over so many trials, each with another
/// integrand, seed and place.
pub fn measure(strategy: Strategy, tiling: Tiling, shape: Shape, dimensions: u32, count: u32, trials: u32) -> Measured {
    let squares: Vec<f64> =
        (0..trials).map(|trial| error(strategy, tiling, shape, dimensions, count, trial).powi(2)).collect();
    let n = f64::from(trials.max(1));
    let mean = squares.iter().sum::<f64>() / n;
    let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let rmse = mean.sqrt();
    // The delta method: the error of a root is that of what is under it, over twice the root.
    Measured { rmse, half_width: if rmse > 0.0 { 1.96 * (variance / n).sqrt() / (2.0 * rmse) } else { 0.0 } }
}

fn error(strategy: Strategy, tiling: Tiling, shape: Shape, dimensions: u32, count: u32, trial: u32) -> f64 {
    let sampler = Sampler::new(strategy, tiling, count, 1 + trial);
    let integrand = Integrand::new(shape, dimensions, trial);
    let h = hash_uint(trial);
    let corner = [h % 64 * 4, h / 64 % 64 * 4];
    let mut difference = 0.0;
    for i in 0..16 {
        let inside = [i % 4, i / 4];
        let pixel = [0, 1].map(|axis| corner[axis] + inside[axis]);
        let at = |sample: u32, d: u32| f64::from(sampler.coordinate(pixel, sample, d)) / 4_294_967_296.0;
        let sum: f64 = (0..count).map(|sample| integrand.value(inside, |d| at(sample, d))).sum();
        difference += sum / f64::from(count) - integrand.exact(inside);
    }
    difference / 16.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_are_those_of_simple_bodies() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(volume(&[1.0], 0.3), 0.3);
        close(volume(&[1.0, 1.0], 0.5), 0.125);
        close(volume(&[0.5, 1.0], 1.5), 1.0);
        close(volume(&[1.0, 2.0], 1.5), 0.5);
        // A plane through the middle halves any cube.
        for n in 1..=9 {
            let weights: Vec<f64> = (0..n).map(|i| 0.2 + 0.09 * f64::from(i)).collect();
            assert!((volume(&weights, 0.5 * weights.iter().sum::<f64>()) - 0.5).abs() < 1e-9, "{n}");
        }
    }

    /// Independent samples have the error that their variance says: this is what makes the other numbers believable.
    #[test]
    fn random_numbers_err_as_they_must() {
        for (dimensions, count) in [(2, 4), (6, 16)] {
            let measured = measure(Strategy::Random, Tiling::Regular, Shape::Edge, dimensions, count, 400);
            let variance = |trial: u32| {
                let integrand = Integrand::new(Shape::Edge, dimensions, trial);
                let of = |i: u32| integrand.exact([i % 4, i / 4]);
                (0..16).map(|i| of(i) * (1.0 - of(i))).sum::<f64>() / (256.0 * f64::from(count))
            };
            let expected = ((0..400).map(variance).sum::<f64>() / 400.0).sqrt();
            assert!((measured.rmse - expected).abs() < 2.0 * measured.half_width, "{measured:?} {expected}");
        }
    }

    /// More than twice the interval apart, in both shapes.
    #[test]
    fn cooperation_and_sequences_help() {
        for shape in [Shape::Edge, Shape::Smooth] {
            let of = |strategy| measure(strategy, Tiling::Sudoku, shape, 2, 16, 200);
            let less = |a: Strategy, b: Strategy| {
                let (x, y) = (of(a), of(b));
                assert!(x.rmse + 2.0 * (x.half_width + y.half_width) < y.rmse, "{} {x:?} {} {y:?}", a.name(), b.name());
            };
            less(Strategy::Jittered, Strategy::Random);
            less(Strategy::Sudoku, Strategy::Jittered);
            less(Strategy::Hammersley, Strategy::HammersleyUncooperative);
            less(Strategy::Sobol, Strategy::Jittered);
        }
    }
}
