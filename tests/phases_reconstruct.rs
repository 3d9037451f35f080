//! Reconstruction and resolve agree with their CPU twins within the error that Vulkan's precision allows, and give what
//! can be said beforehand in simple cases.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use ash::vk;
use bytemuck::Zeroable;
use half::f16;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use stillray::gpu::submit::Submitter;
use stillray::gpu::{Buffer, Context, Image, ImageDesc, Place};
use stillray::oracle::bounded::Bounded;
use stillray::oracle::camera::pixel_index;
use stillray::oracle::reconstruct::{WIDEST_RADIUS, motions, reconstruct, resolve};
use stillray::shaders::{self, FRAME_RESET, Frame, MOTION_UNKNOWN, Shaded};
use support::kernel::{Bound, Kernel, data};
use support::random::{Random, SIZES};
use support::shaded::{Inputs, compare, random_motion, shaded};

fn twin(inputs: &Inputs, film: Option<&[[f32; 4]]>) -> Vec<[Bounded; 4]> {
    reconstruct(&inputs.frame, inputs.slots(), &inputs.shaded, film)
}

#[test]
fn films_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct::SHADER);
    let mut widest: f64 = 0.0;
    for (seed, size) in SIZES.into_iter().cycle().take(16).enumerate() {
        let inputs = Inputs::random(seed as u32, size);
        let (device, twin) = (inputs.on_device(&kernel), twin(&inputs, None));
        compare(&device, &twin).unwrap();
        if inputs.frame.filter_width < 0.5 {
            continue; // its exponents are beyond what is derived below
        }
        let relative = twin.iter().flatten().filter(|t| t.value > 1e-30).map(|t| t.error / t.value);
        widest = relative.fold(widest, f64::max);
    }
    // What the bound is worth. The exponent of a weight is at most 9: exp is off by 3 + 2 x 9 ulp = 42 u, the exponent
    // itself by some 20 u x 9, and a sum of up to 9 x 16 terms by 144 u: 400 u = 2.4e-5 at most.
    println!("bounds are at most {widest:.1e} of the value");
    assert!(widest < 2.4e-5);
    let config = Config { cases: 16, failure_persistence: None, ..Config::default() };
    let outcome = TestRunner::new(config).run(&(any::<u32>(), 1_u32..60, 1_u32..60), |(seed, width, height)| {
        let inputs = Inputs::random(seed, [width, height]);
        prop_assert_eq!(compare(&inputs.on_device(&kernel), &twin(&inputs, None)), Ok(()));
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&context);
}

#[test]
fn the_film_accumulates_until_it_is_reset() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct_accumulate::SHADER);
    let random = &mut Random::new(4);
    for (seed, size) in SIZES.into_iter().enumerate() {
        let mut inputs = Inputs::random(seed as u32, size);
        let film: Vec<[f32; 4]> =
            (0..size[0] * size[1]).map(|_| [(); 4].map(|()| random.between(0.0, 1000.0))).collect();
        compare(&inputs.run(&kernel, data(&film)), &twin(&inputs, Some(&film))).unwrap();
        inputs.frame.flags = FRAME_RESET;
        // After a reset nothing of what was there is read, not even where it is no number.
        let nan = vec![[f32::NAN; 4]; film.len()];
        compare(&inputs.run(&kernel, data(&nan)), &twin(&inputs, None)).unwrap();
    }
    support::assert_clean(&context);
}

#[test]
fn samples_behind_the_list_are_those_of_their_pixels() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct::SHADER);
    let random = &mut Random::new(3);
    for (seed, size) in SIZES.into_iter().enumerate() {
        let whole = Inputs::random(seed as u32, size);
        let split = whole.split(random);
        // The same numbers in the same order.
        assert_eq!(twin(&split, None), twin(&whole, None));
        compare(&split.on_device(&kernel), &twin(&whole, None)).unwrap();
        let mut wrong = split.clone();
        wrong.extras.iter_mut().for_each(|e| *e = split.shaded.len() as u32);
        let lost = split.shaded.iter().skip(split.extras[0] as usize).any(|s| s.depth >= 0.0);
        assert_eq!(compare(&split.on_device(&kernel), &twin(&wrong, None)).is_err(), lost, "without the second runs");
    }
    support::assert_clean(&context);
}

#[test]
fn motions_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct_motion::SHADER);
    let plain = Kernel::new(&context, shaders::reconstruct::SHADER);
    for (seed, size) in SIZES.into_iter().cycle().take(16).enumerate() {
        let mut inputs = Inputs::random(seed as u32, size);
        let random = &mut Random::new(seed as u32);
        inputs.shaded.iter_mut().for_each(|s| s.motion = random_motion(random));
        let (film, got) = inputs.with_motions(&kernel);
        let motions = |inputs: &Inputs| motions(&inputs.frame, inputs.slots(), &inputs.shaded);
        assert_eq!(got, motions(&inputs), "{size:?}");
        assert_eq!(inputs.split(random).with_motions(&kernel).1, got, "{size:?}, in two runs");
        compare(&film, &twin(&inputs, None)).unwrap();
        assert_eq!(film, inputs.on_device(&plain), "the film is the same");
        // Negative control: one sample that moved farther than all others.
        if let Some(index) = inputs.shaded.iter().position(|s| s.depth >= 0.0) {
            inputs.shaded[index].motion = u32::from(f16::from_f32(9.0).to_bits());
            assert_ne!(got, motions(&inputs));
        }
    }
    support::assert_clean(&context);
}

