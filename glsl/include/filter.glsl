// The reconstruction filter. Twin: src/oracle/reconstruct.rs. No bindings.

#ifndef STILLRAY_FILTER
#define STILLRAY_FILTER

#include "types.glsl"

// The lowest density, 1/16, puts a sample into every 4 x 4 block of pixels, so radius 4 always finds one where the
// density holds; twice that is allowed before a pixel is left black.
const int WIDEST_RADIUS = 8;

// Position of a shaded sample in its pixel, in [0, 1).
vec2 shaded_offset(Shaded s) {
    uint bytes = s.color_b_offset >> 16;
    return (vec2(bytes & 255u, bytes >> 8) + 0.5) / 256.0;
}

vec3 shaded_color(Shaded s) {
    return vec3(unpackHalf2x16(s.color_rg), unpackHalf2x16(s.color_b_offset).x);
}

// The longer of two motions, as samples hold them: the first of equals, and an unknown one only if both are. Halves have 11
// bits, so that the squares are exact and the sum is rounded once: every device chooses alike.
uint longer_motion(uint first, uint second) {
    if (first == MOTION_UNKNOWN || second == MOTION_UNKNOWN) {
        return first == MOTION_UNKNOWN ? second : first;
    }
    vec2 a = unpackHalf2x16(first);
    vec2 b = unpackHalf2x16(second);
    precise float length_a = a.x * a.x + a.y * a.y;
    precise float length_b = b.x * b.x + b.y * b.y;
    return length_b > length_a ? second : first;
}

// The mean that an entry of the film stands for: scene-linear RGB; black where there is no sample.
vec3 film_mean(vec4 sum) {
    return sum.a > 0.0 ? sum.rgb / sum.a : vec3(0.0);
}

// Colour times weight, and the weight, of a sample in the pixel `away` from the one that is reconstructed. `deviation` is
// the filter's for the 3 x 3 block; wider blocks widen it.
vec4 weighted_sample(Shaded s, vec2 away, int radius, float deviation) {
    if (s.depth < 0.0) {
        return vec4(0.0);  // not visible
    }
    vec2 d = away + shaded_offset(s) - 0.5;
    float width = deviation * float(radius);
    float weight = exp(-dot(d, d) / (2.0 * width * width));
    return vec4(shaded_color(s) * weight, weight);
}

#endif
