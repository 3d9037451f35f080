//! The prefix sum over tiles, and what fits the cache. Twin of `glsl/scan.comp` and `glsl/include/thin.glsl`, exact.

use crate::shaders::{Counters, Frame};

/// First sample of each tile before thinning, and the counters `samples`, `thin` and `trace_*` (the rest is 0).
pub fn scan(frame: &Frame, tiles: &[u32]) -> (Vec<u32>, Counters) {
    listed_behind(0, frame.capacity, tiles)
}

/// As [`scan`], for samples that are added behind `listed` ones; sets the counters `first` and `fill_*` too.
pub fn scan_fill(frame: &Frame, listed: u32, tiles: &[u32]) -> (Vec<u32>, Counters) {
    let (first, counters) = listed_behind(listed, frame.capacity, tiles);
    let groups = (counters.samples - listed).div_ceil(64);
    let fill = Counters { fill_x: groups.min(32768), fill_y: groups.div_ceil(32768), fill_z: 1, ..counters };
    (first, fill)
}

fn listed_behind(listed: u32, capacity: u32, tiles: &[u32]) -> (Vec<u32>, Counters) {
    let mut total = 0;
    let mut first = Vec::with_capacity(tiles.len());
    for count in tiles {
        first.push(total);
        total += count;
    }
    let thin = part_that_fits(capacity - listed, total);
    let samples = listed + thinned(total, thin);
    let groups = samples.div_ceil(64);
    let counters = Counters {
        first: listed,
        samples,
        thin,
        trace_x: groups.min(32768),
        trace_y: groups.div_ceil(32768),
        trace_z: 1,
        ..Counters::default()
    };
    (first, counters)
}

/// 2³² times the part of `total` samples that a cache of `capacity` holds, 0 if all fit. At least 1 if they do not.
pub fn part_that_fits(capacity: u32, total: u32) -> u32 {
    if total <= capacity {
        return 0;
    }
    (((u64::from(capacity)) << 32) / u64::from(total)).max(1) as u32
}

/// An offset in the list of all samples that are asked for becomes one in the list that fits.
pub fn thinned(offset: u32, thin: u32) -> u32 {
    if thin == 0 {
        return offset;
    }
    ((u64::from(offset) * u64::from(thin)) >> 32) as u32
}
