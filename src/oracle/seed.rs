//! What samples carry of how they were drawn, and what they carry it for. Twin of `glsl/include/seed.glsl`, exact.

use super::camera;
use super::gather::Gathered;
use super::random::unit_float;
use crate::sampler::Sampler;
use crate::shaders::{Frame, NO_SOURCE};

/// Which dimensions of a path are for what: pairs, of which the first is the place in the pixel.
pub const PAIR_LENS: u32 = 1;
/// See [`PAIR_LENS`].
pub const PAIR_TIME: u32 = 2;
/// See [`PAIR_LENS`].
pub const PAIR_LIGHT: u32 = 3;
/// See [`PAIR_LENS`].
pub const PAIR_ENVIRONMENT: u32 = 5;

/// The seed of a new sample: 14 bits a pixel coordinate, 4 bits of its number in the pixel.
pub fn new_seed([x, y]: [u32; 2], number: u32) -> u32 {
    x | y << 14 | (number & 15) << 28
}

/// See [`PAIR_LENS`].
pub const PAIR_LOBE: u32 = 4;
/// See [`PAIR_LENS`]: which lobe, and which triangle that shines.
pub const PAIR_CHOICE: u32 = 6;
/// Dimensions of which of several points of what shines is taken.
pub const PAIR_EMITTER: u32 = 7;

/// The seed by which a later step of a sample's path is drawn.
pub fn path_seed(seed: u32, step: u32) -> u32 {
    let x = seed.wrapping_add(2741 * step);
    let y = (seed >> 14).wrapping_add(6053 * step);
    (seed & 0xf000_0000) | (x & 16383) | (y & 16383) << 14
}

/// A pair of coordinates of a sample, 2^32 to one.
pub fn seed_bits(sampler: &Sampler, variation: u32, seed: u32, pair: u32) -> [u32; 2] {
    let pixel = [seed & 16383, seed >> 14 & 16383];
    let index = (seed >> 28) + 16 * variation;
    [0, 1].map(|axis| sampler.coordinate(pixel, index, 2 * pair + axis))
}

/// The same in [0, 1).
pub fn seed_pair(sampler: &Sampler, variation: u32, seed: u32, pair: u32) -> [f32; 2] {
    seed_bits(sampler, variation, seed, pair).map(unit_float)
}

/// Seeds of a gathered list: those of the last frame's samples for what was kept, of `visible` samples in each pixel; new
/// ones are numbered from there on.
pub fn gathered_seeds(frame: &Frame, list: &Gathered, visible: &[u32], previous: &[u32]) -> Vec<u32> {
    let mut seeds = Vec::with_capacity(list.sources.len());
    for (index, pixel) in camera::pixels_in_order(frame.size).enumerate() {
        let mut number = visible[index];
        for source in &list.sources[list.offsets[index] as usize..list.offsets[index + 1] as usize] {
            seeds.push(if *source == NO_SOURCE { new_seed(pixel, number) } else { previous[*source as usize] });
            number += u32::from(*source == NO_SOURCE);
        }
    }
    seeds
}

/// Seeds of what pixels add behind a list, from `extras[i]` to `extras[i + 1]`.
pub fn appended_seeds(frame: &Frame, extras: &[u32], visible: &[u32]) -> Vec<u32> {
    let pixels = camera::pixels_in_order(frame.size).enumerate();
    let of_pixel = |(i, pixel): (usize, [u32; 2])| {
        (0..extras[i + 1] - extras[i]).map(move |added| new_seed(pixel, visible[i] + added)).collect::<Vec<_>>()
    };
    pixels.flat_map(of_pixel).collect()
}

/// Seeds of the same number of new samples in every pixel.
pub fn generated_seeds(frame: &Frame) -> Vec<u32> {
    camera::pixels_in_order(frame.size).flat_map(|pixel| (0..frame.spp).map(move |i| new_seed(pixel, i))).collect()
}
