//! Reprojection agrees with its CPU twin exactly, wherever rounding cannot put a sample on another subpixel, and its
//! outcome is that of the paper's Algorithm 1 without the race.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::Zeroable;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::collections::HashSet;
use stillray::oracle::bounded::Bounded;
use stillray::oracle::camera::{self, Projection, subpixel_bit};
use stillray::oracle::lens::lens_point;
use stillray::oracle::motion::frame_time;
use stillray::oracle::reproject::{
    Cache, Landing, Reprojected, Subpixel, UNCLAIMED, landing, landing_bounded, reproject, reproject_displaced,
    reproject_nearest,
};
use stillray::oracle::seed::{PAIR_LENS, PAIR_TIME, new_seed, seed_pair};
use stillray::sampler::{Sampler, Strategy, Tiling};
use stillray::shaders::{
    self, Counters, FRAME_QUARTERS, FRAME_RESET, FRAME_TURNS, Frame, INSTANCE_MASK, Instance, MODEL_LENS, MODEL_MOTION,
    OCCLUDED_BIT, Sample,
};
use support::kernel::{Bound, Kernel, data, values};
use support::random::{Random, SIZES};
use support::view::View;

fn on_device(kernel: &Kernel, frame: &Frame, instances: &[Instance], samples: &[Sample], listed: u32) -> Reprojected {
    let pixels = (frame.size[0] * frame.size[1]) as usize;
    let nothing =
        Reprojected { claims: vec![UNCLAIMED; camera::subpixels(frame.flags) * pixels], masks: vec![0; pixels] };
    run(kernel, frame, instances, samples, listed, &nothing, false)
}

/// From these claims and masks on; the second round of a frame is told what was `taken` before.
fn run(
    kernel: &Kernel,
    frame: &Frame,
    instances: &[Instance],
    samples: &[Sample],
    listed: u32,
    before: &Reprojected,
    taken: bool,
) -> Reprojected {
    let counters = Counters { samples: listed, ..Counters::zeroed() };
    let mut bound = vec![
        data(&[*frame]),
        data(instances),
        data(&[counters]),
        data(samples),
        data(&before.claims),
        data(&before.masks),
    ];
    if taken {
        bound.push(data(&before.masks));
    }
    dispatch(kernel, &mut bound, samples.len())
}

