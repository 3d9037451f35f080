#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 4.1: each cached sample claims the subpixel that it projects to. Where several land on one subpixel
// the smallest claim wins: unoccluded before occluded, then the older index. The minimum does not depend on the order of
// arrival, which is Algorithm 1's outcome without its race.
#include "camera.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 4, std430) buffer Claims { uint data[]; } claims;
layout(set = 0, binding = 5, std430) buffer Masks { uint data[]; } masks;

void main() {
    uint i = dense_index();
    if (i >= counters.data.samples || (frame.data.flags & FRAME_RESET) != 0u) {
        return;
    }
    Sample s = samples.data[i];
    uint id = s.instance & INSTANCE_MASK;
    vec3 relative = s.position;
    if (id < frame.data.instance_count) {
        relative = transform_point(instances.data[id].to_relative, s.position);
    } else if (id != SKY_INSTANCE) {
        return;  // lost
    }
    vec2 where;
    if (!project(frame.data.right, frame.data.up, frame.data.forward.xyz, frame.data.size, relative, where)) {
        return;
    }
    uvec2 pixel = pixel_of(where, frame.data.size);
    uint flags = frame.data.flags;
    uint subpixel = subpixel_bit(subpixel_of(where, pixel), flags);
    uint index = pixel_index(pixel, frame.data.size);
    uint occluded = s.instance & OCCLUDED_BIT;
    atomicMin(claims.data[claim_slot(index, subpixel, flags)], occluded | i);
    atomicOr(masks.data[index], (occluded == 0u ? 0x10001u : 1u) << subpixel);
}
