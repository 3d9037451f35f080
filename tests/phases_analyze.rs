//! The density analysis agrees with its CPU twin to the bit, and the twin is what paper 1, section 4.2 asks for.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::Zeroable;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use stillray::oracle::analyze::{self, Analysis, BAYER, balanced, plan_pixel, sample_demand, stratum_mask};
use stillray::oracle::camera::{pixel_index, pixels_in_order, subpixel_bit, tiles};
use stillray::oracle::random::pixel_hash;
use stillray::shaders::{self, Counters, FRAME_PAPER_EDGES, FRAME_QUARTERS, FRAME_SETTLED, Frame};
use support::kernel::{Kernel, blank, data, values};
use support::masks::{random_density, random_masks, random_word};
use support::random::{Random, SIZES};

fn on_device(kernel: &Kernel, frame: &Frame, masks: &[u32]) -> Analysis {
    let [across, down] = tiles(frame.size);
    let mut bound = [
        data(&[*frame]),
        data(masks),
        blank::<u32>(masks.len()),
        blank::<u32>((across * down) as usize),
        data(&[Counters::zeroed()]),
    ];
    kernel.run(&mut bound, &[], [frame.size[0], frame.size[1], 1]);
    Analysis { plan: values(&bound[2]), tiles: values(&bound[3]), counters: values(&bound[4])[0] }
}

fn compare(device: &Analysis, twin: &Analysis) -> Result<(), String> {
    if let Some(i) = (0..twin.plan.len()).find(|&i| device.plan[i] != twin.plan[i]) {
        return Err(format!("plan {:08x} of pixel {i}, expected {:08x}", device.plan[i], twin.plan[i]));
    }
    let rest = (&device.tiles, device.counters) == (&twin.tiles, twin.counters);
    if rest { Ok(()) } else { Err(format!("counts {:?}, expected {:?}", device.counters, twin.counters)) }
}

/// The first subpixel of each stratum.
const QUARTER_BITS: u32 = 0x0505;

fn random_frame(random: &mut Random, size: [u32; 2]) -> Frame {
    Frame {
        size,
        frame: random.bits(),
        seed: random.bits(),
        d_target: random_density(random),
        d_tolerance: random_density(random),
        occluded_limit: random.below(17),
        flags: random.pick(&[
            0,
            0,
            FRAME_PAPER_EDGES,
            FRAME_QUARTERS,
            FRAME_QUARTERS | FRAME_PAPER_EDGES,
            FRAME_SETTLED,
        ]),
        ..Frame::zeroed()
    }
}

#[test]
fn plans_tiles_and_counts_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::analyze::SHADER);
    for (seed, size) in SIZES.into_iter().cycle().take(32).enumerate() {
        let random = &mut Random::new(seed as u32);
        let masks = random_masks(random, size);
        let frame = random_frame(random, size);
        compare(&on_device(&kernel, &frame, &masks), &analyze::analyze(&frame, &masks)).unwrap();
    }
    let inputs = (any::<u32>(), 1_u32..80, 1_u32..80);
    let config = Config { cases: 24, failure_persistence: None, ..Config::default() };
    let outcome = TestRunner::new(config).run(&inputs, |(seed, width, height)| {
        let random = &mut Random::new(seed);
        let masks = random_masks(random, [width, height]);
        let frame = random_frame(random, [width, height]);
        prop_assert_eq!(compare(&on_device(&kernel, &frame, &masks), &analyze::analyze(&frame, &masks)), Ok(()));
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&context);
}

#[test]
fn the_two_runs_of_a_frame_with_a_fill_are_the_twins() {
    let context = support::validated_context();
    let keep = Kernel::new(&context, shaders::analyze_keep::SHADER);
    let fill = Kernel::new(&context, shaders::analyze_fill::SHADER);
    for (seed, size) in SIZES.into_iter().cycle().take(16).enumerate() {
        let random = &mut Random::new(seed as u32);
        let masks = random_masks(random, size);
        let frame = random_frame(random, size);
        compare(&on_device(&keep, &frame, &masks), &analyze::keep(&frame, &masks)).unwrap();
        let device = on_device(&fill, &frame, &masks);
        compare(&device, &analyze::fill(&frame, &masks)).unwrap();
        assert_eq!(device.plan, analyze::analyze(&frame, &masks).plan, "the same decision");
        let others = [analyze::keep(&frame, &masks), analyze::analyze(&frame, &masks)];
        let same = others.iter().filter(|other| compare(&device, other).is_ok()).count();
        assert!(same == 0 || masks.len() < 200, "another count of tiles is noticed");
    }
    support::assert_clean(&context);
}

