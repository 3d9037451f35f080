#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 4.4: a 3 x 3 pixel truncated Gaussian over the shaded samples around each pixel.
// Writes weighted sums (rgb) and the sum of weights (a), in row order; `resolve` divides.
//
// For temporal integration also the motion of the sample that moved most (paper 1, section 4.4): of those in the pixel, and only
// where none is known there, of all that the filter reaches. To take the longest of all everywhere lets what moves fast carry
// away the history of what it passes by: on the hairball seen from an orbit, that makes a sixth more error.
//
// variant accumulate: ACCUMULATE
// variant motion: MOTION
#include "camera.glsl"
#include "filter.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 2, std430) readonly buffer ShadedBlock { Shaded data[]; } shaded;
#ifdef ACCUMULATE
layout(set = 0, binding = 3, std430) buffer Film { vec4 data[]; } film;
#else
layout(set = 0, binding = 3, std430) writeonly buffer Film { vec4 data[]; } film;
#endif
layout(set = 0, binding = 4, std430) readonly buffer Extras { uint data[]; } extras;
#ifdef MOTION
layout(set = 0, binding = 5, std430) writeonly buffer Motion { uint data[]; } motion;
#endif

#include "slots.glsl"

// The longest known motion in a pixel, and in the block.
struct Motions {
    uint inside;
    uint around;
};

// The block of pixels up to `radius` around, with the Gaussian as wide as the block.
vec4 gather_block(ivec2 pixel, int radius, inout Motions longest) {
    ivec2 low = max(pixel - radius, ivec2(0));
    ivec2 high = min(pixel + radius, ivec2(frame.data.size) - 1);
    vec4 sum = vec4(0.0);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            uint index = pixel_index(uvec2(x, y), frame.data.size);
            for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
                Shaded s = shaded.data[slots.at];
                sum += weighted_sample(s, vec2(ivec2(x, y) - pixel), radius, frame.data.filter_width);
#ifdef MOTION
                uint moved = s.depth < 0.0 ? MOTION_UNKNOWN : s.motion;
                longest.around = longer_motion(longest.around, moved);
                longest.inside = ivec2(x, y) == pixel ? longer_motion(longest.inside, moved) : longest.inside;
#endif
            }
        }
    }
    return sum;
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, frame.data.size))) {
        return;
    }
    vec4 sum = vec4(0.0);
    Motions longest = Motions(MOTION_UNKNOWN, MOTION_UNKNOWN);
    // Densities below 1/9 leave blocks empty: the filter widens until it finds a sample.
    for (int radius = 1; radius <= WIDEST_RADIUS && sum.a == 0.0; ++radius) {
        sum = gather_block(ivec2(pixel), radius, longest);
    }
    uint row_index = pixel.y * frame.data.size.x + pixel.x;
#ifdef ACCUMULATE
    sum += (frame.data.flags & FRAME_RESET) != 0u ? vec4(0.0) : film.data[row_index];
#endif
    film.data[row_index] = sum;
#ifdef MOTION
    motion.data[row_index] = longest.inside == MOTION_UNKNOWN ? longest.around : longest.inside;
#endif
}
