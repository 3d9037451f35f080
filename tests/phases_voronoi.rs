//! Reconstruction with Voronoi weights agrees with its CPU twin, and gives what can be said beforehand in simple cases.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use half::f16;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use stillray::oracle::bounded::Bounded;
use stillray::oracle::reconstruct::{WIDEST_RADIUS, motions, resolve};
use stillray::oracle::voronoi::{nearest, voronoi};
use stillray::shaders::{self, Shaded};
use support::kernel::Kernel;
use support::random::{Random, SIZES};
use support::shaded::{Inputs, compare, random_motion, shaded};

fn twin(inputs: &Inputs) -> Vec<[Bounded; 4]> {
    voronoi(&inputs.frame, inputs.slots(), &inputs.shaded)
}

#[test]
fn films_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::voronoi::SHADER);
    let random = &mut Random::new(1);
    for (seed, size) in SIZES.into_iter().enumerate() {
        let inputs = Inputs::random(seed as u32, size);
        let twin = twin(&inputs);
        compare(&inputs.on_device(&kernel), &twin).unwrap();
        compare(&inputs.split(random).on_device(&kernel), &twin).unwrap();
    }
    let config = Config { cases: 8, failure_persistence: None, ..Config::default() };
    let outcome = TestRunner::new(config).run(&(any::<u32>(), 1_u32..40, 1_u32..40), |(seed, width, height)| {
        let inputs = Inputs::random(seed, [width, height]);
        prop_assert_eq!(compare(&inputs.on_device(&kernel), &twin(&inputs)), Ok(()));
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&context);
}

#[test]
fn motions_are_those_that_equal_weights_keep() {
    let context = support::validated_context();
    let plain = Kernel::new(&context, shaders::voronoi::SHADER);
    let kernel = Kernel::new(&context, shaders::voronoi_motion::SHADER);
    let random = &mut Random::new(2);
    for (seed, size) in SIZES.into_iter().enumerate() {
        let mut inputs = Inputs::random(seed as u32, size);
        inputs.shaded.iter_mut().for_each(|s| s.motion = random_motion(random));
        let (film, got) = inputs.with_motions(&kernel);
        let motions = |inputs: &Inputs| motions(&inputs.frame, inputs.slots(), &inputs.shaded);
        assert_eq!(got, motions(&inputs), "{size:?}");
        assert_eq!(film, inputs.on_device(&plain), "the film is the same");
        assert_eq!(inputs.split(random).with_motions(&kernel).1, got, "{size:?}, in two runs");
        if let Some(index) = inputs.shaded.iter().position(|s| s.depth >= 0.0) {
            inputs.shaded[index].motion = u32::from(f16::from_f32(9.0).to_bits());
            assert_ne!(got, motions(&inputs), "one sample that moved farther than all others");
        }
    }
    support::assert_clean(&context);
}

#[test]
fn wrong_twins_are_caught() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::voronoi::SHADER);
    let inputs = Inputs::random(4, [40, 30]);
    let device = inputs.on_device(&kernel);
    compare(&device, &twin(&inputs)).unwrap();
    let changed = |change: fn(&mut Shaded)| {
        let mut wrong = inputs.clone();
        wrong.shaded.iter_mut().for_each(change);
        compare(&device, &twin(&wrong))
    };
    assert!(changed(|s| s.color_b_offset ^= 1 << 20).is_err(), "positions that are off by 1/16 of a pixel");
    assert!(changed(|s| s.color_rg ^= 1).is_err(), "colours that are off by their last bit");
    assert!(changed(|s| s.depth = s.depth.abs()).is_err(), "samples that are not visible");
    let mut wider = inputs.clone();
    wider.frame.filter_width *= 1.000_1;
    assert!(compare(&device, &twin(&wider)).is_err(), "another filter");
    support::assert_clean(&context);
}

#[test]
fn every_pixel_in_reach_of_a_lone_sample_has_its_colour() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::voronoi::SHADER);
    let color = [0.25, 3.0, 1024.0];
    let inputs =
        Inputs::new([25, 25], |pixel| if pixel == [12, 13] { vec![shaded(color, [200, 3], 1.0)] } else { Vec::new() });
    let film = inputs.on_device(&kernel);
    for y in 0..25 {
        for x in 0..25 {
            let distance = (x - 12_i64).abs().max((y - 13_i64).abs());
            let sum = film[(y * 25 + x) as usize];
            // A pixel is filtered from itself and those beside it.
            if distance > WIDEST_RADIUS + 1 {
                assert_eq!(sum, [0.0; 4], "out of reach: black, with no weight");
                continue;
            }
            for (mean, exact) in resolve(sum, f32::MAX).iter().zip(color) {
                // 144 products of three factors, each rounded, and as many sums, in the colour and in the weight.
                let bound = f64::from(2 * 144 + 2 * 3 + 1) * 2.0_f64.powi(-24);
                assert!((mean.value / f64::from(exact) - 1.0).abs() <= bound, "{sum:?}");
            }
        }
    }
    support::assert_clean(&context);
}

#[test]
fn a_picture_that_is_one_everywhere_stays_so_to_the_bit() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::voronoi::SHADER);
    for (seed, size) in SIZES.into_iter().enumerate() {
        let mut inputs = Inputs::random(seed as u32, size);
        let one = shaded([1.0; 3], [0, 0], 1.0);
        for s in &mut inputs.shaded {
            (s.color_rg, s.color_b_offset) = (one.color_rg, one.color_b_offset | s.color_b_offset & 0xffff_0000);
        }
        let film = inputs.on_device(&kernel);
        assert!(film.iter().all(|sum| sum[..3].iter().all(|c| *c == sum[3])), "{size:?}");
    }
    support::assert_clean(&context);
}

/// What equal weights get wrong: a crowd of samples beside a single one. Here a half plane that ends in the middle between
/// a column of pixels with eight samples each and one with one each, all at the middles of subpixels in the same rows.
#[test]
fn a_crowd_counts_for_its_area() {
    let columns = |x: u32| if x < 8 { [32, 96, 160, 224].as_slice() } else { &[32] };
    let inputs = Inputs::new([16, 16], |[x, _]| {
        let color = if x < 8 { [1.0; 3] } else { [0.0; 3] };
        columns(x).iter().flat_map(|bx| [32, 96, 160, 224].map(|by| shaded(color, [*bx, by], 1.0))).collect()
    });
    // The pixel behind the edge has no subpixel that is nearer to the crowd.
    let cells = nearest(&inputs.frame, inputs.slots(), &inputs.shaded, [8, 8]).unwrap();
    let black = cells.iter().filter(|slot| f16::from_bits(inputs.shaded[**slot].color_rg as u16).to_f32() == 0.0);
    assert_eq!(black.count(), 16);
    // So the film is the Gaussian of a half plane: a pixel and its mirror image beyond the edge add up to one.
    let film = twin(&inputs);
    for x in 5..8 {
        let mean = |x: usize| resolve(film[8 * 16 + x].map(|b| b.value as f32), f32::MAX)[0].value;
        assert!((mean(x) + mean(15 - x) - 1.0).abs() < 1e-5, "{} {}", mean(x), mean(15 - x));
    }
}