#[test]
fn uniform_frames_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::analyze::SHADER);
    let targets = [(1.0, 1.0), (0.0625, 0.0625), (16.0, 0.0625), (0.3, 0.2), (4.0, 16.0), (2.5, 0.5)];
    for (i, (d_target, d_tolerance)) in targets.into_iter().enumerate() {
        for word in [0, 0xffff, 0xffff_ffff, 0x0001_0001, 0x0001, 0x8421_8421, 0x00ff_ffff] {
            for occluded_limit in [0, 1, 16] {
                let size = SIZES[i];
                let frame = Frame { size, d_target, d_tolerance, occluded_limit, seed: i as u32, ..Frame::zeroed() };
                let masks = vec![word; (size[0] * size[1]) as usize];
                compare(&on_device(&kernel, &frame, &masks), &analyze::analyze(&frame, &masks)).unwrap();
            }
        }
    }
    support::assert_clean(&context);
}

#[test]
fn a_settled_frame_keeps_everything() {
    let random = &mut Random::new(1);
    let masks = random_masks(random, [40, 30]);
    let frame = Frame { size: [40, 30], d_target: 1.0, flags: FRAME_SETTLED, ..Frame::zeroed() };
    let plan = analyze::analyze(&frame, &masks).plan;
    assert!(plan.iter().zip(&masks).all(|(plan, mask)| *plan == mask & 0xffff));
}

/// The plan of the paper's rule, which holds where nothing is hidden and below a sample a pixel, made from other windows and other strata than ours, to show that the comparison notices.
fn plan_with(frame: &Frame, masks: &[u32], seen: impl Fn(u32) -> u32, turn: u32) -> Vec<u32> {
    let seen: Vec<u32> = masks.iter().map(|&m| seen(m)).collect();
    // Turning a mask's columns by one before planning and back after is what a shifted stratum mask does.
    let columns = |half: u32, by: u32| (0..16).fold(0, |m, b| m | (half >> b & 1) << (b / 4 * 4 + (b + by) % 4));
    let turned = |word: u32, by: u32| columns(word & 0xffff, by) | columns(word >> 16, by) << 16;
    let plan = pixels_in_order(frame.size).zip(masks).map(|(pixel, &word)| {
        let (count, quarters) = analyze::window(pixel, frame.size, &seen, |m| m >> 16);
        let demand = sample_demand(count, quarters, frame.d_target, frame.d_tolerance, pixel);
        let h = pixel_hash(pixel, frame.frame, frame.seed);
        turned(plan_pixel(turned(word, turn), demand, frame.occluded_limit, 0xffff, h), 4 - turn)
    });
    plan.collect()
}

#[test]
fn wrong_twins_are_caught() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::analyze::SHADER);
    let random = &mut Random::new(9);
    let size = [64, 40];
    let masks = random_masks(random, size);
    let frame = Frame { size, d_target: 0.75, d_tolerance: 0.5, occluded_limit: 4, ..Frame::zeroed() };
    let device = on_device(&kernel, &frame, &masks);
    let twin = |plan: Vec<u32>| Analysis { plan, ..analyze::analyze(&frame, &masks) };
    assert_eq!(compare(&device, &twin(plan_with(&frame, &masks, |m| m, 0))), Ok(()));
    // The window shifted by a subpixel, the window of occupied instead of unoccluded samples, shifted strata.
    let shifted = |m: u32| (m & 0xffff) | (m >> 16 << 1 & 0xeeee) << 16;
    assert!(compare(&device, &twin(plan_with(&frame, &masks, shifted, 0))).is_err());
    assert!(compare(&device, &twin(plan_with(&frame, &masks, |m| m | m << 16, 0))).is_err());
    assert!(compare(&device, &twin(plan_with(&frame, &masks, |m| m, 1))).is_err());
    // The paper's rule at edges.
    let denser = Frame { d_target: 3.0, ..frame };
    let papers = Analysis { plan: plan_with(&denser, &masks, |m| m, 0), ..analyze::analyze(&denser, &masks) };
    assert!(compare(&on_device(&kernel, &denser, &masks), &papers).is_err());
    // Asked for, that rule is followed.
    let asked = Frame { flags: FRAME_PAPER_EDGES, ..denser };
    assert_eq!(analyze::analyze(&asked, &masks).plan, papers.plan);
    assert_eq!(on_device(&kernel, &asked, &masks).plan, papers.plan);
    let all_visible: Vec<u32> = masks.iter().map(|m| (m >> 16) * 0x1_0001).collect();
    let plan = plan_with(&denser, &all_visible, |m| m, 0);
    assert_eq!(analyze::analyze(&denser, &all_visible).plan, plan, "where nothing is hidden it is the paper's");
    // One tile's count off by one.
    let mut off = analyze::analyze(&frame, &masks);
    off.tiles[7] += 1;
    assert!(compare(&device, &off).is_err());
    support::assert_clean(&context);
}

