//! The walk on the GPU finds what its CPU twin finds, and has no cracks either.

#![allow(clippy::unwrap_used)] // helpers of tests, which may

mod accel_support;
mod support;

use std::time::Instant;

use accel_support::rays::{aimed, closed_meshes, placements, random_query, worlds};
use accel_support::{Built, Rng};
use bytemuck::{bytes_of, cast_slice};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use stillray::gpu::Context;
use stillray::gpu::kernel::{self, Argument};
use stillray::oracle::traverse::reference::disagreement;
use stillray::oracle::traverse::{Intersection, Query, closest};
use stillray::scene::builtin;
use stillray::shaders::{self, Hit, Shader};

/// What the shaders bind before their outputs.
struct Buffers {
    nodes: Vec<u8>,
    corners: Vec<u8>,
    rest: Vec<u8>,
    instances: Vec<u8>,
    rays: Vec<u8>,
}

impl Buffers {
    fn new(built: &Built, queries: &[Query]) -> Self {
        let mut nodes = built.tlas.nodes.clone();
        nodes.resize(built.geometry.tlas_capacity as usize, [0; 20]);
        nodes.extend_from_slice(&built.geometry.nodes);
        let ray = |q: &Query| [q.origin.extend(q.tmax).to_array(), q.direction.extend(0.0).to_array()];
        let rays: Vec<[f32; 4]> = queries.iter().flat_map(ray).collect();
        Self {
            nodes: cast_slice(&nodes).to_vec(),
            corners: cast_slice(&built.geometry.triangle_corners).to_vec(),
            rest: cast_slice(&built.geometry.triangle_rest).to_vec(),
            instances: cast_slice(&built.instances).to_vec(),
            rays: cast_slice(&rays).to_vec(),
        }
    }

    /// Runs a shader with these and its outputs; returns the device's milliseconds.
    fn run(&mut self, context: &Context, shader: &'static Shader, outputs: &mut [Vec<u8>]) -> f64 {
        let count = (self.rays.len() / 32) as u32;
        let inputs = [&mut self.nodes, &mut self.corners, &mut self.rest, &mut self.instances, &mut self.rays];
        let mut arguments: Vec<Argument> = inputs.into_iter().chain(outputs).map(Argument::Buffer).collect();
        let push = shaders::closest::Push { count };
        kernel::run(context, shader, &mut arguments, bytes_of(&push), [count, 1, 1]).unwrap()
    }
}

fn trace(context: &Context, built: &Built, queries: &[Query]) -> Vec<Option<Intersection>> {
    let mut outputs = [vec![0; 4 * queries.len()], vec![0; 16 * queries.len()]];
    Buffers::new(built, queries).run(context, shaders::closest::SHADER, &mut outputs);
    let instances: &[u32] = cast_slice(&outputs[0]);
    let hits = outputs[1].chunks_exact(16).map(bytemuck::pod_read_unaligned::<Hit>);
    let found = hits.zip(instances).map(|(hit, &instance)| {
        let Hit { primitive, u, v, t } = hit;
        (primitive != shaders::HIT_SKY).then_some(Intersection { instance, primitive, u, v, t })
    });
    found.collect()
}

fn occluded(context: &Context, built: &Built, queries: &[Query]) -> Vec<bool> {
    let mut outputs = [vec![0; 4 * queries.len()]];
    Buffers::new(built, queries).run(context, shaders::any::SHADER, &mut outputs);
    cast_slice::<u8, u32>(&outputs[0]).iter().map(|&o| o != 0).collect()
}

/// Only a reciprocal may round differently from driver to driver (2.5 ulp, where IEEE's is 0.5): where the bits differ, the
/// hit has to be right within the bounds of the reference all the same. Where a driver's reciprocal is IEEE's, all bits agree.
#[test]
fn the_gpu_finds_what_the_twin_finds() {
    let context = support::validated_context();
    for (name, built) in worlds() {
        let queries: Vec<Query> = (0..20_000).map(|i| random_query(&mut Rng::new(i + 77), &built)).collect();
        let found = trace(&context, &built, &queries);
        let world = built.world();
        let differing: Vec<usize> = (0..queries.len()).filter(|&i| closest(&world, &queries[i]) != found[i]).collect();
        for &i in &differing {
            let problem = disagreement(&world, &queries[i], found[i].as_ref());
            assert!(problem.is_none(), "{name}, ray {i} {:?}: {problem:?}", queries[i]);
        }
        let hits = found.iter().flatten().count();
        println!("{name}: {hits} hits of {}, {} not bit for bit the twin's", queries.len(), differing.len());
        assert!(hits > 2000 && differing.len() * 1000 <= queries.len(), "{name}: {} differ", differing.len());
        let any = occluded(&context, &built, &queries);
        assert!(any.iter().zip(&found).all(|(&any, closest)| any == closest.is_some()), "{name}");
    }
    support::assert_clean(&context);
}