fn dispatch(kernel: &Kernel, bound: &mut [Bound<'_>], samples: usize) -> Reprojected {
    // Two-dimensional as in a frame, with groups to spare.
    let across = 1 + samples as u32 / 64 / 3;
    kernel.run(bound, &[], [64 * across, 4, 1]);
    Reprojected { claims: values(&bound[4]), masks: values(&bound[5]) }
}

/// Subpixels that some device could give to another sample than ours does, because of where a sample lands.
fn uncertain(frame: &Frame, instances: &[Instance], samples: &[Sample]) -> HashSet<Subpixel> {
    uncertain_through(frame, instances, Cache::from(samples))
}

fn uncertain_through(frame: &Frame, instances: &[Instance], cache: Cache<'_>) -> HashSet<Subpixel> {
    let mut all = HashSet::new();
    for (i, sample) in cache.samples.iter().enumerate() {
        let lens = cache.seen(i);
        match landing_bounded(frame, instances, sample, lens) {
            Landing::Nowhere => assert_eq!(landing(frame, instances, sample, lens), None),
            Landing::On(subpixel) => assert_eq!(landing(frame, instances, sample, lens), Some(subpixel)),
            Landing::Among(subpixels) => {
                if let Some(subpixel) = landing(frame, instances, sample, lens) {
                    assert!(subpixels.contains(&subpixel), "the twin is outside its own bound");
                }
                all.extend(subpixels);
            }
            Landing::Anywhere => panic!("no test puts samples into the camera"),
        }
    }
    all
}

/// Every subpixel that is certain must agree.
fn compare(flags: u32, device: &Reprojected, twin: &Reprojected, uncertain: &HashSet<Subpixel>) -> Result<(), String> {
    for (pixel, (&mask, &expected)) in device.masks.iter().zip(&twin.masks).enumerate() {
        for subpixel in (0..16).filter(|&s| !uncertain.contains(&(pixel, s))) {
            let bits = 0x10001 << subpixel;
            if mask & bits != expected & bits {
                return Err(format!("mask {mask:08x} of pixel {pixel}, expected {expected:08x}, subpixel {subpixel}"));
            }
            if subpixel_bit(subpixel, flags) != subpixel {
                continue;
            }
            let slot = camera::claim_slot(pixel, subpixel, flags);
            if device.claims[slot] != twin.claims[slot] {
                let (found, expected) = (device.claims[slot], twin.claims[slot]);
                return Err(format!("claim {found:08x} on {subpixel} of pixel {pixel}, expected {expected:08x}"));
            }
        }
    }
    Ok(())
}

/// What must hold on every subpixel, certain or not: masks say what claims say, and who claims a subpixel reaches it.
fn consistent(device: &Reprojected, frame: &Frame, instances: &[Instance], samples: &[Sample]) {
    consistent_through(device, frame, instances, Cache::from(samples));
}

fn consistent_through(device: &Reprojected, frame: &Frame, instances: &[Instance], cache: Cache<'_>) {
    for (slot, &claim) in device.claims.iter().enumerate() {
        let each = camera::subpixels(frame.flags);
        let bits: Vec<u32> = (0..16).filter(|bit| subpixel_bit(*bit, frame.flags) == *bit).collect();
        let (pixel, subpixel) = (slot / each, bits[slot % each]);
        let mask = device.masks[pixel] >> subpixel;
        assert_eq!(mask & 1 != 0, claim != UNCLAIMED);
        assert_eq!(mask & 0x10000 != 0, claim & OCCLUDED_BIT == 0);
        if claim == UNCLAIMED {
            continue;
        }
        let i = (claim & INSTANCE_MASK) as usize;
        let sample = &cache.samples[i];
        assert_eq!(sample.instance & OCCLUDED_BIT, claim & OCCLUDED_BIT);
        match landing_bounded(frame, instances, sample, cache.seen(i)) {
            Landing::On(there) => assert_eq!(there, (pixel, subpixel)),
            Landing::Among(places) => assert!(places.contains(&(pixel, subpixel))),
            other => panic!("a sample that lands {other:?} has claimed {slot}"),
        }
    }
}

#[test]
fn random_samples_land_where_the_twin_says() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject::SHADER);
    let mut subpixels = 0;
    let mut excluded = 0;
    let mut caught = 0;
    for (case, size) in SIZES.into_iter().chain([[160, 90], [33, 17]]).enumerate() {
        let random = &mut Random::new(case as u32);
        let mut view = View::new(random, size, 5);
        view.frame.flags = [0, FRAME_QUARTERS][case % 2];
        let count = (16 * size[0] * size[1] * (1 + case as u32 % 3)).min(60_000);
        let share = [0.3, 0.0, 1.0][case % 3];
        let samples: Vec<Sample> = (0..count).map(|_| view.random_sample(random, share)).collect();
        let twin = reproject(&view.frame, &view.instances, &samples);
        let device = on_device(&kernel, &view.frame, &view.instances, &samples, count);
        let unsure = uncertain(&view.frame, &view.instances, &samples);
        compare(view.frame.flags, &device, &twin, &unsure).unwrap();
        consistent(&device, &view.frame, &view.instances, &samples);
        subpixels += twin.claims.len();
        excluded += unsure.len();

        // Negative control: samples in another order, or one of them turned over, are another outcome.
        let mut wrong = samples.clone();
        wrong.rotate_left(1);
        caught += u32::from(
            compare(view.frame.flags, &device, &reproject(&view.frame, &view.instances, &wrong), &unsure).is_err(),
        );
    }
    println!("{excluded} of {subpixels} subpixels are uncertain");
    // A sample is uncertain if it is within the error of one of 4 + 4 borders a pixel, and then excludes two or four
    // subpixels. The error is some tens of units of 2^-24 of the frame's size: 100 x 30 / 2^24 pixels. At up to three
    // samples a subpixel that is 3 x 2 x 8 x 2 x 100 x 30 / 2^24, a percent or two at the very most.
    // Of quarter pixels there are fewer borders, and a fourth as many subpixels for the same samples: a percent or two too.
    assert!(excluded * 50 < subpixels);
    assert_eq!(caught as usize, SIZES.len() + 2);
    support::assert_clean(&context);
}

