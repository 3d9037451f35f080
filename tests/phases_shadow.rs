//! Shadow rays on the device reach the lights that they reach on the CPU.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod accel_support;
mod stage_support;
mod support;

use bytemuck::bytes_of;
use glam::Vec3;
use rayon::prelude::*;
use stage_support::{Gallery, Theatre};
use std::cell::Cell;
use stillray::gpu::Context;
use stillray::oracle::shadow::{Outcome, shadow, shadow_query};
use stillray::oracle::traverse::{Intersection, Query, any_with_alpha};
use stillray::oracle::verify::verify;
use stillray::shaders::{self, Counters, FOUND_LOST, Found, HIT_SKY, INFINITY_BITS, Light, OCCLUDED_BIT, SKY_INSTANCE};
use support::kernel::{Kernel, blank, data, values};
use support::random::Random;

const SIZE: [u32; 2] = [160, 120];
const UNUSED: usize = 7;

struct Device {
    context: Context,
    kernel: Kernel,
    alpha: bool,
}

impl Device {
    fn new(alpha: bool) -> Self {
        let context = support::validated_context();
        let shader = if alpha { &shaders::shadow_alpha::SHADER } else { &shaders::shadow::SHADER };
        Self { kernel: Kernel::new(&context, shader), context, alpha }
    }

    /// Bits a sample, and the count of rays.
    fn run(&self, theatre: &Theatre, found: &[Found]) -> (Vec<u32>, u32) {
        let gallery = Gallery::new(&self.context, &theatre.atlas);
        let unused = Found { instance: 0, primitive: 0, u: 0.3, v: 0.3 };
        let padded: Vec<Found> = found.iter().copied().chain([unused; UNUSED]).collect();
        let geometry = &theatre.geometry;
        let counters = Counters { samples: found.len() as u32, shadow_rays: 1000, ..Counters::default() };
        let mut bound = vec![
            data(&[theatre.frame]),
            data(&theatre.instances),
            data(&[counters]),
            theatre.nodes(),
            data(&geometry.triangle_corners),
            data(&geometry.triangle_rest),
            data(&theatre.lights),
            data(&padded),
            blank::<u32>(padded.len()),
        ];
        if self.alpha {
            bound.extend([data(&geometry.triangles), data(&theatre.materials), data(&geometry.vertices)]);
            bound.extend([gallery.bound(), Gallery::srgb()]);
        }
        self.kernel.run(&mut bound, &[], [(padded.len() as u32).div_ceil(2).next_multiple_of(64), 2, 1]);
        let mut bits = values::<u32>(&bound[8]);
        assert!(bits.split_off(found.len()).iter().all(|b| *b == u32::MAX), "written behind the list's end");
        let after: Counters = values(&bound[2])[0];
        assert_eq!(bytes_of(&Counters { shadow_rays: 1000, ..after }), bytes_of(&counters), "another count changed");
        (bits, after.shadow_rays - 1000)
    }
}

/// What verification may have found: seen points, points anywhere on triangles, hidden and lost ones, and sky.
fn random_found(theatre: &Theatre, random: &mut Random) -> Found {
    match random.below(8) {
        0 => Found { instance: random.pick(&[0, OCCLUDED_BIT]), primitive: FOUND_LOST, u: 0.0, v: 0.0 },
        1 => Found { instance: SKY_INSTANCE, primitive: HIT_SKY, u: 0.0, v: 0.0 },
        2..5 => verify(&theatre.stage(true), theatre.new_sample(random)).found,
        kind => {
            let (instance, primitive) = theatre.random_triangle(random);
            let u = random.between(0.0, 1.0);
            let hidden = if kind == 5 { OCCLUDED_BIT } else { 0 };
            Found { instance: instance | hidden, primitive, u, v: random.between(0.0, 1.0 - u) }
        }
    }
}

