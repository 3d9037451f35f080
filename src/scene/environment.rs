//! Light from all around, as an equirectangular map, and the table by which the device looks at it and draws directions from
//! it: by how bright it is times the solid angle of a texel, so that a small sun is found as often as it matters.

use crate::shaders::{
    ENVIRONMENT_BLURRED_HEIGHT, ENVIRONMENT_BLURRED_WIDTH, ENVIRONMENT_HEADER, ENVIRONMENT_ONE, ENVIRONMENT_ROW,
};
use glam::{DVec3, Vec3};
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
        let mut table = vec![map.width, map.height, turn.to_bits(), 0, 0, 0];
        table.extend(rows(map, &texels));
        texels.chunks(map.width as usize).for_each(|row| table.extend(chances(row.iter().map(|t| luminance(*t)))));
        table.extend(texels.iter().flatten().map(|x| x.to_bits()));
        table[3] = table.len() as u32;
        table.extend(blurred(map, &texels).into_iter().flat_map(|texel| texel.to_array()).map(f32::to_bits));
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

/// How narrow the blur is: the concentration of von Mises' and Fisher's distribution, whose density falls to 1/e within 11.5 degrees.
const CONCENTRATION: f64 = 50.0;
/// Cells across and down that the map is reduced to before it is blurred: smaller than the blur.
const CELLS: [u32; 2] = [2 * ENVIRONMENT_BLURRED_WIDTH, 2 * ENVIRONMENT_BLURRED_HEIGHT];

/// Radiance from a cell of the sphere.
#[derive(Clone, Copy)]
struct Cell {
    middle: DVec3,
    light: DVec3, // radiance times solid angle
    angle: f64,   // steradians
}

/// The map small and blurred, row by row: means over the sphere, weighted by how near a direction is.
fn blurred(map: &EnvironmentMap, texels: &[[f32; 3]]) -> Vec<Vec3> {
    let cells = reduced(map, texels);
    let size = [ENVIRONMENT_BLURRED_WIDTH, ENVIRONMENT_BLURRED_HEIGHT];
    let mean = |to: DVec3| {
        let near = |cell: &Cell| (CONCENTRATION * (to.dot(cell.middle) - 1.0)).exp();
        let add = |(light, weight): (DVec3, f64), cell: &Cell| {
            (light + cell.light * near(cell), weight + cell.angle * near(cell))
        };
        let (light, weight) = cells.iter().fold((DVec3::ZERO, 0.0), add);
        (light / weight).as_vec3()
    };
    middles(size).map(mean).collect()
}

/// The map in [`CELLS`].
fn reduced(map: &EnvironmentMap, texels: &[[f32; 3]]) -> Vec<Cell> {
    let [width, height] = CELLS;
    let dark = |middle| Cell { middle, light: DVec3::ZERO, angle: 0.0 };
    let mut cells: Vec<Cell> = middles(CELLS).map(dark).collect();
    // Large texels count in parts, each in the cell that its middle is in.
    let [across, down] = [width.div_ceil(map.width), height.div_ceil(map.height)];
    let fine = EnvironmentMap { width: map.width * across, height: map.height * down, ..EnvironmentMap::default() };
    let cell_of = |at: u32, fine: u32, cells: u32| u64::from(cells) * (2 * u64::from(at) + 1) / (2 * u64::from(fine));
    for y in 0..fine.height {
        let angle = fine.solid_angle(y);
        let row = cell_of(y, fine.height, height) * u64::from(width);
        for x in 0..fine.width {
            let texel = texels[((y / down) * map.width + x / across) as usize].map(f64::from);
            let cell = &mut cells[(row + cell_of(x, fine.width, width)) as usize];
            cell.light += DVec3::from(texel) * angle;
            cell.angle += angle;
        }
    }
    cells
}

/// Directions of the middles of all texels of a map of a size, row by row.
fn middles([width, height]: [u32; 2]) -> impl Iterator<Item = DVec3> {
    let places = (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]));
    places.map(move |at| towards(at.map(|x| f64::from(x) + 0.5), [width, height]))
}

