//! What is visible after verification. Twin of `glsl/survey.comp`, exact.

use crate::shaders::{Counters, FOUND_LOST, Found, OCCLUDED_BIT};

/// Masks of this frame, from those of reprojection: the same subpixels are occupied, and those of visible samples are
/// unoccluded. A pixel's samples are in the order of its subpixels, one each. Counts `occluded` and `lost` (the rest is 0).
pub fn survey(offsets: &[u32], found: &[Found], masks: &[u32]) -> (Vec<u32>, Counters) {
    let mut counters = Counters::default();
    let one = |(mask, range): (&u32, &[u32])| {
        let occupied = (0..16).filter(|bit| mask >> bit & 1 != 0);
        let mut word = mask & 0xffff;
        for (bit, found) in occupied.zip(&found[range[0] as usize..range[1] as usize]) {
            if found.primitive == FOUND_LOST {
                counters.lost += 1;
            } else if found.instance & OCCLUDED_BIT != 0 {
                counters.occluded += 1;
            } else {
                word |= 0x1_0000 << bit;
            }
        }
        word
    };
    (masks.iter().zip(offsets.windows(2)).map(one).collect(), counters)
}
