// Triangles that shine, as lights (paper 2, section 3.2): points of them are drawn by what they emit at rest, and of these one by
// what it sends to where light is asked for (resampled importance sampling: Talbot, Cline and Egbert 2005). Needs the bindings
// environment_map, instances, corners and rest, with MOTION previous_corners. Twin: src/oracle/emitter.rs.

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
// Of what a draw sends: the sum of all is a float.
const float SENT_MAX = 1.0e36;
// From draw to draw on a triangle, in the square: the numbers of Roberts 2018, whose multiples are spread evenly.
const vec2 SPREAD = vec2(0.7548777, 0.5698403);

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

// A point of the table's row.
struct Shining {
    SurfacePoint point;
    vec2 weights;
    vec3 e1;  // edges, camera-relative
    vec3 e2;
};

Shining shining_point(uint row, vec2 at) {
    uint id = environment_map.data[row] & INSTANCE_MASK;
    uint p = environment_map.data[row + 1u];
    Shining s;
    s.weights = triangle_weights(at);
    vec3 a;
    vec3 b;
    vec3 c;
    unpack_corners(corners.data[2u * p], corners.data[2u * p + 1u], rest.data[p], a, b, c);
#ifdef MOTION
    shape_at(instances.data[id].flags, p - instances.data[id].triangle_base, frame_time, a, b, c);
#endif
    Placement place = placement_at(id, frame_time);
    s.point = surface_point(place, a, b, c, s.weights.x, s.weights.y);
    s.e1 = transform_direction(place.to_relative, b - a);
    s.e2 = transform_direction(place.to_relative, c - a);
    return s;
}

bool has_two_sides(uint row) {
    return (environment_map.data[row] & EMITTER_TWO_SIDED) != 0u;
}

// Both cosines over the square of the distance; 0 for what looks away.
float sent(SurfacePoint point, bool two_sides, SurfacePoint receiver) {
    precise vec3 towards = receiver.position - point.position;
    precise float square = dot_precise(towards, towards);
    precise float along = dot_precise(point.normal, towards);
    precise float got = abs(dot_precise(receiver.normal, towards)) / square;
    precise float part = (two_sides ? abs(along) : along) / square * got;
    return part > 0.0 ? min(part, SENT_MAX) : 0.0;
}

// Draw number k of a sample: all of them are spread evenly.
uint row_of(uint draw, uint k) {
    return drawn_emitter(draw + k * (0xffffffffu / frame.data.emitters));
}

vec2 place_of(vec2 at, uint k) {
    precise vec2 moved = at + float(k) * SPREAD;
    return moved - floor(moved);
}

// Which draw is taken for a point that it may light up, and how many times as much it counts for that.
uint taken_draw(vec2 at, uint draw, float pick, SurfacePoint receiver, out float counts) {
    float sum = 0.0;
    float taken = 0.0;
    uint number = 0u;
    for (uint k = 0u; k < frame.data.emitters; ++k) {
        uint row = row_of(draw, k);
        float part = sent(shining_point(row, place_of(at, k)).point, has_two_sides(row), receiver);
        if (!(part > 0.0)) {
            continue;
        }
        sum += part;
        precise float chance = part / sum;
        // What is left of the number is as random as it was.
        precise float less = chance < 1.0 ? (pick - chance) / (1.0 - chance) : pick;
        precise float more = pick / chance;
        bool takes = pick < chance;
        number = takes ? k : number;
        taken = takes ? part : taken;
        pick = takes ? more : less;
    }
    counts = taken > 0.0 ? sum / (float(frame.data.emitters) * taken) : 0.0;
    return number;
}

// What is drawn, for a point that it may light up. What has two sides shines towards the point. Rays end before the surface.
Emitter draw_emitter(Light light, vec2 at, uint draw, float pick, SurfacePoint receiver) {
    float counts = 1.0;
    uint k = frame.data.emitters > 1u ? taken_draw(at, draw, pick, receiver, counts) : 0u;
    uint row = row_of(draw, k);
    Shining s = shining_point(row, place_of(at, k));
    vec3 towards = receiver.position - s.point.position;
    bool turned = has_two_sides(row) && dot(s.point.normal, towards) < 0.0;
    light.position = offset_origin(s.point, towards);
    light.direction = turned ? -s.point.normal : s.point.normal;
    float one = uintBitsToFloat(environment_map.data[row + 4u]);
    light.intensity = vec3(min(area_of(s.e1, s.e2, one * counts), INTENSITY_MAX));
    return Emitter(light, environment_map.data[row + 1u], s.weights);
}

#endif