/// The unit vector to a place in texels of an unturned map of a size.
fn towards([x, y]: [f64; 2], [width, height]: [u32; 2]) -> DVec3 {
    let (longitude, latitude) = (TAU * (x / f64::from(width) - 0.5), PI * y / f64::from(height));
    DVec3::new(latitude.sin() * longitude.sin(), latitude.cos(), -latitude.sin() * longitude.cos())
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

    /// A sun of one texel: no more and no less than the distribution's density says, wherever in its cell and its texel it is.
    #[test]
    fn a_sun_is_blurred_as_the_distribution_says() {
        let [width, height] = [256, 128];
        let mut texels = vec![[0.0; 3]; (width * height) as usize];
        let (column, row) = (70, 50);
        texels[(row * width + column) as usize] = [1.0; 3];
        let map = EnvironmentMap { width, height, ..EnvironmentMap::default() };
        let sun = towards([f64::from(column) + 0.5, f64::from(row) + 0.5], [width, height]);
        let light = map.solid_angle(row);
        let density = |angle: f64| (CONCENTRATION * (angle.cos() - 1.0)).exp() * CONCENTRATION / TAU;
        // A cell's middle is within half a diagonal of the sun. The sum over cells of h = 0.098 rad replaces the integral of a
        // bell of variance 1/50: what is lost of it is exp(-2 (pi / h)^2 / 50) by Poisson's sum, nothing; but cells of the
        // equator's width are h^2 / 24 of themselves off in solid angle, in both directions: a thousandth.
        let off = 0.5 * PI / f64::from(CELLS[1]) * 2f64.sqrt();
        let size = [ENVIRONMENT_BLURRED_WIDTH, ENVIRONMENT_BLURRED_HEIGHT];
        let mut seen = 0;
        for (texel, to) in blurred(&map, &texels).into_iter().zip(middles(size)) {
            let angle = to.angle_between(sun);
            let [least, most] = [density((angle + off).min(PI)), density((angle - off).max(0.0))];
            let found = f64::from(texel.x) / light;
            let tiny = f64::from(f32::MIN_POSITIVE) / light;
            assert!(found >= 0.999 * least - tiny && found <= 1.001 * most, "{angle}: {least} {found} {most}");
            seen += u32::from(angle < 0.2);
        }
        assert!(seen > 2, "some are near");
    }

    #[test]
    fn what_is_alike_all_around_is_not_changed_by_the_blur() {
        for [width, height] in [[1, 1], [3, 2], [100, 37]] {
            let value = Vec3::new(0.75, 0.0, 1e20);
            let texels = vec![value.to_array(); (width * height) as usize];
            let map = EnvironmentMap { width, height, ..EnvironmentMap::default() };
            for texel in blurred(&map, &texels) {
                assert!((texel - value).abs().cmple(value * 1e-6).all(), "{texel}");
            }
        }
    }

    #[test]
    fn what_is_no_light_is_black_and_what_is_too_bright_is_cut() {
        let texels = vec![[f32::NAN, -1.0, f32::INFINITY], [f32::NEG_INFINITY, 0.0, 2.0]];
        let map = EnvironmentMap { width: 2, height: 1, texels, scale: 0.5, ..EnvironmentMap::default() };
        let table = EnvironmentMap::table(Some(&map));
        let end = table[3] as usize;
        let floats: Vec<f32> = table[end - 6..end].iter().map(|bits| f32::from_bits(*bits)).collect();
        assert_eq!(floats, [0.0, 0.0, BRIGHTEST, 0.0, 0.0, 1.0]);
        // What is not whole is not read past its end.
        assert_eq!(EnvironmentMap::table(Some(&EnvironmentMap { width: 3, ..map })), [0; ENVIRONMENT_HEADER as usize]);
        assert_eq!(EnvironmentMap::table(None), [0; ENVIRONMENT_HEADER as usize]);
    }
}
