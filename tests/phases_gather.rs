//! The prefix sum and the dense list agree with their CPU twins exactly, also where the cache is too small for all.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Zeroable, bytes_of, cast_slice};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use stillray::gpu::Context;
use stillray::oracle::analyze::analyze;
use stillray::oracle::camera::{self, pixels_in_order};
use stillray::oracle::gather::{Gathered, gather};
use stillray::oracle::reproject::{Reprojected, UNCLAIMED};
use stillray::oracle::scan::{part_that_fits, scan, thinned};
use stillray::oracle::seed::gathered_seeds;
use stillray::shaders::{
    self, Counters, FRAME_QUARTERS, Frame, INSTANCE_MASK, MODEL_AGE, MODEL_SEED, MODEL_SOURCE, NEW_INSTANCE,
    OCCLUDED_BIT, Sample,
};
use support::kernel::{Bound, Kernel, blank, data, values};
use support::masks::{random_density, random_masks};
use support::random::{Random, SIZES};

fn scan_on_device(kernel: &Kernel, capacity: u32, tiles: &[u32]) -> (Vec<u32>, Counters) {
    let frame = Frame { capacity, ..Frame::zeroed() };
    // What other phases counted has to stay.
    let counted = Counters { reused: 7, lost: 9, histogram: [3; 17], ..Counters::zeroed() };
    let mut bound = [data(&[frame]), data(tiles), data(&[counted])];
    let push = shaders::scan::Push { tile_count: tiles.len() as u32 };
    kernel.run(&mut bound, bytes_of(&push), [256, 1, 1]);
    let counters: Counters = values(&bound[2])[0];
    assert_eq!((counters.reused, counters.lost, counters.histogram), (7, 9, [3; 17]));
    (values(&bound[1]), Counters { reused: 0, lost: 0, histogram: [0; 17], ..counters })
}

#[test]
fn prefix_sums_of_any_length() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::scan::SHADER);
    let random = &mut Random::new(1);
    for length in [0, 1, 2, 63, 64, 255, 256, 257, 511, 1000, 4097, 130_000, 518_400] {
        let most = random.pick(&[1, 2, 65, 1025]);
        let tiles: Vec<u32> = (0..length).map(|_| random.below(most)).collect();
        let total: u32 = tiles.iter().sum();
        let capacities = [total, total.saturating_sub(1), total / 2, total / 3 + 1, 1, 0, u32::MAX >> 1];
        for capacity in if length < 5000 { &capacities[..] } else { &capacities[..2] } {
            let frame = Frame { capacity: *capacity, ..Frame::zeroed() };
            let (device, twin) = (scan_on_device(&kernel, *capacity, &tiles), scan(&frame, &tiles));
            assert!(device == twin, "{length} tiles, capacity {capacity}: {:?} {:?}", device.1, twin.1);
        }
    }
    // The largest list that an index with a bit to spare can hold, and one that takes two rows of workgroups.
    for tiles in [vec![1 << 23; 255], vec![2_097_153]] {
        let (device, twin) = (scan_on_device(&kernel, u32::MAX >> 1, &tiles), scan(&large(), &tiles));
        assert!(device == twin, "{:?} {:?}", device.1, twin.1);
        assert_eq!(twin.1.thin, 0);
    }
    // Negative control: one count more is another sum.
    let (device, mut tiles) = (scan_on_device(&kernel, 100, &[1, 2, 3]), vec![1, 2, 3]);
    tiles[1] += 1;
    assert!(device != scan(&Frame { capacity: 100, ..Frame::zeroed() }, &tiles));
    support::assert_clean(&context);
}

fn large() -> Frame {
    Frame { capacity: u32::MAX >> 1, ..Frame::zeroed() }
}

/// Everything that goes into the phase.
struct Inputs {
    frame: Frame,
    reprojected: Reprojected,
    plan: Vec<u32>,
    /// Samples that each tile asks for.
    tiles: Vec<u32>,
    previous: Vec<Sample>,
    ages: Vec<u32>,
}

