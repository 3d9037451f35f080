#version 460
#extension GL_GOOGLE_include_directive : require
// Builds the dense ray list: the samples that each pixel keeps, and its new ones, in pixel order. Every entry is a ray
// to trace. A workgroup is a tile; its first entry comes from the prefix sum over tiles.
//
// models: AGE SOURCE SEED
#include "camera.glsl"
#include "analysis.glsl"
#include "seed.glsl"
#include "thin.glsl"
#include "tile_sum.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Claims { uint data[]; } claims;
layout(set = 0, binding = 2, std430) readonly buffer Masks { uint data[]; } masks;
layout(set = 0, binding = 3, std430) readonly buffer Plan { uint data[]; } plan;
layout(set = 0, binding = 4, std430) readonly buffer Tiles { uint data[]; } tiles;
layout(set = 0, binding = 5, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 6, std430) readonly buffer Previous { Sample data[]; } previous;
layout(set = 0, binding = 7, std430) writeonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 8, std430) writeonly buffer Offsets { uint data[]; } offsets;
#ifdef AGE
layout(set = 0, binding = 9, std430) readonly buffer PreviousAges { uint data[]; } previous_ages;
layout(set = 0, binding = 10, std430) writeonly buffer Ages { uint data[]; } ages;
#endif
#ifdef SOURCE
layout(set = 0, binding = 11, std430) writeonly buffer Sources { uint data[]; } sources;
#endif
#ifdef SEED
layout(set = 0, binding = 12, std430) readonly buffer PreviousSeeds { uint data[]; } previous_seeds;
layout(set = 0, binding = 13, std430) writeonly buffer Seeds { uint data[]; } seeds;
#endif

void write(uint slot, uvec2 pixel, uint index, uint subpixel, bool added, uint number) {
    if (added) {
        uint h = pixel_hash(pixel, frame.data.frame, ~frame.data.seed);
        samples.data[slot] = Sample(vec3(new_position(pixel, subpixel, h, frame.data.flags), 0.0), NEW_INSTANCE);
    } else {
        samples.data[slot] = previous.data[claims.data[claim_slot(index, subpixel, frame.data.flags)] & INSTANCE_MASK];
    }
#ifdef AGE
    uint age = added ? 0u : previous_ages.data[claims.data[claim_slot(index, subpixel, frame.data.flags)] & INSTANCE_MASK];
    ages.data[slot] = added ? 0u : min(age, 0xfffffffeu) + 1u;
#endif
#ifdef SOURCE
    sources.data[slot] = added ? NO_SOURCE : claims.data[claim_slot(index, subpixel, frame.data.flags)] & INSTANCE_MASK;
#endif
#ifdef SEED
    seeds.data[slot] = added ? new_seed(pixel, number & 15u)
        : previous_seeds.data[claims.data[claim_slot(index, subpixel, frame.data.flags)] & INSTANCE_MASK];
#endif
}

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    bool inside = all(lessThan(pixel, frame.data.size));
    uint index = inside ? pixel_index(pixel, frame.data.size) : 0u;
    uint decided = inside ? plan.data[index] : 0u;
    uint kept = decided & 0xffffu;
    uint visible = kept & (inside ? masks.data[index] >> 16 : 0u);
    uint count = uint(bitCount(decided));
    uint first = exclusive_sum(gl_LocalInvocationIndex, count);
    if (!inside) {
        return;
    }
    first += tiles.data[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x];
    uint slot = thinned(first, counters.data.thin);
    uint end = thinned(first + count, counters.data.thin);
    offsets.data[index] = slot;
    if (index + 1u == frame.data.size.x * frame.data.size.y) {
        offsets.data[index + 1u] = end;
    }
    // Where all fits, by subpixel. Else unoccluded first, then new, then occluded: what is thinned out is what matters least.
    uint urgent = counters.data.thin == 0u ? decided : visible | (decided & 0xffff0000u);
    uint rest = decided & ~urgent;
    uint number = uint(bitCount(visible));
    for (; slot < end; ++slot) {
        bool last = urgent == 0u;
        uint bit = uint(findLSB(last ? rest : urgent));
        urgent &= urgent - uint(!last);
        rest &= rest - uint(last);
        write(slot, pixel, index, bit & 15u, bit >= 16u, number);
        number += bit >> 4;
    }
}