/// A view with a lens, samples, and where each is on the lens.
fn through_a_lens(case: u32, size: [u32; 2], sampler: &Sampler) -> (View, Vec<Sample>, Vec<u32>, Vec<[f32; 2]>) {
    let random = &mut Random::new(900 + case);
    let mut view = View::new(random, size, 5);
    view.frame.lens = [random.between(0.01, 0.5), random.pick(&[0.0, 0.2, 1.0]), [0.0, 6.0][case as usize % 2], 0.0];
    view.frame.variation = [0, 3][case as usize % 2];
    let count = (16 * size[0] * size[1]).min(60_000);
    let samples: Vec<Sample> = (0..count).map(|_| view.random_sample(random, 0.3)).collect();
    let seeds: Vec<u32> =
        samples.iter().map(|_| new_seed([random.below(5000), random.below(5000)], random.below(16))).collect();
    let point = |seed: &u32| lens_point(view.frame.lens, seed_pair(sampler, view.frame.variation, *seed, PAIR_LENS));
    let lens = seeds.iter().map(point).collect();
    (view, samples, seeds, lens)
}

#[test]
fn through_a_lens_samples_land_where_the_twin_says() {
    let context = support::validated_context();
    let shader = |bits| shaders::reproject::modelling(bits);
    let kernel = Kernel::new(&context, shader(MODEL_LENS));
    let pinhole = Kernel::new(&context, shader(0));
    let mut caught = 0;
    for (case, size) in SIZES.into_iter().chain([[160, 90], [33, 17]]).enumerate() {
        let strategy = [Strategy::Sobol, Strategy::Sudoku, Strategy::Random][case % 3];
        let sampler = Sampler::new(strategy, Tiling::Sudoku, 4, case as u32);
        let (mut view, samples, seeds, lens) = through_a_lens(case as u32, size, &sampler);
        let run = |frame: &Frame, kernel: &Kernel, seeded: bool| {
            let counters = Counters { samples: samples.len() as u32, ..Counters::zeroed() };
            let pixels = (size[0] * size[1]) as usize;
            let claims = vec![UNCLAIMED; camera::subpixels(frame.flags) * pixels];
            let mut bound = vec![
                data(&[*frame]),
                data(&view.instances),
                data(&[counters]),
                data(&samples),
                data(&claims),
                data(&vec![0_u32; pixels]),
            ];
            if seeded {
                bound.extend([data(&seeds), data(&sampler.table())]);
            }
            dispatch(kernel, &mut bound, samples.len())
        };
        let device = run(&view.frame, &kernel, true);
        let cache = Cache { lens: &lens, ..Cache::from(&samples) };
        let unsure = uncertain_through(&view.frame, &view.instances, cache);
        let twin = reproject(&view.frame, &view.instances, cache);
        compare(view.frame.flags, &device, &twin, &unsure).unwrap();
        consistent_through(&device, &view.frame, &view.instances, cache);
        // Negative control: seen through the middle, they land elsewhere.
        let straight = reproject(&view.frame, &view.instances, &samples);
        caught += usize::from(compare(view.frame.flags, &device, &straight, &unsure).is_err());
        // A closed aperture is a pinhole, to the bit.
        view.frame.lens[0] = 0.0;
        assert_eq!(run(&view.frame, &kernel, true), run(&view.frame, &pinhole, false));
    }
    assert!(caught > SIZES.len() / 2, "{caught}");
    support::assert_clean(&context);
}

