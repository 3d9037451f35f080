//! Temporal integration (Karis 2014, with the variance clamp of Patney et al. 2016) and the box filter of paper 3. Twin of
//! `glsl/temporal.comp`, `glsl/average.comp` and `glsl/include/temporal.glsl`: where a pixel is followed to in f32, exactly;
//! colours in f64 with a bound for the device.

use super::bounded::Bounded;
use super::reconstruct::{motion_of, resolve};
use crate::settings::{History, HistoryFilter};
use crate::shaders::{FRAME_RESET, Frame, MOTION_UNKNOWN};

/// Three channels, with bounds.
pub type Color = [Bounded; 3];

/// A clamp this wide is none.
pub const NO_CLAMP: f32 = 16.0;

/// What a frame begins with.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// Its constants.
    pub frame: &'a Frame,
    /// The knobs.
    pub history: &'a History,
    /// Weighted sums and weights, in row order.
    pub film: &'a [[f32; 4]],
    /// Packed motions in row order, or [`MOTION_UNKNOWN`].
    pub motion: &'a [u32],
    /// The last picture in YCoCg, in row order.
    pub previous: &'a [[f32; 3]],
}

/// The new picture in YCoCg in row order, before it is rounded to be stored.
pub fn integrate(inputs: &Inputs<'_>) -> Vec<Color> {
    let [width, height] = inputs.frame.size;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    pixels.map(|pixel| inputs.pixel(pixel)).collect()
}

/// What the frame shows of a picture: scene-linear RGB from 0 to `largest`.
pub fn displayed(picture: Color, largest: f32) -> Color {
    let [zero, most] = [0.0, largest].map(Bounded::exact);
    from_ycocg(picture).map(|c| c.max(zero).min(most))
}

/// The average of a film's entry with the frames before of one pixel in RGB, at most `largest`.
pub fn average(sum: [f32; 4], before: &[[f32; 3]], largest: f32) -> Color {
    let count = Bounded::exact((before.len() + 1) as f32);
    let now = resolve(sum, f32::MAX);
    [0, 1, 2].map(|i| {
        let total = before.iter().fold(now[i], |sum, frame| sum + Bounded::exact(frame[i]));
        (total / count).min(Bounded::exact(largest))
    })
}

/// Luma, orange minus blue, green minus magenta.
pub fn to_ycocg([r, g, b]: Color) -> Color {
    let [quarter, half] = [0.25, 0.5].map(Bounded::exact);
    let outer = quarter * (r + b);
    [outer + half * g, half * (r - b), half * g - outer]
}

/// The inverse.
pub fn from_ycocg([y, co, cg]: Color) -> Color {
    let outer = y - cg;
    [outer + co, y + cg, outer - co]
}

/// Where in the last frame the middle of a pixel was, if that is known and in the frame. Exact.
pub fn followed_back(frame: &Frame, [x, y]: [u32; 2], motion: u32) -> Option<[f32; 2]> {
    if frame.flags & FRAME_RESET != 0 || motion == MOTION_UNKNOWN {
        return None;
    }
    let moved = motion_of(motion);
    let from = [x as f32 + 0.5 - moved[0], y as f32 + 0.5 - moved[1]];
    (0..2).all(|i| (0.0..=frame.size[i] as f32).contains(&from[i])).then_some(from)
}

/// Weights of the four pixels around a point that lies `f` behind the middle of the second.
pub fn tap_weights(f: f32, filter: HistoryFilter) -> [Bounded; 4] {
    let [zero, one, half] = [0.0, 1.0, 0.5].map(Bounded::exact);
    let [three_halves, two, five_halves] = [1.5, 2.0, 2.5].map(Bounded::exact);
    let f = Bounded::exact(f);
    match filter {
        HistoryFilter::Bilinear => [zero, one - f, f, zero],
        HistoryFilter::CatmullRom => [
            f * (f * (one - half * f) - half),
            f * f * (three_halves * f - five_halves) + one,
            f * (f * (two - three_halves * f) + half),
            f * f * (half * f - half),
        ],
    }
}

