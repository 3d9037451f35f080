// Where things are at a time of the frame, while the shutter is open (paper 2, section 3.4): "linear between frames". Twin:
// src/oracle/motion.rs. No bindings, no loops.
//
// Times are parts of the way from the last frame, 0, to this one, 1.

#ifndef STILLRAY_MOTION
#define STILLRAY_MOTION

#include "ray.glsl"

// Entries between those of two matrices, each within 3 u (|before| + |now|) of the line; the same where they are the same.
// All that follows takes the outcome as exact: every kernel computes the same one.
void blend_rows(vec4 before[3], vec4 now[3], float time, out vec4 rows[3]) {
    precise vec4 x = before[0] + (now[0] - before[0]) * time;
    precise vec4 y = before[1] + (now[1] - before[1]) * time;
    precise vec4 z = before[2] + (now[2] - before[2]) * time;
    rows = vec4[3](x, y, z);
}

vec3 blend_point(vec3 before, vec3 now, float time) {
    precise vec3 p = before + (now - before) * time;
    return p;
}

// Largest condition of a matrix that is inverted: see below. accel/ enlarges the boxes of what moves by as much.
const float INVERSE_LIMIT = 1024.0;
const float INVERSE_SIZE = 9.0949470e-13;    // 2^-40: least entry that the largest may be; 2^46 is the most
const float INVERSE_VOLUME = 8.2718061e-25;  // 2^-80: least determinant, of a matrix whose largest entry is 1 to 2
const float INVERSE_REACH = 1.2676506e30;    // 2^100: largest translation of an inverse

// Inverts at.to_relative by its adjugate; false for what is singular, or nearly so: such an instance is not met at this time.
//
// The matrix A is scaled by a power of two first, which rounds nothing. With C the cofactors, C+ the same with products taken
// absolutely, D+ = sum |a| C+ along a row, det the determinant, G = C+ / |det| and D = D+ / |det| >= 1:
//   C: 2 u C+ (products, difference); det: 2 u and product 1 u, two sums 2 u: 5 u D+; reciprocal and product: 6 u.
//   R = C / det is off by (2 + 5 D + 6) u G <= 13 u D G; with det in D and G itself off by 5 u D <= 2^-11: 16 u D G.
// A ray's origin x = A p + c comes to R x + r, and r = -R c is off by 3 u |R| |c|: the inverse's error goes with x - c = A p,
// 16 u D G |A| |p|, so that 19 D G (|A| |p| + |c|) bounds both: that is `slack`.
// In camera-relative space that is |A| 19 u D G |x|: what D |A| G, summed along a row, is limited for.
bool invert(inout Placement at) {
    vec3 a = at.to_relative[0].xyz;
    vec3 b = at.to_relative[1].xyz;
    vec3 c = at.to_relative[2].xyz;
    float size = largest_component(max(max(abs(a), abs(b)), abs(c)));
    if (!(size >= INVERSE_SIZE && size <= RAY_RANGE)) {
        return false;
    }
    float unit = uintBitsToFloat((254u << 23) - (floatBitsToUint(size) & INFINITY_BITS));
    a *= unit;
    b *= unit;
    c *= unit;
    precise vec3 bc = b.yzx * c.zxy - b.zxy * c.yzx;
    precise vec3 ca = c.yzx * a.zxy - c.zxy * a.yzx;
    precise vec3 ab = a.yzx * b.zxy - a.zxy * b.yzx;
    vec3 bc_size = abs(b.yzx * c.zxy) + abs(b.zxy * c.yzx);
    vec3 ca_size = abs(c.yzx * a.zxy) + abs(c.zxy * a.yzx);
    vec3 ab_size = abs(a.yzx * b.zxy) + abs(a.zxy * b.yzx);
    precise float volume = (a.x * bc.x + a.y * bc.y) + a.z * bc.z;
    if (!(abs(volume) >= INVERSE_VOLUME)) {
        return false;
    }
    precise float part = 1.0 / volume;
    precise float spread = (abs(a.x) * bc_size.x + abs(a.y) * bc_size.y + abs(a.z) * bc_size.z) * abs(part);
    precise vec3 sums = (bc_size + ca_size + ab_size) * abs(part);
    precise float largest = max(max(abs(a.x) * sums.x + abs(a.y) * sums.y + abs(a.z) * sums.z,
        abs(b.x) * sums.x + abs(b.y) * sums.y + abs(b.z) * sums.z), abs(c.x) * sums.x + abs(c.y) * sums.y + abs(c.z) * sums.z);
    if (!(spread * largest <= INVERSE_LIMIT)) {
        return false;
    }
    precise float scale = part * unit;
    precise vec3 x = vec3(bc.x, ca.x, ab.x) * scale;
    precise vec3 y = vec3(bc.y, ca.y, ab.y) * scale;
    precise vec3 z = vec3(bc.z, ca.z, ab.z) * scale;
    vec3 from = vec3(at.to_relative[0].w, at.to_relative[1].w, at.to_relative[2].w);
    vec3 reach = vec3(dot(abs(x), abs(from)), dot(abs(y), abs(from)), dot(abs(z), abs(from)));
    if (!(largest_component(reach) <= INVERSE_REACH)) {
        return false;
    }
    precise vec3 back = -vec3((x.x * from.x + x.y * from.y) + x.z * from.z, (y.x * from.x + y.y * from.y) + y.z * from.z,
        (z.x * from.x + z.y * from.y) + z.z * from.z);
    at.to_object = vec4[3](vec4(x, back.x), vec4(y, back.y), vec4(z, back.z));
    float loose = 19.0 * spread * abs(scale);
    at.slack = vec4[3](vec4(bc_size.x, ca_size.x, ab_size.x, 0.0) * loose,
        vec4(bc_size.y, ca_size.y, ab_size.y, 0.0) * loose, vec4(bc_size.z, ca_size.z, ab_size.z, 0.0) * loose);
    at.flags = (at.flags & ~INSTANCE_FLIPPED) | (volume < 0.0 ? INSTANCE_FLIPPED : 0u);
    return true;
}

// Unit vectors as near to both of two pairs as their blends; those of `now` where the blends have no direction, half-way
// through half a turn.
void blend_axes(vec3 right_before, vec3 forward_before, float time, inout vec3 right, inout vec3 forward) {
    const float LEAST = 1.0e-6;  // of a squared length: a rotation by less than 0.002 from half a turn
    precise vec3 f = forward_before + (forward - forward_before) * time;
    precise vec3 r = right_before + (right - right_before) * time;
    precise float f2 = (f.x * f.x + f.y * f.y) + f.z * f.z;
    if (!(f2 >= LEAST)) {
        return;
    }
    precise vec3 ahead = f / sqrt(f2);
    precise float along = (ahead.x * r.x + ahead.y * r.y) + ahead.z * r.z;
    precise vec3 across = r - ahead * along;
    precise float r2 = (across.x * across.x + across.y * across.y) + across.z * across.z;
    if (!(r2 >= LEAST)) {
        return;
    }
    precise vec3 aside = across / sqrt(r2);
    right = aside;
    forward = ahead;
}

#endif
