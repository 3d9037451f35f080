//! Twin of `glsl/include/ray.glsl`.

use glam::Vec3;

use crate::oracle::motion::Placement;

/// 2^-24.
const UNIT_ROUNDOFF: f32 = 5.960_464_5e-8;
/// 2^46.
const RAY_RANGE: f32 = 70_368_744_177_664.0;
/// 2^-30.
const RAY_GUARD: f32 = 9.313_226e-10;

/// A ray with what is derived from it once per space.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Metres.
    pub origin: Vec3,
    /// Of any length in range.
    pub direction: Vec3,
    /// Guarded reciprocal of the direction.
    pub inverse: Vec3,
    /// Bits of the non-negative axes (x: 4, y: 2, z: 1), in each of the four bytes.
    pub octant: u32,
    /// Axis of the largest direction component.
    pub axis: u32,
    /// Of the watertight test, in permuted axes.
    pub shear: Vec3,
}

/// Rotates the components so that `axis` comes last.
pub(super) fn permute(p: Vec3, axis: u32) -> Vec3 {
    match axis {
        2 => p,
        1 => Vec3::new(p.z, p.x, p.y),
        _ => Vec3::new(p.y, p.z, p.x),
    }
}

/// Whether the arithmetic on a ray stays within f32.
pub fn in_range(origin: Vec3, direction: Vec3) -> bool {
    let far = origin.abs().max_element();
    let longest = direction.abs().max_element();
    far <= RAY_RANGE && longest <= RAY_RANGE && longest * RAY_RANGE >= 1.0
}

impl Ray {
    /// Needs [`in_range`].
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let size = direction.abs();
        let reciprocal = 1.0 / size.max(Vec3::splat(size.max_element() * RAY_GUARD));
        let negative = direction.cmplt(Vec3::ZERO);
        let octant_bits = |axis: usize, bits: u32| if negative.test(axis) { 0 } else { bits };
        let axis = if size.z >= size.x.max(size.y) {
            2
        } else if size.y >= size.x {
            1
        } else {
            0
        };
        let permuted = permute(direction, axis);
        let scale = 1.0 / permuted.z;
        Self {
            origin,
            direction,
            inverse: Vec3::select(negative, -reciprocal, reciprocal),
            octant: octant_bits(0, 0x0404_0404) | octant_bits(1, 0x0202_0202) | octant_bits(2, 0x0101_0101),
            axis,
            shear: Vec3::new(permuted.x * scale, permuted.y * scale, scale),
        }
    }
}

/// Rows of a 3×4 matrix times a point.
pub fn transform_point(rows: &[[f32; 4]; 3], p: Vec3) -> Vec3 {
    let row = |[x, y, z, w]: [f32; 4]| ((x * p.x + y * p.y) + z * p.z) + w;
    Vec3::new(row(rows[0]), row(rows[1]), row(rows[2]))
}

/// Rows of a 3×4 matrix times a direction.
pub fn transform_direction(rows: &[[f32; 4]; 3], d: Vec3) -> Vec3 {
    let row = |[x, y, z, _]: [f32; 4]| (x * d.x + y * d.y) + z * d.z;
    Vec3::new(row(rows[0]), row(rows[1]), row(rows[2]))
}

fn transform_magnitude(rows: &[[f32; 4]; 3], p: Vec3, translation: f32) -> Vec3 {
    let row = |[x, y, z, w]: [f32; 4]| (x.abs() * p.x + y.abs() * p.y + z.abs() * p.z) + translation * w.abs();
    Vec3::new(row(rows[0]), row(rows[1]), row(rows[2]))
}

/// A point on a triangle of an instance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Object space.
    pub object: Vec3,
    /// Camera-relative, metres.
    pub position: Vec3,
    /// Camera-relative unit geometric normal of the counterclockwise side; +z for a triangle without area.
    pub normal: Vec3,
    /// Metres along the normal that clear every rounding error on the way back.
    pub clearance: f32,
    /// Metres: the largest component of the rounding error of `position`.
    pub error: f32,
}

/// The point with barycentric weights `u` of vertex 1 and `v` of vertex 2, of an instance whose matrices the host made.
pub fn surface_point(
    to_relative: &[[f32; 4]; 3],
    to_object: &[[f32; 4]; 3],
    corners: [Vec3; 3],
    u: f32,
    v: f32,
) -> SurfacePoint {
    let (to_relative, to_object) = (*to_relative, *to_object);
    surface_point_at(&Placement { to_relative, to_object, slack: [[0.0; 4]; 3], flags: 0 }, corners, u, v)
}

/// The same of an instance wherever it is.
pub fn surface_point_at(at: &Placement, [v0, v1, v2]: [Vec3; 3], u: f32, v: f32) -> SurfacePoint {
    let Placement { to_relative, to_object, slack, .. } = at;
    let (e1, e2) = (v1 - v0, v2 - v0);
    let (a, b) = (u * e1, v * e2);
    let p = v0 + (a + b);
    let yzx = |p: Vec3| Vec3::new(p.y, p.z, p.x);
    let zxy = |p: Vec3| Vec3::new(p.z, p.x, p.y);
    let (left, right) = (yzx(e1) * zxy(e2), zxy(e1) * yzx(e2));
    let n = left - right;
    let across = a.abs() + b.abs();
    let reach = transform_magnitude(to_relative, p.abs(), 1.0);
    let back = Vec3::new(to_object[0][3], to_object[1][3], to_object[2][3]).abs();
    let lost =
        UNIT_ROUNDOFF * (4.0 * across + p.abs() + 11.0 * transform_magnitude(to_object, reach, 0.0) + 5.0 * back);
    let lost = lost + UNIT_ROUNDOFF * transform_magnitude(slack, reach, 0.0);
    let height = n.abs().dot(lost) + 10.0 * UNIT_ROUNDOFF * (left.abs() + right.abs()).dot(across);
    let row = |i: usize| Vec3::new(to_object[i][0], to_object[i][1], to_object[i][2]);
    let normal = n.x * row(0) + n.y * row(1) + n.z * row(2);
    let others = 30.0 * UNIT_ROUNDOFF * reach.max_element();
    let size = normal.abs().max_element();
    let (unscaled, own) = if size > 0.0 {
        let unscaled = normal / size;
        (unscaled, 2.0 * height / (size * unscaled.length()))
    } else {
        (Vec3::Z, 0.0)
    };
    SurfacePoint {
        object: p,
        position: transform_point(to_relative, p),
        normal: unscaled / unscaled.length(),
        clearance: others + own,
        error: UNIT_ROUNDOFF
            * (transform_magnitude(to_relative, 4.0 * across + p.abs(), 0.0) + 5.0 * reach).max_element(),
    }
}

/// Where a ray leaves the surface into `direction`: on the side that the direction points to.
pub fn offset_origin(point: &SurfacePoint, direction: Vec3) -> Vec3 {
    let side = if point.normal.dot(direction) < 0.0 { -point.clearance } else { point.clearance };
    point.position + side * point.normal
}
