// Packed attributes and shaded samples. Twin: src/oracle/shade/pack.rs. No bindings, no loops.

#ifndef STILLRAY_PACK
#define STILLRAY_PACK

#include "types.glsl"

const float HALF_MAX = 65504.0;  // the largest finite half

// Whether x is neither infinite nor a NaN, by its bits: compilers may assume that no float is either.
bool is_finite_bits(float x) {
    return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u;
}

// Unit vector of a point of the octahedral map (Meyer et al. 2010), x and y in -1..1. The sum of the absolute components is
// 1 before normalisation, so its length is at least 1/sqrt(3): no division by zero.
vec3 octahedral_decode(vec2 p) {
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float fold = max(-n.z, 0.0);
    n.x += n.x >= 0.0 ? -fold : fold;
    n.y += n.y >= 0.0 ? -fold : fold;
    return normalize(n);
}

// Vertex.normal. Two 16-bit snorms: within 3 sqrt(2) / 65534 = 6.5e-5 radians of what was encoded.
vec3 decode_normal(uint packed) {
    return octahedral_decode(unpackSnorm2x16(packed));
}

// Vertex.tangent: direction, and the handedness (1 or -1) in w. The 15-bit y doubles that axis' error: within
// sqrt(42) / 65534 = 9.9e-5 radians.
vec4 decode_tangent(uint packed) {
    float x = unpackSnorm2x16(packed).x;
    // Bits 16..30, sign-extended.
    float y = clamp(float(int(packed << 1) >> 17) / 16383.0, -1.0, 1.0);
    return vec4(octahedral_decode(vec2(x, y)), (packed >> 31) != 0u ? -1.0 : 1.0);
}

// Linear RGBA colour of a vertex.
vec4 decode_color(uint rg, uint ba) {
    return vec4(unpackUnorm2x16(rg), unpackUnorm2x16(ba));
}

// A radiance that a half can hold: not negative, at most HALF_MAX, and 0 for a NaN.
float storable(float x) {
    bool nan = (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u;
    return nan ? 0.0 : clamp(x, 0.0, HALF_MAX);
}

// The same sample in another colour.
Shaded with_color(Shaded s, vec3 color) {
    s.color_rg = packHalf2x16(vec2(storable(color.r), storable(color.g)));
    s.color_b_offset = (packHalf2x16(vec2(storable(color.b), 0.0)) & 0xffffu) | (s.color_b_offset & 0xffff0000u);
    return s;
}

// `offset` is the position in the pixel, 0..1; `motion` in pixels. Halves are rounded as the driver's packHalf2x16 does it:
// within one unit in the last place.
Shaded pack_shaded(vec3 color, vec2 offset, vec2 motion, float depth) {
    uvec2 bytes = uvec2(clamp(offset, vec2(0.0), vec2(0.998046875)) * 256.0);
    vec2 moved = vec2(is_finite_bits(motion.x) ? motion.x : 0.0, is_finite_bits(motion.y) ? motion.y : 0.0);
    Shaded s;
    s.color_b_offset = bytes.x << 16 | bytes.y << 24;
    s = with_color(s, color);
    s.motion = packHalf2x16(clamp(moved, vec2(-HALF_MAX), vec2(HALF_MAX)));
    s.depth = depth;
    return s;
}

#endif
