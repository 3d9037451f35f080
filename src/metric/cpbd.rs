//! CPBD, the cumulative probability of blur detection (Narvekar and Karam 2011, *A No-Reference Image Blur Metric Based on
//! the Cumulative Probability of Blur Detection*): the share of edges that do not look blurred. Range 0..=1; no unit;
//! higher is sharper. It needs no reference and knows none: **noise counts as sharpness**. Read it beside an error measure.
//!
//! The widths of vertical edges are measured on 8-bit luma, in blocks of 64x64 pixels that have edges, as the public
//! implementations do; details (filters, thresholds, thinning) are those of `cpbd-py312` 1.0.3.

use super::canny::canny;
use super::convolve::{Border, columns, rows};
use super::image::Frame;

const BLOCK: usize = 64;
/// Share of a block's pixels that must be edges for it to count.
const EDGE_SHARE: f64 = 0.002;
/// Exponent of the psychometric function.
const BETA: f64 = 3.6;
/// Up to this contrast, 0..=255, the wider of the two just noticeable widths holds.
const LOW_CONTRAST: f64 = 50.0;
/// Just noticeable widths of blur in pixels: at low contrast and above.
const JUST_NOTICEABLE: [f64; 2] = [5.0, 3.0];
/// Probability of detection in percent, rounded, from which on an edge counts as blurred.
const DETECTED: f64 = 64.0;
/// Steps that the walk along an edge takes at most.
const REACH: usize = 101;

/// Sharpness of the frame, or none where it has no whole block.
pub fn cpbd(frame: &Frame) -> Option<f64> {
    let [width, height] = frame.size();
    if width.min(height) < BLOCK {
        return None;
    }
    let luma = luma(frame);
    let (edges, widths) = rayon::join(|| canny(&luma, width), || widths(&luma, width));
    let (mut sharp, mut all) = (0_u64, 0_u64);
    for top in (0..=height - BLOCK).step_by(BLOCK) {
        for left in (0..=width - BLOCK).step_by(BLOCK) {
            let pixels = || (top..top + BLOCK).flat_map(move |y| (left..left + BLOCK).map(move |x| y * width + x));
            let edge_pixels = pixels().filter(|&i| edges[i]).count();
            if edge_pixels as f64 > EDGE_SHARE * (BLOCK * BLOCK) as f64 {
                let noticeable = noticeable_width(pixels().map(|i| luma[i]));
                let measured: Vec<usize> = pixels().map(|i| widths[i]).filter(|w| *w > 0).collect();
                all += measured.len() as u64;
                sharp += measured.iter().filter(|w| looks_sharp(**w as f64, noticeable)).count() as u64;
            }
        }
    }
    Some(if all == 0 { 0.0 } else { sharp as f64 / all as f64 })
}

/// 8-bit luma (ITU-R BT.601 weights, 16-bit fixed point) of 8-bit display values.
fn luma(frame: &Frame) -> Vec<f64> {
    let [r, g, b] = frame.display();
    let code = |v: f32| (v * 255.0).round_ties_even() as u32;
    let at = |i: usize| (code(r[i]) * 19595 + code(g[i]) * 38470 + code(b[i]) * 7471 + 0x8000) >> 16;
    (0..r.len()).map(|i| f64::from(at(i))).collect()
}

fn noticeable_width(block: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = block.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    JUST_NOTICEABLE[usize::from(high - low > LOW_CONTRAST)]
}

fn looks_sharp(width: f64, noticeable: f64) -> bool {
    let probability = 1.0 - (-(width / noticeable).powf(BETA)).exp();
    (100.0 * probability).round_ties_even() < DETECTED
}

/// Width in pixels of the edge at each pixel, 0 where there is none that is measured.
fn widths(luma: &[f64], width: usize) -> Vec<usize> {
    let height = luma.len() / width;
    let mut widths = vec![0; luma.len()];
    let directions: Vec<Option<Direction>> = (0..luma.len()).map(|i| direction(luma, width, i)).collect();
    if directions.iter().all(|d| *d == Some(Direction::Flat)) {
        return widths;
    }
    let edges = vertical_edges(luma, width);
    for y in 1..height - 1 {
        let row = &luma[y * width..][..width];
        for x in 1..width - 1 {
            let i = y * width + x;
            widths[i] = match directions[i].filter(|_| edges[i]) {
                // What gets brighter to the right falls to the left, and the other way round.
                Some(Direction::Flat | Direction::Right) => run(row, x, -1, false) + run(row, x, 1, true),
                Some(Direction::Left) => run(row, x, -1, true) + run(row, x, 1, false),
                None => 0,
            };
        }
    }
    widths
}

/// Where a gradient points that is horizontal, to within 22.5 degrees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Direction {
    /// Not at all: treated as to the right.
    Flat,
    Right,
    Left,
}

/// Of the central difference; one-sided at the border. A purely vertical gradient counts as none.
fn direction(luma: &[f64], width: usize, i: usize) -> Option<Direction> {
    let height = luma.len() / width;
    let slope = |position: usize, length: usize, step: usize| {
        let (back, ahead) = (usize::from(position > 0), usize::from(position + 1 < length));
        (luma[i + ahead * step] - luma[i - back * step]) / (ahead + back) as f64
    };
    let (dx, dy) = (slope(i % width, width, 1), slope(i / width, height, width));
    let angle = if dx == 0.0 { 0.0 } else { dy.atan2(dx).to_degrees() };
    match (angle / 45.0).round_ties_even() as i32 {
        0 if angle == 0.0 => Some(Direction::Flat),
        0 => Some(Direction::Right),
        4 | -4 => Some(Direction::Left),
        _ => None,
    }
}

/// Pixels from the neighbour of `x` outwards over which values go on rising, or falling, strictly; at least 1.
fn run(row: &[f64], x: usize, outwards: isize, rising: bool) -> usize {
    let value = |steps: usize| x.checked_add_signed(outwards * steps as isize).and_then(|at| row.get(at));
    let goes_on = |steps: &usize| match (value(*steps), value(steps + 1)) {
        (Some(inner), Some(outer)) => {
            if rising {
                outer > inner
            } else {
                outer < inner
            }
        }
        _ => false,
    };
    (1..REACH).take_while(goes_on).count() + 1
}

/// Sobel's vertical edges, thinned: strong pixels that exceed both neighbours in a row or in a column.
fn vertical_edges(luma: &[f64], width: usize) -> Vec<bool> {
    let across = rows(luma, width, &[1.0, 0.0, -1.0], Border::Clamp);
    let mut strength = columns(&across, width, &[0.125, 0.25, 0.125], Border::Clamp);
    strength.iter_mut().for_each(|s| *s *= *s);
    let threshold = 2.0 * (strength.iter().sum::<f64>() / strength.len() as f64).sqrt();
    strength.iter_mut().filter(|s| **s <= threshold).for_each(|s| *s = 0.0);
    let height = luma.len() / width;
    let peak = |i: usize, position: usize, length: usize, step: usize| {
        let before = if position > 0 { strength[i - step] } else { 0.0 };
        let after = if position + 1 < length { strength[i + step] } else { 0.0 };
        strength[i] > before && strength[i] > after
    };
    (0..luma.len()).map(|i| peak(i, i % width, width, 1) || peak(i, i / width, height, width)).collect()
}
