// Sample positions of supersampling. Twin: src/oracle/generate.rs, exact. No bindings.

#ifndef STILLRAY_STRATIFY
#define STILLRAY_STRATIFY

#include "random.glsl"

// Each pixel shifts the pattern by a vector of its own, on the torus (Cranley and Patterson 1976): every sample is then
// uniform over the pixel, so that any number of them is unbiased, and they stay as far apart as they were.
vec2 pixel_shift(uvec2 pixel, uint seed, uint jitter) {
    uint h = hash_combine(hash_combine(hash_combine(seed, jitter), pixel.x), pixel.y);
    return vec2(unit_float(hash_uint(h)), unit_float(hash_uint(h + 1u)));
}

// The i-th of up to 16 positions: cells of a 4 x 4 grid in an order of which every first 4^k fill all the quarters.
vec2 stratified_position(uvec2 pixel, uint i, vec2 shift) {
    uint x = ((i & 1u) << 1) | ((i >> 2) & 1u);
    uint y = (((i ^ (i >> 1)) & 1u) << 1) | (((i >> 2) ^ (i >> 3)) & 1u);
    precise vec2 moved = vec2(x, y) * 0.25 + shift;
    precise vec2 position = vec2(pixel) + (moved - floor(moved));
    return position;
}

#endif
