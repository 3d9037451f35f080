//! Shadow rays on the device reach the lights that they reach on the CPU.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod accel_support;
mod stage_support;
mod support;

use bytemuck::bytes_of;
use glam::Vec3;
use rayon::prelude::*;
use stage_support::{Draw, Gallery, Theatre};
use std::cell::Cell;
use stillray::gpu::Context;
use stillray::oracle::shadow::{Outcome, chosen_lights, light_from_afar, light_weight, shadow, shadow_query};
use stillray::oracle::traverse::{Intersection, Query, any_with_alpha};
use stillray::oracle::verify::verify;
use stillray::shaders::{
    self, Counters, ENVIRONMENT_LIGHT, FOUND_LOST, Found, Frame, HIT_SKY, INFINITY_BITS, Light, MODEL_ALPHA,
    MODEL_AREA, MODEL_EMITTER, MODEL_ENVIRONMENT, MODEL_LENS, MODEL_MOTION, OCCLUDED_BIT,
};
use stillray::shaders::{SKY_INSTANCE, Sample};
use support::kernel::{Kernel, blank, data, values};
use support::random::Random;

const SIZE: [u32; 2] = [160, 120];
const UNUSED: usize = 7;

struct Device {
    context: Context,
    kernel: Kernel,
    alpha: bool,
    draw: Option<Draw>,
    afar: bool,
    moving: bool,
}

impl Device {
    fn new(alpha: bool) -> Self {
        let context = support::validated_context();
        let shader = shaders::shadow::modelling(if alpha { MODEL_ALPHA } else { 0 });
        Self { kernel: Kernel::new(&context, shader), context, alpha, draw: None, afar: false, moving: false }
    }

    /// Of what models holes, a lens and lights that have an extent.
    fn wide(draw: Draw) -> Self {
        let context = support::validated_context();
        let shader = shaders::shadow::modelling(MODEL_ALPHA | MODEL_LENS | MODEL_AREA);
        Self {
            kernel: Kernel::new(&context, shader),
            context,
            alpha: true,
            draw: Some(draw),
            afar: false,
            moving: false,
        }
    }

    /// Of what models a map of light from all around as well.
    fn afar(draw: Draw) -> Self {
        let context = support::validated_context();
        let shader = shaders::shadow::modelling(MODEL_ALPHA | MODEL_LENS | MODEL_AREA | MODEL_ENVIRONMENT);
        Self {
            kernel: Kernel::new(&context, shader),
            context,
            alpha: true,
            draw: Some(draw),
            afar: true,
            moving: false,
        }
    }

    /// Of what models what shines as lights.
    fn shining(draw: Draw) -> Self {
        let context = support::validated_context();
        let shader = shaders::shadow::modelling(shaders::with_brought(MODEL_ALPHA | MODEL_EMITTER));
        let kernel = Kernel::new(&context, shader);
        Self { kernel, context, alpha: true, draw: Some(draw), afar: true, moving: false }
    }

    /// Of what models an open shutter.
    fn moving(draw: Draw) -> Self {
        let context = support::validated_context();
        let shader = shaders::shadow::modelling(shaders::with_brought(MODEL_ALPHA | MODEL_AREA | MODEL_MOTION));
        let kernel = Kernel::new(&context, shader);
        Self { kernel, context, alpha: true, draw: Some(draw), afar: false, moving: true }
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
            data(&padded.iter().map(sample_of).collect::<Vec<_>>()),
        ];
        if self.alpha {
            bound.extend([data(&geometry.triangles), data(&theatre.materials), data(&geometry.vertices)]);
            bound.extend([gallery.bound(), Gallery::srgb()]);
        }
        bound.extend(self.draw.iter().flat_map(|draw| draw.bound(padded.len())));
        bound.extend(self.moving.then(|| data(&[0.0_f32])));
        bound.extend(self.afar.then(|| data(&theatre.environment)));
        self.kernel.run(&mut bound, &[], [(padded.len() as u32).div_ceil(2).next_multiple_of(64), 2, 1]);
        let mut bits = values::<u32>(&bound[8]);
        assert!(bits.split_off(found.len()).iter().all(|b| *b == u32::MAX), "written behind the list's end");
        let after: Counters = values(&bound[2])[0];
        assert_eq!(bytes_of(&Counters { shadow_rays: 1000, ..after }), bytes_of(&counters), "another count changed");
        (bits, after.shadow_rays - 1000)
    }
}