impl Inputs {
    /// Random masks, claimed by samples of the last frame in no particular order, and the analysis' plan for them.
    fn random(seed: u32, size: [u32; 2], share: f32) -> Self {
        let random = &mut Random::new(seed);
        let flags = random.pick(&[0, FRAME_QUARTERS]);
        let there = camera::subpixel_bits(flags);
        let mut masks = random_masks(random, size);
        masks.iter_mut().for_each(|mask| *mask &= there | there << 16);
        let listed: u32 = masks.iter().map(|m| (m & 0xffff).count_ones()).sum();
        let mut order: Vec<u32> = (0..listed + 10).collect();
        random.shuffle(&mut order);
        let mut order = order.into_iter();
        let mut claims = vec![UNCLAIMED; camera::subpixels(flags) * masks.len()];
        for (pixel, mask) in masks.iter().enumerate() {
            for bit in (0..16).filter(|bit| mask >> bit & 1 != 0) {
                let occluded = if mask >> (16 + bit) & 1 == 0 { OCCLUDED_BIT } else { 0 };
                claims[camera::claim_slot(pixel, bit, flags)] = order.next().unwrap() | occluded;
            }
        }
        let sample = |random: &mut Random| Sample {
            position: [0, 1, 2].map(|_| random.between(-1e3, 1e3)),
            instance: random.bits(),
        };
        let previous: Vec<Sample> = (0..listed + 10).map(|_| sample(random)).collect();
        let ages = (0..listed + 10).map(|_| random.pick(&[0, 1, 77, u32::MAX - 1, u32::MAX])).collect();
        let mut frame = Frame {
            size,
            frame: random.bits(),
            seed: random.bits(),
            d_target: random_density(random),
            d_tolerance: random_density(random) / 4.0,
            occluded_limit: random.below(17),
            flags,
            ..Frame::zeroed()
        };
        let analysis = analyze(&frame, &masks);
        let total: u32 = analysis.tiles.iter().sum();
        frame.capacity = (f64::from(total) * f64::from(share)) as u32;
        let (plan, tiles) = (analysis.plan, analysis.tiles);
        Self { frame, reprojected: Reprojected { claims, masks }, plan, tiles, previous, ages }
    }

    /// What every variant binds, and the counts of the prefix sum.
    fn bound(&self) -> (Vec<Bound<'static>>, Counters) {
        let (tiles, counters) = scan(&self.frame, &self.tiles);
        let bound = vec![
            data(&[self.frame]),
            data(&self.reprojected.claims),
            data(&self.reprojected.masks),
            data(&self.plan),
            data(&tiles),
            data(&[counters]),
            data(&self.previous),
            blank::<Sample>(counters.samples as usize),
            blank::<u32>(self.plan.len() + 1),
        ];
        (bound, counters)
    }

    fn twin(&self) -> Gathered {
        let (_, counters) = scan(&self.frame, &self.tiles);
        gather(&self.frame, counters.thin, &self.reprojected, &self.plan, &self.previous, &self.ages)
    }
}

struct Kernels {
    context: Context,
    /// Plain, with ages, with sources, with both.
    variants: [Kernel; 4],
}

/// What a variant does besides.
#[derive(Clone, Copy)]
struct With {
    ages: bool,
    sources: bool,
}

const PLAIN: With = With { ages: false, sources: false };
const ALL: With = With { ages: true, sources: true };
const VARIANTS: [With; 4] = [PLAIN, With { ages: true, ..PLAIN }, With { sources: true, ..PLAIN }, ALL];

impl Kernels {
    fn new() -> Self {
        let context = support::validated_context();
        let variants = [
            shaders::gather::SHADER,
            shaders::gather::modelling(MODEL_AGE),
            shaders::gather::modelling(MODEL_SOURCE),
            shaders::gather::modelling(MODEL_AGE | MODEL_SOURCE),
        ];
        Self { variants: variants.map(|shader| Kernel::new(&context, shader)), context }
    }

    fn run(&self, inputs: &Inputs, with: With) -> Gathered {
        let (mut bound, counters) = inputs.bound();
        if with.ages {
            bound.push(data(&inputs.ages));
            bound.push(blank::<u32>(counters.samples as usize));
        }
        if with.sources {
            bound.push(blank::<u32>(counters.samples as usize));
        }
        let [width, height] = inputs.frame.size;
        let kernel = &self.variants[usize::from(with.ages) + 2 * usize::from(with.sources)];
        kernel.run(&mut bound, &[], [width, height, 1]);
        let written = |there: bool, binding: usize| if there { values(&bound[binding]) } else { Vec::new() };
        let sources = written(with.sources, if with.ages { 11 } else { 9 });
        Gathered { samples: values(&bound[7]), offsets: values(&bound[8]), ages: written(with.ages, 10), sources }
    }
}