impl Inputs<'_> {
    fn row_index(&self, [x, y]: [i64; 2]) -> usize {
        (y * i64::from(self.frame.size[0]) + x) as usize
    }

    /// A pixel's mean colour, if it has one.
    fn mean(&self, pixel: [i64; 2]) -> Option<Color> {
        let sum = self.film[self.row_index(pixel)];
        (sum[3] > 0.0).then(|| to_ycocg(resolve(sum, f32::MAX)))
    }

    fn pixel(&self, pixel: [u32; 2]) -> Color {
        let at = pixel.map(i64::from);
        let own = self.mean(at);
        let middle = own.unwrap_or_default();
        let around = self.around(at, middle);
        let count = Bounded::exact(around.len() as f32);
        let average = |part: fn(Bounded) -> Bounded, i: usize| -> Bounded {
            around.iter().fold(Bounded::default(), |sum, d| sum + part(d[i])) / count
        };
        let Some(now) = own else {
            return if around.is_empty() { middle } else { [0, 1, 2].map(|i| average(|d| d, i)) };
        };
        let motion = self.motion[self.row_index(at)];
        let Some(from) = followed_back(self.frame, pixel, motion) else { return now };
        let past = self.read(from);
        let [alpha, rest] = [self.history.alpha, 1.0 - self.history.alpha].map(Bounded::exact);
        [0, 1, 2].map(|i| {
            let mean = average(|d| d, i);
            let variance = (average(|d| d * d, i) - mean * mean).max(Bounded::default());
            let reach = Bounded::exact(self.history.clamp) * variance.sqrt();
            let clamped = past[i].max(middle[i] + mean - reach).min(middle[i] + mean + reach);
            let past = if self.history.clamp < NO_CLAMP { clamped } else { past[i] };
            rest * past + alpha * now[i]
        })
    }

    /// Differences of the known pixels around from the one in the middle, which may be one of them.
    fn around(&self, [px, py]: [i64; 2], middle: Color) -> Vec<Color> {
        let [width, height] = self.frame.size.map(i64::from);
        let rows = (py - 1).max(0)..=(py + 1).min(height - 1);
        let pixels = rows.flat_map(|y| ((px - 1).max(0)..=(px + 1).min(width - 1)).map(move |x| [x, y]));
        let difference = |pixel| self.mean(pixel).map(|c| [0, 1, 2].map(|i| c[i] - middle[i]));
        pixels.filter_map(difference).collect()
    }

    /// The last picture between its pixels, within the range of those that are read.
    fn read(&self, from: [f32; 2]) -> Color {
        let corner = from.map(|c| c - 0.5);
        let filter = self.history.filter;
        let [across, down] = corner.map(|c| tap_weights(c - c.floor(), filter));
        let taps = if filter == HistoryFilter::CatmullRom { 0..4 } else { 1..3 };
        let edge = self.frame.size.map(|n| i64::from(n) - 1);
        let mut read: [Vec<f32>; 3] = Default::default();
        let mut sum = Color::default();
        for j in taps.clone() {
            for i in taps.clone() {
                let tap = [(0, i), (1, j)].map(|(axis, k)| (corner[axis].floor() as i64 + k - 1).clamp(0, edge[axis]));
                let texel = self.previous[self.row_index(tap)];
                let weight = across[i as usize] * down[j as usize];
                sum = [0, 1, 2].map(|c| sum[c] + weight * Bounded::exact(texel[c]));
                (0..3).for_each(|c| read[c].push(texel[c]));
            }
        }
        [0, 1, 2].map(|c| {
            let low = read[c].iter().copied().fold(f32::INFINITY, f32::min);
            let high = read[c].iter().copied().fold(f32::NEG_INFINITY, f32::max);
            sum[c].max(Bounded::exact(low)).min(Bounded::exact(high))
        })
    }
}
