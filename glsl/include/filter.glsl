// The reconstruction filter. Twin: src/oracle/reconstruct.rs. No bindings.

#ifndef STILLRAY_FILTER
#define STILLRAY_FILTER

#include "types.glsl"

// The lowest density, 1/16, puts a sample into every 4 x 4 block of pixels, so radius 4 always finds one where the
// density holds; twice that is allowed before a pixel is left black.
const int WIDEST_RADIUS = 8;

// Standard deviation in pixels for the 3 x 3 block (radius 1): the block's edge is three deviations from the centre.
const float FILTER_SIGMA = 0.5;

// Position of a shaded sample in its pixel, in [0, 1).
vec2 shaded_offset(Shaded s) {
    uint bytes = s.color_b_offset >> 16;
    return (vec2(bytes & 255u, bytes >> 8) + 0.5) / 256.0;
}

vec3 shaded_color(Shaded s) {
    return vec3(unpackHalf2x16(s.color_rg), unpackHalf2x16(s.color_b_offset).x);
}

// Colour times weight, and the weight, of a sample in the pixel `away` from the one that is reconstructed.
vec4 weighted_sample(Shaded s, vec2 away, int radius) {
    if (s.depth < 0.0) {
        return vec4(0.0);  // not visible
    }
    vec2 d = away + shaded_offset(s) - 0.5;
    float width = FILTER_SIGMA * float(radius);
    float weight = exp(-dot(d, d) / (2.0 * width * width));
    return vec4(shaded_color(s) * weight, weight);
}

#endif
