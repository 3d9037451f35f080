//! The map of light from all around. Twin of `glsl/include/environment.glsl`: searches are exact, directions are computed in
//! f32 and in the shader's order, colours in f64 with a bound.

use super::lens::turn_vector;
use super::stage::U;
use crate::shaders::{
    ENVIRONMENT_BLURRED_HEIGHT, ENVIRONMENT_BLURRED_WIDTH, ENVIRONMENT_HEADER, ENVIRONMENT_ONE, ENVIRONMENT_ROW,
};
use glam::{DVec2, DVec3, Vec3};

/// A table as [`crate::scene::EnvironmentMap::table`] makes it, and one draw from it.
#[derive(Debug, Clone, Copy)]
pub struct Afar<'a> {
    /// The table.
    pub table: &'a [u32],
    /// Coordinates of the draw, 2^32 to one.
    pub at: [u32; 2],
}

/// A direction that was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Column and row of its texel.
    pub texel: [u32; 2],
    /// Unit vector, within [`DIRECTION`].
    pub direction: Vec3,
    /// Density of directions there, per steradian.
    pub density: f64,
    /// Radiance over density.
    pub irradiance: DVec3,
}

/// A map in the table: how many texels across and down, and where they begin.
#[derive(Debug, Clone, Copy)]
struct Grid {
    size: [u32; 2],
    texels: u32,
}

/// Radians that a direction on a device may be off by. Its longitude is a sum below 2 times a turn: 2.5 ulp of a division, two
/// sums, the polynomials of a turn, 6 U of 2 pi; the rest is some ten roundings.
pub const DIRECTION: f64 = 64.0 * U;
/// Relative error of an irradiance that was drawn: four divisions of 2.5 ulp and conversions.
pub const IRRADIANCE: f64 = 24.0 * U;

impl Afar<'_> {
    fn size(&self) -> [u32; 2] {
        [self.table[0], self.table[1]]
    }

    /// Whether there is a map.
    pub fn is_there(&self) -> bool {
        self.table[0] != 0
    }

    fn float(&self, at: u32) -> f32 {
        f32::from_bits(self.table[at as usize])
    }

    fn row(row: u32) -> u32 {
        ENVIRONMENT_HEADER + ENVIRONMENT_ROW * row
    }

    /// The map itself.
    fn sharp(&self) -> Grid {
        let [width, height] = self.size();
        Grid { size: [width, height], texels: Self::row(height + 1) + height * (width + 1) }
    }

    fn texel(&self, grid: Grid, x: u32, y: u32) -> DVec3 {
        let first = grid.texels + 3 * (y * grid.size[0] + x);
        DVec3::from([0, 1, 2].map(|i| f64::from(self.float(first + i))))
    }

    /// The last of `count` entries whose chance is not above the aim: its index, the chance before it, and its own.
    fn find(&self, first: u32, stride: u32, count: u32, aim: u32) -> (u32, u32, u32) {
        let chance = |i: u32| self.table[(first + stride * i) as usize];
        let (mut low, mut high) = (0, count);
        while high - low > 1 {
            let middle = low.midpoint(high);
            if chance(middle) <= aim {
                low = middle;
            } else {
                high = middle;
            }
        }
        (low, chance(low), chance(low + 1) - chance(low))
    }

    /// The direction of the draw; none if there is no map.
    pub fn drawn(&self) -> Option<Drawn> {
        let [width, height] = self.size();
        if !self.is_there() {
            return None;
        }
        let draw = self.at.map(|x| x >> 1);
        let (row, rows_before, row_share) = self.find(Self::row(0) + 3, ENVIRONMENT_ROW, height, draw[1]);
        let columns = Self::row(height + 1) + row * (width + 1);
        let (column, before, share) = self.find(columns, 1, width, draw[0]);
        let part = |draw: u32, before: u32, own: u32| ((draw - before) as f32 + 0.5) / own as f32;
        let inside = [part(draw[0], before, share), part(draw[1], rows_before, row_share)];
        let one = f64::from(ENVIRONMENT_ONE);
        let chance = f64::from(row_share) / one * (f64::from(share) / one);
        let density = chance / f64::from(self.float(Self::row(row) + 2));
        let irradiance = self.texel(self.sharp(), column, row) / density;
        Some(Drawn { texel: [column, row], direction: self.direction([column, row], inside), density, irradiance })
    }

    /// The direction of a place inside of a texel.
    fn direction(&self, [column, row]: [u32; 2], [x, y]: [f32; 2]) -> Vec3 {
        let (upper, lower) = (Self::row(row), Self::row(row + 1));
        let between = |i: u32| self.float(upper + i) + (self.float(lower + i) - self.float(upper + i)) * y;
        let (s, c) = (between(0), between(1));
        let turn = (column as f32 + x) / self.table[0] as f32 - 0.5 - self.float(2);
        let v = turn_vector(turn - turn.floor());
        let level = 2.0 * (s * c).sqrt();
        Vec3::new(v[1] * level, c - s, -v[0] * level)
    }

    /// What the map looks like in a direction of any length but 0, and what a device's may differ by.
    pub fn radiance(&self, direction: [f32; 3]) -> (DVec3, DVec3) {
        self.looked_up(self.sharp(), direction)
    }

    /// The same of what it looks like blurred.
    pub fn blurred(&self, direction: [f32; 3]) -> (DVec3, DVec3) {
        let size = [ENVIRONMENT_BLURRED_WIDTH, ENVIRONMENT_BLURRED_HEIGHT];
        self.looked_up(Grid { size, texels: self.table[3] }, direction)
    }

    fn looked_up(&self, grid: Grid, direction: [f32; 3]) -> (DVec3, DVec3) {
        let [width, height] = grid.size;
        let d = DVec3::from(direction.map(f64::from));
        let level = DVec2::new(d.x, d.z).length();
        let turn = d.x.atan2(-d.z) / std::f64::consts::TAU + 0.5 + f64::from(self.float(2));
        let x = (turn - turn.floor()) * f64::from(width) - 0.5;
        let y = level.atan2(d.y) / std::f64::consts::PI * f64::from(height) - 0.5;
        let value = self.interpolated(grid, x, y);
        // A turn is within 2^-21, and what is added to it is below 3; coordinates round once more. A corner of what is
        // interpolated may lie between the two places: both sides of it are looked at.
        let off = [f64::from(width), 2.0 * f64::from(height)].map(|side| side * (2f64.powi(-21) + 4.0 * U));
        let steps = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]];
        let moved = steps.map(|[a, b]| (self.interpolated(grid, x + a * off[0], y + b * off[1]) - value).abs());
        let most = moved.into_iter().fold(DVec3::ZERO, DVec3::max);
        // Interpolation rounds three times, in each of two directions; moves along both axes add up, and mixed terms are less.
        (value, 4.0 * most + 16.0 * U * value + off[0] * off[1] * value)
    }

    fn interpolated(&self, grid: Grid, x: f64, y: f64) -> DVec3 {
        let [width, height] = grid.size.map(i64::from);
        let (left, top) = (x.floor(), y.floor());
        let at = |dx: i64, dy: i64| {
            let column = (left as i64 + dx).rem_euclid(width);
            let row = (top as i64 + dy).clamp(0, height - 1);
            self.texel(grid, column as u32, row as u32)
        };
        let across = |dy: i64| at(0, dy).lerp(at(1, dy), x - left);
        across(0).lerp(across(1), y - top)
    }
}
