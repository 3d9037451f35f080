// Light through fog and mist (paper 2, section 3.6): what is left of it on its way, and what is scattered. Twin:
// src/oracle/medium.rs. No bindings but, with MEDIUM_NOISE, `medium_noise`; no loops.

#ifndef STILLRAY_MEDIUM
#define STILLRAY_MEDIUM

#include "types.glsl"

const float MEDIUM_FAR = 1e30;                  // metres: what is farther is there
const float MEDIUM_SOURCE_MAX = 1e30;           // keeps sums finite; far above what a half holds
const float TRANSMITTANCE_LEAST = 0.000244140625;  // 2^-12: below it in all channels a march gathers no more

// Light that a metre takes away where the density is 1.
vec3 medium_extinction(Medium m) {
    return m.scattering + m.absorption;
}

// The part of it that is scattered.
vec3 medium_albedo(Medium m) {
    vec3 extinction = medium_extinction(m);
    bvec3 there = greaterThanEqual(extinction, vec3(SMALLEST_NORMAL));
    return mix(vec3(0.0), m.scattering / max(extinction, vec3(SMALLEST_NORMAL)), there);
}

// Optical depth. Nothing times infinity is nothing.
vec3 optical_depth(vec3 extinction, float metres) {
    return mix(vec3(0.0), extinction * metres, greaterThanEqual(extinction, vec3(SMALLEST_NORMAL)));
}

// 1 - exp(-x) for x >= 0, which does not cancel: the series is short of it by x^4 / 120 of itself.
vec3 opacity(vec3 x) {
    vec3 series = x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0))));
    return mix(1.0 - exp(-x), series, lessThan(x, vec3(0.0625)));
}

// Henyey and Greenstein's phase function, per steradian, of the cosine between where light goes and where it is scattered to.
float medium_phase(float g, float cosine) {
    float least = (1.0 - abs(g)) * (1.0 - abs(g));
    float base = max(1.0 + g * g - 2.0 * g * cosine, least);
    return 0.07957747 * (1.0 - g * g) / (base * sqrt(base));
}

// Mist without its noise: 1 in the middle of the box, 0 at its sides and beyond.
float base_density(Medium m, vec3 point) {
    vec3 x = (point - m.centre) / m.half_extent;
    vec3 f = max(1.0 - x * x, vec3(0.0));
    f *= f;
    return f.x * f.y * f.z;
}

// Where a ray enters and leaves a box, in lengths of its direction, from its origin on; empty if the first is not less.
vec2 box_interval(vec3 centre, vec3 extent, vec3 origin, vec3 direction) {
    vec3 guarded = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 a = (centre - extent - origin) / guarded;
    vec3 b = (centre + extent - origin) / guarded;
    vec3 low = min(a, b);
    vec3 high = max(a, b);
    return vec2(max(max(low.x, low.y), max(low.z, 0.0)), min(min(high.x, high.y), high.z));
}

// Metres of density 1 that are as much as the mist, without its noise, from a point on. Along a line the density is a polynomial
// of degree 12, which Gauss' rule of seven points integrates exactly.
float base_length(Medium m, vec3 origin, vec3 direction, float distance) {
    vec2 inside = box_interval(m.centre, m.half_extent, origin, direction);
    inside.y = min(inside.y, distance);
    if (!(inside.x < inside.y)) {
        return 0.0;
    }
    float reach = 0.5 * (inside.y - inside.x);
    vec3 middle = origin + direction * (inside.x + reach);
    vec3 p = direction * (reach * 0.40584515);
    vec3 q = direction * (reach * 0.74153119);
    vec3 r = direction * (reach * 0.94910791);
    float sum = 0.41795918 * base_density(m, middle);
    sum += 0.38183005 * (base_density(m, middle - p) + base_density(m, middle + p));
    sum += 0.27970539 * (base_density(m, middle - q) + base_density(m, middle + q));
    sum += 0.12948497 * (base_density(m, middle - r) + base_density(m, middle + r));
    return reach * sum;
}

// What is left of a light on its way to a point, which it reaches from a direction (a unit vector) and a distance. Fog takes
// nothing from infinity: see scene/medium.rs.
vec3 light_transmittance(Medium m, vec3 point, vec3 direction, float distance) {
    bool endless = floatBitsToUint(distance) == INFINITY_BITS;
    float metres = m.kind == MEDIUM_MIST ? base_length(m, point, direction, distance) : (endless ? 0.0 : distance);
    return exp(-optical_depth(medium_extinction(m), metres));
}

// Where a march is at a part of its way from `near` to `far`. Through fog steps take away the same part of the light each, so
// that they are short where it matters and the last may be endless; through mist they are as long as each other.
float march_depth(Medium m, float near, float far, float part) {
    if (m.kind == MEDIUM_MIST) {
        return near + (far - near) * part;
    }
    vec3 extinction = medium_extinction(m);
    float pace = (extinction.r + extinction.g + extinction.b) / 3.0;
    float depth = pace * far;
    if (depth < 0.01) {
        return far * part;
    }
    return min(-log(max(1.0 - part * (1.0 - exp(-depth)), 5.9604645e-8)) / pace, MEDIUM_FAR);
}

#ifdef MEDIUM_NOISE
vec3 noise_cell(uvec3 at) {
    uvec3 c = at % MEDIUM_NOISE_SIDE;
    uint first = 3u * ((c.z * MEDIUM_NOISE_SIDE + c.y) * MEDIUM_NOISE_SIDE + c.x);
    return vec3(medium_noise.data[first], medium_noise.data[first + 1u], medium_noise.data[first + 2u]);
}

vec3 noise_row(uvec3 at, float part) {
    return mix(noise_cell(at), noise_cell(at + uvec3(1u, 0u, 0u)), part);
}

// The noise vector field, interpolated, -1..1 along each axis.
vec3 noise_at(Medium m, vec3 point) {
    vec3 period = point * m.per_period + m.noise_origin;
    vec3 cell = (period - floor(period)) * float(MEDIUM_NOISE_SIDE);
    uvec3 low = uvec3(cell);
    vec3 part = cell - vec3(low);
    vec3 front = mix(noise_row(low, part.x), noise_row(low + uvec3(0u, 1u, 0u), part.x), part.y);
    vec3 back = mix(noise_row(low + uvec3(0u, 0u, 1u), part.x), noise_row(low + uvec3(0u, 1u, 1u), part.x), part.y);
    return mix(front, back, part.z);
}

// Density at a point, 0..1.
float medium_density(Medium m, vec3 point) {
    if (m.kind != MEDIUM_MIST) {
        return 1.0;
    }
    return m.amplitude > 0.0 ? base_density(m, point + m.amplitude * noise_at(m, point)) : base_density(m, point);
}
#endif

#endif
