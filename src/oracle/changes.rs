//! What is not as it was in the last frame, pixel by pixel. Twin of `glsl/changes.comp`, exact.

use super::camera::pixel_index;
use super::gather::NO_SOURCE;
use super::slots::Slots;
use crate::shaders::{INSTANCE_MASK, OCCLUDED_BIT, Sample};

/// What a method with a cache remembers, and what has become of it.
#[derive(Debug, Clone, Copy)]
pub struct Memory<'a> {
    /// A word a pixel: occupied subpixels in the low half, of those the unoccluded in the high half.
    pub masks: &'a [u32],
    /// A word a pixel: kept subpixels in the low half, new ones in the high half.
    pub plan: &'a [u32],
    /// The samples of the last frame.
    pub previous: &'a [Sample],
    /// Those of this frame, after verification and retention.
    pub samples: &'a [Sample],
    /// A word a sample of this frame: which of the last frame's it is, or [`NO_SOURCE`].
    pub sources: &'a [u32],
    /// The lights that reach each sample of this frame.
    pub lit: &'a [u32],
    /// The lights that reached each sample of the last frame.
    pub reached: &'a [u32],
}

/// Samples that are new, evicted, of another visibility and of other lights, of all pixels row by row. `slots` are in the
/// order of [`pixel_index`]; where a fill has added some, evicted ones are listed as lost, and counted as evicted only. What the next frame is told to have been reached is `lit`.
pub fn changes(size: [u32; 2], slots: Slots<'_>, memory: Option<Memory<'_>>) -> Vec<[f32; 4]> {
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
    pixels.map(|pixel| one(pixel_index(pixel, size), slots, memory)).collect()
}

fn one(index: usize, slots: Slots<'_>, memory: Option<Memory<'_>>) -> [f32; 4] {
    let Some(m) = memory else { return [slots.of(index).count() as f32, 0.0, 0.0, 0.0] };
    let (unoccluded, kept) = (m.masks[index] >> 16, m.plan[index] & 0xffff);
    let evicted = (unoccluded & !kept).count_ones() as i32;
    let mut counts = [0, evicted, if slots.extras.is_empty() { 0 } else { -evicted }, 0];
    for slot in slots.of(index) {
        if let Some(channel) = channel_of(m, slot) {
            counts[channel] += 1;
        }
    }
    counts.map(|n| n as f32)
}

/// The channel in which a sample counts, if it changed.
fn channel_of(m: Memory<'_>, slot: usize) -> Option<usize> {
    if m.sources[slot] == NO_SOURCE {
        return Some(0);
    }
    let source = m.sources[slot] as usize;
    let [before, now] = [m.previous[source], m.samples[slot]];
    let hidden = |s: Sample| s.instance & OCCLUDED_BIT != 0;
    if !is_same_point(before, now) || hidden(before) != hidden(now) {
        return Some(2);
    }
    (!hidden(now) && m.lit[slot] != m.reached[source]).then_some(3)
}

/// Whether two samples are one point of one instance. Twin of `glsl/include/identity.glsl`, exact.
pub fn is_same_point(a: Sample, b: Sample) -> bool {
    let identity = |s: Sample| (s.position.map(f32::to_bits), s.instance & INSTANCE_MASK);
    identity(a) == identity(b)
}
