#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 3: the average of the last frames, as many as there are since the last reset, each pixel for itself. Keeps the frames
// before this one, the youngest first.
//
// variant float: FLOAT_OUTPUT FLOAT_HISTORY
#include "filter.glsl"
#include "temporal.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Film { vec4 data[]; } film;
layout(set = 0, binding = 2, std430) buffer History { STORED data[]; } history;
#ifdef FLOAT_OUTPUT
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D color;
const float LARGEST = 3.4028234e38;
#else
layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D color;
const float LARGEST = 65504.0;
#endif
layout(push_constant) uniform Push {
    uint frames;  // that are averaged, this one included; at least 2
} push;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, frame.data.size))) {
        return;
    }
    uint index = pixel.y * frame.data.size.x + pixel.x;
    uint kept = push.frames - 1u;
    uint known = min(frame.data.frame, kept);
    vec3 now = film_mean(film.data[index]);
    vec3 sum = now;
    for (uint i = 0u; i < known; ++i) {
        sum += restored(history.data[index * kept + i]);
    }
    for (uint i = kept - 1u; i > 0u; --i) {
        history.data[index * kept + i] = history.data[index * kept + i - 1u];
    }
    history.data[index * kept] = stored(now);
    imageStore(color, ivec2(pixel), vec4(min(sum / float(known + 1u), vec3(LARGEST)), 1.0));
}