#[test]
fn a_motion_is_that_of_the_pixels_own_samples_or_else_of_those_around() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct_motion::SHADER);
    let moving = |x: f32, depth: f32| Shaded {
        motion: u32::from(f16::from_f32(x).to_bits()),
        ..shaded([1.0; 3], [128, 128], depth)
    };
    let unknown = Shaded { motion: MOTION_UNKNOWN, ..shaded([1.0; 3], [128, 128], 1.0) };
    // Slow and slower; fast but not visible; none; unknown; fast.
    let row = [
        vec![moving(1.0, 1.0), moving(-2.0, 1.0)],
        vec![moving(8.0, -1.0)],
        vec![],
        vec![unknown],
        vec![moving(4.0, 1.0)],
    ];
    let inputs = Inputs::new([16, 1], |[x, _]| row.get(x as usize).cloned().unwrap_or_default());
    let (_, got) = inputs.with_motions(&kernel);
    let of = |x: f32| u32::from(f16::from_f32(x).to_bits());
    // The third finds only the unknown one in its 3 x 3 pixels; the fourth looks beyond its own; from five pixels on, blocks
    // as wide as that reach the last.
    assert_eq!(got[..6], [of(-2.0), of(-2.0), MOTION_UNKNOWN, of(4.0), of(4.0), of(4.0)]);
    assert_eq!((got[12], got[13]), (of(4.0), MOTION_UNKNOWN), "eight pixels away, and nine");
    support::assert_clean(&context);
}

#[test]
fn wrong_twins_are_caught() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct::SHADER);
    let inputs = Inputs::random(2, [40, 30]);
    let device = inputs.on_device(&kernel);
    compare(&device, &twin(&inputs, None)).unwrap();
    let changed = |change: fn(&mut Shaded)| {
        let mut wrong = inputs.clone();
        wrong.shaded.iter_mut().for_each(change);
        compare(&device, &twin(&wrong, None))
    };
    assert!(changed(|s| s.color_b_offset ^= 1 << 16).is_err(), "a position that is off by 1/256 of a pixel");
    assert!(changed(|s| s.color_rg ^= 1).is_err(), "a colour that is off by its last bit");
    assert!(changed(|s| s.depth = s.depth.abs()).is_err(), "samples that are not visible");
    let mut wrong = inputs.clone();
    wrong.offsets.iter_mut().skip(1).for_each(|o| *o = o.saturating_sub(1));
    assert!(compare(&device, &twin(&wrong, None)).is_err(), "offsets that are off by one");
    support::assert_clean(&context);
}

#[test]
fn one_sample_is_the_colour_of_all_that_it_reaches() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct::SHADER);
    let middle = [12, 13];
    let color = [0.25, 3.0, 1024.0];
    let inputs =
        Inputs::new([25, 25], |pixel| if pixel == middle { vec![shaded(color, [200, 3], 1.0)] } else { Vec::new() });
    let film = inputs.on_device(&kernel);
    for y in 0..25 {
        for x in 0..25 {
            let distance = (x - 12_i64).abs().max((y - 13_i64).abs());
            let sum = film[(y * 25 + x) as usize];
            if distance > WIDEST_RADIUS {
                assert_eq!(sum, [0.0; 4], "out of reach: black, with no weight");
                continue;
            }
            // Powers of two and 3/2 of them times a weight: one rounding each, then the twin's division.
            for (mean, exact) in resolve(sum, f32::MAX).iter().zip(color) {
                assert!((mean.value / f64::from(exact) - 1.0).abs() <= 2.0_f64.powi(-24), "{sum:?}");
            }
        }
    }
    support::assert_clean(&context);
}

#[test]
fn no_sample_is_black_and_a_constant_colour_stays_what_it_is() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reconstruct::SHADER);
    for size in SIZES {
        let empty = Inputs::new(size, |_| Vec::new());
        assert!(empty.on_device(&kernel).iter().all(|sum| *sum == [0.0; 4]));
        let hidden = Inputs::new(size, |_| vec![shaded([1.0; 3], [9, 9], -1.0)]);
        assert!(hidden.on_device(&kernel).iter().all(|sum| *sum == [0.0; 4]));
        for counts in [0..2, 1..2, 16..17, 0..17] {
            let random = &mut Random::new(size[0]);
            let color = [1.0, 0.7, 123.4].map(|c| f16::from_f32(c).to_f32());
            let inputs = Inputs::new(size, |_| {
                let count = counts.start + random.below(counts.len() as u32);
                (0..count).map(|_| shaded(color, [random.below(256), random.below(256)], 2.0)).collect()
            });
            for sum in inputs.on_device(&kernel) {
                if sum[3] == 0.0 {
                    assert_eq!((sum, inputs.shaded.len()), ([0.0; 4], 0));
                    continue;
                }
                // With colour 1 both sums are the same numbers added up in the same order.
                assert_eq!(sum[0], sum[3]);
                // Else every term is rounded once more, and both sums of up to 9 x 16 terms 144 times.
                for (mean, exact) in resolve(sum, f32::MAX).iter().zip(color) {
                    let bound = f64::from(2 * 9 * 16 + 1) * 2.0_f64.powi(-24) * f64::from(exact);
                    assert!((mean.value - f64::from(exact)).abs() <= bound, "{sum:?}");
                }
            }
        }
    }
    support::assert_clean(&context);
}

