//! Point tracking agrees with its CPU twin exactly, wherever rounding cannot put a point on another pixel, and its rule is
//! that of paper 3: the nearest point of a pixel directs its ray.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::Zeroable;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::collections::HashSet;
use stillray::gpu::Context;
use stillray::oracle::bounded::Bounded;
use stillray::oracle::camera::{self, Projection};
use stillray::oracle::reproject::{Landing, landing_bounded};
use stillray::oracle::track::{Tracking, UNTRACKED, random_position, track};
use stillray::shaders::{self, Counters, FRAME_RESET, FRAME_SETTLED, Frame, NEW_INSTANCE, Sample, Tracked};
use support::kernel::{Kernel, blank, data, values};
use support::random::{Random, SIZES};
use support::view::View;

/// The three dispatches of the phase.
struct Kernels([Kernel; 3]);

impl Kernels {
    fn new(context: &Context) -> Self {
        let shaders = [shaders::nearest::SHADER, shaders::nearest_index::SHADER, shaders::track::SHADER];
        Self(shaders.map(|shader| Kernel::new(context, shader)))
    }

    fn run(&self, view: &View, previous: &[Sample], aims: &[[f32; 2]]) -> Tracking {
        let [width, height] = view.frame.size;
        let pixels = (width * height) as usize;
        let counters = Counters { samples: previous.len() as u32, shadow_rays: 7, ..Counters::zeroed() };
        let instances = || data(&view.instances);
        let mut tracked = vec![UNTRACKED; pixels];
        for kernel in &self.0[..2] {
            let mut bound = [data(&[view.frame]), instances(), data(&[counters]), data(previous), data(&tracked)];
            // Two-dimensional as in a frame, with groups to spare.
            kernel.run(&mut bound, &[], [64 * (1 + previous.len() as u32 / 64 / 3), 4, 1]);
            tracked = values(&bound[4]);
        }
        let mut bound = [
            data(&[view.frame]),
            instances(),
            data(previous),
            data(&tracked),
            data(aims),
            blank::<Sample>(pixels),
            blank::<u32>(pixels + 1),
            data(&[counters]),
        ];
        self.0[2].run(&mut bound, &[], [width, height, 1]);
        let offsets: Vec<u32> = values(&bound[6]);
        assert!(offsets.iter().copied().eq(0..=pixels as u32), "a sample a pixel, in order");
        let mut counters: Counters = values(&bound[7])[0];
        assert_eq!((counters.samples, counters.shadow_rays), (previous.len() as u32, 7));
        (counters.samples, counters.shadow_rays) = (0, 0);
        Tracking { samples: values(&bound[5]), aims: values(&bound[4]), tracked, counters }
    }
}

/// Pixels that some device could give to another point than ours does, because of where a point lands.
fn uncertain(view: &View, previous: &[Sample]) -> HashSet<usize> {
    let pixels = |sample| match landing_bounded(&view.frame, &view.instances, sample, [0.0; 2]) {
        Landing::Nowhere => HashSet::new(),
        Landing::On(_) => HashSet::new(),
        Landing::Among(places) => {
            let pixels: HashSet<usize> = places.iter().map(|place| place.0).collect();
            // Among the subpixels of one pixel nothing is at stake, unless it may as well be outside.
            let inside = camera::project_bounded(&view.frame, relative(view, sample));
            if pixels.len() == 1 && matches!(inside, Projection::Inside(_)) { HashSet::new() } else { pixels }
        }
        Landing::Anywhere => panic!("no test puts points into the camera"),
    };
    previous.iter().flat_map(pixels).collect()
}

fn relative(view: &View, sample: &Sample) -> [Bounded; 3] {
    match view.instances.get(sample.instance as usize) {
        Some(instance) => camera::transform_bounded(&instance.to_relative, sample.position),
        None => sample.position.map(Bounded::exact),
    }
}

/// Whether a ray may go there, of a pixel whose ray the twin sends to `expected`: to the bit where nothing was divided.
fn is_aim(view: &View, previous: &[Sample], won: &Tracked, expected: [f32; 2], found: [f32; 2]) -> bool {
    if *won == UNTRACKED || view.frame.flags & FRAME_SETTLED != 0 {
        return found == expected;
    }
    let position = camera::project_bounded(&view.frame, relative(view, &previous[won.point as usize]));
    matches!(position, Projection::Inside(p) | Projection::Border(p) if p[0].allows(found[0]) && p[1].allows(found[1]))
}

