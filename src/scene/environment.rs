//! Light from all around, as an equirectangular map, and the table by which the device looks at it and draws directions from
//! it: by how bright it is times the solid angle of a texel, so that a small sun is found as often as it matters.

use crate::shaders::{ENVIRONMENT_HEADER, ENVIRONMENT_ONE, ENVIRONMENT_ROW};
use std::f64::consts::{PI, TAU};

/// Radiance from all directions: what a ray that hits nothing sees, and light that casts shadows. It adds to the uniform
/// [`super::Environment`].
///
/// Texel columns are longitudes and rows are latitudes: the upper edge is +Y, the lower one -Y, the middle -Z, which is where
/// an unturned camera looks, and what is to the right of it there is to the right in the map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EnvironmentMap {
    /// File or made-up name.
    pub name: String,
    /// Texels around, 1 to [`MOST_TEXELS_A_SIDE`]; usually twice the height.
    pub width: u32,
    /// Texels from top to bottom, 1 to [`MOST_TEXELS_A_SIDE`].
    pub height: u32,
    /// `width * height` scene-linear RGB radiances, row by row from the top; finite and not negative.
    pub texels: Vec<[f32; 3]>,
    /// What all texels are multiplied by, finite and not negative.
    pub scale: f32,
    /// Radians that the map is turned by about +Y: counterclockwise as seen from above.
    pub turn: f64,
}

/// The most texels across or down.
pub const MOST_TEXELS_A_SIDE: u32 = 1 << 15;
/// What is brighter is cut off here, so that what is drawn rarely stays finite: far above what a half holds.
const BRIGHTEST: f32 = (1u64 << 60) as f32;

