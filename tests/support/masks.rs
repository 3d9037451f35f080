//! Random pixel masks: occupied subpixels in the low half, unoccluded ones of them in the high half.

use super::random::Random;
use stillray::oracle::camera::pixel_index;

/// A mask word of which each subpixel is occupied, and then unoccluded, with these probabilities.
pub fn random_word(random: &mut Random, occupied: f32, unoccluded: f32) -> u32 {
    let mut bits =
        |of: u32, p: f32| (0..16).filter(|b| of >> b & 1 != 0 && random.chance(p)).map(|b| 1 << b).sum::<u32>();
    let occupancy = bits(0xffff, occupied);
    occupancy | bits(occupancy, unoccluded) << 16
}

/// Masks of a frame with empty, sparse, crowded and full regions, in list order.
pub fn random_masks(random: &mut Random, size: [u32; 2]) -> Vec<u32> {
    let densities = [0.0, 0.03, 0.1, 0.25, 0.6, 1.0];
    let regions: Vec<(f32, f32)> =
        (0..64).map(|_| (random.pick(&densities), random.pick(&[0.0, 0.5, 0.9, 1.0]))).collect();
    let mut masks = vec![0; (size[0] * size[1]) as usize];
    for y in 0..size[1] {
        for x in 0..size[0] {
            let (occupied, unoccluded) = regions[(x / 7 % 8 + y / 7 % 8 * 8) as usize];
            masks[pixel_index([x, y], size)] = random_word(random, occupied, unoccluded);
        }
    }
    masks
}

/// A density or tolerance in the range that the settings allow: sixteenths, thirds, or any number.
pub fn random_density(random: &mut Random) -> f32 {
    match random.below(3) {
        0 => (1 + random.below(256)) as f32 / 16.0,
        1 => random.pick(&[0.0625, 0.1, 1.0 / 3.0, 0.5, 1.0, 2.0, 4.0, 16.0]),
        _ => (random.between(-4.0, 4.0)).exp2(),
    }
}