/// Every pixel that is certain must agree, and the counts with the pixels.
fn compare(view: &View, previous: &[Sample], device: &Tracking, twin: &Tracking) -> Result<usize, String> {
    let unsure = uncertain(view, previous);
    let pixels = twin.tracked.len();
    for i in (0..pixels).filter(|i| !unsure.contains(i)) {
        if device.tracked[i] != twin.tracked[i] {
            return Err(format!("pixel {i}: {:?}, expected {:?}", device.tracked[i], twin.tracked[i]));
        }
        if !is_aim(view, previous, &twin.tracked[i], twin.aims[i], device.aims[i]) {
            return Err(format!("pixel {i}: ray to {:?}, expected {:?}", device.aims[i], twin.aims[i]));
        }
    }
    let mut counted = Counters::zeroed();
    for (i, won) in device.tracked.iter().enumerate() {
        let [x, y] = device.aims[i];
        if device.samples[i] != (Sample { position: [x, y, 0.0], instance: NEW_INSTANCE }) {
            return Err(format!("pixel {i}: {:?} is not a ray to {x}, {y}", device.samples[i]));
        }
        counted.histogram[won.others.wrapping_add(1).min(16) as usize] += 1;
        counted.reused += u32::from(*won != UNTRACKED);
        counted.added += u32::from(*won == UNTRACKED);
    }
    if device.counters == counted {
        Ok(unsure.len())
    } else {
        Err(format!("{:?}, expected {counted:?}", device.counters))
    }
}

/// A view with points, a third of them twice, so that distances tie.
fn scene(random: &mut Random, size: [u32; 2], points: u32) -> (View, Vec<Sample>) {
    let mut view = View::new(random, size, 5);
    view.frame.seed = random.bits();
    view.frame.frame = random.bits();
    let mut samples: Vec<Sample> = (0..points).map(|_| view.random_sample(random, 0.0)).collect();
    samples.extend_from_within(..samples.len() / 3);
    random.shuffle(&mut samples);
    (view, samples)
}

fn aims(random: &mut Random, view: &View) -> Vec<[f32; 2]> {
    (0..view.frame.size[0] * view.frame.size[1]).map(|_| [0, 1].map(|_| random.between(0.0, 100.0))).collect()
}

#[test]
fn rays_go_where_the_twin_says() {
    let context = support::validated_context();
    let kernels = Kernels::new(&context);
    let (mut pixels, mut excluded, mut crowded) = (0, 0, 0);
    for (case, size) in SIZES.into_iter().chain([[160, 90], [33, 17]]).enumerate() {
        let random = &mut Random::new(case as u32);
        let (mut view, previous) = scene(random, size, 64 + size[0] * size[1] * (1 + 3 * (case as u32 % 2)));
        let aims = aims(random, &view);
        for flags in [0, FRAME_SETTLED, FRAME_RESET] {
            view.frame.flags = flags;
            let twin = track(&view.frame, &view.instances, &previous, &aims);
            let device = kernels.run(&view, &previous, &aims);
            excluded += compare(&view, &previous, &device, &twin).unwrap();
            pixels += twin.tracked.len();
            assert_eq!(device.aims == aims, flags == FRAME_SETTLED, "settled rays are those of the last frame");
            assert!(flags != FRAME_RESET || device.tracked.iter().all(|t| *t == UNTRACKED));
            crowded += twin.counters.histogram[3..].iter().sum::<u32>();
            if flags == 0 {
                // Negative controls: the points in another order, and another seed.
                let mut turned = previous.clone();
                turned.rotate_left(1);
                let other = track(&view.frame, &view.instances, &turned, &aims);
                assert!(compare(&view, &previous, &device, &other).is_err(), "{size:?}");
                let reseeded = Frame { seed: !view.frame.seed, flags: FRAME_RESET, ..view.frame };
                let fresh = track(&reseeded, &view.instances, &previous, &aims);
                assert!(compare(&view, &previous, &device, &fresh).is_err(), "{size:?}");
            }
        }
    }
    println!("{excluded} of {pixels} pixels are uncertain, {crowded} have three points or more");
    // The bound of tests/phases_reproject.rs, for a fourth as many borders and a pixel for sixteen subpixels.
    assert!(excluded * 12 < pixels && crowded > 1000);
    support::assert_clean(&context);
}