fn compare(device: &Gathered, twin: &Gathered) -> Result<(), String> {
    if let Some(i) = (0..twin.offsets.len()).find(|&i| device.offsets[i] != twin.offsets[i]) {
        return Err(format!("offset {} of pixel {i}, expected {}", device.offsets[i], twin.offsets[i]));
    }
    // Samples by their bits.
    if cast_slice::<Sample, u8>(&device.samples) != cast_slice::<Sample, u8>(&twin.samples) {
        let i = (0..twin.samples.len()).find(|&i| device.samples[i] != twin.samples[i]);
        return Err(format!("sample {i:?}"));
    }
    if device.ages != twin.ages {
        return Err("ages".to_owned());
    }
    if device.sources == twin.sources { Ok(()) } else { Err("sources".to_owned()) }
}

#[test]
fn lists_are_the_twins() {
    let kernels = Kernels::new();
    for (seed, size) in SIZES.into_iter().cycle().take(24).enumerate() {
        let share = [1.0, 0.9, 0.5, 0.01, 2.0, 0.0][seed % 6];
        let inputs = Inputs::random(seed as u32, size, share);
        let twin = inputs.twin();
        for with in VARIANTS {
            let mut twin = twin.clone();
            twin.ages.truncate(if with.ages { usize::MAX } else { 0 });
            twin.sources.truncate(if with.sources { usize::MAX } else { 0 });
            assert_eq!(compare(&kernels.run(&inputs, with), &twin), Ok(()), "{size:?} {share}");
        }
    }
    let config = Config { cases: 16, failure_persistence: None, ..Config::default() };
    let cases = (any::<u32>(), 1_u32..80, 1_u32..80, 0.0_f32..1.5);
    let outcome = TestRunner::new(config).run(&cases, |(seed, width, height, share)| {
        let inputs = Inputs::random(seed, [width, height], share);
        prop_assert_eq!(compare(&kernels.run(&inputs, ALL), &inputs.twin()), Ok(()));
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&kernels.context);
}

#[test]
fn kept_samples_keep_their_seeds_and_new_ones_get_their_pixels() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::gather::modelling(MODEL_SEED));
    let mut caught = 0;
    for (seed, size) in SIZES.into_iter().cycle().take(16).enumerate() {
        let inputs = Inputs::random(seed as u32, size, [1.0, 0.6, 2.0][seed % 3]);
        let (mut bound, counters) = inputs.bound();
        let list = inputs.twin();
        let masks = &inputs.reprojected.masks;
        // Any words do for the seeds of the last frame.
        bound.extend([data(&inputs.ages), blank::<u32>(counters.samples as usize)]);
        kernel.run(&mut bound, &[], [size[0], size[1], 1]);
        let kept = inputs.plan.iter().zip(masks).map(|(plan, mask)| (plan & 0xffff & mask >> 16).count_ones());
        let visible: Vec<u32> = kept.collect();
        let device: Vec<u32> = values(&bound[10]);
        assert_eq!(device, gathered_seeds(&inputs.frame, &list, &visible, &inputs.ages), "{size:?}");
        assert_eq!(values::<u32>(&bound[8]), list.offsets);
        // Negative control: numbered from nothing on.
        let none = vec![0; visible.len()];
        caught += usize::from(device != gathered_seeds(&inputs.frame, &list, &none, &inputs.ages));
    }
    assert!(caught > 8, "{caught}");
    support::assert_clean(&context);
}

#[test]
fn any_plan_is_followed() {
    // Not only what the analysis would plan: nothing, everything kept, everything new, and both at random.
    let kernels = Kernels::new();
    for (i, size) in [[1, 1], [7, 5], [97, 61], [1, 100]].into_iter().enumerate() {
        let random = &mut Random::new(i as u32);
        for kind in 0..4 {
            let mut inputs = Inputs::random(100 + i as u32, size, 1.0);
            let there = camera::subpixel_bits(inputs.frame.flags);
            let mut plan_for = |mask: u32| match kind {
                0 => 0,
                1 => mask & 0xffff,
                2 => there << 16,
                _ => {
                    let kept = mask & random.bits() & 0xffff;
                    kept | (random.bits() & there & !kept) << 16
                }
            };
            inputs.plan = inputs.reprojected.masks.iter().map(|&m| plan_for(m)).collect();
            let [across, down] = camera::tiles(size);
            inputs.tiles = vec![0; (across * down) as usize];
            for (pixel, plan) in pixels_in_order(size).zip(&inputs.plan) {
                inputs.tiles[(pixel[1] / 8 * across + pixel[0] / 8) as usize] += plan.count_ones();
            }
            inputs.frame.capacity = inputs.tiles.iter().sum::<u32>() / (1 + kind % 2);
            assert_eq!(compare(&kernels.run(&inputs, ALL), &inputs.twin()), Ok(()), "{size:?} plan {kind}");
        }
    }
    support::assert_clean(&kernels.context);
}