#[test]
fn the_filter_is_truncated_to_three_by_three_pixels() {
    let random = &mut Random::new(6);
    let mut inputs = Inputs::new([9, 9], |_| vec![shaded([1.0; 3], [random.below(256), random.below(256)], 1.0)]);
    let before = twin(&inputs, None)[4 * 9 + 4];
    let change = |inputs: &mut Inputs, pixel| {
        let index = pixel_index(pixel, [9, 9]);
        inputs.shaded[index] = shaded([50.0; 3], [128, 128], 1.0);
    };
    [[2, 4], [6, 6], [4, 2], [0, 0]].into_iter().for_each(|pixel| change(&mut inputs, pixel));
    assert_eq!(twin(&inputs, None)[4 * 9 + 4], before);
    change(&mut inputs, [5, 5]);
    assert_ne!(twin(&inputs, None)[4 * 9 + 4], before);
}

/// What the shader writes to an image of this format.
fn resolved(context: &Context, kernel: &Kernel, film: &[[f32; 4]], size: [u32; 2], format: vk::Format) -> Vec<u8> {
    let usage = vk::ImageUsageFlags::STORAGE;
    let image =
        Image::new(context, "color", ImageDesc { format, extent: size, layers: 1, array: false, usage }).unwrap();
    image.clear(context).unwrap();
    let frame = Frame { size, ..Frame::zeroed() };
    kernel.run(&mut [data(&[frame]), data(film), Bound::Image(&image)], &[], [size[0], size[1], 1]);
    let texel = if format == vk::Format::R32G32B32A32_SFLOAT { 16 } else { 8 };
    let back = Buffer::new(context, "back", u64::from(size[0] * size[1] * texel), Place::Readback).unwrap();
    // SAFETY: `run` hands over a command buffer that is recording and waits for it.
    let copy = |commands| unsafe { image.record_copy(commands, &back) };
    Submitter::new(context).unwrap().run("copy", copy).unwrap();
    back.bytes()[..(size[0] * size[1] * texel) as usize].to_vec()
}

fn random_film(random: &mut Random, size: [u32; 2]) -> Vec<[f32; 4]> {
    let one = |random: &mut Random| match random.below(8) {
        0 => [0.0; 4],
        1 => [1e30, 1e10, 0.0, 1e-3],
        _ => {
            let weight = random.between(-10.0, 4.0).exp();
            let mut color = || random.between(-12.0, 11.0).exp() * weight;
            [color(), color(), color(), weight]
        }
    };
    (0..size[0] * size[1]).map(|_| one(random)).collect()
}

#[test]
fn resolve_divides_by_the_weight_and_stays_finite() {
    let context = support::validated_context();
    let full = Kernel::new(&context, shaders::resolve_float::SHADER);
    let half = Kernel::new(&context, shaders::resolve::SHADER);
    let random = &mut Random::new(8);
    for size in SIZES {
        let film = random_film(random, size);
        let floats: Vec<[f32; 4]> =
            bytemuck::pod_collect_to_vec(&resolved(&context, &full, &film, size, vk::Format::R32G32B32A32_SFLOAT));
        let halves: Vec<[f16; 4]> =
            bytemuck::pod_collect_to_vec(&resolved(&context, &half, &film, size, vk::Format::R16G16B16A16_SFLOAT));
        let mut caught = false;
        for ((sum, float), half) in film.iter().zip(floats).zip(halves) {
            let half = half.map(f16::to_f32);
            assert_eq!((float[3], half[3]), (1.0, 1.0));
            for i in 0..3 {
                let (wide, narrow) = (resolve(*sum, 3.4028234e38)[i], resolve(*sum, 65504.0)[i]);
                assert!(wide.allows(float[i]), "{sum:?} {wide:?} {}", float[i]);
                // Rounding to half may go either way: an ulp is 2^-10 of the value, or 2^-24 where it is subnormal.
                let rounding = (narrow.value.abs() * 2.0_f64.powi(-10)).max(2.0_f64.powi(-24));
                let narrow = Bounded { error: narrow.error + rounding, ..narrow };
                assert!(half[i].is_finite() && narrow.allows(half[i]), "{sum:?} {narrow:?} {}", half[i]);
                caught |= !resolve([sum[0], sum[1], sum[2], sum[3] * 1.000_01], 3.4028234e38)[i].allows(float[i]);
            }
        }
        assert!(caught || size == [1, 1], "a weight that is off by 1e-5 is noticed");
    }
    support::assert_clean(&context);
}