/// A word, a demand, a limit and a hash.
fn pixels() -> impl Strategy<Value = (u32, i32, u32, u32)> {
    let word =
        (any::<u32>(), 0.0_f32..=1.0, 0.0_f32..=1.0).prop_map(|(s, a, b)| random_word(&mut Random::new(s), a, b));
    (word, -16_i32..=16, 0_u32..=16, any::<u32>())
}

fn in_stratum(mask: u32) -> [u32; 4] {
    [0, 1, 2, 3].map(|s| (mask & stratum_mask(s)).count_ones())
}

proptest! {
    #![proptest_config(Config { cases: 2000, failure_persistence: None, ..Config::default() })]

    #[test]
    fn a_pixel_keeps_and_adds_what_it_was_asked_to((word, demand, limit, h) in pixels()) {
        let plan = plan_pixel(word, demand, limit, 0xffff, h);
        let (visible, occluded) = (word >> 16, word & 0xffff & !(word >> 16));
        let (kept, added) = (plan & 0xffff, plan >> 16);
        prop_assert!(plan.count_ones() <= 16);
        prop_assert_eq!(kept & added, 0);
        prop_assert_eq!(kept & !(visible | occluded), 0);
        prop_assert_eq!(added & visible, 0);
        let wanted = (visible.count_ones() as i32 + demand).clamp(0, 16) as u32;
        prop_assert_eq!((kept & visible).count_ones() + added.count_ones(), wanted);
        prop_assert!((kept & occluded).count_ones() <= limit);
        // Occluded samples go only where the limit or a new sample drives them out, and that only from a full stratum.
        let spare = (occluded & !added).count_ones().saturating_sub(limit);
        prop_assert_eq!((occluded & !kept & !added).count_ones(), spare);
        for s in 0..4 {
            let stratum = stratum_mask(s);
            let driven_out = occluded & added & stratum != 0;
            prop_assert!(!driven_out || (stratum & !(visible | occluded | added)) == 0);
        }
    }

    #[test]
    fn quarter_pixels_take_a_sample_each((word, demand, limit, h) in pixels()) {
        let word = word & (QUARTER_BITS | QUARTER_BITS << 16);
        let plan = plan_pixel(word, demand, limit, QUARTER_BITS, h);
        let (visible, occluded) = (word >> 16, word & 0xffff & !(word >> 16));
        let (kept, added) = (plan & 0xffff, plan >> 16);
        prop_assert_eq!((kept | added) & !QUARTER_BITS, 0);
        prop_assert_eq!((kept & added, kept & !(visible | occluded), added & visible), (0, 0, 0));
        let wanted = (visible.count_ones() as i32 + demand).clamp(0, 4) as u32;
        prop_assert_eq!((kept & visible).count_ones() + added.count_ones(), wanted);
    }

    #[test]
    fn evictions_come_from_the_fullest_stratum((word, _, _, h) in pixels()) {
        let after = |n: i32| plan_pixel(word, -n, 16, 0xffff, h) & (word >> 16);
        for n in 0..(word >> 16).count_ones() as i32 {
            let (before, evicted) = (after(n), after(n) & !after(n + 1));
            prop_assert_eq!(evicted.count_ones(), 1);
            let counts = in_stratum(before);
            let from = in_stratum(evicted).iter().position(|&c| c == 1).unwrap();
            prop_assert_eq!(Some(&counts[from]), counts.iter().max());
        }
    }

    #[test]
    fn additions_go_to_the_emptiest_stratum((word, _, _, h) in pixels()) {
        let after = |n: i32| plan_pixel(word, n, 16, 0xffff, h) >> 16;
        for n in 0..16 - (word >> 16).count_ones() as i32 {
            let (before, added) = (after(n) | word >> 16, after(n + 1) & !after(n));
            prop_assert_eq!(added.count_ones(), 1);
            let counts = in_stratum(before);
            let to = in_stratum(added).iter().position(|&c| c == 1).unwrap();
            prop_assert_eq!(Some(&counts[to]), counts.iter().min());
        }
    }

    #[test]
    fn demand_is_nothing_inside_the_tolerance_and_rounds_to_a_neighbour_outside(
        count in 0_u32..=64, quarters in prop::sample::select(vec![4_u32, 6, 8, 9, 12, 16]),
        target in 0.0625_f32..=16.0, tolerance in 0.0625_f32..=16.0, x in 0_u32..4, y in 0_u32..4,
    ) {
        let count = count.min(4 * quarters);
        let n = sample_demand(count, quarters, target, tolerance, [x, y]);
        // The exact lack differs from the one in f32 by 2^-24 of the largest number in it, 16 x 16.
        let lack = f64::from(target) - f64::from(4 * count) / f64::from(quarters);
        let rounding = 16.0 * 16.0 / 16_777_216.0;
        let tolerance = if lack > 0.0 { tolerance.min(target) } else { tolerance };
        if lack.abs() < f64::from(tolerance) - rounding {
            prop_assert_eq!(n, 0);
        }
        if lack.abs() > f64::from(tolerance) + rounding {
            prop_assert!((f64::from(n) - lack).abs() < 1.0 + rounding);
            prop_assert!(n == 0 || (n > 0) == (lack > 0.0));
        }
    }

    #[test]
    fn whole_demands_are_equation_1(count in 0_u32..=64, target in 1_u32..=16, tolerance in 1_u32..=16) {
        // On 16 quarters, a whole density is a count that is a multiple of four.
        let count = count / 4 * 4;
        let lack = f64::from(target) - f64::from(count) / 4.0;
        // Equation 1 knows no empty windows: see `an_empty_frame_fills_whatever_the_tolerance`.
        prop_assume!(count > 0 || tolerance <= target);
        let equation_1 = if lack.abs() >= f64::from(tolerance) { lack.signum() * lack.abs().ceil() } else { 0.0 };
        for pixel in pixels_in_order([4, 4]) {
            let n = sample_demand(count, 16, target as f32, tolerance as f32, pixel);
            prop_assert_eq!(f64::from(n), equation_1);
        }
    }

    #[test]
    fn fractional_demands_are_met_on_average(count in 0_u32..=64, sixteenths in 1_u32..=256) {
        // Both the target and a density of count / 4 are whole numbers of sixteenths, which 16 pixels can meet exactly.
        let target = sixteenths as f32 / 16.0;
        let lack = f64::from(target) - f64::from(count) / 4.0;
        prop_assume!(lack.abs() >= 0.0625);
        let sum: i32 = pixels_in_order([4, 4]).map(|p| sample_demand(count, 16, target, 0.0625, p)).sum();
        prop_assert_eq!(f64::from(sum) / 16.0, lack);
    }

    #[test]
    fn new_samples_lie_inside_their_subpixel(x in 0_u32..16384, y in 0_u32..16384, subpixel in 0_u32..16, h: u32) {
        for (flags, across) in [(0, 4), (FRAME_QUARTERS, 2)] {
            let at = analyze::new_position([x, y], subpixel_bit(subpixel, flags), h, flags);
            let corner = [subpixel % 4, subpixel / 4].map(|place| place * across / 4);
            for (i, pixel) in [x, y].into_iter().enumerate() {
                let inside = (f64::from(at[i]) - f64::from(pixel)) * f64::from(across) - f64::from(corner[i]);
                // Up to four subpixels a pixel, and half an ulp of a coordinate of up to 2^14.
                let rounding = 4.0 * f64::from(2.0_f32.powi(14 - 24));
                prop_assert!(inside >= 0.125 - rounding && inside <= 0.875 + rounding, "{}", inside);
            }
        }
    }
}