#[test]
fn while_the_shutter_is_open_samples_land_where_the_twin_says() {
    let context = support::validated_context();
    let shader = |bits| shaders::reproject::modelling(shaders::with_brought(bits));
    let kernel = Kernel::new(&context, shader(MODEL_MOTION));
    let pinhole = Kernel::new(&context, shader(0));
    let mut caught = 0;
    for (case, size) in SIZES.into_iter().chain([[160, 90], [33, 17]]).enumerate() {
        let strategy = [Strategy::Sobol, Strategy::Sudoku, Strategy::Random][case % 3];
        let sampler = Sampler::new(strategy, Tiling::Sudoku, 4, case as u32);
        let (mut view, samples, seeds, lens) = through_a_lens(case as u32, size, &sampler);
        let random = &mut Random::new(700 + case as u32);
        let shutter = random.pick(&[0.25, 1.0]);
        let off = |random: &mut Random, x: f32| x + random.between(-0.05, 0.05);
        for instance in &mut view.instances {
            instance.previous = instance.to_relative.map(|row| row.map(|x| off(random, x)));
            stillray::accel::mark_moving(instance, f64::from(shutter));
        }
        view.frame.previous_right = view.frame.right.map(|x| off(random, x));
        view.frame.previous_up = view.frame.up;
        view.frame.previous_forward = view.frame.forward.map(|x| off(random, x));
        view.frame.flags |= FRAME_TURNS;
        view.frame.shutter = shutter;
        let run = |frame: &Frame, kernel: &Kernel, seeded: bool| {
            let counters = Counters { samples: samples.len() as u32, ..Counters::zeroed() };
            let pixels = (size[0] * size[1]) as usize;
            let claims = vec![UNCLAIMED; camera::subpixels(frame.flags) * pixels];
            let mut bound = vec![
                data(&[*frame]),
                data(&view.instances),
                data(&[counters]),
                data(&samples),
                data(&claims),
                data(&vec![0_u32; pixels]),
            ];
            if seeded {
                // Nothing deforms.
                bound.extend([data(&seeds), data(&sampler.table())]);
                bound.extend([data(&[[0.0_f32; 4]; 2]), data(&[0.0_f32]), data(&[0.0_f32])]);
            }
            dispatch(kernel, &mut bound, samples.len())
        };
        let device = run(&view.frame, &kernel, true);
        let at = |seed: &u32| seed_pair(&sampler, view.frame.variation, *seed, PAIR_TIME)[0];
        let times: Vec<f32> = seeds.iter().map(|seed| frame_time(shutter, at(seed))).collect();
        let cache = Cache { lens: &lens, times: &times, ..Cache::from(&samples) };
        let unsure = uncertain_through(&view.frame, &view.instances, cache);
        let twin = reproject(&view.frame, &view.instances, cache);
        compare(view.frame.flags, &device, &twin, &unsure).unwrap();
        consistent_through(&device, &view.frame, &view.instances, cache);
        // Negative control: all at the end of the frame.
        let end = reproject(&view.frame, &view.instances, Cache { times: &[], ..cache });
        caught += usize::from(compare(view.frame.flags, &device, &end, &unsure).is_err());
        // With shutter and aperture closed it is a pinhole, to the bit.
        view.frame.lens[0] = 0.0;
        view.frame.shutter = 0.0;
        assert_eq!(run(&view.frame, &kernel, true), run(&view.frame, &pinhole, false));
    }
    assert!(caught > SIZES.len() / 2, "{caught}");
    support::assert_clean(&context);
}

#[test]
fn proptest_finds_no_other_outcome() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject::SHADER);
    let inputs = (any::<u32>(), 1_u32..70, 1_u32..70, 0_usize..8000, 0.0_f32..1.0, 1_usize..9);
    let config = Config { cases: 24, failure_persistence: None, ..Config::default() };
    let outcome = TestRunner::new(config).run(&inputs, |(seed, width, height, count, occluded, instances)| {
        let random = &mut Random::new(seed);
        let mut view = View::new(random, [width, height], instances);
        view.frame.flags = random.pick(&[0, FRAME_QUARTERS]);
        let samples: Vec<Sample> = (0..count).map(|_| view.random_sample(random, occluded)).collect();
        let twin = reproject(&view.frame, &view.instances, &samples);
        let device = on_device(&kernel, &view.frame, &view.instances, &samples, count as u32);
        let unsure = uncertain(&view.frame, &view.instances, &samples);
        prop_assert_eq!(compare(view.frame.flags, &device, &twin, &unsure), Ok(()));
        consistent(&device, &view.frame, &view.instances, &samples);
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&context);
}

