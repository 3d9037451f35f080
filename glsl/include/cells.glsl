// Voronoi cells on the 4 x 4 subpixels of a pixel. Twin: src/oracle/voronoi.rs. No bindings.
//
// Positions are whole numbers of 1/512 of a pixel, in which both the middles of subpixels and the positions of shaded
// samples are exact: which sample is nearest is no matter of rounding.

#ifndef STILLRAY_CELLS
#define STILLRAY_CELLS

#include "filter.glsl"

const uint NO_SAMPLE = 0xffffffffu;

// Of the subpixels of a pixel, a vector a row: the nearest sample's slot, and its squared distance.
struct Nearest {
    uvec4 slot0;
    uvec4 slot1;
    uvec4 slot2;
    uvec4 slot3;
    ivec4 distance0;
    ivec4 distance1;
    ivec4 distance2;
    ivec4 distance3;
};

Nearest no_sample() {
    const uvec4 none = uvec4(NO_SAMPLE);
    const ivec4 far = ivec4(0x7fffffff);
    return Nearest(none, none, none, none, far, far, far, far);
}

// The first of equally near samples stays.
void consider_row(inout uvec4 slots, inout ivec4 distances, uint slot, ivec4 across, int down) {
    ivec4 distance = across + down * down;
    bvec4 nearer = lessThan(distance, distances);
    slots = mix(slots, uvec4(slot), nearer);
    distances = mix(distances, distance, nearer);
}

// A sample in the pixel `away` from the one whose subpixels are asked about.
void consider(inout Nearest n, Shaded s, uint slot, ivec2 away) {
    if (s.depth < 0.0) {
        return;  // not visible
    }
    uint bytes = s.color_b_offset >> 16;
    ivec2 at = away * 512 + ivec2(bytes & 255u, bytes >> 8) * 2 + 1;
    ivec4 across = ivec4(64, 192, 320, 448) - at.x;
    across *= across;
    consider_row(n.slot0, n.distance0, slot, across, 64 - at.y);
    consider_row(n.slot1, n.distance1, slot, across, 192 - at.y);
    consider_row(n.slot2, n.distance2, slot, across, 320 - at.y);
    consider_row(n.slot3, n.distance3, slot, across, 448 - at.y);
}

// The filter along one axis, at the middles of the four subpixels of the pixel `away` from the one that is reconstructed.
vec4 cell_weights(int away, float deviation) {
    vec4 d = vec4(-0.375, -0.125, 0.125, 0.375) + float(away);
    return exp(-d * d / (2.0 * deviation * deviation));
}

#endif
