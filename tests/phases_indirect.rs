//! Diffuse paths begin on the device as in the CPU twin: which sample of the last frame goes on, its path's number and seed exactly,
//! directions and what the surface scatters within derived bounds.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod accel_support;
mod stage_support;
mod support;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use stage_support::{Draw, Gallery, Theatre};
use std::collections::BTreeSet;
use stillray::gpu::Context;
use stillray::oracle::indirect::{Start, fresh_path_of, path_of, source_of, start};
use stillray::oracle::verify::verify;
use stillray::shaders::{
    self, Counters, FOUND_LOST, Found, Gathered, MODEL_LENS, NO_SOURCE, OCCLUDED_BIT, PathCounters, Sample,
};
use support::kernel::{Kernel, blank, data, values};
use support::random::Random;

const SIZE: [u32; 2] = [160, 120];
const UNUSED: usize = 7;

/// A list, as the phases before leave it, and what is kept of the last frame.
#[derive(Clone)]
struct Inputs {
    samples: Vec<Sample>,
    found: Vec<Found>,
    sources: Vec<u32>,
    previous: Vec<Sample>,
    gathered: Vec<Gathered>,
}

impl Inputs {
    fn random(theatre: &Theatre, seed: u32, count: u32) -> Self {
        let one = |i: u32| {
            let random = &mut Random::new(seed.wrapping_add(i.wrapping_mul(15_485_863)));
            let seen = verify(&theatre.stage(true), theatre.new_sample(random));
            let mut found = seen.found;
            match random.below(20) {
                0 => found.primitive = FOUND_LOST,
                1 => found.instance |= OCCLUDED_BIT,
                _ => {}
            }
            let (mut sample, mut before) = (seen.sample, seen.sample);
            match random.below(8) {
                // Another point, another instance; a mark of visibility does not matter.
                0 => before.position[1] = f32::from_bits(before.position[1].to_bits() ^ 1),
                1 => before.instance ^= 1,
                2 => before.instance ^= OCCLUDED_BIT,
                3 => sample.instance ^= OCCLUDED_BIT,
                _ => {}
            }
            let gathered = Gathered { radiance: random.direction(), paths: random.bits() };
            (sample, found, before, gathered, random.chance(0.2))
        };
        let all: Vec<_> = (0..count).into_par_iter().map(one).collect();
        // What was before lies in another order.
        let mut order: Vec<u32> = (0..count).collect();
        Random::new(seed).shuffle(&mut order);
        let mut previous = vec![all[0].2; count as usize];
        let mut gathered = vec![all[0].3; count as usize];
        for (i, (_, _, before, g, _)) in all.iter().enumerate() {
            previous[order[i] as usize] = *before;
            gathered[order[i] as usize] = *g;
        }
        let source = |(i, new): (usize, bool)| if new { NO_SOURCE } else { order[i] };
        Self {
            samples: all.iter().map(|a| a.0).collect(),
            found: all.iter().map(|a| a.1).collect(),
            sources: all.iter().map(|a| a.4).enumerate().map(source).collect(),
            previous,
            gathered,
        }
    }

    fn source(&self, slot: usize, stable: bool) -> u32 {
        if stable { source_of(&self.sources, &self.previous, &self.samples, slot) } else { NO_SOURCE }
    }
}

/// What the device made of a list.
struct Outcome {
    gathered: Vec<Gathered>,
    brought: Vec<[u32; 4]>,
    origins: Vec<[f32; 4]>,
    directions: Vec<[f32; 4]>,
    weights: Vec<[f32; 4]>,
    listed: Vec<u32>,
}

struct Device {
    context: Context,
    kernel: Kernel,
    stable: bool,
}

impl Device {
    fn new(stable: bool) -> Self {
        let context = support::validated_context();
        let shader = if stable {
            shaders::indirect_stable::modelling(MODEL_LENS)
        } else {
            shaders::indirect::modelling(MODEL_LENS)
        };
        Self { kernel: Kernel::new(&context, shader), context, stable }
    }