#[test]
fn the_nearer_of_two_wins_where_it_is_asked_for() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject_nearest::SHADER);
    let mut caught = 0;
    for (case, size) in SIZES.into_iter().chain([[160, 90]]).enumerate() {
        let random = &mut Random::new(100 + case as u32);
        let mut view = View::new(random, size, 5);
        view.frame.flags = [0, FRAME_QUARTERS][case % 2];
        let count = (32 * size[0] * size[1]).min(60_000);
        let share = [0.3, 0.0, 1.0][case % 3];
        let samples: Vec<Sample> = (0..count).map(|_| view.random_sample(random, share)).collect();
        let unsure = uncertain(&view.frame, &view.instances, &samples);
        let device = on_device(&kernel, &view.frame, &view.instances, &samples, count);
        compare(view.frame.flags, &device, &reproject_nearest(&view.frame, &view.instances, &samples), &unsure)
            .unwrap();
        consistent(&device, &view.frame, &view.instances, &samples);
        caught += u32::from(
            compare(view.frame.flags, &device, &reproject(&view.frame, &view.instances, &samples), &unsure).is_err(),
        );
    }
    assert!(caught > 6, "the older ones are others");
    support::assert_clean(&context);
}

#[test]
fn who_does_not_get_a_subpixel_takes_the_next_free_one() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject_displaced::SHADER);
    let mut displaced = 0;
    for (case, size) in SIZES.into_iter().chain([[160, 90]]).enumerate() {
        let random = &mut Random::new(200 + case as u32);
        let mut view = View::new(random, size, 5);
        view.frame.flags = [0, FRAME_QUARTERS][case % 2];
        let count = (random.pick(&[2, 8, 20]) * size[0] * size[1]).min(60_000);
        let mut samples: Vec<Sample> = (0..count).map(|_| view.random_sample(random, 0.3)).collect();
        // A sample that lands on a border could displace others, or not: they are left out.
        samples.retain(|s| matches!(landing_bounded(&view.frame, &view.instances, s, [0.0; 2]), Landing::On(_)));
        let (frame, instances) = (&view.frame, &view.instances);
        let first = reproject_nearest(frame, instances, &samples);
        let device = run(&kernel, frame, instances, &samples, samples.len() as u32, &first, true);
        assert_eq!(device, reproject_displaced(frame, instances, &samples, &first), "{size:?}");
        let claims = |r: &Reprojected| r.claims.iter().filter(|c| **c != UNCLAIMED).count();
        displaced += claims(&device) - claims(&first);
        // Everyone is there once, and in the pixel where it lands.
        let mut seen = HashSet::new();
        for (slot, claim) in device.claims.iter().enumerate().filter(|c| *c.1 != UNCLAIMED) {
            let i = (claim & INSTANCE_MASK) as usize;
            assert!(
                seen.insert(i)
                    && landing(frame, instances, &samples[i], [0.0; 2]).unwrap().0
                        == slot / camera::subpixels(view.frame.flags)
            );
        }
        // The same samples in another order get the same places: a still picture keeps still.
        let at = |r: &Reprojected, samples: &[Sample]| -> Vec<[u32; 3]> {
            let held = r.claims.iter().filter(|c| **c != UNCLAIMED);
            held.map(|c| samples[(c & INSTANCE_MASK) as usize].position.map(f32::to_bits)).collect()
        };
        let before = at(&device, &samples);
        random.shuffle(&mut samples);
        let first = reproject_nearest(frame, instances, &samples);
        assert_eq!(at(&reproject_displaced(frame, instances, &samples, &first), &samples), before);
    }
    assert!(displaced > 1000, "{displaced}");
    support::assert_clean(&context);
}

#[test]
fn of_all_on_one_subpixel_the_nearest_unoccluded_one_stays() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject_nearest::SHADER);
    let random = &mut Random::new(4);
    let view = View::new(random, [7, 5], 4);
    let at = [0.375, 0.625].map(|inside| 3.0 + inside);
    let ndc = [at[0] / 7.0 * 2.0 - 1.0, 1.0 - (at[1] - 1.0) / 5.0 * 2.0];
    for occluded in [0.0, 0.9, 1.0] {
        // Two of every depth: of equally near ones the older stays. A sky sample is farther than everything.
        let mut samples: Vec<Sample> = (0..3000)
            .flat_map(|i| {
                let sample = view.sample(i % 4, view.point(ndc, f64::from(random.between(0.5, 20.0))));
                let hidden = if random.chance(occluded) { OCCLUDED_BIT } else { 0 };
                [Sample { instance: sample.instance | hidden, ..sample }; 2]
            })
            .collect();
        samples.insert(0, View::sky(view.point(ndc, 1.0)));
        samples[0].instance |= if occluded == 1.0 { OCCLUDED_BIT } else { 0 };
        for _ in 0..3 {
            let device = on_device(&kernel, &view.frame, &view.instances, &samples, samples.len() as u32);
            let twin = reproject_nearest(&view.frame, &view.instances, &samples);
            assert_eq!(device, twin);
            let holder: Vec<u32> = device.claims.into_iter().filter(|c| *c != UNCLAIMED).collect();
            assert!(holder.len() == 1 && samples[(holder[0] & INSTANCE_MASK) as usize].instance & INSTANCE_MASK < 4);
            random.shuffle(&mut samples);
        }
    }
    support::assert_clean(&context);
}