/// The sample that found this: somewhere, and the same wherever it is asked for.
fn sample_of(found: &Found) -> Sample {
    Sample { position: [found.u, found.v, found.primitive as f32], instance: found.instance }
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
    list.par_iter().map(|f| shadow(&theatre.stage(alpha), &theatre.lights, &sample_of(f), f)).collect()
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
            let afar = light_from_afar(&theatre.stage(alpha)).filter(|_| i == ENVIRONMENT_LIGHT as usize);
            let light = theatre.lights.get(i).copied().or(afar).ok_or("a bit without a light")?;
            if !(doubtful || is_visible(found) && is_grazing(theatre, alpha, found, &light)) {
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

#[test]
fn points_of_lights_are_seen_as_the_twin_sees_them() {
    let mut differing = 0;
    for seed in 0..4 {
        let random = &mut Random::new(80 + seed);
        let wide = || Theatre::wide(SIZE, &mut Random::new(90 + seed));
        let device = Device::wide(Draw::random(random));
        let seen = wide().drawn(device.draw.as_ref().unwrap());
        let list = random_list(&seen, seed, 4000);
        let got = device.run(&wide(), &list);
        differing += compare(&seen, true, &list, &twins(&seen, &list, true), &got).unwrap();
        // Negative control: the middle of each light.
        let middle = Theatre { lens: seen.lens, ..wide() };
        assert!(compare(&middle, true, &list, &twins(&middle, &list, true), &got).is_err());
        // Without a lens and extents nothing changes, to the bit.
        let plain = Theatre::new(SIZE);
        assert!(device.run(&plain, &list) == Device::new(true).run(&plain, &list));
        support::assert_clean(&device.context);
    }
    println!("{differing} bits of 16000 samples differ");
    assert!(differing * 1000 <= 16_000, "{differing}");
}

#[test]
fn what_shines_is_seen_as_the_twin_sees_it() {
    let mut differing = 0;
    let mut reached = 0;
    for seed in 0..6 {
        let random = &mut Random::new(280 + seed);
        let device = Device::shining(Draw::random(random));
        let draw = device.draw.as_ref().unwrap();
        let plain = || Theatre::wide(SIZE, &mut Random::new(290 + seed));
        let draws = [1, 8, 2][seed as usize % 3];
        let shining = || plain().shining(draws);
        let seen = shining().drawn(draw);
        let list = random_list(&seen, seed, 4000);
        let got = device.run(&shining(), &list);
        differing += compare(&seen, true, &list, &twins(&seen, &list, true), &got).unwrap();
        reached += got.0.iter().filter(|bits| *bits >> plain().lights.len() & 1 != 0).count();
        // Negative controls: another triangle or another point of it, another of the draws, and nothing that shines.
        let (at, which, pick) = seen.shining_at;
        let mut others = vec![(at.map(|x| 1.0 - x), which, pick), (at, which ^ 1 << 31, pick)];
        if draws > 1 {
            others.push((at, which, if pick < 0.5 { 0.99 } else { 0.01 }));
        }
        for other in others {
            let wrong = Theatre { shining_at: other, ..shining().drawn(draw) };
            assert!(compare(&wrong, true, &list, &twins(&wrong, &list, true), &got).is_err());
        }
        let dark = plain().drawn(draw);
        assert!(compare(&dark, true, &list, &twins(&dark, &list, true), &device.run(&plain(), &list)).is_ok());
        assert!(compare(&dark, true, &list, &twins(&dark, &list, true), &got).is_err());
        support::assert_clean(&device.context);
    }
    println!("{differing} bits of 24000 samples differ; what shines reaches {reached}");
    assert!(differing * 1000 <= 24_000 && reached > 1000, "{differing} {reached}");
}

#[test]
fn while_the_shutter_is_open_lights_are_seen_as_the_twin_sees_them() {
    let mut differing = 0;
    for seed in 0..4 {
        let random = &mut Random::new(180 + seed);
        let moving = || Theatre::moving(SIZE, &mut Random::new(190 + seed));
        let device = Device::moving(Draw::random(random));
        let seen = moving().drawn(device.draw.as_ref().unwrap());
        let list = random_list(&seen, seed, 4000);
        let got = device.run(&moving(), &list);
        differing += compare(&seen, true, &list, &twins(&seen, &list, true), &got).unwrap();
        // Negative controls: at the end of the frame, and with lights that stand still.
        let mut still = moving();
        still.lights.iter_mut().for_each(|light| light.moved = [0.0; 3]);
        let still = still.drawn(device.draw.as_ref().unwrap());
        let end = Theatre { time: 1.0, ..moving().drawn(device.draw.as_ref().unwrap()) };
        for wrong in [still, end] {
            assert!(compare(&wrong, true, &list, &twins(&wrong, &list, true), &got).is_err());
        }
        let closed = Theatre::new(SIZE);
        assert!(device.run(&closed, &list) == Device::new(true).run(&closed, &list));
        support::assert_clean(&device.context);
    }
    println!("{differing} bits of 16000 samples differ");
    assert!(differing * 1000 <= 16_000, "{differing}");
}

#[test]
fn a_direction_of_the_map_is_seen_as_the_twin_sees_it() {
    let mut differing = 0;
    let mut bits = [0; 2];
    for seed in 0..8 {
        let random = &mut Random::new(180 + seed);
        let device = Device::afar(Draw::random(random));
        let draw = device.draw.as_ref().unwrap();
        let wide = |rays: u32| {
            let mut theatre = Theatre::wide(SIZE, &mut Random::new(190 + seed));
            theatre.frame.shadow_rays = rays;
            theatre
        };
        let mapped = |rays| wide(rays).under_a_map(&mut Random::new(200 + seed));
        let list = random_list(&mapped(32).drawn(draw), seed, 2000);
        for rays in [0, 1, 32] {
            let seen = mapped(rays).drawn(draw);
            let got = device.run(&mapped(rays), &list);
            differing += compare(&seen, true, &list, &twins(&seen, &list, true), &got).unwrap();
            assert!((rays == 0) == (got.1 == 0), "a ray for the map where there are rays");
            got.0.iter().for_each(|b| bits[(b >> ENVIRONMENT_LIGHT) as usize] += 1);
            // Negative controls: a direction to the other side, and no map.
            let opposite = seen.afar_at.map(|x| x ^ 1 << 31);
            let other = Theatre { afar_at: opposite, ..mapped(rays).drawn(draw) };
            let direction = |theatre: &Theatre| light_from_afar(&theatre.stage(true)).unwrap().direction;
            let apart = Vec3::from(direction(&other)).distance(Vec3::from(direction(&seen)));
            assert!(apart < 0.1 || compare(&other, true, &list, &twins(&other, &list, true), &got).is_err());
            let none = wide(rays).drawn(draw);
            assert!(compare(&none, true, &list, &twins(&none, &list, true), &got).is_err());
            assert!(compare(&none, true, &list, &twins(&none, &list, true), &device.run(&wide(rays), &list)).is_ok());
        }
        support::assert_clean(&device.context);
    }
    println!("{differing} bits differ; the map reaches {bits:?}");
    assert!(differing * 1000 <= 48_000 && bits.iter().all(|n| *n > 2000), "{differing} {bits:?}");
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

#[test]
fn lights_are_chosen_as_the_twin_chooses_them() {
    let mut theatre = Theatre::new(SIZE);
    let device = Device::new(true);
    let list = random_list(&theatre, 5, 2000);
    let most = |rays: u32| if rays == 0 { 0 } else { rays.min(theatre.frame.light_count) };
    let mut last = Vec::new();
    for (rays, most) in [0, 1, 2, 4, 5, 32].map(|rays| (rays, most(rays))) {
        theatre.frame.shadow_rays = rays;
        let want = twins(&theatre, &list, true);
        let got = device.run(&theatre, &list);
        assert!(compare(&theatre, true, &list, &want, &got).is_ok(), "{rays} rays");
        assert!(want.iter().all(|w| w.rays <= most) && (rays == 0) == (got.1 == 0), "{rays} rays");
        let seeded = Frame { seed: 1, ..theatre.frame };
        let other = std::mem::replace(&mut theatre.frame, seeded);
        let reseeded = compare(&theatre, true, &list, &twins(&theatre, &list, true), &got);
        theatre.frame = other;
        assert_eq!(reseeded.is_err(), (1..5).contains(&rays), "another seed, {rays} rays");
        last.push(got.0);
    }
    assert!(last[4] == last[5], "as many rays as lights are all that can be used");
    // Without rays nothing is in shadow: all that some ray reaches is lit, and more.
    assert!(last[0].iter().zip(&last[5]).all(|(open, lit)| lit & !open == 0) && last[0] != last[5]);
    support::assert_clean(&device.context);
}

/// Each light counts, on average over many samples, as if it had been chosen for all of them; and so does each pair, so that
/// no set is preferred.
#[test]
fn the_choice_is_unbiased_and_sticks_to_the_sample() {
    const SAMPLES: u32 = 40_000;
    let random = &mut Random::new(17);
    for (light_count, shadow_rays) in [(5, 1), (5, 2), (32, 3), (3, 2), (7, 7), (4, 0)] {
        let frame = Frame { light_count, shadow_rays, seed: random.bits(), ..Frame::default() };
        let sample = |random: &mut Random| Sample { position: random.direction(), instance: random.below(9) };
        let chosen: Vec<Vec<bool>> = (0..SAMPLES)
            .map(|_| {
                let sample = sample(random);
                let chosen = chosen_lights(&frame, &sample);
                let hidden = Sample { instance: sample.instance | OCCLUDED_BIT, ..sample };
                assert_eq!(chosen, chosen_lights(&frame, &hidden), "whether it was hidden does not matter");
                chosen
            })
            .collect();
        let (lights, rays) = (f64::from(light_count), chosen[0].iter().filter(|c| **c).count() as f64);
        assert!(chosen.iter().all(|c| c.iter().filter(|c| **c).count() as f64 == rays));
        assert_eq!(light_weight(&frame) * rays, lights, "all weights together are the number of lights");
        // Five standard deviations of a mean of 0 and 1 with this probability: one in 1.7 million, times some 600 checks.
        let fits = |p: f64, found: f64| (found - p).abs() <= 5.0 * (p * (1.0 - p) / f64::from(SAMPLES)).sqrt() + 1e-12;
        let share = |of: &dyn Fn(&[bool]) -> bool| chosen.iter().filter(|c| of(c)).count() as f64 / f64::from(SAMPLES);
        for i in 0..light_count as usize {
            assert!(fits(rays / lights, share(&|c| c[i])), "light {i} of {lights}");
            let both = rays / lights * (rays - 1.0) / (lights - 1.0);
            for j in 0..i {
                assert!(fits(both, share(&|c| c[i] && c[j])), "lights {i} and {j} of {lights}");
            }
            // Negative control.
            assert!(!fits(rays / lights + 0.02, share(&|c| c[i])));
        }
    }
}

#[test]
fn unfiltered_masks_cast_unfiltered_shadows() {
    let device = Device::new(true);
    let (filtered, nearest) = (Theatre::filtered(SIZE, false), Theatre::filtered(SIZE, true));
    let list = random_list(&filtered, 6, 8000);
    let got = device.run(&nearest, &list);
    assert!(compare(&nearest, true, &list, &twins(&nearest, &list, true), &got).is_ok());
    assert!(compare(&filtered, true, &list, &twins(&filtered, &list, true), &got).is_err(), "negative control");
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
