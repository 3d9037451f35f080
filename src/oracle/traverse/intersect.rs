//! Twin of `glsl/include/intersect.glsl`.

use glam::Vec3;

use super::ray::{Ray, permute};
use crate::accel::Node;

/// 2^-18.
const BOX_TOLERANCE: f32 = 3.814_697_3e-6;
/// 2^-126.
const SMALLEST_NORMAL: f32 = f32::MIN_POSITIVE;
/// 2^-100.
const SMALLEST_SLOPE: f32 = 7.888_609e-31;

/// Which children of a node a ray meets at t in `0..=tmax`: bits 24..=31 are inner children by priority, bits 0..=23
/// primitives.
pub fn hit_children(node: &Node, ray: &Ray, tmax: f32) -> u32 {
    let head = node[3];
    let exponent = |shift: u32| f32::from_bits(((head >> shift) & 0xff) << 23);
    let e = Vec3::new(exponent(0), exponent(8), exponent(16));
    let relative = Vec3::from_array([node[0], node[1], node[2]].map(f32::from_bits)) - ray.origin;
    let slack = ray.inverse.abs() * (BOX_TOLERANCE * (relative.abs() + 256.0 * e).max_element());
    let stride = e * ray.inverse;
    let (first, last) = (relative * ray.inverse - slack, relative * ray.inverse + slack);
    let mut mask = 0;
    for child in 0..8 {
        let (half, shift) = (child / 4, 8 * (child % 4));
        let mut near = 0.0_f32;
        let mut far = tmax;
        for axis in 0..3 {
            let plane = |upper: usize| ((node[8 + 4 * axis + 2 * upper + half] >> shift) & 0xff) as f32;
            let positive = ray.octant & (4 >> axis) != 0;
            near = near.max(plane(usize::from(!positive)) * stride[axis] + first[axis]);
            far = far.min(plane(usize::from(positive)) * stride[axis] + last[axis]);
        }
        if near <= far {
            mask |= child_bits((node[6 + half] >> shift) & 0xff, ray.octant);
        }
    }
    mask
}

/// The bits that a child with this meta byte sets.
fn child_bits(meta: u32, octant: u32) -> u32 {
    let inner = meta & (meta << 1) & 0x10 != 0;
    let position = (if inner { meta ^ (octant & 7) } else { meta }) & 0x1f;
    (meta >> 5) << position
}

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// In lengths of the direction, of either sign.
    pub t: f32,
    /// Weight of vertex 1.
    pub u: f32,
    /// Weight of vertex 2.
    pub v: f32,
    /// Seen from the side on which the vertices run clockwise.
    pub back: bool,
}

/// Watertight test, both sides, edges and corners included.
pub fn hit_triangle(ray: &Ray, [v0, v1, v2]: [Vec3; 3]) -> Option<TriangleHit> {
    let a0 = v0 - ray.origin;
    let [a, b, c] = [a0, v1 - ray.origin, v2 - ray.origin].map(|p| permute(p, ray.axis));
    let shear = |p: Vec3| (p.x - ray.shear.x * p.z, p.y - ray.shear.y * p.z);
    let ((ax, ay), (bx, by), (cx, cy)) = (shear(a), shear(b), shear(c));
    let wa = cx * by - cy * bx;
    let wb = ax * cy - ay * cx;
    let wc = bx * ay - by * ax;
    let det = (wa + wb) + wc;
    let mixed = wa.min(wb).min(wc) < 0.0 && wa.max(wb).max(wc) > 0.0;
    if mixed || det.abs() < SMALLEST_NORMAL {
        return None;
    }
    let scale = 1.0 / det;
    let u = (wb * scale).min(1.0);
    let v = (wc * scale).min(1.0 - u);
    let [ta, tb, tc] = [a, b, c].map(|p| p.z * ray.shear.z);
    let (plane, back) = plane_distance(ray, a0, v1 - v0, v2 - v0);
    let t = plane.unwrap_or(((1.0 - u) - v) * ta + (u * tb + v * tc));
    Some(TriangleHit { t: t.max(ta.min(tb).min(tc)).min(ta.max(tb).max(tc)), u, v, back })
}

/// t of the plane through a point `a` away from the origin, along two edges; and whether it is met from behind.
fn plane_distance(ray: &Ray, a: Vec3, e1: Vec3, e2: Vec3) -> (Option<f32>, bool) {
    let n = Vec3::new(e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x);
    let size = n.abs().max_element();
    if size < SMALLEST_NORMAL {
        return (None, false);
    }
    let m = n * (1.0 / size);
    let slope = (m.x * ray.direction.x + m.y * ray.direction.y) + m.z * ray.direction.z;
    let height = (m.x * a.x + m.y * a.y) + m.z * a.z;
    ((slope.abs() >= SMALLEST_SLOPE).then(|| height * (1.0 / slope)), slope > 0.0)
}