#[test]
fn wrong_twins_are_caught() {
    let kernels = Kernels::new();
    let inputs = Inputs::random(5, [40, 30], 0.7);
    let device = kernels.run(&inputs, ALL);
    let twin = inputs.twin();
    assert_eq!(compare(&device, &twin), Ok(()));
    let mut off_by_one = twin.clone();
    off_by_one.offsets[600] += 1;
    assert!(compare(&device, &off_by_one).is_err());
    let mut younger = twin.clone();
    younger.ages.iter_mut().for_each(|age| *age = age.saturating_sub(1));
    assert!(compare(&device, &younger).is_err());
    let other_seed = Inputs { frame: Frame { seed: !inputs.frame.seed, ..inputs.frame }, ..inputs };
    assert!(compare(&device, &other_seed.twin()).is_err());
    // Occluded samples before new ones.
    let swapped = Reprojected { masks: vec![u32::MAX; 1200], ..other_seed.reprojected.clone() };
    let wrong = Inputs {
        frame: Frame { seed: !other_seed.frame.seed, ..other_seed.frame },
        reprojected: swapped,
        ..other_seed
    };
    assert!(compare(&device, &wrong.twin()).is_err());
    support::assert_clean(&kernels.context);
}

#[test]
fn what_does_not_fit_is_given_up_evenly_and_the_least_urgent_first() {
    let kernels = Kernels::new();
    for (seed, share) in [(1, 0.99), (2, 0.6), (3, 0.25), (4, 0.001)] {
        let inputs = Inputs::random(seed, [61, 43], share);
        let device = kernels.run(&inputs, PLAIN);
        let total: u32 = inputs.tiles.iter().sum();
        let (capacity, listed) = (inputs.frame.capacity, *device.offsets.last().unwrap());
        assert!(total > capacity, "the case is one of overflow");
        assert_eq!(listed, scan(&inputs.frame, &inputs.tiles).1.samples);
        assert!(listed <= capacity && listed + 1 >= capacity, "{listed} of {capacity}");
        for (index, &plan) in inputs.plan.iter().enumerate() {
            let range = device.offsets[index] as usize..device.offsets[index + 1] as usize;
            let (wanted, got) = (plan.count_ones(), range.len() as u32);
            // Whole numbers next to the fair share, which is off by what the part's rounding to 2^-32 makes of `total`.
            let fair = f64::from(wanted) * f64::from(capacity) / f64::from(total);
            assert!(got <= wanted && (f64::from(got) - fair).abs() <= 1.0, "{got} of {wanted}, fair {fair}");
            let visible = inputs.reprojected.masks[index] >> 16;
            let (new, urgent) = (plan >> 16, plan & visible);
            let kinds = device.samples[range].iter().map(|s| s.instance & INSTANCE_MASK == NEW_INSTANCE);
            let new_kept = kinds.filter(|&new| new).count() as u32;
            // New ones only after all unoccluded ones, occluded ones only after all new ones.
            assert!(new_kept <= got.saturating_sub(urgent.count_ones()).min(new.count_ones()));
            let for_occluded = got - new_kept.min(got) - urgent.count_ones().min(got - new_kept);
            assert!(for_occluded == 0 || new_kept == new.count_ones());
        }
    }
    support::assert_clean(&kernels.context);
}

proptest! {
    #![proptest_config(Config { cases: 2000, failure_persistence: None, ..Config::default() })]

    #[test]
    fn thinned_offsets_never_pass_the_capacity(
        capacity in 0_u32..1 << 31, total in 0_u32..1 << 31, offset: u32, count in 0_u32..=16,
    ) {
        let thin = part_that_fits(capacity, total);
        prop_assert_eq!(thin == 0, total <= capacity);
        prop_assert!(thinned(total, thin) <= capacity.min(total));
        prop_assert!(thinned(total, thin) + 1 >= capacity.min(total));
        // A pixel never gets more than it asks for, so that its bits suffice.
        let offset = offset % (total + 1);
        let (first, end) = (thinned(offset, thin), thinned(offset + count, thin));
        prop_assert!(end >= first && end - first <= count);
    }
}
