//! What rays cost, by kind and by packet: twin of `glsl/include/count.glsl`.

use std::collections::HashSet;

use super::random::hash_combine;
use super::traverse::Cost;
use crate::shaders::{PACKET_THREADS, RAY_KINDS};
use crate::stats::{RayCost, RayCosts};

/// Bits of a set of triangles.
const PACKET_BITS: u32 = 2048;

/// What a thread of a dispatch traced.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Thread {
    /// One of the `RAY_` constants.
    pub kind: u32,
    /// Its rays in order.
    pub rays: Vec<Cost>,
}

/// Counts of each kind, but for steps of marches.
pub fn count(threads: &[Thread]) -> RayCosts {
    let mut kinds = [RayCost::default(); RAY_KINDS as usize];
    for thread in threads {
        if let Some(own) = kinds.get_mut(thread.kind as usize) {
            *own = own.plus(&cost_of(thread));
        }
    }
    for packet in threads.chunks(PACKET_THREADS as usize) {
        let busy = packet.iter().filter(|thread| !thread.rays.is_empty());
        let Some((nodes, kind)) = busy.map(|thread| (cost_of(thread).nodes, thread.kind)).max() else { continue };
        let Some(own) = kinds.get_mut(kind as usize) else { continue };
        own.packets += 1;
        own.held += u64::from(PACKET_THREADS) * nodes;
        own.packet_triangles += estimated(packet);
    }
    let [camera, shadow, reflection, refraction, march, indirect] = kinds;
    RayCosts { camera, shadow, reflection, refraction, march, indirect, march_steps: 0 }
}

fn cost_of(thread: &Thread) -> RayCost {
    let sum = |of: fn(&Cost) -> usize| thread.rays.iter().map(of).sum::<usize>() as u64;
    RayCost {
        rays: thread.rays.len() as u64,
        nodes: sum(|ray| ray.nodes as usize),
        triangles: sum(|ray| ray.tested.len()),
        ..RayCost::default()
    }
}

/// Number of a ray among its thread's, from 1, instance, and triangle slot, of everything that a packet tests.
fn tests(packet: &[Thread]) -> impl Iterator<Item = (u32, u32, u32)> + '_ {
    let rays = packet.iter().flat_map(|thread| (1..).zip(&thread.rays));
    rays.flat_map(|(number, ray)| ray.tested.iter().map(move |(instance, primitive)| (number, *instance, *primitive)))
}

/// Different triangles that the rays of a packet test.
pub fn different(packet: &[Thread]) -> u64 {
    tests(packet).collect::<HashSet<_>>().len() as u64
}

/// The same as the device tells it, by linear counting; the device's logarithm may make it one more or less.
pub fn estimated(packet: &[Thread]) -> u64 {
    let bit = |(number, instance, primitive)| hash_combine(hash_combine(number, instance), primitive) % PACKET_BITS;
    let filled = tests(packet).map(bit).collect::<HashSet<_>>().len() as u32;
    set_size(filled)
}

/// How many different things were put into a set of which so many bits are set.
fn set_size(filled: u32) -> u64 {
    let bits = f64::from(PACKET_BITS);
    let empty = (bits - f64::from(filled.min(PACKET_BITS - 1))) / bits;
    (-bits * empty.ln()).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders::{RAY_CAMERA, RAY_SHADOW};

    fn thread(kind: u32, nodes: u32, tested: &[u32]) -> Thread {
        Thread { kind, rays: vec![Cost { nodes, tested: tested.iter().map(|primitive| (0, *primitive)).collect() }] }
    }

    #[test]
    fn a_packet_waits_for_its_slowest_and_shares_what_it_tests() {
        let threads: Vec<Thread> = (0..20).map(|i| thread(RAY_CAMERA, 1 + i % 16, &[7, 8 + i / 16])).collect();
        let costs = count(&threads).camera;
        assert_eq!((costs.rays, costs.triangles, costs.packets), (20, 40, 2));
        assert_eq!(costs.nodes, (1..=16).sum::<u64>() + 1 + 2 + 3 + 4);
        // The second packet has four rays: twelve threads have none, and wait all the same.
        assert_eq!((costs.held, costs.packet_triangles), (16 * 16 + 16 * 4, 2 + 2));
    }

    #[test]
    fn a_packet_counts_for_its_slowest_and_rays_for_themselves() {
        let none = Thread { kind: RAY_SHADOW, rays: Vec::new() };
        let costs = count(&[thread(RAY_CAMERA, 3, &[1]), thread(RAY_SHADOW, 5, &[2, 3]), none]);
        assert_eq!((costs.camera.rays, costs.camera.packets, costs.camera.held), (1, 0, 0));
        assert_eq!((costs.shadow.rays, costs.shadow.packets, costs.shadow.held), (1, 1, 80));
        assert_eq!(costs.shadow.packet_triangles, 3);
    }

    #[test]
    fn the_rays_of_a_thread_to_different_lights_share_nothing() {
        let two = |i: u32| Thread {
            kind: RAY_SHADOW,
            rays: vec![Cost { nodes: i, tested: vec![(0, 1)] }, Cost { nodes: 1, tested: vec![(0, 1)] }],
        };
        assert_eq!(different(&[two(1), two(2)]), 2);
    }

    /// Whang, Vander-Zanden and Taylor 1990: with t things a bit, the relative error has the deviation
    /// sqrt((e^t - t - 1) / bits) / t.
    #[test]
    fn estimates_are_as_good_as_linear_counting_is() {
        for different in [30_u32, 300, 2000] {
            let load = f64::from(different) / f64::from(PACKET_BITS);
            let deviation = ((load.exp() - load - 1.0) / f64::from(PACKET_BITS)).sqrt() / load;
            let errors = (0..200_u32).map(|trial| {
                let tested: Vec<u32> = (0..different).map(|i| trial * 100_000 + i).collect();
                estimated(&[thread(RAY_CAMERA, 1, &tested)]) as f64 / f64::from(different) - 1.0
            });
            let errors: Vec<f64> = errors.collect();
            let mean = errors.iter().sum::<f64>() / 200.0;
            let spread = (errors.iter().map(|e| e * e).sum::<f64>() / 200.0).sqrt();
            // Five deviations of a mean of 200; the bias that the paper gives, (e^t - t - 1) / (2 n); and half of one, which rounding
            // to whole numbers is off by: of 30 things two share a bit in one trial of five, and 29 bits, 29.2 things, become 29.
            let bias = (load.exp() - load - 1.0) / (2.0 * f64::from(different)) + 0.5 / f64::from(different);
            assert!(mean.abs() < 5.0 * deviation / 200.0_f64.sqrt() + bias, "{different}: {mean}");
            // A spread of 200 is off by a twentieth of itself; whole numbers add up to a half of one.
            assert!(spread < 1.25 * deviation + 0.5 / f64::from(different), "{different}: {spread} {deviation}");
            assert!(deviation < 0.02);
        }
        // A set that is full tells what it can.
        assert_eq!(set_size(PACKET_BITS), set_size(PACKET_BITS - 1));
        assert_eq!((set_size(0), set_size(1), set_size(PACKET_BITS)), (0, 1, 15_615));
    }
}