#[test]
fn extreme_lists_are_no_exception() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject::SHADER);
    let random = &mut Random::new(7);
    let view = View::new(random, [33, 21], 3);
    let compared = |frame: &Frame, samples: &[Sample], listed: u32| {
        let device = on_device(&kernel, frame, &view.instances, samples, listed);
        let twin = reproject(frame, &view.instances, &samples[..listed as usize]);
        let unsure = uncertain(frame, &view.instances, &samples[..listed as usize]);
        compare(view.frame.flags, &device, &twin, &unsure).unwrap();
        device
    };
    let untouched = |r: &Reprojected| r.masks.iter().all(|&m| m == 0) && r.claims.iter().all(|&c| c == UNCLAIMED);

    assert!(untouched(&compared(&view.frame, &[], 0)), "empty");
    let many: Vec<Sample> = (0..5000).map(|_| view.random_sample(random, 0.3)).collect();
    assert!(untouched(&compared(&view.frame, &many, 0)), "entries behind the list's end are not samples");
    assert!(!untouched(&compared(&view.frame, &many, 700)));
    let reset = Frame { flags: FRAME_RESET, ..view.frame };
    assert!(untouched(&compared(&reset, &many, 5000)), "a reset forgets everything");
    let behind: Vec<Sample> = (0..5000)
        .map(|i| (i, [0, 1].map(|_| random.between(-3.0, 3.0)), -f64::from(random.between(0.01, 100.0))))
        .map(|(i, at, depth)| view.sample(i % 3, view.point(at, depth)))
        .collect();
    assert!(untouched(&compared(&view.frame, &behind, 5000)), "all behind the camera");
    let full: Vec<Sample> = (0..33 * 21 * 16)
        .map(|i| [i % 132, i / 132].map(|v| v as f32 + 0.5))
        .map(|[x, y]| View::sky(view.point([x / 66.0 - 1.0, 1.0 - y / 42.0], 1.0)))
        .collect();
    assert!(
        compared(&view.frame, &full, full.len() as u32).masks.iter().all(|&m| m == u32::MAX),
        "every subpixel full"
    );
    support::assert_clean(&context);
}

#[test]
fn all_on_one_subpixel_leave_the_oldest_unoccluded() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject::SHADER);
    for size in [[1, 1], [7, 5], [64, 64], [1, 100]] {
        let random = &mut Random::new(size[0]);
        let view = View::new(random, size, 4);
        // The middle of subpixel 9 of a pixel near the middle, seen at different depths.
        let middle = size.map(|n| n / 2);
        let at = [middle[0] as f32 + 0.375, middle[1] as f32 + 0.625];
        let ndc = [at[0] / size[0] as f32 * 2.0 - 1.0, 1.0 - at[1] / size[1] as f32 * 2.0];
        let slot = (camera::pixel_index(middle, size), 9);
        let mut samples: Vec<Sample> = (0..3000)
            .map(|i| {
                let sample = view.sample(i % 4, view.point(ndc, f64::from(random.between(0.5, 20.0))));
                let occluded = if random.chance(0.9) { OCCLUDED_BIT } else { 0 };
                Sample { instance: sample.instance | occluded, ..sample }
            })
            .collect();
        for round in 0..4 {
            let oldest_visible = samples.iter().position(|s| s.instance & OCCLUDED_BIT == 0);
            let winner = oldest_visible.map_or(OCCLUDED_BIT, |i| i as u32);
            let device = on_device(&kernel, &view.frame, &view.instances, &samples, 3000);
            assert_eq!(device.claims[16 * slot.0 + 9], winner);
            assert_eq!(device, reproject(&view.frame, &view.instances, &samples));
            assert_eq!(device.masks.iter().map(|m| m.count_ones()).sum::<u32>(), if round == 3 { 1 } else { 2 });
            random.shuffle(&mut samples);
            if round == 2 {
                samples.iter_mut().for_each(|s| s.instance |= OCCLUDED_BIT);
            }
        }
    }
    support::assert_clean(&context);
}

