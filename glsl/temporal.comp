#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 6: temporal integration. The last picture, read where a pixel was, is clamped to what this frame shows
// around the pixel, and blended with it. Writes the frame, and the picture for the next frame.
//
// There is no history after a reset, off the frame, and where motion is unknown. A pixel without any sample takes the mean of
// the pixels around, black if they have none either.
//
// variant float: FLOAT_OUTPUT
// variant precise: FLOAT_HISTORY
// variant precise_float: FLOAT_OUTPUT FLOAT_HISTORY
#include "filter.glsl"
#include "temporal.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Film { vec4 data[]; } film;
layout(set = 0, binding = 2, std430) readonly buffer Motion { uint data[]; } motion;
layout(set = 0, binding = 3, std430) readonly buffer Previous { STORED data[]; } previous;
layout(set = 0, binding = 4, std430) writeonly buffer History { STORED data[]; } history;
#ifdef FLOAT_OUTPUT
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D color;
const float LARGEST = 3.4028234e38;
#else
layout(set = 0, binding = 5, rgba16f) uniform writeonly image2D color;
const float LARGEST = 65504.0;
#endif
layout(push_constant) uniform Push {
    float alpha;        // weight of this frame
    float clamp_width;  // standard deviations
    uint cubic;         // 1: Catmull-Rom, 0: bilinear
} push;

uint row_index(ivec2 pixel) {
    return uint(pixel.y) * frame.data.size.x + uint(pixel.x);
}

Around look_around(ivec2 pixel, vec3 middle) {
    Around around = Around(vec3(0.0), vec3(0.0), 0.0);
    ivec2 low = max(pixel - 1, ivec2(0));
    ivec2 high = min(pixel + 1, ivec2(frame.data.size) - 1);
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            vec4 sum = film.data[row_index(ivec2(x, y))];
            if (sum.a > 0.0) {
                add_pixel(around, to_ycocg(film_mean(sum)) - middle);
            }
        }
    }
    return around;
}

// Never beyond the range of what is read, so that nothing grows from frame to frame.
vec3 read_history(vec2 from) {
    vec2 corner = from - 0.5;
    vec2 base = floor(corner);
    bool cubic = push.cubic != 0u;
    vec4 across = tap_weights(corner.x - base.x, cubic);
    vec4 down = tap_weights(corner.y - base.y, cubic);
    int first = cubic ? 0 : 1;
    int last = cubic ? 3 : 2;
    ivec2 edge = ivec2(frame.data.size) - 1;
    vec3 sum = vec3(0.0);
    vec3 low = vec3(HALF_MAX);
    vec3 high = vec3(-HALF_MAX);
    for (int j = first; j <= last; ++j) {
        for (int i = first; i <= last; ++i) {
            ivec2 tap = clamp(ivec2(base) + ivec2(i, j) - 1, ivec2(0), edge);
            vec3 read = restored(previous.data[row_index(tap)]);
            sum += across[i] * down[j] * read;
            low = min(low, read);
            high = max(high, read);
        }
    }
    return clamp(sum, low, high);
}

vec3 integrated(ivec2 pixel, vec3 now, Around around) {
    uint moved = motion.data[row_index(pixel)];
    if ((frame.data.flags & FRAME_RESET) != 0u || moved == MOTION_UNKNOWN) {
        return now;
    }
    vec2 from = followed_back(uvec2(pixel), moved);
    if (!is_in_frame(from, frame.data.size)) {
        return now;
    }
    return blend(clamp_to(around, now, push.clamp_width, read_history(from)), now, push.alpha);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, frame.data.size))) {
        return;
    }
    vec4 sum = film.data[row_index(pixel)];
    vec3 now = to_ycocg(film_mean(sum));
    Around around = look_around(pixel, now);
    vec3 result = vec3(0.0);
    if (sum.a > 0.0) {
        result = integrated(pixel, now, around);
    } else if (around.count > 0.0) {
        result = around.sum / around.count;
    }
    history.data[row_index(pixel)] = stored(result);
    imageStore(color, pixel, vec4(clamp(from_ycocg(result), vec3(0.0), vec3(LARGEST)), 1.0));
}
