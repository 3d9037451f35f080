#version 460
#extension GL_GOOGLE_include_directive : require
// After verification: which of a pixel's samples are visible, one thread a pixel. The masks say then what is so in this
// frame, where reprojection could only say what was so in the last one. A lost sample keeps its subpixel as if it were
// hidden: a surface ends there.
#include "camera.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 2, std430) readonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 3, std430) buffer Masks { uint data[]; } masks;
layout(set = 0, binding = 4, std430) buffer CountersBlock { Counters data; } counters;

// Counts of the workgroup: occluded, lost.
shared uint tally[2];

void look(uint index) {
    uint occupied = masks.data[index] & 0xffffu;
    uint visible = 0u;
    uint lost = 0u;
    uint slot = offsets.data[index];
    for (uint rest = occupied; rest != 0u; rest &= rest - 1u) {
        Found f = found.data[slot++];
        bool is_lost = f.primitive == FOUND_LOST;
        bool is_visible = !is_lost && (f.instance & OCCLUDED_BIT) == 0u;
        lost += uint(is_lost);
        visible |= is_visible ? rest & (~rest + 1u) : 0u;
    }
    masks.data[index] = occupied | (visible << 16);
    atomicAdd(tally[0], uint(bitCount(occupied & ~visible)) - lost);
    atomicAdd(tally[1], lost);
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    if (thread < 2u) {
        tally[thread] = 0u;
    }
    barrier();
    if (all(lessThan(gl_GlobalInvocationID.xy, frame.data.size))) {
        look(pixel_index(gl_GlobalInvocationID.xy, frame.data.size));
    }
    barrier();
    if (thread == 0u) {
        atomicAdd(counters.data.occluded, tally[0]);
        atomicAdd(counters.data.lost, tally[1]);
    }
}
