#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 4.3: where every sample of a pixel is occluded, one of them takes its occluder's hit, so that the
// pixel keeps a sample without another ray. One thread a pixel reads all of the pixel's outcomes: no race decides.
// The first occluded sample in list order is taken. While nothing has moved for two frames nothing is replaced, so that
// the picture comes to rest.
//
// models: DEFORM
#include "camera.glsl"
#include "triangle.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 2, std430) readonly buffer Corners { vec4 data[]; } corners;
layout(set = 0, binding = 3, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 4, std430) buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 5, std430) buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 6, std430) buffer CountersBlock { Counters data; } counters;
#ifdef DEFORM
layout(set = 0, binding = 7, std430) readonly buffer Instances { Instance data[]; } instances;
#endif

const uint NONE = 0xffffffffu;

// Counts of the workgroup: occluded, lost, replaced.
shared uint tally[3];

void replace(uint slot) {
    Found f = found.data[slot];
    f.instance &= INSTANCE_MASK;
#ifdef DEFORM
    if ((instances.data[f.instance].flags & INSTANCE_DEFORMS) != 0u) {
        float local = float(f.primitive - instances.data[f.instance].triangle_base);
        found.data[slot] = f;
        samples.data[slot] = Sample(vec3(local, f.u, f.v), f.instance);
        return;
    }
#endif
    vec3 a;
    vec3 b;
    vec3 c;
    unpack_corners(corners.data[2u * f.primitive], corners.data[2u * f.primitive + 1u], rest.data[f.primitive], a, b, c);
    found.data[slot] = f;
    samples.data[slot] = Sample(triangle_point(a, b, c, f.u, f.v), f.instance);
}

void settle(uint index) {
    uint end = offsets.data[index + 1u];
    uint first_occluded = NONE;
    bool any_visible = false;
    uint occluded = 0u;
    uint lost = 0u;
    for (uint slot = offsets.data[index]; slot < end; ++slot) {
        Found f = found.data[slot];
        bool is_lost = f.primitive == FOUND_LOST;
        bool is_occluded = !is_lost && (f.instance & OCCLUDED_BIT) != 0u;
        first_occluded = is_occluded && first_occluded == NONE ? slot : first_occluded;
        any_visible = any_visible || !(is_lost || is_occluded);
        occluded += uint(is_occluded);
        lost += uint(is_lost);
    }
    bool settled = (frame.data.flags & FRAME_SETTLED) != 0u;
    bool take = !any_visible && first_occluded != NONE && !settled;
    if (take) {
        replace(first_occluded);
    }
    atomicAdd(tally[0], occluded);
    atomicAdd(tally[1], lost);
    atomicAdd(tally[2], uint(take));
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    if (thread < 3u) {
        tally[thread] = 0u;
    }
    barrier();
    if (all(lessThan(gl_GlobalInvocationID.xy, frame.data.size))) {
        settle(pixel_index(gl_GlobalInvocationID.xy, frame.data.size));
    }
    barrier();
    if (thread == 0u) {
        atomicAdd(counters.data.occluded, tally[0]);
        atomicAdd(counters.data.lost, tally[1]);
        atomicAdd(counters.data.replaced, tally[2]);
    }
}
