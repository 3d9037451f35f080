#version 460
#extension GL_GOOGLE_include_directive : require
// Images besides colour, one thread a pixel:
//   depth    distance of the nearest visible sample in metres, infinity where there is none or only sky
//   motion   pixels moved since the last frame, of the pixel's sample that moved most (paper 1, section 4.4); 0 if unknown
//   density  samples evicted (red), added (green) and kept (blue): paper 1, figure 4
//   age      frames that the oldest sample has lived
//
// variant stable: STABLE
// variant age: STABLE AGE
#include "camera.glsl"
#include "filter.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 2, std430) readonly buffer ShadedBlock { Shaded data[]; } shaded;
layout(set = 0, binding = 3, r32f) uniform writeonly image2D depth;
layout(set = 0, binding = 4, rg32f) uniform writeonly image2D motion;
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D density;
layout(set = 0, binding = 6, r32f) uniform writeonly image2D age;
layout(set = 0, binding = 7, std430) readonly buffer Extras { uint data[]; } extras;
#ifdef STABLE
layout(set = 0, binding = 8, std430) readonly buffer Masks { uint data[]; } masks;
layout(set = 0, binding = 9, std430) readonly buffer Plan { uint data[]; } plan;
#endif
#ifdef AGE
layout(set = 0, binding = 10, std430) readonly buffer Ages { uint data[]; } ages;
#endif

#include "slots.glsl"

vec4 density_of(uint index, uint count) {
#ifdef STABLE
    uint decided = plan.data[index];
    uint evicted = (masks.data[index] >> 16) & ~decided;
    return vec4(bitCount(evicted), bitCount(decided >> 16), bitCount(decided & 0xffffu), 1.0);
#else
    return vec4(0.0, float(count), 0.0, 1.0);
#endif
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, frame.data.size))) {
        return;
    }
    uint index = pixel_index(uvec2(pixel), frame.data.size);
    float nearest = uintBitsToFloat(INFINITY_BITS);
    uint longest = MOTION_UNKNOWN;
    uint oldest = 0u;
    uint count = 0u;
    for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
        Shaded s = shaded.data[slots.at];
        ++count;
        if (s.depth < 0.0) {
            continue;  // not visible
        }
        nearest = min(nearest, s.depth);
        longest = longer_motion(longest, s.motion);
#ifdef AGE
        oldest = max(oldest, ages.data[slots.at]);
#endif
    }
    imageStore(depth, pixel, vec4(nearest));
    vec2 moved = longest == MOTION_UNKNOWN ? vec2(0.0) : unpackHalf2x16(longest);
    imageStore(motion, pixel, vec4(moved, 0.0, 0.0));
    imageStore(density, pixel, density_of(index, count));
    imageStore(age, pixel, vec4(float(oldest)));
}
