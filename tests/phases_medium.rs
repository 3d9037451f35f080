//! The march through fog and mist on the device agrees with its CPU twin, within a derived bound.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::bytes_of;
use glam::{DVec3, Vec3};
use half::f16;
use stillray::oracle::camera::pixel_index;
use stillray::oracle::medium::{Air, Seen};
use stillray::scene::medium::{Medium, Mist, Region, noise};
use stillray::shaders::{
    self, Counters, FRAME_FILL, Frame, Instance, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SHARP, Light, Shaded,
};
use support::kernel::{Kernel, data, values};
use support::random::Random;

const SIZE: [u32; 2] = [21, 13];
const U: f64 = 1.0 / 16_777_216.0;
/// What a colour may be off by, as a part of the brightest that the pixel shows or the medium scatters. In units of U:
/// - exp is exact to 3 + 2 x ulp (Vulkan), 6 U + 4 U x e^-x: 8; so are the transmittances of up to 64 steps, one after the
///   other: 512; 1 - exp(-x) beyond 1/16 is off by 8 U of a part that adds up to 1: 128.
/// - Points of a march through fog: a logarithm (6) of what has lost 2 U of at least 1/64: 134, on lights that are at least as
///   far off as points are apart, squared: 268. Through mist: densities change by at most 3 across half a box, and noise by 2
///   a cell, amplitude / size * 32 cells = 4 of them a box; points are off by 16 U of the way: 16 * 3 * 8 = 384.
/// - The phase function: 1 + g² - 2 g c is off by 16 U of up to 4 where the least is (1 - 0.6)² = 0.16, to the power of 1.5: 600.
/// - Where a march ends: gathered or not, 2^-12 of the rest: 4096, if the two differ on it.
/// - Irradiance, albedo, sums of 64 steps: 128.
const OFF: f64 = 6200.0 * U;

struct Case {
    frame: Frame,
    medium: shaders::Medium,
    noise: Vec<f32>,
    lights: Vec<Light>,
    offsets: Vec<u32>,
    extras: Vec<u32>,
    shaded: Vec<Shaded>,
}

fn frame(random: &mut Random, lights: usize) -> Frame {
    Frame {
        right: [1.0, 0.0, 0.0, 0.5],
        up: [0.0, 1.0, 0.0, 0.35],
        forward: [0.0, 0.0, -1.0, 0.05],
        size: SIZE,
        seed: random.bits(),
        jitter: random.pick(&[0, 7]),
        light_count: lights as u32,
        flags: random.pick(&[0, FRAME_FILL]),
        shadow_rays: 0,
        ..Frame::default()
    }
}

/// Lights that are far from what is looked at.
fn light(random: &mut Random) -> Light {
    let towards = Vec3::from(random.direction());
    let lamp = random.chance(0.5);
    Light {
        kind: if lamp { LIGHT_POINT } else { LIGHT_DIRECTIONAL },
        shape: LIGHT_SHARP,
        position: (towards * 90.0).to_array(),
        direction: (-towards).to_array(),
        intensity: [1.0, 0.8, 0.6].map(|c| if lamp { 20_000.0 * c } else { 3.0 * c }),
        ..Light::default()
    }
}

fn medium(random: &mut Random) -> Medium {
    let mut rgb = |most: f32| Vec3::from([0, 1, 2].map(|_| random.between(0.0, most)));
    let (scattering, absorption) = (rgb(0.4), rgb(0.1));
    let mist = Mist {
        low: DVec3::new(-8.0, -3.0, -25.0),
        high: DVec3::new(7.0, 2.0, random.pick(&[-4.0, 3.0])),
        amplitude: random.pick(&[0.0, 0.5]),
        size: 4.0,
        drift: DVec3::X,
    };
    let region = random.pick(&[Region::Everywhere, Region::Mist(mist)]);
    Medium { scattering, absorption, anisotropy: random.between(-0.6, 0.6), region }
}

fn sample(random: &mut Random) -> Shaded {
    let color = [0, 1, 2].map(|_| f16::from_f32(random.between(0.0, 2.0)).to_bits());
    let depth = random.pick(&[-1.0, f32::INFINITY, random.clone().between(0.1, 30.0), 2.5]);
    Shaded {
        color_rg: u32::from(color[0]) | u32::from(color[1]) << 16,
        color_b_offset: u32::from(color[2]) | random.bits() << 16,
        motion: random.bits(),
        depth,
    }
}

impl Case {
    fn random(seed: u32) -> Self {
        let random = &mut Random::new(seed);
        let lights: Vec<Light> = (0..random.below(4)).map(|_| light(random)).collect();
        let frame = frame(random, lights.len());
        let medium = medium(random);
        let ambient = Vec3::new(0.3, 0.2, 0.5) * random.pick(&[0.0, 1.0]);
        let record = medium.record(DVec3::ZERO, DVec3::new(2.5, 0.0, -1.0), ambient);
        let steps = random.pick(&[1, 5, 32, 64]);
        let pixels = SIZE[0] * SIZE[1];
        let mut runs = |first: u32| {
            let mut offsets = vec![first];
            (0..pixels).for_each(|i| offsets.push(offsets[i as usize] + random.below(4)));
            offsets
        };
        let offsets = runs(0);
        let extras = runs(offsets[pixels as usize]);
        let shaded = (0..extras[pixels as usize]).map(|_| sample(random)).collect();
        let medium_record = shaders::Medium { steps, ..record };
        Self { frame, medium: medium_record, noise: noise(Some(&medium)), lights, offsets, extras, shaded }
    }