    fn run(&self, theatre: &Theatre, draw: &Draw, inputs: &Inputs) -> Outcome {
        let gallery = Gallery::new(&self.context, &theatre.atlas);
        let count = inputs.found.len();
        let padded = count + UNUSED;
        let found: Vec<Found> = inputs.found.iter().chain(inputs.found.iter().cycle().take(UNUSED)).copied().collect();
        let geometry = &theatre.geometry;
        let frame = shaders::Frame { capacity: padded as u32, ..theatre.frame };
        let counters = Counters { samples: count as u32, ..Counters::default() };
        let mut bound = vec![
            data(&[frame]),
            data(&theatre.instances),
            data(&[counters]),
            data(&geometry.triangle_corners),
            data(&geometry.triangle_rest),
            data(&geometry.triangles),
            data(&geometry.vertices),
            data(&theatre.materials),
            gallery.bound(),
            Gallery::srgb(),
            data(&theatre.lights),
            data(&found),
        ];
        bound.extend(draw.bound(padded));
        bound.extend([blank::<Gathered>(padded), blank::<[u32; 4]>(padded)]);
        bound.extend([blank::<[u32; 4]>(padded), blank::<[u32; 4]>(padded), blank::<[u32; 4]>(padded)]);
        bound.extend([blank::<u32>(2 * padded), data(&[PathCounters::default()])]);
        if self.stable {
            bound.extend([
                data(&inputs.samples),
                data(&inputs.previous),
                data(&inputs.sources),
                data(&inputs.gathered),
            ]);
        }
        self.kernel.run(&mut bound, &[], [(padded as u32).div_ceil(2).next_multiple_of(64), 2, 1]);
        support::assert_clean(&self.context);
        let mut gathered = values::<Gathered>(&bound[14]);
        assert!(gathered.split_off(count).iter().all(|g| g.paths == u32::MAX), "written behind the list's end");
        let counted = values::<PathCounters>(&bound[20])[0];
        assert_eq!(counted.refracted, 0);
        let list: Vec<u32> = values(&bound[19]);
        assert!(list[counted.reflected as usize..].iter().all(|slot| *slot == u32::MAX));
        Outcome {
            gathered,
            brought: values(&bound[15]),
            origins: values(&bound[16]),
            directions: values(&bound[17]),
            weights: values(&bound[18]),
            listed: list[..counted.reflected as usize].to_vec(),
        }
    }
}

/// Paths that the twin begins, with their numbers and what tells their samples from others.
fn twins(theatre: &Theatre, draw: &Draw, inputs: &Inputs, stable: bool) -> Vec<(Option<Start>, [u32; 2], u32)> {
    let one = |slot: usize| {
        let source = inputs.source(slot, stable);
        let before = (source != NO_SOURCE).then(|| inputs.gathered[source as usize]);
        let frame = &theatre.frame;
        let path = if stable { path_of(frame, draw.seed, before) } else { fresh_path_of(frame, draw.seed) };
        (start(&theatre.stage(true), &inputs.found[slot], path), path, source)
    };
    (0..inputs.found.len()).into_par_iter().map(one).collect()
}

/// What is wrong with a path, in a word.
fn problem(got: &Outcome, slot: usize, want: &(Option<Start>, [u32; 2], u32)) -> Option<&'static str> {
    let (want, [number, scramble], source) = want;
    if got.brought[slot] != [0, 0, 0, *source] {
        return Some("source");
    }
    let Some(want) = want else {
        return (got.gathered[slot] != Gathered { radiance: [0.0; 3], paths: 0 }).then_some("begun");
    };
    let vector = |list: &[[f32; 4]]| Vec3::from_slice(&list[slot][..3]).as_dvec3();
    let within = |a: DVec3, b: DVec3, error: f64| (a - b).abs().max_element() <= error;
    if !within(Vec3::from(got.gathered[slot].radiance).as_dvec3(), want.albedo, want.albedo_error) && !want.doubtful {
        return Some("albedo");
    }
    if got.gathered[slot].paths == 0 {
        // What scatters nothing to all that is known may scatter nothing.
        return (want.albedo.max_element() > want.albedo_error).then_some("not begun");
    }
    if got.origins[slot][3].to_bits() != *number || got.directions[slot][3].to_bits() != *scramble {
        return Some("number");
    }
    if got.weights[slot].map(f32::to_bits) != [1.0_f32.to_bits(), 1.0_f32.to_bits(), 1.0_f32.to_bits(), 0] {
        return Some("weight");
    }
    if want.doubtful {
        return None;
    }
    if vector(&got.origins) != want.origin.as_dvec3() {
        return Some("origin");
    }
    let fits = |direction: DVec3| within(vector(&got.directions), direction, want.direction_error);
    (!fits(want.direction) && !want.turned.is_some_and(fits)).then_some("direction")
}

