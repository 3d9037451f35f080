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
use stillray::oracle::indirect::{Ray, Start, bring, fresh_path_of, path_of, source_of, start};
use stillray::oracle::verify::verify;
use stillray::shaders::{
    self, Counters, FOUND_LOST, Found, Gathered, MODEL_LENS, NO_SOURCE, OCCLUDED_BIT, PathCounters, SKY_INSTANCE,
    Sample,
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

/// What a diffuse ray that was not reflected carries of its path's number.
fn tag(number: u32) -> u32 {
    shaders::RAY_INDIRECT << shaders::PATH_KIND | number
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
    if got.origins[slot][3].to_bits() != tag(*number) || got.directions[slot][3].to_bits() != *scramble {
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

/// Rays of a step, what they have found, and what their paths have brought so far.
struct Rays {
    rays: Vec<Ray>,
    found: Vec<Found>,
    lit: Vec<u32>,
    brought: Vec<[f32; 3]>,
}

impl Rays {
    /// From anywhere to anywhere on triangles, or to the sky.
    fn random(theatre: &Theatre, seed: u32, count: u32) -> Self {
        let random = &mut Random::new(seed);
        let mut list = Self { rays: Vec::new(), found: Vec::new(), lit: Vec::new(), brought: Vec::new() };
        for _ in 0..count {
            let (instance, primitive) = theatre.random_triangle(random);
            let u = random.between(0.0, 1.0);
            let v = random.between(0.0, 1.0 - u);
            let sky = random.chance(0.1);
            list.found.push(Found { instance: if sky { SKY_INSTANCE } else { instance }, primitive, u, v });
            let mut three = |size: f32| Vec3::from([0; 3].map(|_| random.between(-size, size)));
            let (origin, weight, brought) = (three(6.0) - Vec3::Z * 6.0, three(1.0).abs(), three(9.0).abs());
            list.rays.push(Ray { origin, weight, number: random.below(0x1_0000), scramble: random.bits() });
            list.brought.push(brought.to_array());
            list.lit.push(random.bits() & random.pick(&[0, 1, 31]));
        }
        list
    }

    /// On the device; every second sample has a ray.
    fn on_device(&self, context: &Context, kernel: &Kernel, theatre: &Theatre, draw: &Draw, step: u32) -> Outcome {
        let count = self.rays.len();
        let gallery = Gallery::new(context, &theatre.atlas);
        let geometry = &theatre.geometry;
        let frame = shaders::Frame { capacity: count as u32, ..theatre.frame };
        let listed: Vec<u32> = (0..count as u32).filter(|slot| slot % 2 == 0).rev().collect();
        let mut list = vec![u32::MAX; 2 * count];
        let from = if step & 1 == 0 { 0 } else { count };
        list[from..from + listed.len()].copy_from_slice(&listed);
        let mut counters = vec![PathCounters::default(); shaders::PATH_STEPS as usize + 1];
        counters[step as usize].reflected = listed.len() as u32;
        counters[step as usize].listed = listed.len() as u32;
        let words = |v: Vec3, w: u32| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), w];
        let of = |f: &dyn Fn(usize) -> [u32; 4]| data(&(0..count).map(f).collect::<Vec<_>>());
        let mut bound = vec![
            data(&[frame]),
            data(&theatre.instances),
            data(&geometry.triangle_corners),
            data(&geometry.triangle_rest),
            data(&geometry.triangles),
            data(&geometry.vertices),
            data(&theatre.materials),
            gallery.bound(),
            Gallery::srgb(),
            data(&theatre.lights),
            data(&self.found),
            data(&self.lit),
            of(&|i| words(self.brought[i].into(), 77)),
        ];
        bound.extend(draw.bound(count));
        bound.extend([data(&theatre.environment)]);
        bound.extend([
            of(&|i| words(self.rays[i].origin, tag(self.rays[i].number))),
            of(&|i| words(Vec3::X, self.rays[i].scramble)),
            of(&|i| words(self.rays[i].weight, 0)),
            data(&list),
            data(&counters),
        ]);
        let threads = (listed.len() as u32).next_multiple_of(64);
        kernel.run(&mut bound, bytemuck::bytes_of(&step), [threads, 1, 1]);
        support::assert_clean(context);
        let counted = values::<PathCounters>(&bound[20])[step as usize + 1];
        assert_eq!(counted.refracted, 0);
        let list: Vec<u32> = values(&bound[19]);
        let next = count - from;
        Outcome {
            gathered: Vec::new(),
            brought: values(&bound[12]),
            origins: values(&bound[16]),
            directions: values(&bound[17]),
            weights: values(&bound[18]),
            listed: list[next..next + counted.reflected as usize].to_vec(),
        }
    }

    /// What is wrong with the first ray that is, in a word.
    fn problem(&self, got: &Outcome, theatre: &Theatre, step: u32) -> Option<(usize, &'static str)> {
        let listed: BTreeSet<u32> = got.listed.iter().copied().collect();
        assert_eq!(listed.len(), got.listed.len());
        (0..self.rays.len()).find_map(|slot| {
            let word = self.problem_of(got, theatre, (slot, step), listed.contains(&(slot as u32)));
            word.map(|word| (slot, word))
        })
    }

    fn problem_of(
        &self,
        got: &Outcome,
        theatre: &Theatre,
        (slot, step): (usize, u32),
        listed: bool,
    ) -> Option<&'static str> {
        let before = Vec3::from(self.brought[slot]).as_dvec3();
        let vector = |words: [f32; 4]| Vec3::from_slice(&words[..3]).as_dvec3();
        let total = vector(got.brought[slot].map(f32::from_bits));
        if slot % 2 != 0 {
            return (total != before || listed).then_some("no ray");
        }
        let ray = &self.rays[slot];
        let want = bring(&theatre.stage(true), &theatre.lights, &self.found[slot], ray, (step, self.lit[slot]));
        let sum = before + want.radiance;
        let error = want.error + sum / 16_777_216.0;
        if !(0..3).all(|i| error[i].is_infinite() || (total[i] - sum[i]).abs() <= error[i]) {
            return Some("radiance");
        }
        let Some(next) = want.next else { return listed.then_some("goes on") };
        if next.doubtful {
            return None;
        }
        if !listed {
            return (next.albedo.max_element() > next.albedo_error).then_some("ends");
        }
        let weight = ray.weight.as_dvec3();
        let weighed = (vector(got.weights[slot]) - next.albedo * weight).abs();
        if !weighed.cmple(weight * (next.albedo_error + 2.0 / 16_777_216.0)).all() {
            return Some("weight");
        }
        let kept = [got.origins[slot][3].to_bits(), got.directions[slot][3].to_bits()];
        if kept != [tag(ray.number), ray.scramble] || vector(got.origins[slot]) != next.origin.as_dvec3() {
            return Some("origin");
        }
        let off = |d: DVec3| (vector(got.directions[slot]) - d).abs().max_element() > next.direction_error;
        (off(next.direction) && next.turned.is_none_or(off)).then_some("direction")
    }
}

