// Rays, their transforms, and points on surfaces with bounds on their rounding error. No bindings, no loops.
//
// Notation of the bounds: u = 2^-24 is f32's unit roundoff; "n u" stands for a relative error of at most n u / (1 - n u).
// IEEE addition and multiplication are exact to 1 u; a reciprocal is exact to 2.5 ulp = 5 u, which is what Vulkan asks for.
// `precise` forbids contraction and reassociation, so that every driver computes the same bits here.

#ifndef STILLRAY_RAY
#define STILLRAY_RAY

#include "types.glsl"

const float UNIT_ROUNDOFF = 5.9604645e-8;   // 2^-24
const float RAY_RANGE = 7.0368744e13;       // 2^46: largest origin coordinate and direction component, the reciprocal the least
const float RAY_GUARD = 9.3132257e-10;      // 2^-30: direction components below this share of the largest are replaced by it

// A ray with what is derived from it once per space. The direction need not be normalised: t counts in its lengths, so that
// t is the same in world and object space.
struct Ray {
    vec3 origin;
    vec3 direction;
    vec3 inverse;   // of the direction, guarded: finite, its sign that of the direction (+ for both zeros)
    uint octant;    // bits of the non-negative axes (x: 4, y: 2, z: 1), in each of the four bytes
    uint axis;      // of the largest direction component: 0, 1 or 2
    vec3 shear;     // in permuted axes: direction.x / direction.z, direction.y / direction.z, 1 / direction.z
};

// Rotates the components so that `axis` comes last.
vec3 permute(vec3 p, uint axis) {
    return axis == 2u ? p : (axis == 1u ? p.zxy : p.yzx);
}

float largest_component(vec3 p) {
    return max(max(p.x, p.y), p.z);
}

// Whether the arithmetic on this ray stays within f32. With geometry within 2^44, as accel/ ensures, and the bounds of
// RAY_RANGE, |p - o| * guarded inverse <= 2^47 * 2^46 * 2^30 = 2^123, and 256 e adds at most 2^122 to it. A ray out of
// range, and one without a direction, hits nothing.
bool in_range(vec3 origin, vec3 direction) {
    float far = largest_component(abs(origin));
    float longest = largest_component(abs(direction));
    return far <= RAY_RANGE && longest <= RAY_RANGE && longest * RAY_RANGE >= 1.0;
}

// Needs in_range(origin, direction).
Ray make_ray(vec3 origin, vec3 direction) {
    Ray ray;
    ray.origin = origin;
    ray.direction = direction;
    vec3 size = abs(direction);
    precise vec3 reciprocal = 1.0 / max(size, vec3(largest_component(size) * RAY_GUARD));
    bvec3 negative = lessThan(direction, vec3(0.0));
    ray.inverse = mix(reciprocal, -reciprocal, negative);
    ray.octant = (negative.x ? 0u : 0x04040404u) | (negative.y ? 0u : 0x02020202u) | (negative.z ? 0u : 0x01010101u);
    ray.axis = size.z >= max(size.x, size.y) ? 2u : (size.y >= size.x ? 1u : 0u);
    vec3 permuted = permute(direction, ray.axis);
    precise float scale = 1.0 / permuted.z;
    precise vec3 shear = vec3(permuted.x * scale, permuted.y * scale, scale);
    ray.shear = shear;
    return ray;
}

// Rows of a 3x4 matrix times a point. Error: 4 u (|rows| |p| + |translation|), of which the terms of an exact zero are none.
vec3 transform_point(vec4 rows[3], vec3 p) {
    precise vec3 q = vec3(
        ((rows[0].x * p.x + rows[0].y * p.y) + rows[0].z * p.z) + rows[0].w,
        ((rows[1].x * p.x + rows[1].y * p.y) + rows[1].z * p.z) + rows[1].w,
        ((rows[2].x * p.x + rows[2].y * p.y) + rows[2].z * p.z) + rows[2].w);
    return q;
}

// Rows of a 3x4 matrix times a direction. Error: 3 u |rows| |d|.
vec3 transform_direction(vec4 rows[3], vec3 d) {
    precise vec3 q = vec3(
        (rows[0].x * d.x + rows[0].y * d.y) + rows[0].z * d.z,
        (rows[1].x * d.x + rows[1].y * d.y) + rows[1].z * d.z,
        (rows[2].x * d.x + rows[2].y * d.y) + rows[2].z * d.z);
    return q;
}

// The same with absolute values throughout: what errors are measured by.
vec3 transform_magnitude(vec4 rows[3], vec3 p, float translation) {
    return vec3(
        dot(abs(rows[0].xyz), p) + translation * abs(rows[0].w),
        dot(abs(rows[1].xyz), p) + translation * abs(rows[1].w),
        dot(abs(rows[2].xyz), p) + translation * abs(rows[2].w));
}

// Where an instance is. Rows of 3x4 matrices.
struct Placement {
    vec4 to_relative[3];  // object to camera-relative space
    vec4 to_object[3];    // its inverse
#ifdef MOTION
    vec4 slack[3];  // bound on what to_object was computed wrong by, times 2^24; 0 where the host inverted
    uint flags;     // INSTANCE_*; of where it is
#endif
};