/// Negative control: the comparison sees a triangle moved by a thousandth.
#[test]
fn a_moved_triangle_is_noticed() {
    let context = support::validated_context();
    let mut built = Built::one(accel_support::icosphere(1));
    let queries: Vec<Query> = (0..1000).map(|i| random_query(&mut Rng::new(i), &built)).collect();
    let found = trace(&context, &built, &queries);
    built.geometry.triangle_corners.iter_mut().for_each(|c| c[0] += 1e-3);
    let world = built.world();
    assert!(queries.iter().zip(&found).any(|(q, f)| disagreement(&world, q, f.as_ref()).is_some()));
}

#[test]
fn a_million_rays_leak_none() {
    let context = support::validated_context();
    for (name, mesh) in closed_meshes() {
        for m in placements() {
            let built = Built::new(vec![mesh.clone()], &[(0, m)], DVec3::ZERO);
            let ray = |i| aimed(&mut Rng::new(i), &mesh, &m);
            let queries: Vec<Query> = (0..100_000).into_par_iter().map(ray).collect();
            let leaks = trace(&context, &built, &queries).iter().filter(|found| found.is_none()).count();
            assert_eq!(leaks, 0, "{name}");
        }
    }
    support::assert_clean(&context);
}

/// For information: compile time at the first dispatch, and rays a second on a hairball of 144,000 triangles, seen from
/// outside and on random rays from points inside.
#[test]
fn speed_for_information() {
    let context = support::validated_context();
    let mut rng = Rng::new(41);
    let scene = builtin::load("hairball?strands=1000", 1).unwrap();
    let built = Built::new(scene.meshes, &[(0, DAffine3::IDENTITY)], DVec3::ZERO);
    let bounds = built.geometry.meshes[0].bounds;
    let (center, radius) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).max_element() * 0.5);
    let side = 512;
    let camera = |i: usize| {
        let (x, y) = ((i % side) as f32 / side as f32 - 0.5, (i / side) as f32 / side as f32 - 0.5);
        let origin = center + Vec3::Z * radius * 3.0;
        Query { origin, direction: Vec3::new(x, y, -1.0) * 0.8, tmax: f32::INFINITY }
    };
    let primary: Vec<Query> = (0..side * side).map(camera).collect();
    let random: Vec<Query> = (0..side * side)
        .map(|_| {
            let origin = center + (rng.cube() * f64::from(radius)).as_vec3();
            Query { origin, direction: rng.direction().as_vec3(), tmax: f32::INFINITY }
        })
        .collect();
    for (name, queries) in [("coherent", &primary), ("random", &random)] {
        let start = Instant::now();
        queries.iter().for_each(|q| {
            std::hint::black_box(closest(&built.world(), q));
        });
        let twin = queries.len() as f64 / start.elapsed().as_secs_f64() / 1e6;
        for shader in [shaders::closest::SHADER, shaders::any::SHADER] {
            let time = |queries: &[Query]| {
                let mut outputs = vec![vec![0; 4 * queries.len()]];
                if shader.bindings.len() > 6 {
                    outputs.push(vec![0; 16 * queries.len()]);
                }
                Buffers::new(&built, queries).run(&context, shader, &mut outputs)
            };
            // One ray is all compilation, which the first dispatch pays.
            let start = Instant::now();
            time(&queries[..1]);
            let compile = start.elapsed().as_secs_f64() * 1e3;
            let (short, long) = (time(&queries[..queries.len() / 4]), time(queries));
            let rate = queries.len() as f64 * 0.75 / (long - short) / 1e3;
            println!(
                "{name} {}: first dispatch {compile:.0} ms, {rate:.2} Mrays/s; CPU twin, one thread: {twin:.2}",
                shader.name
            );
        }
    }
}