fn random_list(theatre: &Theatre, seed: u32, count: u32) -> Vec<Found> {
    let one = |i: u32| random_found(theatre, &mut Random::new(seed.wrapping_add(i.wrapping_mul(104_729))));
    (0..count).into_par_iter().map(one).collect()
}

fn twins(theatre: &Theatre, list: &[Found], alpha: bool) -> Vec<Outcome> {
    list.par_iter().map(|f| shadow(&theatre.stage(alpha), &theatre.lights, f)).collect()
}

/// Whether a shadow ray is so near to an edge that its outcome changes when its ends are moved within their rounding.
fn is_grazing(theatre: &Theatre, alpha: bool, found: &Found, light: &Light) -> bool {
    let stage = theatre.stage(alpha);
    let Some(query) = shadow_query(&stage, light, found, &Cell::new(false)) else { return false };
    let blocked = |query: &Query| {
        let doubtful = Cell::new(false);
        any_with_alpha(&stage.world, query, &|hit: &Intersection| stage.alpha_hit(hit, &doubtful))
    };
    let outcome = blocked(&query);
    // The origin is a position, exact, and a clearance along a normal, neither off by more than some 64 U of itself; the
    // sum rounds. So do the transforms on the way to a blocker, by some 16 U of where they are.
    let size = 32.0 / 16_777_216.0 * (query.origin.abs().max_element() + 1.0);
    let around = (0..26).map(|i| Vec3::new((i % 3) as f32 - 1.0, (i / 3 % 3) as f32 - 1.0, (i / 9) as f32 - 1.0));
    around.into_iter().any(|d| blocked(&Query { origin: query.origin + d * size, ..query }) != outcome)
}

/// Lights on which device and twin differ, or what is wrong. Where a device's rounding may decide otherwise is a matter of
/// the shadow's edge, or of the twin's doubts: see there.
fn compare(
    theatre: &Theatre,
    alpha: bool,
    list: &[Found],
    want: &[Outcome],
    got: &(Vec<u32>, u32),
) -> Result<usize, String> {
    let mut differing = 0;
    for ((found, want), got) in list.iter().zip(want).zip(&got.0) {
        for i in (0..32).filter(|i| (want.bits ^ got) >> i & 1 != 0) {
            let doubtful = want.doubtful >> i & 1 != 0;
            let light = theatre.lights.get(i).ok_or("a bit without a light")?;
            if !(doubtful || is_visible(found) && is_grazing(theatre, alpha, found, light)) {
                return Err(format!("{found:?}: {got:b} instead of {:b}", want.bits));
            }
            differing += 1;
        }
    }
    let rays: u32 = want.iter().map(|w| w.rays).sum();
    let doubtful: u32 = want.iter().map(|w| w.doubtful.count_ones()).sum();
    let off = got.1.abs_diff(rays);
    if off > doubtful { Err(format!("{} rays instead of {rays}", got.1)) } else { Ok(differing) }
}

#[test]
fn the_device_sees_the_lights_that_the_twin_sees() {
    let theatre = Theatre::new(SIZE);
    for alpha in [false, true] {
        let device = Device::new(alpha);
        let list = random_list(&theatre, 1, 20_000);
        let want = twins(&theatre, &list, alpha);
        let got = device.run(&theatre, &list);
        let differing = compare(&theatre, alpha, &list, &want, &got).unwrap();
        let doubtful = want.iter().filter(|w| w.doubtful != 0).count();
        println!("alpha {alpha}: {} rays, {differing} bits differ, {doubtful} in doubt", got.1);
        assert!(differing * 1000 <= list.len() && doubtful * 1000 <= list.len(), "{differing} {doubtful}");
        for i in 0..theatre.lights.len() {
            let lit = got.0.iter().filter(|b| *b >> i & 1 != 0).count();
            let traced = list.iter().filter(|f| reaches_out(&theatre, f, i)).count();
            assert!(traced > lit + 100, "light {i}: {lit} of {traced}: some of its rays are blocked");
            // Light 3 is inside a ball, and shines through nothing.
            assert!(lit > 100 || i == 3, "light {i} reaches {lit}");
        }
        for count in [1, 63, 64, 65, 129] {
            let got = device.run(&theatre, &list[..count]);
            assert_eq!(compare(&theatre, alpha, &list[..count], &want[..count], &got), Ok(0));
        }
        support::assert_clean(&device.context);
    }
}

