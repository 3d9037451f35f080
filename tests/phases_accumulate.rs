//! What diffuse paths bring goes into the means of samples on the device as in the CPU twin.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Zeroable, bytes_of};
use half::f16;
use stillray::gpu::Context;
use stillray::oracle::accumulate::{accumulate, within_limit};
use stillray::shaders::{self, Counters, FRAME_LIT_ALIKE, Frame, Gathered, NO_SOURCE, Shaded};
use support::kernel::{Kernel, data, values};
use support::random::Random;

const UNUSED: usize = 7;

/// What the shader reads of a list.
#[derive(Clone)]
struct Inputs {
    frame: Frame,
    brought: Vec<[u32; 4]>,
    started: Vec<Gathered>,
    shaded: Vec<Shaded>,
    previous: Vec<Gathered>,
}

fn radiance(random: &mut Random) -> [f32; 3] {
    let size = random.pick(&[0.0, 1e-30, 0.01, 1.0, 30.0, 1e4, 1e30]);
    [0; 3].map(|_| size * random.between(0.0, 1.0))
}

impl Inputs {
    fn random(random: &mut Random, count: u32) -> Self {
        let before = |random: &mut Random| {
            let paths = random.pick(&[0, 1, 18, 19, 20, 0xffff, random.clone().below(0xffff)]);
            Gathered { radiance: radiance(random), paths: paths | random.below(0x1_0000) << 16 }
        };
        let path = |random: &mut Random| {
            let mut light = radiance(random);
            light[random.below(3) as usize] = random.pick(&[light[0], f32::INFINITY, f32::NAN, -1.0, f32::MAX]);
            let [r, g, b] = if random.chance(0.8) { radiance(random) } else { light };
            let source = if random.chance(0.3) { NO_SOURCE } else { random.below(count + 5) };
            [r.to_bits(), g.to_bits(), b.to_bits(), source]
        };
        let started = |random: &mut Random| {
            let kind = u32::from(random.chance(0.7));
            Gathered { radiance: [0; 3].map(|_| if kind == 1 { random.between(0.0, 1.0) } else { 0.0 }), paths: kind }
        };
        let shaded = |random: &mut Random| {
            let mut half = || u32::from(f16::from_f32(random.between(0.0, 9.0)).to_bits());
            Shaded { color_rg: half() | half() << 16, color_b_offset: half() | 0xabcd_0000, motion: 77, depth: 3.5 }
        };
        let alpha = random.pick(&[0.01, 0.1, 1.0]);
        Self {
            frame: Frame {
                flags: random.pick(&[0, FRAME_LIT_ALIKE]),
                indirect_alpha: alpha,
                indirect_count: ((2.0 - alpha) / alpha).round() as u32,
                indirect_clamp: random.pick(&[0.0, 0.5, 100.0]),
                ..Frame::zeroed()
            },
            brought: (0..count).map(|_| path(random)).collect(),
            started: (0..count).map(|_| started(random)).collect(),
            shaded: (0..count).map(|_| shaded(random)).collect(),
            previous: (0..count + 5).map(|_| before(random)).collect(),
        }
    }

    fn on_device(&self, context: &Context, kernel: &Kernel, stable: bool) -> (Vec<Gathered>, Vec<Shaded>) {
        let count = self.brought.len();
        let padded = |list: &[Gathered]| [list, &[Gathered { radiance: [9.0; 3], paths: 9 }; UNUSED]].concat();
        let counters = Counters { samples: count as u32, ..Counters::default() };
        let mut bound = vec![data(&[self.frame]), data(&[counters]), data(&self.brought)];
        bound.extend([data(&padded(&self.started)), data(&self.shaded)]);
        bound.extend(stable.then(|| data(&self.previous)));
        kernel.run(&mut bound, &[], [(count as u32).div_ceil(2).next_multiple_of(64), 2, 1]);
        support::assert_clean(context);
        let mut gathered = values::<Gathered>(&bound[3]);
        assert!(gathered.split_off(count).iter().all(|g| g.paths == 9), "written behind the list's end");
        (gathered, values(&bound[4]))
    }
}

/// Whether a float is another but for so many roundings at a size.
fn near(got: f32, want: f32, size: f32, roundings: f32) -> bool {
    got.is_finite() && (got - want).abs() <= roundings * size / 16_777_216.0 + f32::MIN_POSITIVE
}

fn half(bits: u32) -> f32 {
    f16::from_bits(bits as u16).to_f32()
}

