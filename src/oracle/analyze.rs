//! Density analysis on bitmasks (paper 1, section 4.2). Twin of `glsl/analyze.comp` and
//! `glsl/include/analysis.glsl`, exact.
//!
//! A mask word holds the occupancy of a pixel's 16 subpixels in its low half and, of those, the unoccluded ones in its
//! high half.

use super::camera::{self, M, TILE};
use super::random::{hash_combine, hash_uint, pixel_hash, unit_float};
use crate::shaders::{Counters, FRAME_PAPER_EDGES, FRAME_QUARTERS, FRAME_SETTLED, Frame};

/// Outcome of the phase.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// A word a pixel: kept subpixels in the low half, new ones in the high half.
    pub plan: Vec<u32>,
    /// Samples, kept and new, of each tile.
    pub tiles: Vec<u32>,
    /// `reused`, `added`, `evicted` and `histogram`; the rest is 0.
    pub counters: Counters,
}

/// The plan to keep everything, with the samples of each tile; counts nothing.
pub fn keep(frame: &Frame, masks: &[u32]) -> Analysis {
    let plan: Vec<u32> = masks.iter().map(|word| word & 0xffff).collect();
    let tiles = tally(frame, &plan, u32::count_ones);
    Analysis { plan, tiles, counters: Counters::default() }
}

/// As [`analyze`], with the samples that each tile adds.
pub fn fill(frame: &Frame, masks: &[u32]) -> Analysis {
    let analysis = analyze(frame, masks);
    let tiles = tally(frame, &analysis.plan, |word| (word >> 16).count_ones());
    Analysis { tiles, ..analysis }
}

/// Sums over the pixels of each tile.
fn tally(frame: &Frame, plan: &[u32], count: impl Fn(u32) -> u32) -> Vec<u32> {
    let [across, down] = camera::tiles(frame.size);
    let mut tiles = vec![0; (across * down) as usize];
    for (pixel, word) in camera::pixels_in_order(frame.size).zip(plan) {
        tiles[(pixel[1] / TILE * across + pixel[0] / TILE) as usize] += count(*word);
    }
    tiles
}

/// Plans every pixel.
pub fn analyze(frame: &Frame, masks: &[u32]) -> Analysis {
    let size = frame.size;
    let mut counters = Counters::default();
    let mut plan = Vec::with_capacity(masks.len());
    for (pixel, &word) in camera::pixels_in_order(size).zip(masks) {
        let decided = if frame.flags & FRAME_SETTLED != 0 {
            word & 0xffff
        } else {
            let h = pixel_hash(pixel, frame.frame, frame.seed);
            let (word, demand) = word_and_demand(frame, pixel, word, masks, h);
            plan_pixel(word, demand, frame.occluded_limit, camera::subpixel_bits(frame.flags), h)
        };
        let [visible, kept, added] = [word >> 16, decided & 0xffff, decided >> 16];
        counters.reused += kept.count_ones();
        counters.added += added.count_ones();
        counters.evicted += (visible & !kept).count_ones();
        counters.histogram[visible.count_ones() as usize] += 1;
        plan.push(decided);
    }
    let tiles = tally(frame, &plan, u32::count_ones);
    Analysis { plan, tiles, counters }
}

/// What a pixel goes on with, and how many samples it adds to that or evicts from it. The window decides (Equation 1),
/// but from one sample a pixel on, beside samples that were found occluded, the pixel itself does, without tolerance, once its strata are balanced:
/// `glsl/include/analysis.glsl` says why.
fn word_and_demand(frame: &Frame, pixel: [u32; 2], word: u32, masks: &[u32], h: u32) -> (u32, i32) {
    let visible = |word: u32| word >> 16;
    let hidden = |word: u32| word & 0xffff & !visible(word);
    let paper = frame.d_target < 1.0 || frame.flags & FRAME_PAPER_EDGES != 0;
    if paper || window(pixel, frame.size, masks, hidden).0 == 0 {
        let (count, quarters) = window(pixel, frame.size, masks, visible);
        return (word, sample_demand(count, quarters, frame.d_target, frame.d_tolerance, pixel));
    }
    let word = balanced(word, hash_uint(!h));
    (word, sample_demand(visible(word).count_ones(), 4, frame.d_target, 0.0, pixel))
}

/// Samples in the 2 x 2 pixels centred on a pixel, of those that `of` takes from a mask word, and the window's area in
/// quarter pixels, both clipped to the frame. Paper 1, Figure 4, left: the window spans 8 x 8 subpixels and starts two
/// above and left of the pixel.
pub fn window(pixel: [u32; 2], size: [u32; 2], masks: &[u32], of: impl Fn(u32) -> u32) -> (u32, u32) {
    let mut count = 0;
    let mut subpixels = 0;
    let reach = |axis: usize| {
        let start = i64::from(pixel[axis] * M) - 2;
        (start..start + 8).filter(move |&at| 0 <= at && at < i64::from(size[axis] * M)).map(|at| at as u32)
    };
    for y in reach(1) {
        for x in reach(0) {
            let word = masks[camera::pixel_index([x / M, y / M], size)];
            count += of(word) >> (y % M * M + x % M) & 1;
            subpixels += 1;
        }
    }
    (count, subpixels / 4)
}