#[test]
fn samples_on_borders_stay_in_reach() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject::SHADER);
    for size in [[1, 1], [7, 5], [97, 61]] {
        let random = &mut Random::new(size[1]);
        let view = View::new(random, size, 4);
        let samples: Vec<Sample> = (0..4000)
            .map(|i| {
                let at = size.map(|n| random.below(4 * n + 1) as f32 / 2.0 / n as f32 - 1.0);
                let relative = view.point(at, f64::from(random.between(0.5, 20.0)));
                if i % 2 == 0 { View::sky(relative) } else { view.sample(i % 4, relative) }
            })
            .collect();
        let device = on_device(&kernel, &view.frame, &view.instances, &samples, 4000);
        consistent(&device, &view.frame, &view.instances, &samples);
        assert!(device.masks.iter().any(|&m| m != 0));
    }
    support::assert_clean(&context);
}

#[test]
fn positions_that_are_no_numbers_do_no_harm() {
    // No cached sample has such a position, and shaders may assume that there are none: nothing is said about where they
    // land, but they write nowhere else, and do not touch what others claim.
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::reproject::SHADER);
    let random = &mut Random::new(5);
    let view = View::new(random, [33, 21], 3);
    let broken = |random: &mut Random| {
        let mut sample = view.random_sample(random, 0.5);
        let (axis, value) = (random.below(3), [f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        sample.position[axis as usize] = random.pick(&value);
        sample
    };
    let samples: Vec<Sample> = (0..4000).map(|_| broken(random)).collect();
    let device = on_device(&kernel, &view.frame, &view.instances, &samples, 4000);
    for (slot, &claim) in device.claims.iter().enumerate().filter(|c| *c.1 != UNCLAIMED) {
        let sample = &samples[(claim & INSTANCE_MASK) as usize];
        assert!(
            matches!(landing_bounded(&view.frame, &view.instances, sample, [0.0; 2]), Landing::Anywhere),
            "{slot} {sample:?}"
        );
    }
    support::assert_clean(&context);
}

#[test]
fn the_twin_keeps_its_own_bound() {
    let random = &mut Random::new(11);
    let mut worst: f64 = 0.0;
    for _ in 0..40 {
        let view = View::new(random, [1920, 1080], 4);
        for _ in 0..500 {
            let sample = view.random_sample(random, 0.0);
            let Some(instance) = view.instances.get(sample.instance as usize) else { continue };
            let exact = camera::transform_bounded(&instance.to_relative, sample.position);
            let rough = camera::transform_point(&instance.to_relative, sample.position);
            let (Projection::Inside(exact), Some(rough)) =
                (camera::project_bounded(&view.frame, exact), camera::project(&view.frame, rough))
            else {
                continue;
            };
            for (e, r) in exact.iter().zip(rough) {
                assert!(e.allows(r), "{e:?} {r}");
                worst = worst.max((f64::from(r) - e.value).abs() / e.error);
                // Negative control: the bound is no blanket permission.
                assert!(!e.allows(r + 3.0 * e.error as f32 + 1e-3));
            }
        }
    }
    println!("the worst error is {worst:.3} of its bound");
    assert!(worst > 0.05, "a bound twenty times too wide proves little: {worst}");
}

#[test]
fn a_still_camera_finds_new_samples_where_they_were_put() {
    // `new_position` leaves a margin of an eighth of a subpixel: wider than the error of a direction in f32 that is
    // projected back, up to frames of 16384 pixels.
    let random = &mut Random::new(3);
    for size in [[640, 480], [16384, 8192]] {
        let view = View::new(random, size, 1);
        for _ in 0..4000 {
            let pixel = size.map(|n| random.below(n));
            let flags = random.pick(&[0, FRAME_QUARTERS]);
            let subpixel = subpixel_bit(random.below(16), flags);
            let at = stillray::oracle::analyze::new_position(pixel, subpixel, random.bits(), flags);
            let direction = camera::camera_direction(&view.frame, at.map(f64::from)).map(|v| v as f32);
            let Projection::Inside(found) = camera::project_bounded(&view.frame, direction.map(Bounded::exact)) else {
                panic!("{pixel:?} is inside")
            };
            let found = found.map(|f| f.value as f32);
            assert_eq!(camera::pixel_of(found, size), pixel);
            assert_eq!(subpixel_bit(camera::subpixel_of(found, pixel), flags), subpixel);
        }
    }
}

/// What Algorithm 1 leaves on one subpixel: its two bits, and whose data it holds.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
struct Slot {
    occupied: bool,
    occluded: bool,
    holder: Option<usize>,
}

/// Paper 1, Algorithm 1, one sample after the other. `literal` takes line 8 as printed. That line clears the occlusion
/// bit which line 5 has just set when an occluded sample comes to an *empty* subpixel, so that no occlusion bit would
/// ever survive. Section 4.1's text and Figure 3 say what is meant: the bit "is copied from the source" then.
fn algorithm_1(slot: &mut Slot, sample: usize, is_occluded: bool, literal: bool) {
    let original = *slot;
    slot.occupied = true; // 5: AtomicOr with both bits
    slot.occluded |= is_occluded;
    let replace = !is_occluded && original.occluded; // 7
    let keeps_bit = is_occluded && (original.occluded || (!literal && !original.occupied));
    if !keeps_bit {
        slot.occluded = false; // 9: AtomicAnd
    }
    if replace || !original.occupied {
        slot.holder = Some(sample); // 13: writeData
    }
}

fn arrivals(order: &[usize], occluded: u32, literal: bool) -> Slot {
    let mut slot = Slot::default();
    order.iter().for_each(|&i| algorithm_1(&mut slot, i, occluded >> i & 1 != 0, literal));
    slot
}

/// The same through our twin: all samples on the one pixel's subpixel, in list order.
fn ours(count: usize, occluded: u32) -> Slot {
    let view = View::new(&mut Random::new(1), [1, 1], 1);
    let samples: Vec<Sample> = (0..count)
        .map(|i| {
            let sample = view.sample(0, view.point([0.25, 0.25], 2.0));
            Sample { instance: sample.instance | (occluded >> i & 1) << 31, ..sample }
        })
        .collect();
    let r = reproject(&view.frame, &view.instances, &samples);
    let claims: Vec<u32> = r.claims.iter().copied().filter(|&c| c != UNCLAIMED).collect();
    Slot {
        occupied: r.masks[0] & 0xffff != 0,
        occluded: r.masks[0] & 0xffff != 0 && r.masks[0] >> 16 == 0,
        holder: claims.first().map(|c| (c & INSTANCE_MASK) as usize),
    }
}

fn permutations(count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![Vec::new()];
    }
    let insert = |shorter: Vec<usize>| {
        (0..count).map(move |at| {
            let mut longer = shorter.clone();
            longer.insert(at, count - 1);
            longer
        })
    };
    permutations(count - 1).into_iter().flat_map(insert).collect()
}

#[test]
fn every_order_of_algorithm_1_leaves_the_visibility_that_we_leave() {
    for count in 0..=5 {
        let orders = permutations(count);
        for occluded in 0..1_u32 << count {
            let ours = ours(count, occluded);
            for order in &orders {
                let theirs = arrivals(order, occluded, false);
                assert_eq!((theirs.occupied, theirs.occluded), (ours.occupied, ours.occluded), "{order:?}");
            }
            // Whoever arrives in list order is kept as we keep it; so ours is one that Algorithm 1 could have kept.
            let in_order: Vec<usize> = (0..count).collect();
            assert_eq!(arrivals(&in_order, occluded, false), ours, "{occluded:b}");
        }
    }
}

#[test]
fn the_comparison_with_algorithm_1_can_fail() {
    // As printed, an occluded sample alone loses its bit; and another order keeps another sample.
    assert!(!arrivals(&[0], 1, true).occluded);
    assert!(ours(1, 1).occluded);
    assert_ne!(arrivals(&[1, 0], 0, false), ours(2, 0));
}
