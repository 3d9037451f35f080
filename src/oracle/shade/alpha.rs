//! Twin of `glsl/include/alpha.glsl`, exact: what of a surface with an alpha mask or blend is there.

use crate::oracle::random::{hash_combine, unit_float};
use crate::shaders::{MATERIAL_BLEND, MATERIAL_MASK, Material};

/// The threshold in [0, 1) of a point in object space; see the shader for `cell` and `seed`.
pub fn alpha_threshold(object_position: [f32; 3], cell: f32, seed: u32) -> f32 {
    let exponent = ((cell.to_bits() >> 23) & 0xff).clamp(2, 252);
    let inverse_cell = f32::from_bits((254 - exponent) << 23);
    let index = |p: f32| match (p * inverse_cell).floor().to_bits() {
        0x8000_0000 => 0,
        bits => bits,
    };
    let h = object_position.into_iter().fold(seed, |h, p| hash_combine(h, index(p)));
    unit_float(hash_combine(h, exponent))
}

/// Whether a point of a surface with this alpha, 0..=1, is there.
pub fn alpha_passes(material: &Material, alpha: f32, object_position: [f32; 3], cell: f32, seed: u32) -> bool {
    if material.flags & MATERIAL_MASK != 0 {
        alpha >= material.alpha_cutoff
    } else if material.flags & MATERIAL_BLEND != 0 {
        alpha > alpha_threshold(object_position, cell, seed)
    } else {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pearson's statistic of thresholds in 64 equal bins over `n` cells in a plane.
    fn chi_squared(threshold: impl Fn(i32, i32) -> f32, n: i32) -> f64 {
        let mut bins = [0u32; 64];
        for (x, y) in (0..n).flat_map(|x| (0..n).map(move |y| (x, y))) {
            bins[(threshold(x, y) * 64.0) as usize] += 1;
        }
        let expected = f64::from(n * n) / 64.0;
        bins.iter().map(|b| (f64::from(*b) - expected).powi(2) / expected).sum()
    }

    #[test]
    fn thresholds_are_uniform_over_cells_and_seeds() {
        // 63 degrees of freedom: mean 63, standard deviation sqrt(126) = 11.2; 130 is six deviations away.
        for seed in 0..8 {
            let over_cells = |x: i32, y: i32| alpha_threshold([x as f32 * 0.25, y as f32 * 0.25, 1.5], 0.3, seed);
            assert!(chi_squared(over_cells, 200) < 130.0);
        }
        let over_seeds = |x: i32, y: i32| alpha_threshold([0.7, -3.0, 2.0], 0.01, (x * 200 + y) as u32);
        assert!(chi_squared(over_seeds, 200) < 130.0);
        let biased = |x: i32, y: i32| over_seeds(x, y) * over_seeds(x, y);
        assert!(chi_squared(biased, 200) > 130.0, "the test can fail");
    }

    #[test]
    fn a_cell_shares_its_threshold_and_its_neighbour_has_another() {
        let at = |x: f32| alpha_threshold([x, 0.1, 0.1], 0.3, 1);
        assert_eq!(at(0.26), at(0.49), "0.3 is rounded down to a quarter");
        assert_ne!(at(0.26), at(0.51));
        assert_eq!(at(-0.0), at(0.0));
        assert_eq!(alpha_threshold([1.0; 3], 0.26, 1), alpha_threshold([1.0; 3], 0.49, 1), "within an octave");
        assert_ne!(alpha_threshold([1.0; 3], 0.26, 1), alpha_threshold([1.0; 3], 0.51, 1), "across octaves");
    }

    #[test]
    fn ends_are_exact_and_the_middle_is_coverage() {
        let blend = Material { flags: MATERIAL_BLEND, ..Material::default() };
        let points: Vec<[f32; 3]> = (0..10_000).map(|i| [i as f32, 0.5, 2.0]).collect();
        let passing = |alpha: f32| points.iter().filter(|p| alpha_passes(&blend, alpha, **p, 1.0, 5)).count();
        assert_eq!((passing(0.0), passing(1.0)), (0, 10_000));
        // Binomial: standard deviation sqrt(0.3 * 0.7 * 10,000) = 46; five of them.
        assert!(passing(0.3).abs_diff(3000) < 230);
        let mask = Material { flags: MATERIAL_MASK, alpha_cutoff: 0.5, ..Material::default() };
        assert!(alpha_passes(&mask, 0.5, [0.0; 3], 1.0, 0) && !alpha_passes(&mask, 0.499, [0.0; 3], 1.0, 0));
        assert!(alpha_passes(&Material::default(), 0.0, [0.0; 3], 1.0, 0), "opaque");
    }

    #[test]
    fn odd_cells_and_positions_give_thresholds_all_the_same() {
        for cell in [0.0, -1.0, f32::MIN_POSITIVE, f32::MAX, f32::INFINITY, f32::NAN] {
            for p in [0.0, 1e7, -1e30, f32::MAX] {
                assert!((0.0..1.0).contains(&alpha_threshold([p; 3], cell, 0)));
            }
        }
    }
}
