#version 460
#extension GL_GOOGLE_include_directive : require
// Divides the film by its weights and writes the frame: scene-linear RGB with Rec. 709 primaries, alpha 1.
//
// variant float: FLOAT_OUTPUT
#include "filter.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Film { vec4 data[]; } film;
#ifdef FLOAT_OUTPUT
layout(set = 0, binding = 2, rgba32f) uniform writeonly image2D color;
const float LARGEST = 3.4028234e38;
#else
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2D color;
const float LARGEST = 65504.0;
#endif

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, frame.data.size))) {
        return;
    }
    vec4 sum = film.data[pixel.y * frame.data.size.x + pixel.x];
    imageStore(color, ivec2(pixel), vec4(min(film_mean(sum), vec3(LARGEST)), 1.0));
}
