// Triangles that shine, as lights (paper 2, section 3.2): one of all is drawn, by what it emits at rest, and a point of it. Needs
// the bindings environment_map, instances, corners and rest, with MOTION previous_corners. Twin: src/oracle/emitter.rs. No loops.

#ifndef STILLRAY_EMITTER
#define STILLRAY_EMITTER

#include "place.glsl"
#include "triangle.glsl"

// A point of a triangle, as a light whose intensity is what a radiance of 1 makes of it: the mean over all draws is all of them.
struct Emitter {
    Light light;
    uint primitive;
    vec2 weights;  // barycentric, of the second and third corner
};

// Far above what a half holds of light from a metre away.
const float INTENSITY_MAX = 3.0e38;

// The square onto a triangle, with areas kept and without a root (Heitz 2019, A Low-Distortion Map Between Triangle and Square).
vec2 triangle_weights(vec2 u) {
    return u.y > u.x ? vec2(0.5 * u.x, u.y - 0.5 * u.x) : vec2(u.x - 0.5 * u.y, 0.5 * u.y);
}

// Which of the table's rows is drawn, by Walker's alias method: first word of its row.
uint drawn_emitter(uint draw) {
    uint table = environment_map.data[EMITTER_TABLE];
    uint row;
    uint within;
    umulExtended(draw, environment_map.data[EMITTER_COUNT], row, within);
    uint first = table + EMITTER_WORDS * row;
    return within < environment_map.data[first + 2u] ? first : table + EMITTER_WORDS * environment_map.data[first + 3u];
}

// Half the cross product's length; sizes are divided out, for its square may not be a float.
float area_of(vec3 e1, vec3 e2, float radiance) {
    float size = max(largest_component(abs(e1)), largest_component(abs(e2)));
    if (!(size >= SMALLEST_NORMAL)) {
        return 0.0;
    }
    return radiance * (0.5 * length(cross(e1 / size, e2 / size))) * size * size;
}

// What is drawn, for a point that it may light up. What has two sides shines towards the point. Rays end before the surface.
Emitter draw_emitter(Light light, vec2 at, uint draw, vec3 receiver) {
    uint row = drawn_emitter(draw);
    uint bits = environment_map.data[row];
    uint id = bits & INSTANCE_MASK;
    Emitter result;
    result.primitive = environment_map.data[row + 1u];
    result.weights = triangle_weights(at);
    vec3 a;
    vec3 b;
    vec3 c;
    uint p = result.primitive;
    unpack_corners(corners.data[2u * p], corners.data[2u * p + 1u], rest.data[p], a, b, c);
#ifdef MOTION
    shape_at(instances.data[id].flags, p - instances.data[id].triangle_base, frame_time, a, b, c);
#endif
    Placement place = placement_at(id, frame_time);
    SurfacePoint point = surface_point(place, a, b, c, result.weights.x, result.weights.y);
    vec3 towards = receiver - point.position;
    bool turned = (bits & EMITTER_TWO_SIDED) != 0u && dot(point.normal, towards) < 0.0;
    light.position = offset_origin(point, towards);
    light.direction = turned ? -point.normal : point.normal;
    float one = uintBitsToFloat(environment_map.data[row + 4u]);
    light.intensity = vec3(min(area_of(transform_direction(place.to_relative, b - a), transform_direction(place.to_relative, c - a), one), INTENSITY_MAX));
    result.light = light;
    return result;
}

#endif
