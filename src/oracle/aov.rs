//! Images besides colour, pixel by pixel. Twin of `glsl/aov.comp`.

use super::camera::pixel_index;
use super::reconstruct::{longer_motion, motion_of};
use super::slots::Slots;
use crate::shaders::{MOTION_UNKNOWN, Shaded};

/// What the images hold at one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AovPixel {
    /// Metres to the nearest visible sample; infinity without one.
    pub depth: f32,
    /// Motion in pixels of the visible sample that moved most; the first of equals; 0 if unknown.
    pub motion: [f32; 2],
    /// Samples evicted, added and kept, then 1.
    pub density: [f32; 4],
    /// Frames that the oldest visible sample has lived.
    pub age: f32,
}

/// What a method with a cache has besides: masks and plan a pixel, and ages a sample if they are kept.
#[derive(Debug, Clone, Copy)]
pub struct Cache<'a> {
    /// Occupied subpixels in the low half, of those the unoccluded in the high half.
    pub masks: &'a [u32],
    /// Kept subpixels in the low half, new ones in the high half.
    pub plan: &'a [u32],
    /// Frames that each sample has lived; empty if they are not kept.
    pub ages: &'a [u32],
}

/// All pixels, row by row. `slots` are in the order of [`pixel_index`].
pub fn aov(size: [u32; 2], slots: Slots<'_>, shaded: &[Shaded], cache: Option<Cache<'_>>) -> Vec<AovPixel> {
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
    pixels.map(|pixel| one(pixel_index(pixel, size), slots, shaded, cache)).collect()
}

fn one(index: usize, slots: Slots<'_>, shaded: &[Shaded], cache: Option<Cache<'_>>) -> AovPixel {
    let visible: Vec<usize> = slots.of(index).filter(|slot| shaded[*slot].depth >= 0.0).collect();
    let longest = visible.iter().map(|slot| shaded[*slot].motion).fold(MOTION_UNKNOWN, longer_motion);
    let ages = cache.map_or(&[][..], |c| c.ages);
    AovPixel {
        depth: visible.iter().map(|slot| shaded[*slot].depth).fold(f32::INFINITY, f32::min),
        motion: if longest == MOTION_UNKNOWN { [0.0; 2] } else { motion_of(longest) },
        density: density(index, slots.of(index).count(), cache),
        age: visible.iter().filter_map(|slot| ages.get(*slot)).max().map_or(0.0, |age| *age as f32),
    }
}

fn density(index: usize, samples: usize, cache: Option<Cache<'_>>) -> [f32; 4] {
    let Some(cache) = cache else { return [0.0, samples as f32, 0.0, 1.0] };
    let (unoccluded, plan) = (cache.masks[index] >> 16, cache.plan[index]);
    let count = |mask: u32| mask.count_ones() as f32;
    [count(unoccluded & !plan & 0xffff), count(plan >> 16), count(plan & 0xffff), 1.0]
}
