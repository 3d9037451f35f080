#version 460
#extension GL_GOOGLE_include_directive : require
// Reconstruction with weights from Voronoi areas: the film of `reconstruct`, but for the weight of a sample, which is the
// Gaussian over those of the 4 x 4 subpixels of a pixel that lie nearest to it, instead of the Gaussian at its own position.
// A lone sample in a wide gap counts for the gap, and one of a crowd for its part of the crowd.
//
// A workgroup does this for its tile and a rim of one pixel: what each of these pixels contributes to each of the nine
// around. Then every thread adds up what reaches its pixel.
//
// For temporal integration also the motion that `reconstruct` would keep.
//
// variant motion: MOTION
#include "camera.glsl"
#include "cells.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 2, std430) readonly buffer ShadedBlock { Shaded data[]; } shaded;
layout(set = 0, binding = 3, std430) writeonly buffer Film { vec4 data[]; } film;
layout(set = 0, binding = 4, std430) readonly buffer Extras { uint data[]; } extras;
#ifdef MOTION
layout(set = 0, binding = 5, std430) writeonly buffer Motion { uint data[]; } motion;
#endif

#include "slots.glsl"

const int RIM = 10;  // pixels of a tile with its rim

// Of a pixel (x, y) to the pixel (x - 1 + i % 3, y - 1 + i / 3): colour times weight, and weight. 14,400 bytes, of the 16,384
// that every device has.
shared vec4 parts[RIM * RIM * 9];

void find_nearest(ivec2 pixel, inout Nearest nearest, int radius) {
    ivec2 low = max(pixel - radius, ivec2(0));
    ivec2 high = min(pixel + radius, ivec2(frame.data.size) - 1);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            uint index = pixel_index(uvec2(x, y), frame.data.size);
            for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
                consider(nearest, shaded.data[slots.at], slots.at, ivec2(x, y) - pixel);
            }
        }
    }
}

vec4 cell_color(uint slot) {
    return vec4(shaded_color(shaded.data[slot]), 1.0);
}

// Colours of four subpixels. The weight goes the way of a colour of 1, so that a picture that is 1 everywhere stays so.
mat4 row_colors(uvec4 slots) {
    return mat4(cell_color(slots.x), cell_color(slots.y), cell_color(slots.z), cell_color(slots.w));
}

void write_parts(int place, Nearest nearest) {
    mat4 rows[4] = mat4[4](row_colors(nearest.slot0), row_colors(nearest.slot1), row_colors(nearest.slot2),
        row_colors(nearest.slot3));
    // Seen from the pixel that is reconstructed, this one lies the other way.
    vec4 weights[3] = vec4[3](cell_weights(1, frame.data.filter_width), cell_weights(0, frame.data.filter_width),
        cell_weights(-1, frame.data.filter_width));
    for (int x = 0; x < 3; ++x) {
        vec4 across = weights[x];
        // Precise: the weight's factors of 1 are an invitation to add it up in another way than the colours.
        precise mat4 columns = mat4(rows[0] * across, rows[1] * across, rows[2] * across, rows[3] * across);
        for (int y = 0; y < 3; ++y) {
            precise vec4 part = columns * weights[y];
            parts[place * 9 + y * 3 + x] = part;
        }
    }
}

void prepare(int place, ivec2 pixel) {
    Nearest nearest = no_sample();
    bool inside = all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, ivec2(frame.data.size)));
    for (int radius = 1; inside && radius <= WIDEST_RADIUS && nearest.slot0.x == NO_SAMPLE; ++radius) {
        find_nearest(pixel, nearest, radius);
    }
    if (nearest.slot0.x != NO_SAMPLE) {
        write_parts(place, nearest);
        return;
    }
    for (int i = 0; i < 9; ++i) {
        parts[place * 9 + i] = vec4(0.0);
    }
}

// What reaches a pixel, at a place of the tile without its rim.
vec4 add_parts(ivec2 place) {
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 9; ++i) {
        ivec2 from = place + ivec2(i % 3, i / 3);
        sum += parts[(from.y * RIM + from.x) * 9 + 8 - i];
    }
    return sum;
}

#ifdef MOTION
// The longest known motion of the visible samples up to `radius` around a pixel, and whether there are any.
uint longest_motion(ivec2 pixel, int radius, out bool any_visible) {
    uint longest = MOTION_UNKNOWN;
    any_visible = false;
    ivec2 low = max(pixel - radius, ivec2(0));
    ivec2 high = min(pixel + radius, ivec2(frame.data.size) - 1);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            uint index = pixel_index(uvec2(x, y), frame.data.size);
            for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
                bool visible = shaded.data[slots.at].depth >= 0.0;
                any_visible = any_visible || visible;
                longest = longer_motion(longest, visible ? shaded.data[slots.at].motion : MOTION_UNKNOWN);
            }
        }
    }
    return longest;
}

// Of the pixel's own samples, or else of those in the smallest block around that has any.
uint motion_of(ivec2 pixel) {
    bool done;
    uint longest = longest_motion(pixel, 0, done);
    done = longest != MOTION_UNKNOWN;
    for (int radius = 1; radius <= WIDEST_RADIUS && !done; ++radius) {
        longest = longest_motion(pixel, radius, done);
    }
    return longest;
}
#endif

void main() {
    ivec2 corner = ivec2(gl_WorkGroupID.xy * 8u) - 1;
    for (int place = int(gl_LocalInvocationIndex); place < RIM * RIM; place += 64) {
        prepare(place, corner + ivec2(place % RIM, place / RIM));
    }
    barrier();
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (all(lessThan(pixel, frame.data.size))) {
        film.data[pixel.y * frame.data.size.x + pixel.x] = add_parts(ivec2(gl_LocalInvocationID.xy));
#ifdef MOTION
        motion.data[pixel.y * frame.data.size.x + pixel.x] = motion_of(ivec2(pixel));
#endif
    }
}