#[test]
fn proptest_finds_no_other_outcome() {
    let context = support::validated_context();
    let kernels = Kernels::new(&context);
    let inputs = (any::<u32>(), 1_u32..70, 1_u32..70, 0_u32..8000, 0_u32..4);
    let config = Config { cases: 24, failure_persistence: None, ..Config::default() };
    let outcome = TestRunner::new(config).run(&inputs, |(seed, width, height, points, flags)| {
        let random = &mut Random::new(seed);
        let (mut view, previous) = scene(random, [width, height], points);
        view.frame.flags = if flags == FRAME_SETTLED { FRAME_SETTLED } else { 0 };
        let aims = aims(random, &view);
        let twin = track(&view.frame, &view.instances, &previous, &aims);
        let compared = compare(&view, &previous, &kernels.run(&view, &previous, &aims), &twin);
        prop_assert_eq!(compared.err(), None);
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&context);
}

#[test]
fn the_nearest_of_many_on_one_pixel_wins_in_any_order_and_the_first_of_equals() {
    let context = support::validated_context();
    let kernels = Kernels::new(&context);
    for size in [[1, 1], [7, 5], [64, 64]] {
        let random = &mut Random::new(size[0]);
        let view = View::new(random, size, 4);
        let middle = size.map(|n| n / 2);
        let at = middle.map(|m| m as f32 + 0.375);
        let ndc = [at[0] / size[0] as f32 * 2.0 - 1.0, 1.0 - at[1] / size[1] as f32 * 2.0];
        let sky = View::sky(view.point(ndc, 1.0));
        let mut points: Vec<(f64, Sample)> = (0..3000)
            .map(|i| (f64::from(random.between(0.5, 20.0)), i % 4))
            .map(|(depth, instance)| (depth, view.sample(instance, view.point(ndc, depth))))
            .collect();
        let nearest = view.sample(0, view.point(ndc, 0.25));
        points.extend([(f64::INFINITY, sky), (f64::INFINITY, sky), (0.25, nearest), (0.25, nearest)]);
        let index = camera::pixel_index(middle, size);
        let none = vec![[0.0; 2]; (size[0] * size[1]) as usize];
        for _ in 0..4 {
            let samples: Vec<Sample> = points.iter().map(|p| p.1).collect();
            let device = kernels.run(&view, &samples, &none);
            // Depths are far enough apart to be told in f32, but for the two that are the same.
            let first = points.iter().position(|p| p.0 == 0.25).unwrap();
            assert_eq!(device.tracked[index].point, first as u32);
            assert_eq!(device.tracked[index].others + 1, 3004);
            assert_eq!(device.counters.histogram[16], 1);
            random.shuffle(&mut points);
        }
        // Only the sky is left: the first of its points, at infinity.
        let device = kernels.run(&view, &[sky, sky], &none);
        assert_eq!(device.tracked[index], Tracked { nearest: f32::INFINITY.to_bits(), point: 0, others: 1 });
    }
    support::assert_clean(&context);
}

#[test]
fn rays_that_nothing_directs_are_uniform_over_their_pixel() {
    // 63 degrees of freedom: 130 is the quantile of 1 - 1e-6 (tests/phases_generate.rs).
    let chi_squared = |squeeze: f64| {
        let mut counts = [0_u32; 64];
        let random = &mut Random::new(9);
        for pixel in camera::pixels_in_order([160, 100]) {
            let at = random_position(pixel, random.bits());
            let inside = [0, 1].map(|i| f64::from(at[i]) - f64::from(pixel[i]));
            assert!(inside.iter().all(|x| (0.0..=1.0).contains(x)));
            let [x, y] = inside.map(|x| (x * squeeze * 8.0).min(7.0) as usize);
            counts[8 * y + x] += 1;
        }
        counts.iter().map(|&c| (f64::from(c) - 250.0).powi(2) / 250.0).sum::<f64>()
    };
    assert!(chi_squared(1.0) < 130.0);
    assert!(chi_squared(0.9) > 130.0, "negative control");
}