#[test]
fn the_dither_is_even_at_every_scale() {
    let mut all: Vec<u32> = BAYER.into_iter().flatten().collect();
    all.sort_unstable();
    assert_eq!(all, (0..16).collect::<Vec<_>>());
    for (x, y) in [(0, 0), (2, 0), (0, 2), (2, 2)] {
        let mut quarters = [BAYER[y][x], BAYER[y][x + 1], BAYER[y + 1][x], BAYER[y + 1][x + 1]].map(|b| b / 4);
        quarters.sort_unstable();
        assert_eq!(quarters, [0, 1, 2, 3]);
    }
}

#[test]
fn the_window_is_clipped_to_the_frame() {
    let full = |size: [u32; 2]| vec![u32::MAX; (size[0] * size[1]) as usize];
    // A full frame has 16 samples a pixel in every window, at its corners and edges too.
    for (size, pixel, quarters) in
        [([1, 1], [0, 0], 4), ([1, 9], [0, 4], 8), ([5, 5], [0, 0], 9), ([5, 5], [2, 0], 12), ([5, 5], [2, 2], 16)]
    {
        assert_eq!(analyze::window(pixel, size, &full(size), |m| m >> 16), (4 * quarters, quarters));
    }
    // Of a neighbour only the half that faces the pixel counts.
    let mut masks = vec![0; 25];
    masks[pixel_index([1, 2], [5, 5])] = 0x1111_1111;
    assert_eq!(analyze::window([2, 2], [5, 5], &masks, |m| m >> 16).0, 0);
    masks[pixel_index([1, 2], [5, 5])] = 0x8888_8888;
    assert_eq!(analyze::window([2, 2], [5, 5], &masks, |m| m >> 16).0, 4);
}

