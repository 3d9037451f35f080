// Temporal integration (Karis 2014; clamped to the variance around a pixel, as Patney et al. 2016 do), in scene-linear YCoCg.
// Twin: src/oracle/temporal.rs. No bindings.
//
// Every channel goes its own way, and everything that happens to the history of a pixel that stands still (clamping,
// blending, rounding) grows with it. So under a picture that does not change it moves in one direction until it rests: it
// never goes round in circles.

#ifndef STILLRAY_TEMPORAL
#define STILLRAY_TEMPORAL

#include "pack.glsl"

// A clamp this wide is none.
const float NO_CLAMP = 16.0;

// The inverse pair is exact but for rounding.
vec3 to_ycocg(vec3 c) {
    float outer = 0.25 * (c.r + c.b);
    return vec3(outer + 0.5 * c.g, 0.5 * (c.r - c.b), 0.5 * c.g - outer);
}

vec3 from_ycocg(vec3 c) {
    float outer = c.x - c.z;
    return vec3(outer + c.y, c.x + c.z, outer - c.y);
}

// --- The pixels around ---

// Sums over known pixels, of differences from the colour in the middle. The middle's own difference is 0, so that by Cauchy's
// inequality the variance is at least a ninth of the mean square: taking it as a difference loses no more than a few bits.
struct Around {
    vec3 sum;
    vec3 squares;
    float count;
};

void add_pixel(inout Around around, vec3 difference) {
    around.sum += difference;
    around.squares += difference * difference;
    around.count += 1.0;
}

// The history, at most `width` standard deviations from the mean of what is around `middle`.
vec3 clamp_to(Around around, vec3 middle, float width, vec3 past) {
    vec3 mean = around.sum / around.count;
    vec3 variance = max(around.squares / around.count - mean * mean, vec3(0.0));
    vec3 reach = width * sqrt(variance);
    return width < NO_CLAMP ? clamp(past, middle + mean - reach, middle + mean + reach) : past;
}

// --- Where the history is read ---

// Where in the last frame the middle of a pixel was. `precise`: whether that is in the frame decides alike everywhere.
vec2 followed_back(uvec2 pixel, uint motion) {
    precise vec2 from = vec2(pixel) + 0.5 - unpackHalf2x16(motion);
    return from;
}

bool is_in_frame(vec2 from, uvec2 size) {
    return all(greaterThanEqual(from, vec2(0.0))) && all(lessThanEqual(from, vec2(size)));
}

// Weights of the four pixels around a point that lies `f` (0..1) behind the middle of the second: Catmull-Rom's, or linear.
vec4 tap_weights(float f, bool cubic) {
    vec4 spline = vec4(
        f * (f * (1.0 - 0.5 * f) - 0.5),
        f * f * (1.5 * f - 2.5) + 1.0,
        f * (f * (2.0 - 1.5 * f) + 0.5),
        f * f * (0.5 * f - 0.5));
    return cubic ? spline : vec4(0.0, 1.0 - f, f, 0.0);
}

// --- Blending and storing ---

vec3 blend(vec3 past, vec3 now, float alpha) {
    // Two products and a sum, each of which grows with the past when it is rounded.
    precise vec3 mixed = (1.0 - alpha) * past + alpha * now;
    return mixed;
}

// To the nearest half, ties to even: drivers may round to either neighbour (packHalf2x16), and one that always rounds down
// would darken the history by up to 1 / alpha units in the last place.
float nearest_half(float x) {
    float magnitude = min(abs(x), HALF_MAX);
    // Below 2^-14 halves are multiples of 2^-24, as floats from 1/2 to 1 are.
    precise float small = (magnitude + 0.5) - 0.5;
    uint bits = floatBitsToUint(magnitude);
    bits = (bits + 0xfffu + (bits >> 13 & 1u)) & ~0x1fffu;
    float rounded = magnitude < 1.0 / 16384.0 ? small : uintBitsToFloat(bits);
    return x < 0.0 ? -rounded : rounded;
}

#ifdef FLOAT_HISTORY
#define STORED vec4

vec4 stored(vec3 c) {
    return vec4(c, 0.0);
}

vec3 restored(vec4 c) {
    return c.xyz;
}
#else
#define STORED uvec2

uvec2 stored(vec3 c) {
    return uvec2(
        packHalf2x16(vec2(nearest_half(c.x), nearest_half(c.y))), packHalf2x16(vec2(nearest_half(c.z), 0.0)));
}

vec3 restored(uvec2 c) {
    return vec3(unpackHalf2x16(c.x), unpackHalf2x16(c.y).x);
}
#endif

#endif
