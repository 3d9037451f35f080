//! Triangles that shine, as lights. Twin of `glsl/include/emitter.glsl`: which one is drawn is exact, where is computed in f32 and in
//! the shader's order, how bright in f64 with a bound.

use super::motion::placement_at;
use super::stage::{Stage, U};
use super::traverse::{offset_origin, transform_direction};
use crate::shaders::{EMITTER_COUNT, EMITTER_TABLE, EMITTER_TWO_SIDED, EMITTER_WORDS, INSTANCE_MASK, Light};
use glam::Vec3;

/// What shines, and one draw from it.
#[derive(Debug, Clone, Copy)]
pub struct Shining<'a> {
    /// The table, in that of the map of light from all around.
    pub table: &'a [u32],
    /// Coordinates on a triangle, in [0, 1).
    pub at: [f32; 2],
    /// Which triangle, 2^32 to one.
    pub draw: u32,
}

/// A point of a triangle, as a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emitter {
    /// Intensity is what a radiance of 1 makes of it.
    pub light: Light,
    /// Triangle slot.
    pub primitive: u32,
    /// Barycentric weights of the second and third corner.
    pub weights: [f32; 2],
}

/// Intensities are cut off here.
pub const INTENSITY_MAX: f32 = 3.0e38;
/// Relative error of an intensity where corners are not close to each other for where they are: two edges of 4 U, nine products and
/// sums of a cross product, its length, three products more.
pub const INTENSITY: f64 = 32.0 * U;

/// The square onto a triangle.
pub fn triangle_weights([x, y]: [f32; 2]) -> [f32; 2] {
    if y > x { [0.5 * x, y - 0.5 * x] } else { [x - 0.5 * y, 0.5 * y] }
}

impl Shining<'_> {
    /// The row of the table that is drawn, of five words.
    pub fn row(&self) -> &[u32] {
        let [table, count] = [EMITTER_TABLE, EMITTER_COUNT].map(|at| self.table[at as usize]);
        let product = u64::from(self.draw) * u64::from(count);
        let row = |row: u32| {
            let first = (table + EMITTER_WORDS * row) as usize;
            &self.table[first..first + EMITTER_WORDS as usize]
        };
        let own = row((product >> 32) as u32);
        if product as u32 >= own[2] { row(own[3]) } else { own }
    }
}

/// What is drawn, for a point that it may light up.
pub fn draw_emitter(stage: &Stage<'_>, shining: &Shining<'_>, light: &Light, receiver: Vec3) -> Emitter {
    let row = shining.row();
    let (id, primitive) = (row[0] & INSTANCE_MASK, row[1]);
    let weights = triangle_weights(shining.at);
    let point = stage.surface(id, primitive, weights[0], weights[1]);
    let towards = receiver - point.position;
    let turned = row[0] & EMITTER_TWO_SIDED != 0 && point.normal.dot(towards) < 0.0;
    let normal = if turned { -point.normal } else { point.normal };
    let place = placement_at(&stage.world.instances[id as usize], stage.world.time);
    let [a, b, c] = stage.world.geometry.corners(primitive);
    let [e1, e2] = [b - a, c - a].map(|edge| transform_direction(&place.to_relative, edge).as_dvec3());
    let area = 0.5 * e1.cross(e2).length() * f64::from(f32::from_bits(row[4]));
    let light = Light {
        position: offset_origin(&point, towards).to_array(),
        direction: normal.to_array(),
        intensity: [area.min(f64::from(INTENSITY_MAX)) as f32; 3],
        ..*light
    };
    Emitter { light, primitive, weights }
}