/// 4 x 4 ordered dither (Bayer 1973).
pub const BAYER: [[u32; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// Equation 1: samples to add (positive) or to evict (negative), for `count` samples on an area of `quarters` quarter
/// pixels. The paper rounds the fraction up; here it is dithered over pixels. And where the tolerance is wider than the
/// target, so that the paper would be content with nothing, an empty window still asks for the target.
pub fn sample_demand(count: u32, quarters: u32, d_target: f32, d_tolerance: f32, pixel: [u32; 2]) -> i32 {
    let area = quarters as f32;
    let lack = d_target * area - (4 * count) as f32;
    let allowed = if lack > 0.0 { d_tolerance.min(d_target) } else { d_tolerance };
    let outside = lack.abs() >= allowed * area;
    if !outside {
        return 0;
    }
    let threshold = (BAYER[(pixel[1] % 4) as usize][(pixel[0] % 4) as usize] as f32 + 0.5) / 16.0;
    // The quotient of a float and a whole number up to 16 is whole, or further from whole than f64 rounds.
    let rounded = (f64::from(lack.abs() + threshold * area) / f64::from(quarters)).floor();
    let n = rounded.min(16.0) as i32;
    if lack < 0.0 { -n } else { n }
}

/// The subpixels of stratum s in 0..4, a quarter of the pixel: (s % 2, s / 2) across and down.
pub fn stratum_mask(s: u32) -> u32 {
    let inside = |bit: &u32| bit % M / 2 == s % 2 && bit / M / 2 == s / 2;
    (0..M * M).filter(inside).map(|bit| 1 << bit).sum()
}

fn in_stratum(mask: u32, s: u32) -> u32 {
    (mask & stratum_mask(s)).count_ones()
}

/// The strata in the order in which ties between them are decided.
fn turned(h: u32) -> impl DoubleEndedIterator<Item = u32> {
    (0..4).map(move |i| (i + h % 4) % 4)
}

fn fullest(mask: u32, h: u32) -> u32 {
    // `max_by_key` takes the last of equals: reversed, the first.
    turned(h).rev().max_by_key(|&s| in_stratum(mask, s)).unwrap_or(0)
}

fn emptiest(mask: u32, h: u32) -> u32 {
    turned(h).min_by_key(|&s| in_stratum(mask, s)).unwrap_or(0)
}

/// The mask word without the visible samples by which a stratum has two or more than another.
pub fn balanced(mut word: u32, mut h: u32) -> u32 {
    loop {
        let visible = word >> 16;
        h = hash_uint(h);
        let [most, least] = [fullest(visible, h), emptiest(visible, h)];
        if in_stratum(visible, most) < in_stratum(visible, least) + 2 {
            return word;
        }
        word &= !(choose_bit(visible & stratum_mask(most), h >> 2) * 0x1_0001);
    }
}

/// What becomes of a pixel: kept subpixels in the low half, new ones in the high half. Evicts from the fullest stratum
/// and adds to the emptiest; ties are broken by the hash. `there` are the bits that stand for subpixels.
pub fn plan_pixel(word: u32, demand: i32, occluded_limit: u32, there: u32, mut h: u32) -> u32 {
    let mut visible = word >> 16;
    let mut occluded = word & 0xffff & !visible;
    let mut added = 0;
    for _ in demand..0 {
        if visible == 0 {
            break;
        }
        h = hash_uint(h);
        visible &= !choose_bit(visible & stratum_mask(fullest(visible, h)), h >> 2);
    }
    for _ in 0..demand {
        h = hash_uint(h);
        let taken = visible | added;
        let free = stratum_mask(emptiest(taken, h)) & there & !taken;
        if free == 0 {
            break;
        }
        let vacant = free & !occluded;
        let chosen = choose_bit(if vacant != 0 { vacant } else { free }, h >> 2);
        added |= chosen;
        occluded &= !chosen;
    }
    while occluded.count_ones() > occluded_limit {
        h = hash_uint(h);
        occluded &= !choose_bit(occluded, h >> 2);
    }
    visible | occluded | added << 16
}

/// One set bit of a mask that is not empty, chosen by a hash.
fn choose_bit(mask: u32, h: u32) -> u32 {
    let set: Vec<u32> = (0..32).map(|i| 1 << i).filter(|bit| mask & bit != 0).collect();
    set[h as usize % set.len()]
}

/// Where a new sample lies, in pixels: anywhere in its subpixel but for a margin of an eighth of the subpixel.
pub fn new_position(pixel: [u32; 2], subpixel: u32, h: u32, flags: u32) -> [f32; 2] {
    let hx = hash_combine(h, subpixel);
    let random = [unit_float(hx), unit_float(hash_uint(hx))];
    let corner = [subpixel % M, subpixel / M];
    let extent = if flags & FRAME_QUARTERS != 0 { 2.0 } else { 1.0 };
    [0, 1].map(|i| pixel[i] as f32 + (corner[i] as f32 + (0.125 + 0.75 * random[i]) * extent) * 0.25)
}
