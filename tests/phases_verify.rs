//! Verification finds on the device what its CPU twin finds, for new, cached, hidden, lost and sky samples.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod accel_support;
mod stage_support;
mod support;

use bytemuck::bytes_of;
use glam::DVec3;
use rayon::prelude::*;
use stage_support::{BLENDED, Draw, Gallery, MASKED, Theatre};
use std::collections::BTreeMap;
use stillray::gpu::Context;
use stillray::oracle::traverse::reference::intersect;
use stillray::oracle::verify::{Outcome, query, verify};
use stillray::shaders::{
    self, Counters, FOUND_LOST, Found, HIT_SKY, INSTANCE_MASK, MODEL_ALPHA, MODEL_AREA, MODEL_LENS, MODEL_MOTION,
    NEW_INSTANCE, OCCLUDED_BIT,
};
use stillray::shaders::{SKY_INSTANCE, Sample};
use support::kernel::{Kernel, blank, data, values};
use support::random::Random;

const SIZE: [u32; 2] = [160, 120];
/// Entries behind the end of the list, which must stay as they are.
const UNUSED: usize = 7;

struct Device {
    context: Context,
    kernel: Kernel,
    alpha: bool,
    draw: Option<Draw>,
    moving: bool,
}

impl Device {
    fn new(alpha: bool) -> Self {
        let context = support::validated_context();
        let shader = shaders::verify::modelling(if alpha { MODEL_ALPHA } else { 0 });
        Self { kernel: Kernel::new(&context, shader), context, alpha, draw: None, moving: false }
    }

    /// Of what models holes, a lens and lights that have an extent.
    fn wide(draw: Draw) -> Self {
        let context = support::validated_context();
        let shader = shaders::verify::modelling(MODEL_ALPHA | MODEL_LENS | MODEL_AREA);
        Self { kernel: Kernel::new(&context, shader), context, alpha: true, draw: Some(draw), moving: false }
    }

    /// Of what models an open shutter as well.
    fn moving(draw: Draw) -> Self {
        let context = support::validated_context();
        let shader = shaders::verify::modelling(shaders::with_brought(MODEL_ALPHA | MODEL_MOTION));
        Self { kernel: Kernel::new(&context, shader), context, alpha: true, draw: Some(draw), moving: true }
    }

