#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 3, section 2: the one ray of each pixel. It goes towards the point that won the pixel, or anywhere in the pixel
// where none landed. What it hits is the new point: the old one "serves the sole purpose of directing new rays".
//
// Tracing towards a point gives that point but for rounding, and the next frame starts from there. While nothing moves
// such errors would add up and the picture would never rest: once it has settled, each pixel's ray is that of the last
// frame, to the bit.
//
// models: SEED LENS DEFORM MOTION
#include "track.glsl"
#include "analysis.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer Previous { Sample data[]; } previous;
layout(set = 0, binding = 3, std430) readonly buffer TrackedBlock { Tracked data[]; } tracked;
layout(set = 0, binding = 4, std430) buffer Aims { vec2 data[]; } aims;
layout(set = 0, binding = 5, std430) writeonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 6, std430) writeonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 7, std430) buffer CountersBlock { Counters data; } counters;
#if defined(SEED) || defined(LENS)
layout(set = 0, binding = 8, std430) writeonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 9, std430) readonly buffer PreviousSeeds { uint data[]; } previous_seeds;
#endif
#ifdef LENS
layout(set = 0, binding = 10, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef DEFORM
layout(set = 0, binding = 11, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 12, std430) readonly buffer Rest { float data[]; } rest;
#endif
#ifdef MOTION
layout(set = 0, binding = 13, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#include "place.glsl"

// Pixels with 0, 1, ... 16 and more points.
shared uint tally[17];

// Where the winner is in this frame.
vec2 position_of(uint point) {
    Sample s = previous.data[point];
#ifdef LENS
    uint seed = previous_seeds.data[point];
#ifdef MOTION
    frame_time = frame_time_of(seed);
#endif
#else
    const uint seed = 0u;
#endif
    vec2 where;
    place_within(eye_now(), seed, relative_position(s), is_surface(s), 1.0, where);
    return where;
}

#if defined(SEED) || defined(LENS)
// A point that is followed keeps its places on lens and lights.
uint seed_of(uvec2 pixel, uint index, Tracked t) {
    if ((frame.data.flags & FRAME_SETTLED) != 0u) {
        return previous_seeds.data[index];
    }
    return t.others + 1u != 0u ? previous_seeds.data[t.point] : new_seed(pixel, 0u);
}
#endif

void aim(uvec2 pixel) {
    uint index = pixel_index(pixel, frame.data.size);
    Tracked t = tracked.data[index];
    uint points = t.others + 1u;
    vec2 at = aims.data[index];
    if ((frame.data.flags & FRAME_SETTLED) == 0u) {
        uint h = pixel_hash(pixel, frame.data.frame, frame.data.seed);
        at = points != 0u ? position_of(t.point) : random_position(pixel, h);
        aims.data[index] = at;
    }
    samples.data[index] = Sample(vec3(at, 0.0), NEW_INSTANCE);
#if defined(SEED) || defined(LENS)
    seeds.data[index] = seed_of(pixel, index, t);
#endif
    offsets.data[index] = index;
    if (index + 1u == frame.data.size.x * frame.data.size.y) {
        offsets.data[index + 1u] = index + 1u;
    }
    atomicAdd(tally[min(points, 16u)], 1u);
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    if (thread < 17u) {
        tally[thread] = 0u;
    }
    barrier();
    if (all(lessThan(gl_GlobalInvocationID.xy, frame.data.size))) {
        aim(gl_GlobalInvocationID.xy);
    }
    barrier();
    if (thread < 17u && tally[thread] != 0u) {
        atomicAdd(counters.data.histogram[thread], tally[thread]);
        if (thread == 0u) {
            atomicAdd(counters.data.added, tally[0]);
        } else {
            atomicAdd(counters.data.reused, tally[thread]);
        }
    }
}