/// A still scene in which everything stays visible: what a frame adds, the next one finds.
fn frames_until_nothing_changes(d_target: f32, d_tolerance: f32) -> Option<u32> {
    let size = [32, 32];
    let mut masks = vec![0; 1024];
    for n in 0..64 {
        let frame = Frame { size, frame: n, d_target, d_tolerance, ..Frame::zeroed() };
        let plan = analyze::analyze(&frame, &masks).plan;
        let next: Vec<u32> = plan.iter().map(|p| (p | p >> 16) & 0xffff).map(|m| m | m << 16).collect();
        if next == masks {
            return Some(n);
        }
        masks = next;
    }
    None
}

#[test]
fn an_empty_frame_fills_whatever_the_tolerance() {
    for (target, tolerance) in [(0.5, 1.0), (0.0625, 16.0), (2.0, 3.0), (1.0, 1.0), (15.9, 16.0)] {
        let frame = Frame { size: [32, 32], d_target: target, d_tolerance: tolerance, ..Frame::zeroed() };
        let first = analyze::analyze(&frame, &[0; 1024]).counters.added;
        // The dither meets the target to a sixteenth of a sample a pixel.
        assert!((first as f32 / 1024.0 - target).abs() <= 1.0 / 32.0, "{target} {tolerance}: {first} samples");
        assert!(frames_until_nothing_changes(target, tolerance).is_some_and(|n| n <= 3));
    }
    // Where there is something, the tolerance is what it says.
    assert_eq!(sample_demand(1, 16, 0.5, 1.0, [3, 3]), 0);
}

#[test]
fn a_still_scene_settles_by_itself() {
    for (target, tolerance) in [(1.0, 1.0), (0.5, 0.5), (0.25, 0.25), (2.0, 1.0), (4.0, 1.0), (16.0, 1.0)] {
        let frames = frames_until_nothing_changes(target, tolerance);
        println!("d_target {target}, d_tolerance {tolerance}: {frames:?}");
        assert!(frames.is_some_and(|n| n <= 32), "{target} {tolerance} {frames:?}");
    }
}

proptest! {
    #[test]
    fn balancing_only_evicts_what_crowds((word, _, _, h) in pixels()) {
        let after = balanced(word, h);
        prop_assert_eq!(after & !word, 0, "nothing is added");
        let hidden = |w: u32| w & 0xffff & !(w >> 16);
        prop_assert_eq!(hidden(after), hidden(word), "what is hidden stays");
        let (least, counts) = (in_stratum(word >> 16).into_iter().min(), in_stratum(after >> 16));
        prop_assert_eq!(counts.into_iter().min(), least, "the emptiest stratum keeps what it has");
        prop_assert!(counts.into_iter().max() <= least.map(|l| l + 1));
        let even = in_stratum(word >> 16).into_iter().max() <= least.map(|l| l + 1);
        prop_assert_eq!(after == word, even, "and an even pixel all of it");
    }
}

/// Planned density of a row of pixels with these visible and hidden subpixels, in the middle of it.
fn planned(visible: u32, hidden: u32) -> u32 {
    let frame = Frame { size: [5, 5], d_target: 4.0, d_tolerance: 1.0, occluded_limit: 4, ..Frame::zeroed() };
    let plan = analyze::analyze(&frame, &[visible << 16 | visible | hidden; 25]).plan[12];
    let kept = plan & 0xffff & !hidden;
    assert_eq!((plan >> 16) & kept, 0);
    kept | plan >> 16
}

#[test]
fn beside_hidden_samples_every_stratum_gets_its_own() {
    // Three samples in one stratum, none in two: within the window's tolerance, and left alone where nothing is hidden.
    let crowded = 0x0001 | 0x0002 | 0x0010 | 0x8000;
    assert_eq!(planned(crowded, 0), crowded);
    assert_eq!(in_stratum(planned(crowded, 0x0400)), [1; 4]);
}