/// The first sample whose mean or colour is not the twin's, and which of the two.
fn wrong(
    inputs: &Inputs,
    stable: bool,
    (gathered, shaded): &(Vec<Gathered>, Vec<Shaded>),
) -> Option<(usize, &'static str)> {
    for (i, got) in gathered.iter().enumerate() {
        let previous = stable.then_some(&inputs.previous[..]);
        let (want, light) = accumulate(&inputs.frame, previous, inputs.started[i], inputs.brought[i]);
        let [r, g, b, source] = inputs.brought[i];
        let path = within_limit([r, g, b].map(f32::from_bits), inputs.frame.indirect_clamp);
        let before = if stable && source != NO_SOURCE { inputs.previous[source as usize].radiance } else { [0.0; 3] };
        // A limit's quotient is off by 2.5 ulp and its product by one rounding; the weight by 2.5 ulp and the mean by three.
        let fits = |c: usize| near(got.radiance[c], want.radiance[c], path[c].max(before[c]), 24.0);
        if got.paths != want.paths || !(0..3).all(fits) {
            return Some((i, "mean"));
        }
        let colors = |s: &Shaded| [s.color_rg, s.color_rg >> 16, s.color_b_offset].map(half);
        let (old, new) = (colors(&inputs.shaded[i]), colors(&shaded[i]));
        // Halves may be rounded to either neighbour; the least step is 2^-24.
        let stored = |c: usize| {
            let value = (old[c] + light[c]).min(65504.0);
            let slack = light[c].min(65504.0) * 1e-5 + value / 1024.0 + 2f32.powi(-24);
            (new[c] - value).abs() <= slack
        };
        let rest = |s: &Shaded| (s.color_b_offset >> 16, s.motion, s.depth.to_bits());
        let untouched = inputs.started[i].paths != 0 || bytes_of(&inputs.shaded[i]) == bytes_of(&shaded[i]);
        if !(0..3).all(stored) || rest(&inputs.shaded[i]) != rest(&shaded[i]) || !untouched {
            return Some((i, "colour"));
        }
    }
    None
}

#[test]
fn the_device_takes_means_as_the_twin_does() {
    let context = support::validated_context();
    let kernels = [
        (true, Kernel::new(&context, shaders::accumulate_stable::SHADER)),
        (false, Kernel::new(&context, shaders::accumulate::SHADER)),
    ];
    for seed in 0..40 {
        let random = &mut Random::new(seed);
        let count = random.pick(&[1, 63, 64, 65, 1000]);
        let inputs = Inputs::random(random, count);
        for (stable, kernel) in &kernels {
            let got = inputs.on_device(&context, kernel, *stable);
            assert_eq!(wrong(&inputs, *stable, &got), None, "seed {seed}, {stable}");
            if count < 1000 {
                continue;
            }
            // Negative controls: another weight, another limit, another source, no albedo.
            let caught = |change: &dyn Fn(&mut Inputs), what: &str| {
                let mut other = inputs.clone();
                change(&mut other);
                assert!(wrong(&other, *stable, &got).is_some(), "seed {seed}, {stable}: {what}");
            };
            if *stable {
                caught(&|i| i.frame.flags ^= FRAME_LIT_ALIKE, "alike");
                caught(&|i| i.brought.iter_mut().for_each(|b| b[3] = NO_SOURCE), "source");
                caught(&|i| i.previous.iter_mut().for_each(|g| g.paths ^= 0x1_0000), "number");
            }
            caught(&|i| i.frame.indirect_clamp = 0.3, "limit");
            caught(&|i| i.started.iter_mut().for_each(|g| g.radiance[1] *= 0.9), "albedo");
            caught(&|i| i.started.iter_mut().for_each(|g| g.paths = 0), "path");
        }
    }
}

/// Values that a driver may not call numbers: the mean stays one.
#[test]
fn what_is_no_number_brings_nothing() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::accumulate_stable::SHADER);
    let mut inputs = Inputs::random(&mut Random::new(3), 64);
    inputs.frame.indirect_clamp = 0.0;
    for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        inputs.brought.iter_mut().for_each(|b| b[..3].fill(bad.to_bits()));
        inputs.started.iter_mut().for_each(|g| *g = Gathered { radiance: [1.0; 3], paths: 1 });
        let (gathered, shaded) = inputs.on_device(&context, &kernel, true);
        assert!(gathered.iter().all(|g| g.radiance.iter().all(|x| x.is_finite() && *x >= 0.0)), "{bad}");
        assert!(shaded.iter().all(|s| half(s.color_rg).is_finite()), "{bad}");
    }
}
