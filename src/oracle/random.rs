//! Integer hashing for tie-breaks and sample positions. Twin of `glsl/include/random.glsl`, exact.

/// PCG output permutation over a linear congruential step (O'Neill 2014; as a hash: Jarzynski and Olano 2020).
pub fn hash_uint(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Folds one more number into a hash.
pub fn hash_combine(h: u32, x: u32) -> u32 {
    hash_uint(h ^ x.wrapping_add(0x9e37_79b9))
}

/// The top 24 bits as a number in [0, 1). Exact: every multiple of 2⁻²⁴ below 1 is a float.
pub fn unit_float(h: u32) -> f32 {
    (h >> 8) as f32 / 16_777_216.0
}

/// Hash of a pixel in a frame, from which the analysis draws its tie-breaks.
pub fn pixel_hash(pixel: [u32; 2], frame: u32, seed: u32) -> u32 {
    [frame, pixel[0], pixel[1]].into_iter().fold(seed, hash_combine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_the_published_one() {
        // pcg_hash(0) by hand: state = 2891336453, its top four bits are 10, so the shift is by 14.
        let state = 2_891_336_453_u32;
        let word = ((state >> 14) ^ state).wrapping_mul(277_803_737);
        assert_eq!(hash_uint(0), (word >> 22) ^ word);
        assert_ne!(hash_uint(0), hash_uint(1));
    }

    #[test]
    fn unit_floats_cover_the_half_open_interval() {
        assert_eq!(unit_float(0), 0.0);
        assert!(unit_float(u32::MAX) < 1.0);
        assert_eq!(unit_float(u32::MAX), 1.0 - 1.0 / 16_777_216.0);
    }
}
