//! Stratified samples agree with their CPU twin to the bit, and are stratified and uniform.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Zeroable, cast_slice};
use stillray::oracle::camera::pixels_in_order;
use stillray::oracle::gather::Gathered;
use stillray::oracle::generate::{cell, generate, pixel_shift, stratified_position};
use stillray::oracle::seed::generated_seeds;
use stillray::shaders::{self, Frame, MODEL_SEED, Sample};
use support::kernel::{Kernel, blank, data, values};
use support::random::{Random, SIZES};

fn on_device(kernel: &Kernel, frame: &Frame) -> Gathered {
    let pixels = (frame.size[0] * frame.size[1]) as usize;
    let mut bound = [data(&[*frame]), blank::<Sample>(pixels * frame.spp as usize), blank::<u32>(pixels + 1)];
    kernel.run(&mut bound, &[], [frame.size[0], frame.size[1], 1]);
    Gathered { samples: values(&bound[1]), offsets: values(&bound[2]), ..Gathered::default() }
}

fn same(a: &Gathered, b: &Gathered) -> bool {
    a.offsets == b.offsets && cast_slice::<Sample, u8>(&a.samples) == cast_slice::<Sample, u8>(&b.samples)
}

#[test]
fn samples_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::generate::SHADER);
    let random = &mut Random::new(1);
    for size in SIZES.into_iter().chain([[2000, 3], [3, 2000]]) {
        for spp in [0, 1, 2, 4, 7, 16] {
            let frame = Frame { size, spp, seed: random.bits(), jitter: random.bits(), ..Frame::zeroed() };
            let device = on_device(&kernel, &frame);
            assert!(same(&device, &generate(&frame)), "{size:?} {spp} spp");
            // Negative control: another jitter is another pattern.
            let other = generate(&Frame { jitter: frame.jitter ^ 1, ..frame });
            assert!(spp == 0 || !same(&device, &other));
        }
    }
    support::assert_clean(&context);
}

#[test]
fn seeds_tell_the_pixel_and_the_number() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::generate::modelling(MODEL_SEED));
    for (size, spp) in SIZES.into_iter().zip([1, 2, 4, 7, 16].into_iter().cycle()) {
        let frame = Frame { size, spp, ..Frame::zeroed() };
        let pixels = (size[0] * size[1]) as usize;
        let count = pixels * spp as usize;
        let mut bound = [data(&[frame]), blank::<Sample>(count), blank::<u32>(pixels + 1), blank::<u32>(count)];
        kernel.run(&mut bound, &[], [size[0], size[1], 1]);
        let seeds: Vec<u32> = values(&bound[3]);
        assert_eq!(seeds, generated_seeds(&frame), "{size:?}");
        let different: std::collections::HashSet<&u32> = seeds.iter().collect();
        assert_eq!(different.len(), count, "no two samples are drawn alike");
    }
    support::assert_clean(&context);
}

#[test]
fn every_first_power_of_four_fills_all_quarters() {
    for (count, across) in [(1, 1), (4, 2), (16, 4)] {
        let mut filled: Vec<[u32; 2]> = (0..count).map(|i| cell(i).map(|c| c * across / 4)).collect();
        filled.sort_unstable();
        filled.dedup();
        assert_eq!(filled.len(), count as usize);
    }
}

#[test]
fn a_shift_moves_the_whole_pattern_on_the_torus() {
    for pixel in pixels_in_order([50, 40]) {
        let shift = pixel_shift(pixel, 7, 3);
        for i in 0..16 {
            let at = stratified_position(pixel, i, shift);
            for axis in 0..2 {
                let inside = f64::from(at[axis]) - f64::from(pixel[axis]);
                let back = (inside - f64::from(shift[axis])).rem_euclid(1.0) * 4.0 - f64::from(cell(i)[axis]);
                // Half an ulp of the sum below 2 and of a coordinate below 64, in quarter pixels; 4 is 0 on the torus.
                let rounding = 4.0 * (2.0_f64.powi(-24) + 2.0_f64.powi(-19));
                assert!(back.abs() <= rounding || (back.abs() - 4.0).abs() <= rounding, "{back}");
                assert!((0.0..=1.0).contains(&inside));
            }
        }
    }
}

/// Chi-squared of positions in their pixels over 8 x 8 cells, for the i-th sample of every pixel.
fn chi_squared(i: u32, shift: impl Fn([u32; 2]) -> [f32; 2]) -> f64 {
    let size = [160, 100];
    let mut counts = [0_u32; 64];
    for pixel in pixels_in_order(size) {
        let at = stratified_position(pixel, i, shift(pixel));
        let bin = [0, 1].map(|a| ((f64::from(at[a]) - f64::from(pixel[a])) * 8.0).min(7.0) as usize);
        counts[bin[1] * 8 + bin[0]] += 1;
    }
    let expected = f64::from(size[0] * size[1]) / 64.0;
    counts.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum()
}

#[test]
fn every_sample_is_uniform_over_the_pixel() {
    // 63 degrees of freedom: mean 63, variance 126. Wilson and Hilferty's approximation puts the quantile of 1 - 1e-6 at
    // 63 (1 - 2 / (9 x 63) + 4.75 sqrt(2 / (9 x 63)))^3 = 130.
    for i in 0..16 {
        for seed in 0..4 {
            let found = chi_squared(i, |pixel| pixel_shift(pixel, seed, 0));
            assert!(found < 130.0, "sample {i}: {found}");
        }
    }
    // Negative controls: without shift, and with one of half the range.
    assert!(chi_squared(3, |_| [0.3, 0.3]) > 130.0);
    assert!(chi_squared(3, |pixel| pixel_shift(pixel, 1, 0).map(|s| 0.5 * s)) > 130.0);
}