// A point on a triangle of an instance.
struct SurfacePoint {
    vec3 object;      // object space: what a Sample keeps
    vec3 position;    // camera-relative, metres
    vec3 normal;      // camera-relative unit geometric normal of the counterclockwise side; (0, 0, 1) for a triangle without area
    float clearance;  // metres along the normal that clear every rounding error on the way back: see below
    float error;      // metres: the largest component of the rounding error of `position`
};

// The point with barycentric weights u of vertex 1 and v of vertex 2, and how far a secondary ray's origin has to stand off
// so that it starts on the right side of its own triangle. (The idea is PBRT-v4's, section 6.8; the bounds are this
// project's, because its test and transforms differ.) With v0 the object-space vertex 0, e1 and e2 the edges, A, c and R, r the
// linear part and translation of to_relative and to_object:
//
// 1. p = v0 + (u e1 + v e2) is in the triangle's plane for any weights. e: 1 u, product: 2 u, sum: 3 u, last sum 1 u more:
//    d1 = 4 u (|u e1| + |v e2|) + u |p|.
// 2. x = A p + c: 4 u, and 1 u for A and c themselves, of |A| |p| + |c| =: S. Adding the offset to x rounds once more.
//    d2 = 6 u S.
// 3. Back by another ray: o' = R x + r: 4 u, and 1 u for R and r, of |R| |x| + |r|; and |x| <= S.
//    d3 = 5 u (|R| S + |r|).
//    So o' differs from p + R (offset) by D = d1 + |R| d2 + d3, and |n . D| <= |n| . D is the height lost, times |n|.
// 4. intersect.glsl finds t from n' . (v0 - o'), with n' = e1 x e2 scaled to a largest component of 1. With
//    N = |e1.yzx e2.zxy| + |e1.zxy e2.yzx|, n' is exact to (4 + 1 + 1) u N, v0 - o' to 1 u and the sum to 3 u:
//    d4 = 10 u N . |p - v0|, also times |n|, where |p - v0| <= |u e1| + |v e2|.
//
// The offset h along the unit vector R^T n / |R^T n| raises o' by h |R^T n| / |n| over the plane, so
// h = (|n| . D + d4) / |R^T n| suffices: then n . (v0 - o') has the sign that it has in exact arithmetic, and t <= 0 for a
// direction that leaves. Twice that, because a neighbour across an edge computes with its own, alike error.
//
// Another instance whose surface meets this one goes through its own transform. If it is rigid or scaled along its
// axes, |A| |R| has rows that sum to 3 at most, and its error is 3 * 5 u (|x| + |c|), with |c| of the order of |x|: 30 u |x|.
//
// A to_object that a shader computed is off by `slack` on top (motion.glsl), which goes with |A| |p| + |c| too: d3 gets slack S.
SurfacePoint surface_point(Placement at, vec3 v0, vec3 v1, vec3 v2, float u, float v) {
    precise vec3 e1 = v1 - v0;
    precise vec3 e2 = v2 - v0;
    precise vec3 a = u * e1;
    precise vec3 b = v * e2;
    precise vec3 p = v0 + (a + b);
    vec3 left = e1.yzx * e2.zxy;
    vec3 right = e1.zxy * e2.yzx;
    vec3 n = left - right;
    vec3 across = abs(a) + abs(b);
    vec3 reach = transform_magnitude(at.to_relative, abs(p), 1.0);
    vec3 lost = UNIT_ROUNDOFF * (4.0 * across + abs(p) + 11.0 * transform_magnitude(at.to_object, reach, 0.0)
        + 5.0 * abs(vec3(at.to_object[0].w, at.to_object[1].w, at.to_object[2].w)));
#ifdef MOTION
    lost += UNIT_ROUNDOFF * transform_magnitude(at.slack, reach, 0.0);
#endif
    float height = dot(abs(n), lost) + 10.0 * UNIT_ROUNDOFF * dot(abs(left) + abs(right), across);
    vec3 normal = n.x * at.to_object[0].xyz + n.y * at.to_object[1].xyz + n.z * at.to_object[2].xyz;

    SurfacePoint point;
    point.object = p;
    point.position = transform_point(at.to_relative, p);
    float others = 30.0 * UNIT_ROUNDOFF * largest_component(reach);
    // Scaled first: the square of a small triangle's normal would vanish.
    float size = largest_component(abs(normal));
    bool flat_enough = size > 0.0;
    vec3 unscaled = flat_enough ? normal / size : vec3(0.0, 0.0, 1.0);
    float stretch = length(unscaled);
    point.normal = unscaled / stretch;
    point.clearance = others + (flat_enough ? 2.0 * height / (size * stretch) : 0.0);
    point.error = UNIT_ROUNDOFF * largest_component(
        transform_magnitude(at.to_relative, 4.0 * across + abs(p), 0.0) + 5.0 * reach);
    return point;
}

// Of an instance whose matrices the host made.
SurfacePoint surface_point(vec4 to_relative[3], vec4 to_object[3], vec3 v0, vec3 v1, vec3 v2, float u, float v) {
    Placement at;
    at.to_relative = to_relative;
    at.to_object = to_object;
#ifdef MOTION
    at.slack = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    at.flags = 0u;
#endif
    return surface_point(at, v0, v1, v2, u, v);
}

// Where a ray leaves the surface into `direction`: on the side that the direction points to.
vec3 offset_origin(SurfacePoint point, vec3 direction) {
    float side = dot(point.normal, direction) < 0.0 ? -point.clearance : point.clearance;
    return point.position + side * point.normal;
}

#endif
