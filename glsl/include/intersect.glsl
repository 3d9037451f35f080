// A ray against the eight boxes of a compressed node, and against a triangle. No bindings, no loops.

#ifndef STILLRAY_INTERSECT
#define STILLRAY_INTERSECT

#include "ray.glsl"

const float BOX_TOLERANCE = 3.8146973e-6;  // 2^-18 = 64 u

// Bytes of a word as floats.
vec4 bytes_of(uint word) {
    return vec4(float(word & 0xffu), float((word >> 8) & 0xffu), float((word >> 16) & 0xffu), float(word >> 24));
}

// Bits of four children at positions that `oct` sorts by priority (obvhs, after Ylitie, Karras and Laine 2017, section 2.3):
// an inner child sets one bit of 24..31, a leaf the bits of its primitives in 0..23, an empty slot none.
uint four_children(uint meta, uint oct, vec4 near, vec4 far) {
    uint inner = ((meta & (meta << 1)) & 0x10101010u) >> 4;
    uint position = (meta ^ (oct & (inner * 0xffu))) & 0x1f1f1f1fu;
    uint bits = (meta >> 5) & 0x07070707u;
    bvec4 hit = lessThanEqual(near, far);
    return (hit.x ? (bits & 0xffu) << (position & 0xffu) : 0u)
        | (hit.y ? ((bits >> 8) & 0xffu) << ((position >> 8) & 0xffu) : 0u)
        | (hit.z ? ((bits >> 16) & 0xffu) << ((position >> 16) & 0xffu) : 0u)
        | (hit.w ? (bits >> 24) << (position >> 24) : 0u);
}

vec4 entry(uint x, uint y, uint z, vec3 stride, vec3 base) {
    vec4 t = max(bytes_of(x) * stride.x + base.x, bytes_of(y) * stride.y + base.y);
    return max(max(t, bytes_of(z) * stride.z + base.z), vec4(0.0));
}

vec4 exit(uint x, uint y, uint z, vec3 stride, vec3 base, float tmax) {
    vec4 t = min(bytes_of(x) * stride.x + base.x, bytes_of(y) * stride.y + base.y);
    return min(min(t, bytes_of(z) * stride.z + base.z), vec4(tmax));
}

// Which children the ray meets at t in [0, tmax]: never fewer than in exact arithmetic.
//
// A child's planes are p + q e with q in 0..255 and e a power of two; the ray meets one at t = q a + b, where a = e inverse
// and b = (p - o) inverse. b cancels against q a, so the error is absolute: with m = |p - o| + 256 e on that axis, in lengths
// (times |direction|) it is
//   p - o: 1 u, inverse: 5 u, product: 1 u (a is exact), sum: 1 u, slack added: 1 u      ->  9 u m;
// the transform of o (4 u) and of the direction (3 u), by which an instance's triangles move against the instance's box:
// 7 u |A| |R| |o| on top of what the box was enlarged by, <= 21 u |o| for a rotation or axis-wise scale (accel/tlas.rs);
// a direction component below the guard G = 2^-30 of the largest is changed by at most 2 G, which moves the ray by
// 2 G t |direction| <= 2 G max m                                                          ->  u/32 max m.
// In all below 31 u of the largest component of m. 64 u are given, so that a triangle's t, whose own rounding is of the order
// of u m too, is not cut off by a hit that rounds the other way. All three axes get the tolerance of the largest: the rounding
// of a transform does not respect axes. At a distance of 1 m it is 4 micrometres, under a hundredth of a pixel: it costs no
// speed.
// Multiplying and adding in one rounding (FMA) only lowers the error, so nothing here has to be precise.
//
// No NaN: in_range() keeps all products finite, inverse is never infinite, and tmax may be.
uint hit_children(uvec4 head, uvec4 refs, uvec4 planes_x, uvec4 planes_y, uvec4 planes_z, Ray ray, float tmax) {
    vec3 e = uintBitsToFloat(uvec3((head.w & 0xffu) << 23, (head.w & 0xff00u) << 15, (head.w & 0xff0000u) << 7));
    vec3 relative = uintBitsToFloat(head.xyz) - ray.origin;
    vec3 slack = abs(ray.inverse) * (BOX_TOLERANCE * largest_component(abs(relative) + 256.0 * e));
    vec3 stride = e * ray.inverse;
    vec3 first = relative * ray.inverse - slack;
    vec3 last = relative * ray.inverse + slack;
    bool px = (ray.octant & 4u) != 0u;
    bool py = (ray.octant & 2u) != 0u;
    bool pz = (ray.octant & 1u) != 0u;
    // Words 0 and 1 hold the lower planes of children 0..3 and 4..7, words 2 and 3 the upper ones.
    uvec2 near_x = px ? planes_x.xy : planes_x.zw;
    uvec2 near_y = py ? planes_y.xy : planes_y.zw;
    uvec2 near_z = pz ? planes_z.xy : planes_z.zw;
    uvec2 far_x = px ? planes_x.zw : planes_x.xy;
    uvec2 far_y = py ? planes_y.zw : planes_y.xy;
    uvec2 far_z = pz ? planes_z.zw : planes_z.xy;
    return four_children(refs.z, ray.octant, entry(near_x.x, near_y.x, near_z.x, stride, first),
               exit(far_x.x, far_y.x, far_z.x, stride, last, tmax))
        | four_children(refs.w, ray.octant, entry(near_x.y, near_y.y, near_z.y, stride, first),
               exit(far_x.y, far_y.y, far_z.y, stride, last, tmax));
}

