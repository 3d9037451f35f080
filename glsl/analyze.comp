#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 4.2: one thread a pixel decides, from the masks of its neighbourhood alone, which samples to keep and
// where to add new ones. It also counts what its workgroup (a tile) lists, for the prefix sum that follows.
//
// With a fill, visibility is tested first and decided upon then. So the phase runs twice: before verification it keeps
// whatever was reprojected (`keep`), and after it, knowing what is visible, it decides, and counts what it adds (`fill`).
//
// variant keep: KEEP
// variant fill: FILL
#include "camera.glsl"
#include "analysis.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Masks { uint data[]; } masks;
layout(set = 0, binding = 2, std430) writeonly buffer Plan { uint data[]; } plan;
layout(set = 0, binding = 3, std430) writeonly buffer Tiles { uint data[]; } tiles;
layout(set = 0, binding = 4, std430) buffer CountersBlock { Counters data; } counters;

// Samples listed, reused, added, evicted; then the histogram.
shared uint tally[21];

#ifdef KEEP
void decide(uvec2 pixel) {
    uint index = pixel_index(pixel, frame.data.size);
    uint decided = masks.data[index] & 0xffffu;
    plan.data[index] = decided;
    atomicAdd(tally[0], uint(bitCount(decided)));
}
#else

uint neighbour(ivec2 pixel) {
    ivec2 size = ivec2(frame.data.size);
    bool inside = all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, size));
    return inside ? masks.data[pixel_index(uvec2(pixel), frame.data.size)] : 0u;
}

void decide(uvec2 pixel) {
    uint near[9];
    for (int i = 0; i < 9; ++i) {
        near[i] = neighbour(ivec2(pixel) + ivec2(i % 3 - 1, i / 3 - 1));
    }
    uint decided = near[4] & 0xffffu;
    if ((frame.data.flags & FRAME_SETTLED) == 0u) {
        uint h = pixel_hash(pixel, frame.data.frame, frame.data.seed);
        // A pixel that is due less than a sample cannot answer for itself.
        bool own = frame.data.d_target >= 1.0 && (frame.data.flags & FRAME_PAPER_EDGES) == 0u;
        bool edge = own && window_hides(near);
        uint word = edge ? balanced(near[4], hash_uint(~h)) : near[4];
        uint quarters = edge ? 4u : window_quarters(pixel, frame.data.size);
        uint count = edge ? uint(bitCount(word >> 16)) : window_count(near);
        float tolerance = edge ? 0.0 : frame.data.d_tolerance;
        int demand = sample_demand(count, quarters, frame.data.d_target, tolerance, pixel);
        decided = plan_pixel(word, demand, frame.data.occluded_limit, subpixel_bits(frame.data.flags), h);
    }
    plan.data[pixel_index(pixel, frame.data.size)] = decided;
#ifdef FILL
    atomicAdd(tally[0], uint(bitCount(decided >> 16)));
#else
    atomicAdd(tally[0], uint(bitCount(decided)));
#endif
    atomicAdd(tally[1], uint(bitCount(decided & 0xffffu)));
    atomicAdd(tally[2], uint(bitCount(decided >> 16)));
    atomicAdd(tally[3], uint(bitCount((near[4] >> 16) & ~decided)));
    atomicAdd(tally[4 + bitCount(near[4] >> 16)], 1u);
}
#endif

void main() {
    uint thread = gl_LocalInvocationIndex;
    if (thread < 21u) {
        tally[thread] = 0u;
    }
    barrier();
    if (all(lessThan(gl_GlobalInvocationID.xy, frame.data.size))) {
        decide(gl_GlobalInvocationID.xy);
    }
    barrier();
    if (thread == 0u) {
        tiles.data[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] = tally[0];
#ifndef KEEP
        atomicAdd(counters.data.reused, tally[1]);
        atomicAdd(counters.data.added, tally[2]);
        atomicAdd(counters.data.evicted, tally[3]);
#endif
    }
    if (thread < 17u && tally[4u + thread] != 0u) {
        atomicAdd(counters.data.histogram[thread], tally[4u + thread]);
    }
}
