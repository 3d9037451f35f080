//! Bias: by how much an image is too bright or too dark over a part of it, (Σ f - Σ r) / Σ r. Range -1 (all is missing) and
//! up, 0 for none; no unit.
//!
//! Over strands whose exact coverage is known it tells whether edges have thickened: frames whose strands emit 1 before a
//! black background show coverage itself, and so a bias of 0.2 means strands that are a fifth too thick.

use super::image::Plane;

/// Relative error of the sum over the pixels of `mask`; none if the reference is 0 there, or sizes differ.
pub fn relative_bias(frame: &Plane, reference: &Plane, mask: &[bool]) -> Option<f64> {
    let sum = |plane: &Plane| {
        let chosen = plane.data.iter().zip(mask).filter(|(_, chosen)| **chosen);
        chosen.map(|(v, _)| f64::from(*v)).sum::<f64>()
    };
    let same = frame.data.len() == reference.data.len() && mask.len() == reference.data.len();
    let expected = sum(reference);
    (same && expected != 0.0).then(|| (sum(frame) - expected) / expected)
}

/// Relative error of `frame`, where 1 is a covered pixel and 0 an empty one, against exact coverage in 0..=1, around edges.
///
/// The sum is over the 3x3 neighbourhoods of partially covered pixels: a reconstruction filter spreads light that far, and
/// what it moves there and back is no bias.
pub fn coverage_bias(frame: &Plane, coverage: &Plane) -> Option<f64> {
    let partial: Vec<bool> = coverage.data.iter().map(|c| *c > 0.0 && *c < 1.0).collect();
    let (width, height) = (coverage.width, coverage.height);
    let around = |i: usize| {
        let (x, y) = (i % width, i / width);
        let near = |at: usize, length: usize| at.saturating_sub(1)..(at + 2).min(length);
        near(y, height).any(|y| near(x, width).any(|x| partial[y * width + x]))
    };
    let mask: Vec<bool> = (0..partial.len()).map(around).collect();
    relative_bias(frame, coverage, &mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(width: usize, data: &[f32]) -> Plane {
        Plane { width, height: data.len() / width, data: data.to_vec() }
    }

    #[test]
    fn thickened_blurred_and_missing_strands() {
        let exact = plane(7, &[0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0]);
        assert_eq!(coverage_bias(&exact, &exact), Some(0.0));
        let thick = plane(7, &[0.0, 0.25, 0.75, 1.0, 0.75, 0.25, 0.0]);
        assert_eq!(coverage_bias(&thick, &exact), Some(0.5));
        let blurred = plane(7, &[0.0, 0.125, 0.5, 0.75, 0.5, 0.125, 0.0]);
        assert_eq!(coverage_bias(&blurred, &exact), Some(0.0));
        assert_eq!(coverage_bias(&plane(7, &[0.0; 7]), &exact), Some(-1.0));
    }

    #[test]
    fn where_no_edge_is_nothing_is_measured() {
        let full = plane(3, &[1.0; 9]);
        assert_eq!(coverage_bias(&full, &full), None);
        assert_eq!(relative_bias(&full, &plane(3, &[1.0; 3]), &[true; 9]), None);
    }
}
