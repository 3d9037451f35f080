// Light from all around, as an equirectangular map: what it looks like, and directions drawn by how bright it is. The middle of
// the map lies along -Z and its upper edge along +Y, before it is turned about +Y. Needs the binding `environment_map`; its
// layout is told in types.glsl. Twin: src/oracle/environment.rs.

#ifndef STILLRAY_ENVIRONMENT
#define STILLRAY_ENVIRONMENT

#include "disc.glsl"
#include "types.glsl"

// What comes from a direction.
struct FromAfar {
    vec3 direction;   // unit vector
    vec3 irradiance;  // radiance over the density of directions: on a perpendicular surface, on average over all draws
};

bool has_environment_map() {
    return environment_map.data[0] != 0u;
}

float environment_float(uint at) {
    return uintBitsToFloat(environment_map.data[at]);
}

uint environment_row(uint row) {
    return ENVIRONMENT_HEADER + ENVIRONMENT_ROW * row;
}

// Where the texels of the map itself begin.
uint environment_texels(uvec2 size) {
    return environment_row(size.y + 1u) + size.y * (size.x + 1u);
}

vec3 environment_texel(uint texels, uint width, uvec2 at) {
    uint first = texels + 3u * (at.y * width + at.x);
    return vec3(environment_float(first), environment_float(first + 1u), environment_float(first + 2u));
}

// The texel in whose part of the chances a draw lies: a row by the draw's y, and a texel of it by its x. Chances before each,
// and its own. One loop for both searches: drivers unroll every one that they see.
uvec2 environment_find(uvec2 size, uvec2 draw, out uvec2 before, out uvec2 own) {
    uvec2 found = uvec2(0u);
    uint first = environment_row(0u) + 3u;
    uint stride = ENVIRONMENT_ROW;
    uint low = 0u;
    uint high = size.y;
    uint aim = draw.y;
    bool across = false;
    // Sides of 2^16 texels at most: 17 steps each.
    for (uint steps = 0u; steps < 40u; ++steps) {
        if (high - low > 1u) {
            uint middle = (low + high) / 2u;
            bool beyond = environment_map.data[first + stride * middle] <= aim;
            low = beyond ? middle : low;
            high = beyond ? high : middle;
            continue;
        }
        uint chance = environment_map.data[first + stride * low];
        uint share = environment_map.data[first + stride * (low + 1u)] - chance;
        if (across) {
            found.x = low;
            before.x = chance;
            own.x = share;
            break;
        }
        found.y = low;
        before.y = chance;
        own.y = share;
        first = environment_row(size.y + 1u) + low * (size.x + 1u);
        stride = 1u;
        low = 0u;
        high = size.x;
        aim = draw.x;
        across = true;
    }
    return found;
}

// A direction, drawn by how bright the map is there, for coordinates of 2^32 to one. Within a texel all directions are alike.
FromAfar environment_sample(uvec2 at) {
    uvec2 size = uvec2(environment_map.data[0], environment_map.data[1]);
    if (size.x == 0u) {
        return FromAfar(vec3(0.0, 1.0, 0.0), vec3(0.0));
    }
    uvec2 draw = at >> 1;
    uvec2 before;
    uvec2 own;
    uvec2 found = environment_find(size, draw, before, own);
    precise vec2 part = (vec2(draw - before) + 0.5) / vec2(own);
    uint upper = environment_row(found.y);
    uint lower = environment_row(found.y + 1u);
    // Two of them, so that neither pole is where a small number is the difference of large ones.
    float sin2 = environment_float(upper);
    float cos2 = environment_float(upper + 1u);
    precise float s = sin2 + (environment_float(lower) - sin2) * part.y;
    precise float c = cos2 + (environment_float(lower + 1u) - cos2) * part.y;
    precise float turn = (float(found.x) + part.x) / float(size.x) - 0.5 - environment_float(2u);
    precise float around = turn - floor(turn);
    vec2 v = turn_vector(around);
    precise float level = 2.0 * sqrt(s * c);
    precise vec3 direction = vec3(v.y * level, c - s, -v.x * level);
    // Solid angle over chance, one division at a time.
    float rare = environment_float(upper + 2u) / (float(own.y) / float(ENVIRONMENT_ONE)) / (float(own.x) / float(ENVIRONMENT_ONE));
    return FromAfar(direction, environment_texel(environment_texels(size), size.x, found) * rare);
}

// Which part of a full turn it is from the x axis to v, 0..1. Polynomials for the reason given at turn_vector: within 2^-21.
float turn_of(vec2 v) {
    float across = abs(v.x);
    float up = abs(v.y);
    float longer = max(across, up);
    if (!(longer > 0.0)) {
        return 0.0;
    }
    precise float slope = min(across, up) / longer;
    // Beyond half of an eighth of a turn, from there.
    bool far = slope > 0.41421356;
    precise float x = far ? (slope - 1.0) / (slope + 1.0) : slope;
    precise float x2 = x * x;
    precise float angle =
        x * (1.0 - x2 * (1.0 / 3.0 - x2 * (1.0 / 5.0 - x2 * (1.0 / 7.0 - x2 * (1.0 / 9.0 - x2 * (1.0 / 11.0))))));
    precise float turn = angle * 0.15915494309 + (far ? 0.125 : 0.0);
    precise float quarter = up > across ? 0.25 - turn : turn;
    precise float half_turn = v.x < 0.0 ? 0.5 - quarter : quarter;
    precise float whole = v.y < 0.0 ? 1.0 - half_turn : half_turn;
    return whole;
}

// A map of this size, whose texels begin there, in a direction of any length: interpolated between the middles of its texels.
vec3 environment_interpolated(vec3 direction, uvec2 size, uint texels) {
    precise float level = sqrt(direction.x * direction.x + direction.z * direction.z);
    precise float turn = turn_of(vec2(-direction.z, direction.x)) + 0.5 + environment_float(2u);
    precise float x = (turn - floor(turn)) * float(size.x) - 0.5;
    precise float y = 2.0 * turn_of(vec2(direction.y, level)) * float(size.y) - 0.5;
    vec2 low = floor(vec2(x, y));
    vec2 part = vec2(x, y) - low;
    uint left = uint(int(low.x) + int(size.x)) % size.x;
    uint right = (left + 1u) % size.x;
    uint top = uint(clamp(int(low.y), 0, int(size.y) - 1));
    uint bottom = uint(clamp(int(low.y) + 1, 0, int(size.y) - 1));
    vec3 above = mix(environment_texel(texels, size.x, uvec2(left, top)), environment_texel(texels, size.x, uvec2(right, top)), part.x);
    vec3 below =
        mix(environment_texel(texels, size.x, uvec2(left, bottom)), environment_texel(texels, size.x, uvec2(right, bottom)), part.x);
    return mix(above, below, part.y);
}

// What the map looks like.
vec3 environment_radiance(vec3 direction) {
    uvec2 size = uvec2(environment_map.data[0], environment_map.data[1]);
    return environment_interpolated(direction, size, environment_texels(size));
}

// What it looks like blurred: what stands in for all that a path would meet (paper 2, section 3.5).
vec3 environment_blurred(vec3 direction) {
    uvec2 size = uvec2(ENVIRONMENT_BLURRED_WIDTH, ENVIRONMENT_BLURRED_HEIGHT);
    return environment_interpolated(direction, size, environment_map.data[3]);
}

#endif