    fn run(&self, kernel: &Kernel) -> Vec<Shaded> {
        let lights = if self.lights.is_empty() { vec![Light::default()] } else { self.lights.clone() };
        let mut bound = vec![
            data(&[self.frame]),
            data(&[Instance::default()]),
            data(&[Counters::default()]),
            data(&[[0u32; 20]]),
            data(&[[0f32; 8]]),
            data(&[0f32; 4]),
            data(&lights),
            data(&[self.medium]),
            data(&self.noise),
            data(&self.shaded),
            data(&self.offsets),
            data(&self.extras),
        ];
        kernel.run(&mut bound, &[], [SIZE[0], SIZE[1], 1]);
        values::<Shaded>(&bound[9])
    }

    fn slots(&self, index: usize) -> Vec<usize> {
        let run = |list: &[u32]| list[index] as usize..list[index + 1] as usize;
        let filled = self.frame.flags & FRAME_FILL != 0;
        run(&self.offsets).chain(if filled { run(&self.extras) } else { 0..0 }).collect()
    }

    /// Colours of the slots of each pixel, with the brightest that they may come from.
    fn twin(&self) -> Vec<(usize, DVec3, f64)> {
        let air = Air { medium: &self.medium, noise: &self.noise };
        let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
        let one = |[x, y]: [u32; 2]| {
            let index = pixel_index([x, y], SIZE);
            let ndc = [(f64::from(x) + 0.5) / f64::from(SIZE[0]), (f64::from(y) + 0.5) / f64::from(SIZE[1])];
            let [u, v] = ndc.map(|c| 2.0 * c - 1.0);
            let [w, h] = [self.frame.right[3], self.frame.up[3]].map(f64::from);
            let direction = DVec3::new(u * w, -v * h, -1.0).normalize();
            let slots: Vec<usize> = self.slots(index).into_iter().filter(|s| self.shaded[*s].depth >= 0.0).collect();
            let samples: Vec<Seen> = slots
                .iter()
                .map(|s| Seen { depth: self.shaded[*s].depth.into(), color: color(&self.shaded[*s]) })
                .collect();
            let seen = air.march(&self.frame, (index as u32, direction), &self.lights, &samples, |_, _| true);
            // Phase functions of |g| up to 0.6 are up to 0.8 a steradian; lights are up to 3 lux, and one counts for all.
            let most = 2.0 + 0.5 + 0.8 * 3.0 * self.lights.len() as f64;
            slots.into_iter().zip(seen).map(move |(slot, color)| (slot, color, most)).collect::<Vec<_>>()
        };
        pixels.flat_map(one).collect()
    }
}

fn half(bits: u32) -> f64 {
    f64::from(f16::from_bits(bits as u16).to_f32())
}

fn color(s: &Shaded) -> DVec3 {
    DVec3::new(half(s.color_rg), half(s.color_rg >> 16), half(s.color_b_offset))
}

/// Slots that differ by more than their bound, and the most that one does, as a part of its bound.
fn differing(case: &Case, device: &[Shaded]) -> (usize, f64) {
    let mut worst: f64 = 0.0;
    let twin = case.twin();
    let bad = twin.iter().filter(|(slot, want, most)| {
        let off = (color(&device[*slot]) - *want).abs();
        // A half rounds by 2^-10 of itself at most, whichever way the driver goes.
        let bound = *want * 2f64.powi(-10) + DVec3::splat(OFF * most + 2f64.powi(-24));
        worst = worst.max((off / bound).max_element());
        !off.cmple(bound).all()
    });
    (bad.count(), worst)
}

#[test]
fn the_march_agrees_with_its_twin() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::medium::SHADER);
    let mut worst: f64 = 0.0;
    for seed in 0..40 {
        let case = Case::random(seed);
        let device = case.run(&kernel);
        let (bad, most) = differing(&case, &device);
        worst = worst.max(most);
        assert_eq!(bad, 0, "case {seed}: off by {most} bounds");
        // All else stays as it was, and so do samples that are not visible, or not this frame's.
        let listed: Vec<usize> = case.twin().into_iter().map(|(slot, ..)| slot).collect();
        for (slot, (after, before)) in device.iter().zip(&case.shaded).enumerate() {
            let same = after.motion == before.motion
                && after.depth.to_bits() == before.depth.to_bits()
                && after.color_b_offset >> 16 == before.color_b_offset >> 16;
            assert!(same && (listed.contains(&slot) || bytes_of(after) == bytes_of(before)), "case {seed}, {slot}");
        }
        assert_eq!(bytemuck::cast_slice::<_, u8>(&device), bytemuck::cast_slice::<_, u8>(&case.run(&kernel)));
    }
    println!("off by at most {worst:.3} of the bound");
    support::assert_clean(&context);
}

/// What is wrong by a little is found.
#[test]
fn the_comparison_can_fail() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::medium::SHADER);
    let changes: [fn(&mut Case); 5] = [
        |c| c.medium.scattering[1] *= 1.05,
        |c| c.medium.absorption[0] += 0.01,
        |c| c.medium.steps += 1,
        |c| c.medium.ambient[2] += 0.02,
        |c| c.frame.seed ^= 1,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let found = (0..20).filter(|seed| {
            let mut case = Case::random(*seed);
            let device = case.run(&kernel);
            change(&mut case);
            differing(&case, &device).0 > 0
        });
        assert!(found.count() > 5, "change {i}");
    }
}

/// With everything modelled and no medium, nothing is touched.
#[test]
fn no_medium_changes_nothing() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::medium::SHADER);
    let mut case = Case::random(3);
    case.medium = shaders::Medium { steps: 32, ..shaders::Medium::default() };
    assert_eq!(bytemuck::cast_slice::<_, u8>(&case.run(&kernel)), bytemuck::cast_slice::<_, u8>(&case.shaded));
}