#[test]
fn the_device_goes_on_as_the_twin_does() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::scatter_diffuse::modelling(0));
    for (step, depth) in [(0, 1), (0, 2), (1, 4), (3, 4)] {
        let mut theatre = Theatre::new(SIZE);
        theatre.frame.indirect = depth;
        let draw = Draw::random(&mut Random::new(step));
        let rays = Rays::random(&theatre, 7 * step + depth, 6000);
        let got = rays.on_device(&context, &kernel, &theatre, &draw, step);
        println!("ray {step} of {depth}: {} go on", got.listed.len());
        assert_eq!(rays.problem(&got, &theatre, step), None, "ray {step} of {depth}");
        assert!((got.listed.len() > 1500) == (step + 1 < depth));
        // Negative controls.
        let caught = |change: &dyn Fn(&mut Theatre), what: &str| {
            let mut other = Theatre::new(SIZE);
            other.frame.indirect = depth;
            change(&mut other);
            assert_eq!(rays.problem(&got, &other, step).map(|p| p.1), Some(what));
        };
        caught(&|t| t.frame.environment[0] += 0.01, "radiance");
        caught(&|t| t.lights[0].intensity[1] *= 1.02, "radiance");
        caught(&|t| t.materials[stage_support::MASKED].emissive[2] *= 1.01, "radiance");
        caught(&|t| t.frame.indirect = if step + 1 < depth { step + 1 } else { step + 2 }, "radiance");
        if step + 1 < depth {
            let wrong = rays.problem(&got, &theatre, step + 1).map(|p| p.1);
            assert!(wrong.is_some(), "another step is another seed");
        }
    }
}
