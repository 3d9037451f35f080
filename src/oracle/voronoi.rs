//! Reconstruction with weights from Voronoi areas. Twin of `glsl/voronoi.comp` and `glsl/include/cells.glsl`: which sample
//! is nearest is exact, sums are in f64 with a bound for the device.

use super::bounded::Bounded;
use super::camera::{self, M};
use super::reconstruct::{WIDEST_RADIUS, shaded_color};
use super::slots::Slots;
use crate::shaders::{Frame, Shaded};

/// The film in row order: weighted sums of red, green and blue, and the sum of weights.
pub fn voronoi(frame: &Frame, slots: Slots<'_>, shaded: &[Shaded]) -> Vec<[Bounded; 4]> {
    let [width, height] = frame.size.map(i64::from);
    let cells: Vec<Option<[usize; 16]>> =
        (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).map(|p| nearest(frame, slots, shaded, p)).collect();
    let mut film = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let mut sum = [Bounded::default(); 4];
            for (dy, dx) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))) {
                if !(0..width).contains(&(x + dx)) || !(0..height).contains(&(y + dy)) {
                    continue;
                }
                if let Some(cells) = &cells[((y + dy) * width + x + dx) as usize] {
                    let part = part(frame, cells.map(|slot| shaded_color(&shaded[slot])), [dx, dy]);
                    sum = [0, 1, 2, 3].map(|i| sum[i] + part[i]);
                }
            }
            film.push(sum);
        }
    }
    film
}

/// The slot of the visible sample nearest to the middle of each subpixel of a pixel, of those in the smallest block around
/// the pixel that holds any; the first in the block's order of equally near ones. Lengths are in 1/512 of a pixel.
pub fn nearest(frame: &Frame, slots: Slots<'_>, shaded: &[Shaded], [px, py]: [i64; 2]) -> Option<[usize; 16]> {
    let [width, height] = frame.size.map(i64::from);
    let candidates = |radius: i64| -> Vec<(usize, [i64; 2])> {
        let mut all = Vec::new();
        for y in (py - radius).max(0)..=(py + radius).min(height - 1) {
            for x in (px - radius).max(0)..=(px + radius).min(width - 1) {
                let index = camera::pixel_index([x as u32, y as u32], frame.size);
                for slot in slots.of(index).filter(|slot| shaded[*slot].depth >= 0.0) {
                    let byte = |shift: u32| i64::from(shaded[slot].color_b_offset >> shift & 255);
                    all.push((slot, [(x - px) * 512 + 2 * byte(16) + 1, (y - py) * 512 + 2 * byte(24) + 1]));
                }
            }
        }
        all
    };
    let candidates = (1..=WIDEST_RADIUS).map(candidates).find(|all| !all.is_empty())?;
    Some(std::array::from_fn(|i| {
        let middle = [i as u32 % M, i as u32 / M].map(|c| i64::from(c) * 128 + 64);
        let distance = |at: [i64; 2]| (at[0] - middle[0]).pow(2) + (at[1] - middle[1]).pow(2);
        // `min_by_key` takes the first of equals.
        candidates.iter().min_by_key(|(_, at)| distance(*at)).map_or(0, |(slot, _)| *slot)
    }))
}

/// What the subpixels of a pixel contribute to the one that it lies `away` from.
fn part(frame: &Frame, colors: [[f32; 3]; 16], away: [i64; 2]) -> [Bounded; 4] {
    let [across, down] = away.map(|away| [0, 1, 2, 3].map(|i| axis_weight(frame.filter_width, i, away)));
    let mut sum = [Bounded::default(); 4];
    for (i, color) in colors.into_iter().enumerate() {
        let weight = across[i % 4] * down[i / 4];
        let [r, g, b] = color.map(|c| Bounded::exact(c) * weight);
        sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + weight];
    }
    sum
}

/// The filter along one axis at the middle of subpixel i of the pixel `away`.
fn axis_weight(deviation: f32, i: usize, away: i64) -> Bounded {
    let d = Bounded::exact((i as f32 - 1.5) * 0.25 + away as f32);
    let deviation = Bounded::exact(deviation);
    (-(d * d) / (Bounded::exact(2.0) * deviation * deviation)).exp()
}
