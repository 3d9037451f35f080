#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 3, section 2: every hit point of the last frame is projected into this one, and the nearest to the camera wins a
// pixel. 64-bit atomics are optional in Vulkan, so that it takes two dispatches: the first finds the least distance and
// counts the points, the variant finds, among those at that distance, the first in the list. Minima and sums do not depend
// on the order of arrival.
//
// variant index: INDEX
// models: LENS DEFORM MOTION
#include "track.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 4, std430) buffer TrackedBlock { Tracked data[]; } tracked;
#ifdef LENS
layout(set = 0, binding = 5, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 6, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef DEFORM
layout(set = 0, binding = 7, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 8, std430) readonly buffer Rest { float data[]; } rest;
#endif
#ifdef MOTION
layout(set = 0, binding = 9, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#include "place.glsl"

void main() {
    uint i = dense_index();
    if (i >= counters.data.samples || (frame.data.flags & FRAME_RESET) != 0u) {
        return;
    }
    Sample s = samples.data[i];
    bool surface = is_surface(s);
    if (!surface && (s.instance & INSTANCE_MASK) != SKY_INSTANCE) {
        return;  // no point
    }
#ifdef LENS
    uint seed = seeds.data[i];
#else
    const uint seed = 0u;
#endif
#ifdef MOTION
    frame_time = frame_time_of(seed);
#endif
    vec3 relative = relative_position(s);
    vec2 where;
    if (!place_within(eye_now(), seed, relative, surface, 1.0, where)) {
        return;
    }
    uint index = pixel_index(pixel_of(where, frame.data.size), frame.data.size);
    uint key = distance_key(relative, surface);
#ifdef INDEX
    if (key == tracked.data[index].nearest) {
        atomicMin(tracked.data[index].point, i);
    }
#else
    atomicMin(tracked.data[index].nearest, key);
    atomicAdd(tracked.data[index].others, 1u);
#endif
}