fn is_visible(found: &Found) -> bool {
    found.primitive != FOUND_LOST && found.instance < SKY_INSTANCE
}

/// Whether a ray towards this light is traced at all.
fn reaches_out(theatre: &Theatre, found: &Found, light: usize) -> bool {
    is_visible(found) && shadow_query(&theatre.stage(true), &theatre.lights[light], found, &Cell::new(false)).is_some()
}

#[test]
fn counts_of_lights_are_kept_to() {
    let mut theatre = Theatre::new(SIZE);
    let device = Device::new(true);
    let list = random_list(&theatre, 2, 500);
    let all = theatre.lights.clone();
    for count in [0, 1, 32] {
        theatre.lights = all.iter().cycle().take(count).copied().collect();
        theatre.frame.light_count = count as u32;
        if count == 0 {
            theatre.lights.push(all[0]);
        }
        let want = twins(&theatre, &list, true);
        let got = device.run(&theatre, &list);
        assert!(compare(&theatre, true, &list, &want, &got).is_ok(), "{count} lights");
        assert!(got.0.iter().all(|b| count == 32 || *b >> count == 0));
    }
    assert!(device.run(&theatre, &list).0.iter().any(|b| b >> 31 != 0), "the last of 32 is used");
    support::assert_clean(&device.context);
}

#[test]
fn wrong_answers_are_caught() {
    let theatre = Theatre::new(SIZE);
    let device = Device::new(true);
    let list = random_list(&theatre, 3, 4000);
    let got = device.run(&theatre, &list);
    let want = twins(&theatre, &list, true);
    assert!(compare(&theatre, true, &list, &want, &got).is_ok());
    let differs = |theatre: &Theatre, alpha: bool, what: &str| {
        assert!(compare(theatre, alpha, &list, &twins(theatre, &list, alpha), &got).is_err(), "{what}");
    };
    differs(&theatre, false, "alpha not looked at");
    let mut wrong = Theatre::new(SIZE);
    wrong.lights[1].position[0] += 0.01;
    differs(&wrong, true, "a light that is a centimetre off");
    let mut wrong = Theatre::new(SIZE);
    wrong.lights.swap(0, 2);
    differs(&wrong, true, "lights mixed up");
    let mut wrong = got.clone();
    let dark = (0..list.len()).find(|&i| want[i] == Outcome::default()).unwrap();
    wrong.0[dark] = 1;
    assert!(compare(&theatre, true, &list, &want, &wrong).is_err(), "a hidden sample lit");
    let wrong = (got.0.clone(), got.1 + 1);
    assert!(compare(&theatre, true, &list, &want, &wrong).is_err(), "one ray too many");
    support::assert_clean(&device.context);
}

/// Both sides of a lit sheet: the light is on one side, and only those who see that side see it lit.
#[test]
fn a_light_behind_the_surface_costs_no_ray() {
    let theatre = Theatre::new(SIZE);
    let stage = theatre.stage(true);
    // The floor is seen from above; light 4 is below it.
    let floor = theatre.geometry.meshes[0].first_triangle;
    let found = Found { instance: 0, primitive: floor, u: 0.3, v: 0.3 };
    let doubt = Cell::new(false);
    assert!(shadow_query(&stage, &theatre.lights[4], &found, &doubt).is_none());
    let query = shadow_query(&stage, &theatre.lights[0], &found, &doubt).unwrap();
    assert_eq!(query.tmax.to_bits(), INFINITY_BITS);
    assert_eq!(shadow_query(&stage, &theatre.lights[1], &found, &doubt).unwrap().tmax, 1.0);
    assert!(!doubt.get());
}
