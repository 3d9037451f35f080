//! The tree over the instances, rebuilt each frame.

use glam::{DMat3, DVec3, Vec3};
use obvhs::BvhBuildParams;

use super::moving::INVERSE_LIMIT;
use super::{Bounds, Geometry, Node, TOP_DEPTH, bvh, is_placed};
use crate::shaders;

/// Roundoff of f32.
const U: f64 = 1.0 / 16_777_216.0;

/// Coordinates beyond which no ray's arithmetic is trusted (2^46; `RAY_RANGE` in ray.glsl).
const RANGE: f64 = 70_368_744_177_664.0;

/// The top level of the acceleration structure.
#[derive(Debug, Clone)]
pub struct Tlas {
    /// At least one node, at most [`Geometry::tlas_capacity`]: what goes to the start of the GPU's node buffer.
    pub nodes: Vec<Node>,
    /// Levels of nodes.
    pub depth: u32,
    /// Instances left out because their transform cannot be inverted or puts them out of range. Those of empty meshes are
    /// left out as well, and not counted.
    pub left_out: u32,
    boxes: Vec<Bounds>,
    members: Vec<u32>,
}

impl Default for Tlas {
    fn default() -> Self {
        // A node of no children, for a scene of no instances.
        Self { nodes: vec![[0; 20]], depth: 1, left_out: 0, boxes: Vec::new(), members: Vec::new() }
    }
}

impl Tlas {
    /// Builds the tree over the frame's instances (one a scene instance, from [`super::place`]) and writes the leaf order
    /// into their `leaf` members. Takes about a millisecond for a thousand instances.
    pub fn rebuild(&mut self, geometry: &Geometry, instances: &mut [shaders::Instance]) {
        self.rebuild_over(geometry, instances, 0.0);
    }

    /// As [`Tlas::rebuild`], for all the time that a shutter is open: the part of the frame's, 0..=1. What moves
    /// ([`super::mark_moving`]) has a box around all of its way.
    pub fn rebuild_over(&mut self, geometry: &Geometry, instances: &mut [shaders::Instance], shutter: f64) {
        self.boxes.clear();
        self.members.clear();
        self.left_out = 0;
        for (i, (instance, &mesh)) in instances.iter().zip(&geometry.instance_meshes).enumerate() {
            let bounds = geometry.meshes[mesh as usize].bounds;
            if bounds.is_empty() {
                continue;
            }
            match swept_bounds(instance, bounds, shutter) {
                Some(bounds) => {
                    self.boxes.push(bounds);
                    self.members.push(i as u32);
                }
                None => self.left_out += 1,
            }
        }
        let tree = bvh::build(&self.boxes, &params(), TOP_DEPTH, |_| ());
        self.nodes.clear();
        self.nodes.extend_from_slice(bytemuck::cast_slice(&tree.nodes));
        if self.nodes.is_empty() {
            self.nodes.push([0; 20]);
        }
        self.depth = tree.extent.map_or(1, |e| e.depth);
        for (instance, &slot) in instances.iter_mut().zip(&tree.order) {
            instance.leaf = self.members[slot as usize];
        }
    }
}

/// One instance a leaf: entering an instance costs more than another box.
fn params() -> BvhBuildParams {
    BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::fast_build() }
}

/// The camera-relative box of an instance, enlarged by what the traversal's rounding can move its triangles. `None` if it
/// cannot be traced.
///
/// The traversal transforms the ray, not the box: o' = R o + r and d' = R d in f32, with R and r = to_object. For a point
/// x = o + t d of the ray, o' + t d' differs from the exact R x + r by at most
/// 4 u |R| |o| + u |r| (sums and products of o') + 3 u |R| |t d| (those of d'), and R and r themselves, rounded
/// from the exact inverse, by u (|R| |x| + |r|). With |t d| <= |x| + |o| that is 4 u |R| |x| + 2 u |r| + 7 u |R| |o|.
/// |A| takes it to world space. The part that goes with o is in the box test's tolerance (intersect.glsl); the rest is added
/// here, doubled for the rounding of A, which is not R's inverse to the last bit either.
fn relative_bounds(instance: &shaders::Instance, bounds: Bounds) -> Option<Bounds> {
    if !is_placed(instance) {
        return None;
    }
    let (linear, translation) = matrix(&instance.to_relative);
    let (inverse, back) = matrix(&instance.to_object);
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let center = linear * ((min + max) * 0.5) + translation;
    let half = absolute(linear) * ((max - min) * 0.5);
    let farthest = center.abs() + half;
    let moved = absolute(inverse) * farthest * (8.0 * U) + back.abs() * (4.0 * U);
    let half = half + absolute(linear) * moved;
    let (min, max) = (center - half, center + half);
    let inside = (center.abs() + half).max_element() <= RANGE;
    inside.then(|| Bounds { min: outward(min, f32::next_down), max: outward(max, f32::next_up) })
}

/// The same over all the time that the shutter is open. Vertices go along straight lines, so that the boxes at both ends bound
/// them; what the blend and the inverse that a shader makes are off by is told in motion.glsl: the former 3 u of both ends'
/// sizes, the latter, with L what `D |A| G` is limited to and x the farthest point, 16 u L |x|, and the ray's transform
/// 8 u L |x| + 4 u L |x|, for |A| |R| is within L too. With the doubling of the static box: 32 u (L + 1) |x|.
fn swept_bounds(instance: &shaders::Instance, bounds: Bounds, shutter: f64) -> Option<Bounds> {
    let now = relative_bounds(instance, bounds)?;
    if instance.flags & shaders::INSTANCE_MOVES == 0 {
        return Some(now);
    }
    let [(linear, translation), (before, from)] = [matrix(&instance.to_relative), matrix(&instance.previous)];
    let open = (before * shutter + linear * (1.0 - shutter), from * shutter + translation * (1.0 - shutter));
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let ends = [(linear, translation), open].map(|(linear, translation)| {
        (linear * ((min + max) * 0.5) + translation, absolute(linear) * ((max - min) * 0.5))
    });
    let farthest = |(center, half): (DVec3, DVec3)| (center.abs() + half).max_element();
    // The blend's error goes with both frames' matrices, whatever the shutter.
    let sizes = (absolute(before) + absolute(linear)) * min.abs().max(max.abs()) + from.abs() + translation.abs();
    let off = 32.0 * U * (INVERSE_LIMIT + 1.0) * ends.map(farthest).into_iter().fold(0.0, f64::max)
        + 4.0 * U * sizes.max_element();
    let low = (ends[0].0 - ends[0].1).min(ends[1].0 - ends[1].1) - off;
    let high = (ends[0].0 + ends[0].1).max(ends[1].0 + ends[1].1) + off;
    let inside = low.abs().max(high.abs()).max_element() <= RANGE;
    inside.then(|| Bounds { min: outward(low, f32::next_down), max: outward(high, f32::next_up) }.union(now))
}

/// Rounding to nearest moves by half a unit in the last place, a step outward by a whole one.
fn outward(p: DVec3, step: fn(f32) -> f32) -> Vec3 {
    let p = p.as_vec3();
    Vec3::new(step(p.x), step(p.y), step(p.z))
}

fn matrix(rows: &[[f32; 4]; 3]) -> (DMat3, DVec3) {
    let [a, b, c] = rows.map(|row| row.map(f64::from));
    let linear = DMat3::from_cols_array_2d(&[[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]]);
    (linear, DVec3::new(a[3], b[3], c[3]))
}

fn absolute(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}
