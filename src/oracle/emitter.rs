//! Triangles that shine, as lights. Twin of `glsl/include/emitter.glsl`: which are drawn is exact, where is computed in f32 and in the
//! shader's order, which of them is taken and how bright it is in f64 with bounds.

use super::motion::placement_at;
use super::stage::{Stage, U, normal_error};
use super::traverse::{SurfacePoint, offset_origin, transform_direction};
use crate::shaders::{EMITTER_COUNT, EMITTER_TABLE, EMITTER_TWO_SIDED, EMITTER_WORDS, INSTANCE_MASK, Light};

/// What shines, and what a sample draws from it.
#[derive(Debug, Clone, Copy)]
pub struct Shining<'a> {
    /// The table, in that of the map of light from all around.
    pub table: &'a [u32],
    /// Coordinates on a triangle, in [0, 1).
    pub at: [f32; 2],
    /// Which triangle, 2^32 to one.
    pub draw: u32,
    /// Which of several draws, in [0, 1).
    pub pick: f32,
    /// How many draws.
    pub count: u32,
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
    /// The instance that it belongs to.
    pub instance: u32,
    /// Relative error of the intensity.
    pub error: f64,
    /// Whether a device's rounding may take another draw.
    pub doubtful: bool,
}

/// What is lit up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Where it is.
    pub point: SurfacePoint,
    /// What its normal may be off by.
    pub error: f64,
}

/// Intensities are cut off here.
pub const INTENSITY_MAX: f32 = 3.0e38;
/// Relative error of an intensity where corners are not close to each other for where they are: two edges of 4 U, nine products and
/// sums of a cross product, its length, four products more.
const INTENSITY: f64 = 32.0 * U;

/// Of what a draw sends.
const SENT_MAX: f64 = 1.0e36;
/// From draw to draw on a triangle (Roberts 2018).
const SPREAD: [f32; 2] = [0.754_877_7, 0.569_840_3];

/// The square onto a triangle.
pub fn triangle_weights([x, y]: [f32; 2]) -> [f32; 2] {
    if y > x { [0.5 * x, y - 0.5 * x] } else { [x - 0.5 * y, 0.5 * y] }
}

impl Shining<'_> {
    /// The row of the table that is the `k`th draw, of five words.
    fn row(&self, k: u32) -> &[u32] {
        let [table, count] = [EMITTER_TABLE, EMITTER_COUNT].map(|at| self.table[at as usize]);
        let draw = self.draw.wrapping_add(k * (u32::MAX / self.count.max(1)));
        let product = u64::from(draw) * u64::from(count);
        let row = |row: u32| {
            let first = (table + EMITTER_WORDS * row) as usize;
            &self.table[first..first + EMITTER_WORDS as usize]
        };
        let own = row((product >> 32) as u32);
        if product as u32 >= own[2] { row(own[3]) } else { own }
    }

    /// Its place on its triangle.
    fn weights(&self, k: u32) -> [f32; 2] {
        triangle_weights([0, 1].map(|axis| {
            let moved = self.at[axis] + k as f32 * SPREAD[axis];
            moved - moved.floor()
        }))
    }

    fn point(&self, stage: &Stage<'_>, k: u32) -> SurfacePoint {
        let [u, v] = self.weights(k);
        stage.surface(self.row(k)[0] & INSTANCE_MASK, self.row(k)[1], u, v)
    }

    /// Both cosines over the square of the distance, 0 for what looks away; with what a device's may differ by.
    fn sent(&self, stage: &Stage<'_>, k: u32, receiver: &Receiver) -> [f64; 2] {
        let (row, point) = (self.row(k), self.point(stage, k));
        let towards = (receiver.point.position - point.position).as_dvec3();
        let square = towards.length_squared();
        let [along, got] = [point, receiver.point].map(|p| p.normal.as_dvec3().dot(towards) / square);
        let part = if row[0] & EMITTER_TWO_SIDED != 0 { along.abs() } else { along } * got.abs();
        // Of the normals, and of differences, sums and quotients.
        let off = (normal_error(stage, row[0] & INSTANCE_MASK, row[1]) + receiver.error + 24.0 * U) / square;
        if part > 0.0 { [part.min(SENT_MAX), off] } else { [0.0, off] }
    }

    /// Which draw is taken, how many times as much it counts for that with what that may be off by as a part of it, and whether a device's
    /// rounding may take another.
    fn taken(&self, stage: &Stage<'_>, receiver: &Receiver) -> (u32, [f64; 2], bool) {
        let (mut sum, mut pick) = ([0.0; 2], [f64::from(self.pick), 0.0]);
        let (mut number, mut taken, mut doubtful) = (0, [0.0; 2], false);
        for k in 0..self.count {
            let part = self.sent(stage, k, receiver);
            sum[1] += part[1] + U * sum[0];
            // What is next to nothing may be something elsewhere: it is taken there with that chance at most.
            if part[0] == 0.0 {
                pick[1] += if sum[0] > 0.0 { part[1] / sum[0] } else { 0.0 };
                continue;
            }
            sum[0] += part[0];
            let chance = part[0] / sum[0];
            let off = (part[1] + chance * sum[1]) / sum[0] + 2.0 * U;
            doubtful |= (pick[0] - chance).abs() <= pick[1] + off;
            let takes = pick[0] < chance;
            (number, taken) = if takes { (k, part) } else { (number, taken) };
            let of = if takes { chance } else { 1.0 - chance };
            let left = if takes { pick[0] } else { pick[0] - chance };
            pick = if of > 0.0 { [left / of, (pick[1] + off) / of + 2.0 * U] } else { pick };
        }
        if taken[0] == 0.0 {
            return (0, [0.0; 2], doubtful);
        }
        (
            number,
            [sum[0] / (f64::from(self.count) * taken[0]), sum[1] / sum[0] + taken[1] / taken[0] + 4.0 * U],
            doubtful,
        )
    }
}

/// What is drawn, for a point that it may light up.
pub fn draw_emitter(stage: &Stage<'_>, shining: &Shining<'_>, light: &Light, receiver: &Receiver) -> Emitter {
    let one = (0, [1.0, 0.0], false);
    let (k, [counts, off], doubtful) = if shining.count > 1 { shining.taken(stage, receiver) } else { one };
    let (row, weights, point) = (shining.row(k), shining.weights(k), shining.point(stage, k));
    let (instance, primitive) = (row[0] & INSTANCE_MASK, row[1]);
    let towards = receiver.point.position - point.position;
    let turned = row[0] & EMITTER_TWO_SIDED != 0 && point.normal.dot(towards) < 0.0;
    let normal = if turned { -point.normal } else { point.normal };
    let place = placement_at(&stage.world.instances[instance as usize], stage.world.time);
    let [a, b, c] = stage.world.geometry.corners(primitive);
    let [e1, e2] = [b - a, c - a].map(|edge| transform_direction(&place.to_relative, edge).as_dvec3());
    let area = 0.5 * e1.cross(e2).length() * f64::from(f32::from_bits(row[4])) * counts;
    let light = Light {
        position: offset_origin(&point, towards).to_array(),
        direction: normal.to_array(),
        intensity: [area.min(f64::from(INTENSITY_MAX)) as f32; 3],
        ..*light
    };
    Emitter { light, primitive, weights, instance, error: INTENSITY + off, doubtful }
}