// Where a ray meets a triangle.
struct TriangleHit {
    float t;
    float u;  // weight of vertex 1, >= 0
    float v;  // weight of vertex 2, >= 0, u + v <= 1
    bool back;  // seen from the side on which the vertices run clockwise
};

const float SMALLEST_SLOPE = 7.8886091e-31;   // 2^-100

// Watertight test (Woop, Benthin and Wald 2013), both sides, edges and corners included. Whether t is in the ray's interval
// is for the caller to say.
//
// The vertices are sheared into a plane across the ray by a rule that depends on the ray and the vertex alone, so that
// neighbours share them bit by bit. An edge function is a difference of two products. Rounding is monotonic: of unequal
// products the larger one never rounds below the smaller, so the computed sign is the exact one, or zero. Zero counts as inside;
// so a triangle whose exact sheared image holds the ray is never missed, and a closed mesh, whose images cover the plane
// around the ray, has no cracks. (What has a determinant of zero is left out: it has no area across the ray, and in exact
// arithmetic its neighbours cover what it covers.) This needs the two products rounded one by one: a fused multiply-add would return the rounding
// error of one product where the exact value is zero, with either sign. Hence `precise`.
//
// t is found from the plane, not from the weights: seen at a grazing angle, the weights' rounding is amplified by the slope
// twice, the plane's only once, and it is this error that a ray leaving the triangle has to stand off from (ray.glsl). It is
// then clamped to the vertices' own range, which is all that is known of a triangle seen edge-on.
bool hit_triangle(Ray ray, vec3 v0, vec3 v1, vec3 v2, out TriangleHit hit) {
    precise vec3 a0 = v0 - ray.origin;
    precise vec3 b0 = v1 - ray.origin;
    precise vec3 c0 = v2 - ray.origin;
    vec3 a = permute(a0, ray.axis);
    vec3 b = permute(b0, ray.axis);
    vec3 c = permute(c0, ray.axis);
    precise float ax = a.x - ray.shear.x * a.z;
    precise float ay = a.y - ray.shear.y * a.z;
    precise float bx = b.x - ray.shear.x * b.z;
    precise float by = b.y - ray.shear.y * b.z;
    precise float cx = c.x - ray.shear.x * c.z;
    precise float cy = c.y - ray.shear.y * c.z;
    precise float wa = cx * by - cy * bx;
    precise float wb = ax * cy - ay * cx;
    precise float wc = bx * ay - by * ax;
    precise float det = (wa + wb) + wc;
    bool mixed = min(min(wa, wb), wc) < 0.0 && max(max(wa, wb), wc) > 0.0;
    hit = TriangleHit(0.0, 0.0, 0.0, false);
    if (mixed || abs(det) < SMALLEST_NORMAL) return false;

    precise float scale = 1.0 / det;
    precise float u = min(wb * scale, 1.0);
    precise float v = min(wc * scale, 1.0 - u);
    precise float ta = a.z * ray.shear.z;
    precise float tb = b.z * ray.shear.z;
    precise float tc = c.z * ray.shear.z;
    precise float t = ((1.0 - u) - v) * ta + (u * tb + v * tc);

    precise vec3 e1 = v1 - v0;
    precise vec3 e2 = v2 - v0;
    precise vec3 n = vec3(e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x);
    float size = largest_component(abs(n));
    if (size >= SMALLEST_NORMAL) {
        // Scaled to a largest component of 1: the third power of a small or large length leaves f32.
        precise float shrink = 1.0 / size;
        precise vec3 m = n * shrink;
        precise float slope = (m.x * ray.direction.x + m.y * ray.direction.y) + m.z * ray.direction.z;
        precise float height = (m.x * a0.x + m.y * a0.y) + m.z * a0.z;
        hit.back = slope > 0.0;
        if (abs(slope) >= SMALLEST_SLOPE) {
            precise float inverse_slope = 1.0 / slope;
            t = height * inverse_slope;
        }
    }
    hit.t = clamp(t, min(min(ta, tb), tc), max(max(ta, tb), tc));
    hit.u = u;
    hit.v = v;
    return true;
}

#endif
