//! Dominance: what is worse in nothing and better in something.
//!
//! All objectives are costs: less is better.

use std::cmp::Ordering;

/// An estimate with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Estimate {
    /// The estimate.
    pub mean: f64,
    /// Half the width of its 95 % confidence interval; 0 if it is exact.
    pub half_width: f64,
}

impl Estimate {
    /// A number that is known.
    pub fn exact(mean: f64) -> Self {
        Self { mean, half_width: 0.0 }
    }

    /// Mean of some independent measurements, with 1.96 standard errors; one alone has a half-width of 0, since nothing is
    /// known of its spread.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        if values.is_empty() {
            return Self::default();
        }
        let mean = values.iter().sum::<f64>() / n;
        if values.len() == 1 {
            return Self::exact(mean);
        }
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Self { mean, half_width: 1.96 * (variance / n).sqrt() }
    }

    /// Lower end of the interval.
    pub fn low(&self) -> f64 {
        self.mean - self.half_width
    }

    /// Upper end of the interval.
    pub fn high(&self) -> f64 {
        self.mean + self.half_width
    }
}

/// Whether `a` is worse in nothing and better in something than `b`, of means.
pub fn dominates(a: &[Estimate], b: &[Estimate]) -> bool {
    let pairs = || a.iter().zip(b);
    pairs().all(|(a, b)| a.mean <= b.mean) && pairs().any(|(a, b)| a.mean < b.mean)
}

/// Whether `a` is better than `b` in everything even if all estimates err within their intervals against it; where both are
/// exact and the same, that does not count against it.
pub fn surely_dominates(a: &[Estimate], b: &[Estimate]) -> bool {
    let pairs = || a.iter().zip(b);
    let equal = |a: &Estimate, b: &Estimate| a == b && a.half_width == 0.0;
    pairs().all(|(a, b)| a.high() < b.low() || equal(a, b)) && pairs().any(|(a, b)| a.high() < b.low())
}

/// Positions of the points that no other dominates.
pub fn front(points: &[Vec<Estimate>]) -> Vec<usize> {
    let beaten = |i: usize| points.iter().any(|other| dominates(other, &points[i]));
    (0..points.len()).filter(|&i| !beaten(i)).collect()
}

/// Positions in the order in which they are worth keeping: front by front (Deb et al. 2002, "NSGA-II", non-dominated
/// sorting), within a front those first that have most room around them (crowding distance), ties in the given order.
pub fn ranking(points: &[Vec<Estimate>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut order = Vec::with_capacity(points.len());
    while !left.is_empty() {
        let subset: Vec<Vec<Estimate>> = left.iter().map(|&i| points[i].clone()).collect();
        let best = front(&subset);
        let room = crowding(&best.iter().map(|&i| &subset[i]).collect::<Vec<_>>());
        let mut ranked: Vec<(usize, f64)> = best.iter().map(|&i| left[i]).zip(room).collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        order.extend(ranked.iter().map(|(i, _)| *i));
        left.retain(|i| !ranked.iter().any(|(r, _)| r == i));
    }
    order
}

/// Sum over the objectives of the distance between a point's neighbours, relative to the range; infinite at the ends.
fn crowding(points: &[&Vec<Estimate>]) -> Vec<f64> {
    let mut room = vec![0.0; points.len()];
    let objectives = points.first().map_or(0, |p| p.len());
    for k in 0..objectives {
        let mut order: Vec<usize> = (0..points.len()).collect();
        let value = |i: usize| points[i][k].mean;
        order.sort_by(|&a, &b| value(a).total_cmp(&value(b)).then(a.cmp(&b)));
        let (first, last) = (order[0], order[order.len() - 1]);
        let range = value(last) - value(first);
        if range.partial_cmp(&0.0) != Some(Ordering::Greater) {
            continue;
        }
        for window in order.windows(3) {
            room[window[1]] += (value(window[2]) - value(window[0])) / range;
        }
        room[first] = f64::INFINITY;
        room[last] = f64::INFINITY;
    }
    room
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(values: &[f64]) -> Vec<Estimate> {
        values.iter().map(|v| Estimate::exact(*v)).collect()
    }

    #[test]
    fn estimates_of_known_numbers() {
        assert_eq!(Estimate::of(&[]), Estimate::default());
        assert_eq!(Estimate::of(&[2.0]), Estimate::exact(2.0));
        let of = Estimate::of(&[1.0, 3.0]);
        // The variance is 2, the standard error 1.
        assert!((of.mean - 2.0).abs() < 1e-12 && (of.half_width - 1.96).abs() < 1e-12);
        assert!((of.low() - 0.04).abs() < 1e-12 && (of.high() - 3.96).abs() < 1e-12);
    }

    #[test]
    fn intervals_hold_back_a_judgement_that_means_would_make() {
        let sure = |a: f64, b: f64, w: f64| {
            let [a, b] = [a, b].map(|mean| vec![Estimate { mean, half_width: w }, Estimate::exact(1.0)]);
            (dominates(&a, &b), surely_dominates(&a, &b))
        };
        assert_eq!(sure(1.0, 2.0, 0.4), (true, true));
        assert_eq!(sure(1.0, 2.0, 0.6), (true, false));
        assert_eq!(sure(2.0, 1.0, 0.1), (false, false));
        assert_eq!(sure(1.0, 1.0, 0.0), (false, false));
    }

    #[test]
    fn a_known_front() {
        let points = [[1.0, 5.0], [2.0, 2.0], [3.0, 3.0], [5.0, 1.0], [5.0, 1.0]].map(|p| point(&p));
        assert_eq!(front(&points), [0, 1, 3, 4]);
        // The ends first, then the middle, then the dominated one.
        assert_eq!(ranking(&points).last(), Some(&2));
        assert_eq!(ranking(&points)[0], 0);
    }

    proptest! {
        #[test]
        fn a_front_dominates_the_rest_and_not_itself(raw in prop::collection::vec(prop::array::uniform3(0_u8..12), 1..40)) {
            let points: Vec<_> = raw.iter().map(|p| point(&p.map(f64::from))).collect();
            let best = front(&points);
            prop_assert!(!best.is_empty());
            for i in 0..points.len() {
                let beaten = best.iter().any(|&b| dominates(&points[b], &points[i]));
                prop_assert_eq!(beaten, !best.contains(&i));
            }
            let mut order = ranking(&points);
            prop_assert!(order[..best.len()].iter().all(|i| best.contains(i)));
            order.sort_unstable();
            prop_assert_eq!(order, (0..points.len()).collect::<Vec<_>>());
        }
    }
}