    fn run(&self, theatre: &Theatre, samples: &[Sample]) -> (Vec<Sample>, Vec<Found>) {
        let gallery = Gallery::new(&self.context, &theatre.atlas);
        let (count, unused) = (samples.len(), Sample { position: [7.0; 3], instance: NEW_INSTANCE });
        let padded: Vec<Sample> = samples.iter().copied().chain([unused; UNUSED]).collect();
        let geometry = &theatre.geometry;
        let mut bound = vec![
            data(&[theatre.frame]),
            data(&theatre.instances),
            data(&[Counters { samples: count as u32, ..Counters::default() }]),
            theatre.nodes(),
            data(&geometry.triangle_corners),
            data(&geometry.triangle_rest),
            data(&padded),
            blank::<Found>(padded.len()),
            data(&geometry.triangles),
            data(&theatre.materials),
        ];
        if self.alpha {
            bound.extend([data(&geometry.vertices), gallery.bound(), Gallery::srgb()]);
        }
        bound.extend(self.draw.iter().flat_map(|draw| draw.bound(padded.len())));
        // Nothing deforms.
        bound.extend(self.moving.then(|| data(&[0.0_f32])));
        // Two rows of workgroups, as an indirect dispatch of a long list has them.
        self.kernel.run(&mut bound, &[], [(padded.len() as u32).div_ceil(2).next_multiple_of(64), 2, 1]);
        let (mut samples, mut found) = (values::<Sample>(&bound[6]), values::<Found>(&bound[7]));
        assert_eq!(samples.split_off(count), [unused; UNUSED]);
        assert!(found.split_off(count).iter().all(|f| bytes_of(f) == [0xff; 16]));
        (samples, found)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Status {
    NewSurface,
    NewSky,
    Visible,
    Hidden,
    /// The ray found nothing.
    LostToNothing,
    /// The ray found something behind the sample.
    LostBehind,
    SkyVisible,
    SkyHidden,
    UnknownHidden,
    UnknownLost,
}

const ALL: [Status; 10] = [
    Status::NewSurface,
    Status::NewSky,
    Status::Visible,
    Status::Hidden,
    Status::LostToNothing,
    Status::LostBehind,
    Status::SkyVisible,
    Status::SkyHidden,
    Status::UnknownHidden,
    Status::UnknownLost,
];

fn status(theatre: &Theatre, before: &Sample, after: &Sample, found: &Found) -> Status {
    let id = before.instance & INSTANCE_MASK;
    let (lost, hidden) = (found.primitive == FOUND_LOST, found.instance & OCCLUDED_BIT != 0);
    if id == NEW_INSTANCE {
        return if found.primitive == HIT_SKY { Status::NewSky } else { Status::NewSurface };
    }
    assert_eq!((after.instance == NEW_INSTANCE, after.instance & OCCLUDED_BIT != 0), (lost, hidden));
    if id == SKY_INSTANCE {
        return if hidden { Status::SkyHidden } else { Status::SkyVisible };
    }
    if id >= theatre.frame.instance_count {
        return if lost { Status::UnknownLost } else { Status::UnknownHidden };
    }
    let hits_nothing = || {
        let stage = theatre.stage(false);
        let query = query(&stage, *before);
        stillray::oracle::traverse::closest(&stage.world, &query).is_none()
    };
    match (lost, hidden) {
        (false, false) => Status::Visible,
        (false, true) => Status::Hidden,
        _ if hits_nothing() => Status::LostToNothing,
        _ => Status::LostBehind,
    }
}

/// A sample of any kind: as traced, or anywhere on a surface, exactly or not, or of the sky, or of nothing.
fn random_sample(theatre: &Theatre, random: &mut Random, alpha: bool) -> Sample {
    let stage = theatre.stage(alpha);
    let fresh = theatre.new_sample(random);
    let mut sample = match random.below(8) {
        0 => fresh,
        1 | 2 => verify(&stage, fresh).sample,
        3 => Sample { position: random.direction(), instance: SKY_INSTANCE },
        4 if random.chance(0.2) => {
            let position = random.direction().map(|c| c * 8.0);
            Sample { position, instance: random.pick(&[theatre.frame.instance_count, 1 << 20, NEW_INSTANCE - 1]) }
        }
        _ => {
            let (instance, primitive) = theatre.random_triangle(random);
            let u = random.between(0.0, 1.0);
            let v = random.between(0.0, 1.0 - u);
            let point = stage.surface(instance, primitive, u, v);
            Sample { position: point.object.to_array(), instance }
        }
    };
    if random.chance(0.3) && sample.instance != NEW_INSTANCE {
        let off = random.between(-24.0, -1.0).exp2();
        sample.position = sample.position.map(|c| c + random.between(-off, off));
    }
    // The mark of the last frame counts for nothing.
    sample.instance |= random.pick(&[0, OCCLUDED_BIT]);
    sample
}

fn samples(theatre: &Theatre, seed: u32, count: u32, alpha: bool) -> Vec<Sample> {
    (0..count)
        .into_par_iter()
        .map(|i| random_sample(theatre, &mut Random::new(seed.wrapping_add(i.wrapping_mul(7919))), alpha))
        .collect()
}

fn twins(theatre: &Theatre, samples: &[Sample], alpha: bool) -> Vec<Outcome> {
    samples.par_iter().map(|&s| verify(&theatre.stage(alpha), s)).collect()
}

/// What is wrong with a device's answer, if anything is; `Ok(false)` if it has the twin's bits.
///
/// A device may round reciprocals by 2.5 ulp, and fuse the operations of a new sample's direction and of the height over a
/// plane. So weights may be off within the bound of the reference, and where the twin says that it might be decided
/// otherwise, the decision too. Everything else is the twin's to the bit.
fn judge(theatre: &Theatre, before: &Sample, want: &Outcome, got: (&Sample, &Found)) -> Result<bool, String> {
    let (sample, found) = got;
    if bytes_of(sample) == bytes_of(&want.sample) && bytes_of(found) == bytes_of(&want.found) {
        return Ok(false);
    }
    // Wherever the ray ended, a sample that was kept has not moved, and a new one is the point that was found, to the bit.
    if found.primitive < FOUND_LOST {
        let added = before.instance & INSTANCE_MASK == NEW_INSTANCE;
        let made = || theatre.stage(true).surface(found.instance, found.primitive, found.u, found.v).object.to_array();
        if sample.position != if added { made() } else { before.position } {
            return Err(format!("{before:?} has moved to {sample:?}"));
        }
    }
    let same = (found.instance, found.primitive) == (want.found.instance, want.found.primitive)
        && sample.instance == want.sample.instance;
    let told = format!("{before:?}: {got:?} against {want:?}");
    if !same {
        return if want.doubtful || on_an_edge(theatre, before, &want.found) { Ok(true) } else { Err(told) };
    }
    if found.primitive == HIT_SKY {
        // A direction of length 1: rounded by camera_direction() (10 U of terms that add up to 3) and normalize() (10 U).
        let close = (0..3).all(|i| (sample.position[i] - want.sample.position[i]).abs() <= 40.0 / 16_777_216.0);
        return if close { Ok(true) } else { Err(told) };
    }
    let Some(bound) = weight_bound(theatre, before, found) else { return Err(told) };
    let off = [(found.u, want.found.u), (found.v, want.found.v)].map(|(a, b)| f64::from((a - b).abs()));
    if off.iter().all(|&o| o <= bound) { Ok(true) } else { Err(told) }
}

/// Twice what the reference allows for one f32 test, and as much again for a new sample's direction, which is off by 10 U
/// of terms that add up to 3: no more than the transform's 3 U of three terms each are allowed for, four times.
fn weight_bound(theatre: &Theatre, before: &Sample, found: &Found) -> Option<f64> {
    let stage = theatre.stage(true);
    let instance = stage.instance(found.instance & INSTANCE_MASK);
    let exact = intersect(&instance, theatre.geometry.corners(found.primitive), &query(&stage, *before))?;
    Some(8.0 * exact.weight_bound)
}

/// Whether the twin's hit is on its triangle's edge within the bound, so that another device may find the neighbour.
fn on_an_edge(theatre: &Theatre, before: &Sample, found: &Found) -> bool {
    found.primitive < FOUND_LOST
        && weight_bound(theatre, before, found)
            .is_some_and(|b| [found.u, found.v, 1.0 - found.u - found.v].iter().any(|&w| f64::from(w) <= b))
}

fn compare(
    theatre: &Theatre,
    before: &[Sample],
    want: &[Outcome],
    got: &(Vec<Sample>, Vec<Found>),
) -> Result<usize, String> {
    let each = before.iter().zip(want).zip(got.0.iter().zip(&got.1));
    let differing: Result<Vec<bool>, String> = each.map(|((b, w), g)| judge(theatre, b, w, g)).collect();
    Ok(differing?.into_iter().filter(|d| *d).count())
}

#[test]
fn the_device_finds_what_the_twin_finds() {
    let theatre = Theatre::new(SIZE);
    for alpha in [false, true] {
        let device = Device::new(alpha);
        let before = samples(&theatre, 1, 40_000, alpha);
        let want = twins(&theatre, &before, alpha);
        let got = device.run(&theatre, &before);
        let differing = compare(&theatre, &before, &want, &got).unwrap();
        let doubtful = want.iter().filter(|w| w.doubtful).count();
        let mut counts: BTreeMap<Status, usize> = BTreeMap::new();
        for (b, w) in before.iter().zip(&want) {
            *counts.entry(status(&theatre, b, &w.sample, &w.found)).or_default() += 1;
        }
        println!("alpha {alpha}: {differing} not bit for bit, {doubtful} in doubt of {}: {counts:?}", before.len());
        assert!(differing * 1000 <= before.len() && doubtful * 1000 <= before.len(), "{differing} {doubtful}");
        assert!(ALL.iter().all(|s| counts.get(s).is_some_and(|&n| n >= 10)), "{counts:?}");
        let short = [0, 1, 63, 64, 65, 129].map(|n| before[..n].to_vec());
        for list in short.iter().filter(|l| !l.is_empty()) {
            let got = device.run(&theatre, list);
            assert_eq!(compare(&theatre, list, &want[..list.len()], &got), Ok(0), "{} entries", list.len());
        }
        support::assert_clean(&device.context);
    }
}

#[test]
fn through_a_lens_rays_find_what_the_twin_finds() {
    let mut differing = 0;
    for seed in 0..4 {
        let random = &mut Random::new(50 + seed);
        let wide = || Theatre::wide(SIZE, &mut Random::new(70 + seed));
        let device = Device::wide(Draw::random(random));
        let seen = wide().drawn(device.draw.as_ref().unwrap());
        let before = samples(&seen, seed, 6000, true);
        let want = twins(&seen, &before, true);
        let got = device.run(&wide(), &before);
        differing += compare(&seen, &before, &want, &got).unwrap();
        // Negative control: from the middle of the lens.
        let straight = wide();
        assert!(compare(&straight, &before, &twins(&straight, &before, true), &got).is_err());
        // A closed aperture is a pinhole, to the bit.
        let closed = Theatre::new(SIZE);
        assert!(device.run(&closed, &before) == Device::new(true).run(&closed, &before));
        support::assert_clean(&device.context);
    }
    println!("{differing} of 24000 not bit for bit");
    assert!(differing * 1000 <= 24_000, "{differing}");
}

#[test]
fn while_the_shutter_is_open_rays_find_what_the_twin_finds() {
    let mut differing = 0;
    for seed in 0..4 {
        let random = &mut Random::new(150 + seed);
        let moving = || Theatre::moving(SIZE, &mut Random::new(170 + seed));
        let device = Device::moving(Draw::random(random));
        let draw = device.draw.as_ref().unwrap();
        let seen = moving().drawn(draw);
        assert!(seen.time < 1.0 && seen.instances.iter().all(|i| i.flags & shaders::INSTANCE_MOVES != 0));
        let before = samples(&seen, seed, 6000, true);
        let want = twins(&seen, &before, true);
        let got = device.run(&moving(), &before);
        differing += compare(&seen, &before, &want, &got).unwrap();
        // Negative controls: at the end of the frame, and a hundredth of it later.
        for time in [1.0, seen.time + 0.01] {
            let late = Theatre { time, ..moving().drawn(draw) };
            assert!(compare(&late, &before, &twins(&late, &before, true), &got).is_err());
        }
        // With the shutter closed all is as it was, to the bit.
        let closed = Theatre::new(SIZE);
        assert!(device.run(&closed, &before) == Device::new(true).run(&closed, &before));
        support::assert_clean(&device.context);
    }
    println!("{differing} of 24000 not bit for bit");
    assert!(differing * 1000 <= 24_000, "{differing}");
}

#[test]
fn unfiltered_masks_let_other_rays_through() {
    let device = Device::new(true);
    let (filtered, nearest) = (Theatre::filtered(SIZE, false), Theatre::filtered(SIZE, true));
    let before = samples(&filtered, 6, 8000, true);
    let got = device.run(&nearest, &before);
    assert!(compare(&nearest, &before, &twins(&nearest, &before, true), &got).is_ok());
    assert!(compare(&filtered, &before, &twins(&filtered, &before, true), &got).is_err(), "negative control");
    support::assert_clean(&device.context);
}

#[test]
fn alpha_is_looked_at_by_its_variant_only() {
    let theatre = Theatre::new(SIZE);
    let before: Vec<Sample> = samples(&theatre, 5, 4000, false);
    let [plain, open] = [false, true].map(|alpha| twins(&theatre, &before, alpha));
    let material = |f: &Found| theatre.stage(true).material(f.primitive).flags;
    let through = |flag: u32| {
        let pairs = plain.iter().zip(&open).filter(|(p, o)| p.found != o.found && p.found.primitive < FOUND_LOST);
        pairs.filter(|(p, _)| material(&p.found) & flag != 0).count()
    };
    assert!(through(shaders::MATERIAL_MASK) > 20 && through(shaders::MATERIAL_BLEND) > 20);
    let still =
        |index: usize| open.iter().any(|o| o.found.primitive < FOUND_LOST && slot_of(&theatre, &o.found) == index);
    assert!(still(MASKED) && still(BLENDED), "some of both is there");
}

fn slot_of(theatre: &Theatre, found: &Found) -> usize {
    theatre.geometry.triangles[found.primitive as usize].material as usize
}

#[test]
fn wrong_answers_are_caught() {
    let theatre = Theatre::new(SIZE);
    let device = Device::new(true);
    let before = samples(&theatre, 3, 4000, true);
    let got = device.run(&theatre, &before);
    let fails = |theatre: &Theatre, alpha: bool, what: &str| {
        let want = twins(theatre, &before, alpha);
        assert!(compare(theatre, &before, &want, &got).is_err(), "{what}");
    };
    fails(&theatre, false, "alpha not looked at");
    let mut wrong = Theatre::new(SIZE);
    wrong.materials.iter_mut().for_each(|m| m.flags |= shaders::MATERIAL_DOUBLE_SIDED);
    fails(&wrong, true, "backs that are seen");
    let mut wrong = Theatre::new(SIZE);
    wrong.frame.alpha_seed = 1;
    fails(&wrong, true, "another seed");
    let mut wrong = Theatre::new(SIZE);
    wrong.geometry.triangle_corners.iter_mut().for_each(|c| c[0] += 1e-4);
    fails(&wrong, true, "geometry that is a tenth of a millimetre off");
    let want = twins(&theatre, &before, true);
    let mut wrong = got.clone();
    let visible = wrong.1.iter().position(|f| f.instance < SKY_INSTANCE && f.primitive < FOUND_LOST).unwrap();
    wrong.1[visible].instance |= OCCLUDED_BIT;
    assert!(compare(&theatre, &before, &want, &wrong).is_err(), "one sample hidden");
    let mut wrong = got.clone();
    wrong.0[visible].position[0] = wrong.0[visible].position[0].next_up();
    assert!(compare(&theatre, &before, &want, &wrong).is_err(), "one sample moved by an ulp");
    support::assert_clean(&device.context);
}

/// What has just been traced is there when it is looked for, but at silhouettes: rounding moves a point by some 2^-22 of its
/// distance, which may put it past the edge. Silhouettes as long as 30 times the picture's height have 10^-5 of all samples
/// that near to them.
#[test]
fn a_sample_just_made_is_visible() {
    let theatre = Theatre::new(SIZE);
    for alpha in [false, true] {
        let device = Device::new(alpha);
        let random = &mut Random::new(9);
        let fresh: Vec<Sample> = (0..100_000).map(|_| theatre.new_sample(random)).collect();
        let (made, first) = device.run(&theatre, &fresh);
        let (again, second) = device.run(&theatre, &made);
        let kept = |i: &usize| made[*i] == again[*i];
        let lost = (0..made.len()).filter(|i| !kept(i)).count();
        let surfaces = first.iter().filter(|f| f.primitive != HIT_SKY).count();
        println!("alpha {alpha}: {lost} of {} not found again", made.len());
        assert!(surfaces > 30_000 && surfaces < 95_000, "{surfaces}");
        assert!(lost * 100_000 <= 10 * made.len(), "{lost}");
        let hit = |f: &Found| (f.instance, f.primitive);
        let other = (0..made.len()).filter(|i| kept(i) && hit(&first[*i]) != hit(&second[*i])).count();
        assert!(other * 1000 <= made.len(), "{other} found on another triangle");
        // Seen from elsewhere, much of it is not.
        let moved = Theatre::seen_from(SIZE, DVec3::new(0.3, 0.2, -0.2));
        let (elsewhere, _) = device.run(&moved, &made);
        assert!((0..made.len()).filter(|&i| made[i] != elsewhere[i]).count() > 1000);
        support::assert_clean(&device.context);
    }
}

#[test]
fn nothing_is_visible_through_a_closed_wall() {
    let [closed, open] = [false, true].map(|hole| Theatre::walled(SIZE, hole));
    let outside = Theatre::new(SIZE);
    let device = Device::new(true);
    let random = &mut Random::new(4);
    let behind: Vec<Sample> = (0..60_000)
        .map(|i| {
            if i % 3 == 0 {
                return Sample { position: random.direction(), instance: SKY_INSTANCE };
            }
            let (instance, primitive) = outside.random_triangle(random);
            let u = random.between(0.0, 1.0);
            let point = outside.stage(true).surface(instance, primitive, u, random.between(0.0, 1.0 - u));
            Sample { position: point.object.to_array(), instance }
        })
        .collect();
    let visible = |theatre: &Theatre| {
        let (_, found) = device.run(theatre, &behind);
        found.iter().filter(|f| f.primitive != FOUND_LOST && f.instance & OCCLUDED_BIT == 0).count()
    };
    assert_eq!(visible(&closed), 0);
    assert!(visible(&open) > 1000, "one triangle less, and something is");
    support::assert_clean(&device.context);
}
