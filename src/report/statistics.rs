//! The few statistics that reports need.

use serde::Serialize;

/// Least, middle and near-worst of some measurements, in their unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Summary {
    /// The smallest; 0 if there are none.
    pub min: f64,
    /// The middle one, or the mean of the two middle ones; 0 if there are none.
    pub median: f64,
    /// The smallest that at least 95 % do not exceed (nearest rank); 0 if there are none.
    pub p95: f64,
}

impl Summary {
    /// Summarises finite `values`, in any order.
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let Some(last) = sorted.len().checked_sub(1) else { return Self::default() };
        let rank = (0.95 * sorted.len() as f64).ceil() as usize;
        Self {
            min: sorted[0],
            median: (sorted[last / 2] + sorted[sorted.len() / 2]) / 2.0,
            p95: sorted[rank.clamp(1, sorted.len()) - 1],
        }
    }
}

/// Arithmetic mean; 0 of nothing.
pub fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// `part / whole`, and 0 of nothing.
pub fn ratio(part: f64, whole: f64) -> f64 {
    if whole == 0.0 { 0.0 } else { part / whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_nothing_and_of_one() {
        assert_eq!(Summary::of(&[]), Summary::default());
        assert_eq!(Summary::of(&[3.0]), Summary { min: 3.0, median: 3.0, p95: 3.0 });
    }

    #[test]
    fn order_does_not_matter_and_even_counts_average() {
        assert_eq!(Summary::of(&[4.0, 1.0, 3.0, 2.0]), Summary { min: 1.0, median: 2.5, p95: 4.0 });
        assert_eq!(Summary::of(&[9.0, 1.0, 5.0]).median, 5.0);
    }

    #[test]
    fn p95_leaves_out_one_outlier_in_twenty() {
        let mut values: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(Summary::of(&values).p95, 19.0);
        values.truncate(19);
        assert_eq!(Summary::of(&values).p95, 19.0);
        let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(Summary::of(&hundred).p95, 95.0);
    }

    #[test]
    fn means_and_ratios_of_nothing_are_zero() {
        assert_eq!(mean([].into_iter()), 0.0);
        assert_eq!(mean([1.0, 2.0].into_iter()), 1.5);
        assert_eq!(ratio(1.0, 0.0), 0.0);
        assert_eq!(ratio(1.0, 4.0), 0.25);
    }
}