type Wants = [(Option<Start>, [u32; 2], u32)];

fn problems<'a>(got: &'a Outcome, wants: &'a Wants) -> impl Iterator<Item = (usize, &'static str)> + 'a {
    wants.iter().enumerate().filter_map(|(i, want)| problem(got, i, want).map(|p| (i, p)))
}

#[test]
fn the_device_begins_paths_as_the_twin_does() {
    for stable in [true, false] {
        let device = Device::new(stable);
        for seed in 0..3 {
            let draw = Draw::random(&mut Random::new(seed));
            let wide = || {
                let mut theatre = Theatre::wide(SIZE, &mut Random::new(20 + seed));
                theatre.frame.seed = seed;
                theatre.frame.spp = 4;
                theatre
            };
            let theatre = wide().drawn(&draw);
            let inputs = Inputs::random(&theatre, seed, 4000);
            let wants = twins(&theatre, &draw, &inputs, stable);
            let got = device.run(&wide(), &draw, &inputs);
            if let Some((i, what)) = problems(&got, &wants).next() {
                panic!(
                    "{what} of {i}: {:?} {:?} {:?} against {:?}; {} wrong",
                    got.gathered[i],
                    got.origins[i],
                    got.directions[i],
                    wants[i],
                    problems(&got, &wants).count()
                );
            }
            // The list holds each sample with a path once.
            let listed: BTreeSet<u32> = got.listed.iter().copied().collect();
            let begun: BTreeSet<u32> = (0..4000).filter(|i| got.gathered[*i as usize].paths == 1).collect();
            assert!(listed == begun && listed.len() == got.listed.len());
            let doubtful = wants.iter().filter_map(|w| w.0).filter(|s| s.doubtful).count();
            let loose = wants.iter().filter_map(|w| w.0).filter(|s| s.direction_error > 1e-2).count();
            let known = wants.iter().filter(|w| w.2 != NO_SOURCE).count();
            println!("{} paths, {doubtful} doubtful, {loose} loose, {known} of the last frame", begun.len());
            assert!(begun.len() > 1500 && doubtful < 100 && loose < 100);
            assert!((known > 1500) == stable);
            // Negative controls.
            let caught = |wants: &Wants, what: &str| problems(&got, wants).any(|(_, p)| p == what);
            let mut other = wide().drawn(&draw);
            other.frame.seed += 1;
            assert!(caught(&twins(&other, &draw, &inputs, stable), "number"));
            let mut other = wide().drawn(&draw);
            other.materials.iter_mut().for_each(|m| m.base_color[1] *= 0.99);
            assert!(caught(&twins(&other, &draw, &inputs, stable), "albedo"));
            let mut other = wide().drawn(&draw);
            other.materials[1].normal_scale += 0.05;
            assert!(caught(&twins(&other, &draw, &inputs, stable), "direction"));
            if stable {
                let mut other = inputs.clone();
                other.gathered.iter_mut().for_each(|g| g.paths ^= 1 << 16);
                assert!(caught(&twins(&theatre, &draw, &other, stable), "number"));
                let mut other = inputs.clone();
                other.previous.iter_mut().for_each(|s| s.position[0] += 1.0);
                assert!(caught(&twins(&theatre, &draw, &other, stable), "source"));
            }
        }
    }
}
