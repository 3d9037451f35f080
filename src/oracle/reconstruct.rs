//! Reconstruction (paper 1, section 4.4): a 3 x 3 pixel truncated Gaussian over the samples around each pixel. Twin of
//! `glsl/reconstruct.comp`, `glsl/include/filter.glsl` and `glsl/resolve.comp`, in f64 with a bound for the device.

use super::bounded::Bounded;
use super::camera;
use super::slots::Slots;
use crate::shaders::{FRAME_RESET, Frame, MOTION_UNKNOWN, Shaded};
use half::f16;

/// Blocks without a sample widen up to this radius in pixels; a pixel without any sample in it is black.
pub const WIDEST_RADIUS: i64 = 8;

/// The film in row order: weighted sums of red, green and blue, and the sum of weights. `film` is what the film held
/// before, for the accumulating variant.
pub fn reconstruct(frame: &Frame, slots: Slots<'_>, shaded: &[Shaded], film: Option<&[[f32; 4]]>) -> Vec<[Bounded; 4]> {
    let film = film.filter(|_| frame.flags & FRAME_RESET == 0);
    let mut out = Vec::new();
    for y in 0..i64::from(frame.size[1]) {
        for x in 0..i64::from(frame.size[0]) {
            let blocks = (1..=WIDEST_RADIUS).map(|radius| block(frame, slots, shaded, [x, y], radius));
            let mut sum = blocks.into_iter().find(|sum| sum[3].value > 0.0).unwrap_or_default();
            if let Some(before) = film {
                let before = before[out.len()].map(Bounded::exact);
                sum = [0, 1, 2, 3].map(|i| sum[i] + before[i]);
            }
            out.push(sum);
        }
    }
    out
}

/// For temporal integration, the longest known motion of each pixel in row order: of its own visible samples, else of those in
/// the first block that has any. Exact.
pub fn motions(frame: &Frame, slots: Slots<'_>, shaded: &[Shaded]) -> Vec<u32> {
    let pixels = (0..i64::from(frame.size[1])).flat_map(|y| (0..i64::from(frame.size[0])).map(move |x| [x, y]));
    let one = |pixel: [i64; 2]| {
        let reach = |radius| samples(frame, slots, shaded, pixel, radius).filter(|(s, _)| s.depth >= 0.0);
        let longest = |radius| reach(radius).map(|(s, _)| s.motion).fold(MOTION_UNKNOWN, longer_motion);
        let inside = longest(0);
        let around =
            || (1..=WIDEST_RADIUS).find(|radius| reach(*radius).next().is_some()).map_or(MOTION_UNKNOWN, longest);
        if inside == MOTION_UNKNOWN { around() } else { inside }
    };
    pixels.map(one).collect()
}

/// Sums over the pixels up to `radius` around one, clipped to the frame.
fn block(frame: &Frame, slots: Slots<'_>, shaded: &[Shaded], pixel: [i64; 2], radius: i64) -> [Bounded; 4] {
    samples(frame, slots, shaded, pixel, radius).fold([Bounded::default(); 4], |sum, (sample, away)| {
        let weighted = weighted_sample(sample, away, radius, frame.filter_width);
        [0, 1, 2, 3].map(|i| sum[i] + weighted[i])
    })
}

/// The samples of the pixels up to `radius` around one, and how far away those pixels are.
fn samples<'a>(
    frame: &Frame,
    slots: Slots<'a>,
    shaded: &'a [Shaded],
    [px, py]: [i64; 2],
    radius: i64,
) -> impl Iterator<Item = (&'a Shaded, [f32; 2])> {
    let [width, height] = frame.size.map(i64::from);
    let rows = (py - radius).max(0)..=(py + radius).min(height - 1);
    let columns = (px - radius).max(0)..=(px + radius).min(width - 1);
    let size = frame.size;
    rows.flat_map(move |y| columns.clone().map(move |x| [x, y])).flat_map(move |[x, y]| {
        let index = camera::pixel_index([x as u32, y as u32], size);
        let away = [(x - px) as f32, (y - py) as f32];
        slots.of(index).map(move |slot| (&shaded[slot], away))
    })
}

/// Position of a shaded sample in its pixel, in (0, 1).
pub fn shaded_offset(sample: &Shaded) -> [Bounded; 2] {
    let byte = |shift: u32| Bounded::exact((sample.color_b_offset >> shift & 255) as f32 + 0.5);
    [16, 24].map(|shift| byte(shift) / Bounded::exact(256.0))
}

/// Scene-linear red, green and blue of a shaded sample.
pub fn shaded_color(sample: &Shaded) -> [f32; 3] {
    [sample.color_rg, sample.color_rg >> 16, sample.color_b_offset].map(|bits| f16::from_bits(bits as u16).to_f32())
}

/// A motion in pixels, right and down, as a sample holds it.
pub fn motion_of(packed: u32) -> [f32; 2] {
    [packed, packed >> 16].map(|half| f16::from_bits(half as u16).to_f32())
}

/// The longer of two motions: the first of equals, and an unknown one only if both are. Exact.
pub fn longer_motion(first: u32, second: u32) -> u32 {
    if first == MOTION_UNKNOWN || second == MOTION_UNKNOWN {
        return if first == MOTION_UNKNOWN { second } else { first };
    }
    let length2 = |packed: u32| motion_of(packed).map(|m| m * m).iter().sum::<f32>();
    if length2(second) > length2(first) { second } else { first }
}

/// Colour times weight, and the weight, of a sample in the pixel `away` from the one that is reconstructed.
fn weighted_sample(sample: &Shaded, away: [f32; 2], radius: i64, deviation: f32) -> [Bounded; 4] {
    if sample.depth < 0.0 {
        return [Bounded::default(); 4];
    }
    let offset = shaded_offset(sample);
    let half = Bounded::exact(0.5);
    let [dx, dy] = [0, 1].map(|i| Bounded::exact(away[i]) + offset[i] - half);
    let width = Bounded::exact(deviation) * Bounded::exact(radius as f32);
    let two = Bounded::exact(2.0);
    let weight = (-(dx * dx + dy * dy) / (two * width * width)).exp();
    let [r, g, b] = shaded_color(sample).map(|c| Bounded::exact(c) * weight);
    [r, g, b, weight]
}

/// What `resolve` makes of a film's entry: scene-linear RGB, at most `largest`; black without weight.
pub fn resolve(sum: [f32; 4], largest: f32) -> [Bounded; 3] {
    let [r, g, b, weight] = sum.map(Bounded::exact);
    if weight.value <= 0.0 {
        return [Bounded::default(); 3];
    }
    [r, g, b].map(|c| {
        let mean = c / weight;
        Bounded { value: mean.value.min(f64::from(largest)), ..mean }
    })
}