/// Relative luminance of Rec. 709.
fn luminance(texel: [f32; 3]) -> f64 {
    let [r, g, b] = texel.map(f64::from);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

impl EnvironmentMap {
    /// Whether there are as many texels as its sides say.
    pub fn is_whole(&self) -> bool {
        let side = 1..=MOST_TEXELS_A_SIDE;
        let texels = u64::from(self.width) * u64::from(self.height);
        side.contains(&self.width) && side.contains(&self.height) && texels == self.texels.len() as u64
    }

    /// Whether any light comes from it.
    pub fn shines(&self) -> bool {
        self.scale > 0.0 && self.texels.iter().any(|texel| luminance(*texel) > 0.0)
    }

    /// The table of a map that [is whole](Self::is_whole), or of no map; laid out as `glsl/include/types.glsl` tells.
    pub fn table(map: Option<&Self>) -> Vec<u32> {
        let Some(map) = map.filter(|map| map.is_whole()) else { return vec![0; ENVIRONMENT_HEADER as usize] };
        let texels: Vec<[f32; 3]> = map.texels.iter().map(|texel| map.shown(*texel)).collect();
        let turn = (map.turn / TAU).rem_euclid(1.0) as f32;
        let mut table = vec![map.width, map.height, turn.to_bits(), 0];
        table.extend(rows(map, &texels));
        texels.chunks(map.width as usize).for_each(|row| table.extend(chances(row.iter().map(|t| luminance(*t)))));
        table.extend(texels.iter().flatten().map(|x| x.to_bits()));
        table
    }

    fn shown(&self, texel: [f32; 3]) -> [f32; 3] {
        // A product that is not a number compares with nothing, and is black.
        texel.map(|x| Some(x * self.scale).filter(|x| *x > 0.0).unwrap_or(0.0).min(BRIGHTEST))
    }

    /// Solid angle in steradians of each texel of a row.
    pub fn solid_angle(&self, row: u32) -> f64 {
        let edge = |row: u32| PI * f64::from(row) / f64::from(self.height);
        let (upper, lower) = (edge(row), edge(row + 1));
        // cos upper - cos lower, without the cancellation near the poles.
        let height = 2.0 * ((upper + lower) / 2.0).sin() * ((lower - upper) / 2.0).sin();
        height * TAU / f64::from(self.width)
    }
}

/// The words of all rows, and of the end.
fn rows(map: &EnvironmentMap, texels: &[[f32; 3]]) -> Vec<u32> {
    let row_weight = |(row, texels): (usize, &[[f32; 3]])| {
        texels.iter().map(|texel| luminance(*texel)).sum::<f64>() * map.solid_angle(row as u32)
    };
    let mut weights: Vec<f64> = texels.chunks(map.width as usize).enumerate().map(row_weight).collect();
    if weights.iter().sum::<f64>() <= 0.0 {
        // A black map sends its rays everywhere, for nothing.
        weights = (0..map.height).map(|row| map.solid_angle(row)).collect();
    }
    let word = |(row, chance): (usize, u32)| {
        let half = PI * row as f64 / f64::from(map.height) / 2.0;
        let solid_angle = if row < map.height as usize { map.solid_angle(row as u32) } else { 0.0 };
        let [sin2, cos2] = [half.sin(), half.cos()].map(|x| ((x * x) as f32).to_bits());
        [sin2, cos2, (solid_angle as f32).to_bits(), chance]
    };
    const _: () = assert!(ENVIRONMENT_ROW == 4);
    chances(weights.into_iter()).into_iter().enumerate().flat_map(word).collect()
}

/// The chances before each of some weights and behind the last, [`ENVIRONMENT_ONE`] to one: without any weight, all alike. What
/// weighs less than half of 2^-31 of all may never be drawn.
fn chances(weights: impl ExactSizeIterator<Item = f64> + Clone) -> Vec<u32> {
    let total: f64 = weights.clone().sum();
    let count = weights.len() as f64;
    let part = |sum: f64, before: usize| if total > 0.0 { sum / total } else { before as f64 / count };
    let mut sum = 0.0;
    let mut all = vec![0];
    for (i, weight) in weights.enumerate() {
        sum += weight;
        all.push((part(sum, i + 1).min(1.0) * f64::from(ENVIRONMENT_ONE)).round() as u32);
    }
    // The sum of the whole is the total but for rounding in another order; the last is exactly one.
    all.last_mut().into_iter().for_each(|last| *last = ENVIRONMENT_ONE);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chances_add_up_and_never_fall() {
        for weights in [vec![1.0], vec![0.0, 3.0, 0.0, 1.0, 0.0], vec![0.0; 4], vec![1e-300, 1e300, 1e-300]] {
            let all = chances(weights.iter().copied());
            assert_eq!((all[0], all[weights.len()]), (0, ENVIRONMENT_ONE));
            assert!(all.is_sorted(), "{all:?}");
        }
        assert_eq!(chances([0.0, 3.0, 0.0, 1.0, 0.0].into_iter()), [0, 0, 3 << 29, 3 << 29, 1 << 31, 1 << 31]);
        assert_eq!(chances([0.0; 4].into_iter()), [0, 1 << 29, 1 << 30, 3 << 29, 1 << 31]);
    }

    #[test]
    fn texels_cover_the_sphere() {
        let map = EnvironmentMap { width: 7, height: 5, ..EnvironmentMap::default() };
        let whole: f64 = (0..5).map(|row| 7.0 * map.solid_angle(row)).sum();
        assert!((whole - 4.0 * PI).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_light_is_black_and_what_is_too_bright_is_cut() {
        let texels = vec![[f32::NAN, -1.0, f32::INFINITY], [f32::NEG_INFINITY, 0.0, 2.0]];
        let map = EnvironmentMap { width: 2, height: 1, texels, scale: 0.5, ..EnvironmentMap::default() };
        let table = EnvironmentMap::table(Some(&map));
        let floats: Vec<f32> = table[table.len() - 6..].iter().map(|bits| f32::from_bits(*bits)).collect();
        assert_eq!(floats, [0.0, 0.0, BRIGHTEST, 0.0, 0.0, 1.0]);
        // What is not whole is not read past its end.
        assert_eq!(EnvironmentMap::table(Some(&EnvironmentMap { width: 3, ..map })), [0; 4]);
        assert_eq!(EnvironmentMap::table(None), [0; 4]);
    }
}
