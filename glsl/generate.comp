#version 460
#extension GL_GOOGLE_include_directive : require
// Supersampling: writes the same number of new, stratified samples to every pixel.
//
// models: SEED
#include "camera.glsl"
#include "seed.glsl"
#include "stratify.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) writeonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 2, std430) writeonly buffer Offsets { uint data[]; } offsets;
#ifdef SEED
layout(set = 0, binding = 3, std430) writeonly buffer Seeds { uint data[]; } seeds;
#endif

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    uvec2 size = frame.data.size;
    if (any(greaterThanEqual(pixel, size))) {
        return;
    }
    uint index = pixel_index(pixel, size);
    uint first = index * frame.data.spp;
    vec2 shift = pixel_shift(pixel, frame.data.seed, frame.data.jitter);
    for (uint i = 0u; i < frame.data.spp; ++i) {
        samples.data[first + i] = Sample(vec3(stratified_position(pixel, i, shift), 0.0), NEW_INSTANCE);
#ifdef SEED
        seeds.data[first + i] = new_seed(pixel, i);
#endif
    }
    offsets.data[index] = first;
    if (index + 1u == size.x * size.y) {
        offsets.data[index + 1u] = first + frame.data.spp;
    }
}
