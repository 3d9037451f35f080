#version 460
#extension GL_GOOGLE_include_directive : require
// The fill: lists the samples that the analysis adds, behind those that were verified, and forgets those that it evicts.
// A workgroup is a tile; its first entry comes from the prefix sum over tiles.
//
// models: AGE SOURCE SEED
#include "camera.glsl"
#include "analysis.glsl"
#include "seed.glsl"
#include "thin.glsl"
#include "tile_sum.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Masks { uint data[]; } masks;
layout(set = 0, binding = 2, std430) readonly buffer Plan { uint data[]; } plan;
layout(set = 0, binding = 3, std430) readonly buffer Tiles { uint data[]; } tiles;
layout(set = 0, binding = 4, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 5, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 6, std430) writeonly buffer Extras { uint data[]; } extras;
layout(set = 0, binding = 7, std430) buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 8, std430) buffer FoundBlock { Found data[]; } found;
#ifdef AGE
layout(set = 0, binding = 9, std430) writeonly buffer Ages { uint data[]; } ages;
#endif
#ifdef SOURCE
layout(set = 0, binding = 10, std430) writeonly buffer Sources { uint data[]; } sources;
#endif
#ifdef SEED
layout(set = 0, binding = 11, std430) writeonly buffer Seeds { uint data[]; } seeds;
#endif

// Slots of a pixel are in the order of its subpixels.
void forget(uint index, uint kept) {
    uint occupied = masks.data[index] & 0xffffu;
    for (uint rest = occupied & ~kept; rest != 0u; rest &= rest - 1u) {
        uint below = (rest & (~rest + 1u)) - 1u;
        uint slot = offsets.data[index] + uint(bitCount(occupied & below));
        found.data[slot].primitive = FOUND_LOST;
        samples.data[slot].instance = NEW_INSTANCE;
    }
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    bool inside = all(lessThan(pixel, frame.data.size));
    uint index = inside ? pixel_index(pixel, frame.data.size) : 0u;
    uint decided = inside ? plan.data[index] : 0u;
    uint added = decided >> 16;
    uint first = exclusive_sum(gl_LocalInvocationIndex, uint(bitCount(added)));
    if (!inside) {
        return;
    }
    forget(index, decided & 0xffffu);
    first += tiles.data[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x];
    uint slot = counters.data.first + thinned(first, counters.data.thin);
    uint end = counters.data.first + thinned(first + uint(bitCount(added)), counters.data.thin);
    extras.data[index] = slot;
    if (index + 1u == frame.data.size.x * frame.data.size.y) {
        extras.data[index + 1u] = end;
    }
    uint h = pixel_hash(pixel, frame.data.frame, ~frame.data.seed);
    uint number = uint(bitCount(decided & masks.data[index] >> 16));
    for (; slot < end; ++slot) {
        samples.data[slot] = Sample(vec3(new_position(pixel, uint(findLSB(added)), h, frame.data.flags), 0.0), NEW_INSTANCE);
        added &= added - 1u;
#ifdef AGE
        ages.data[slot] = 0u;
#endif
#ifdef SOURCE
        sources.data[slot] = NO_SOURCE;
#endif
#ifdef SEED
        seeds.data[slot] = new_seed(pixel, number++ & 15u);
#endif
    }
}
