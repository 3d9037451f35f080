//! What makes a pixel change, told by what happened to its samples: see [`flicker`](super::flicker).

use serde::{Deserialize, Serialize};

/// Samples of each pixel that are new, that were evicted, whose visibility has changed, and whose light has changed since
/// the last frame: four planes of counts, 0 and up.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// Pixels across.
    pub width: usize,
    /// As many values each as there are pixels.
    pub counts: [Vec<f32>; 4],
}

/// Which of the four causes occur.
pub type Present = [bool; 4];

/// The mean square of the flicker error of lag 1, and the parts that add up to it. All in squared display values, 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Causes {
    /// The sum of the others.
    pub mean_square: f64,
    /// Samples were added.
    pub new_sample: f64,
    /// Samples were evicted.
    pub evicted_sample: f64,
    /// Samples appeared or were hidden.
    pub visibility_changed: f64,
    /// Lights reach samples that they did not reach, or the other way round.
    pub light_changed: f64,
    /// None of these: weights, and shading that depends on the view.
    pub unattributed: f64,
}

/// Sums of squares by cause, and without one.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shares {
    sums: [f64; 5],
}

impl Changes {
    /// Of each pixel, which causes occur among the 3x3 around it.
    pub(super) fn nearby(&self) -> Vec<Present> {
        let pixels = self.counts[0].len();
        let (width, height) = (self.width, pixels / self.width);
        let around = |i: usize, cause: usize| {
            let near = |at: usize, length: usize| at.saturating_sub(1)..(at + 2).min(length);
            let mut rows = near(i / width, height);
            rows.any(|y| near(i % width, width).any(|x| self.counts[cause][y * width + x] > 0.0))
        };
        (0..pixels).map(|i| std::array::from_fn(|cause| around(i, cause))).collect()
    }
}

impl Shares {
    /// Shares a square equally among the causes that occur.
    pub(super) fn share(&mut self, square: f64, present: Present) {
        let count = present.iter().filter(|p| **p).count();
        if count == 0 {
            self.sums[4] += square;
        }
        for (sum, _) in self.sums.iter_mut().zip(present).filter(|(_, present)| *present) {
            *sum += square / count as f64;
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, part)| *sum += part);
    }

    /// Means over this many pixels.
    pub(super) fn finish(&self, pixels: u64) -> Causes {
        let [new_sample, evicted_sample, visibility_changed, light_changed, unattributed] =
            self.sums.map(|sum| sum / pixels.max(1) as f64);
        Causes {
            mean_square: new_sample + evicted_sample + visibility_changed + light_changed + unattributed,
            new_sample,
            evicted_sample,
            visibility_changed,
            light_changed,
            unattributed,
        }
    }
}
