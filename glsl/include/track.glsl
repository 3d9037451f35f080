// Point tracking (paper 3). Twin: src/oracle/track.rs. No bindings.

#ifndef STILLRAY_TRACK
#define STILLRAY_TRACK

#include "camera.glsl"
#include "random.glsl"

// Orders camera-relative points by their distance: bits of a positive float compare as the float does. The sky is at
// infinity. (Points whose squared distance is no float tie, as if they were equally far.)
uint distance_key(vec3 relative, bool surface) {
    return surface ? floatBitsToUint(dot_precise(relative, relative)) : INFINITY_BITS;
}

// Where the ray of a pixel goes that no point is projected to: anywhere in the pixel.
vec2 random_position(uvec2 pixel, uint h) {
    precise vec2 position = vec2(pixel) + vec2(unit_float(h), unit_float(hash_uint(h)));
    return position;
}

#endif
