// From the unit square to discs and polygons. Twin: src/oracle/disc.rs, exact where the device takes roots exactly. No
// bindings, no loops.

#ifndef STILLRAY_DISC
#define STILLRAY_DISC

// The unit vector at a part of a full turn, 0..1. `precise` polynomials instead of the device's functions, whose error Vulkan
// bounds by 2^-11 only: lens points are computed in several kernels, and on several devices. Taylor series on an eighth of a
// turn to either side: within 2^-21 of the true vector.
vec2 turn_vector(float turn) {
    precise float quarters = floor(4.0 * turn + 0.5);
    precise float x = (4.0 * turn - quarters) * 1.57079632679;
    precise float x2 = x * x;
    precise float s = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 - x2 * (1.0 / 5040.0))));
    precise float c = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    uint q = uint(quarters) & 3u;
    vec2 v = (q & 1u) != 0u ? vec2(-s, c) : vec2(c, s);
    return q >= 2u ? -v : v;
}

// Uniform on the unit disc (paper 2, section 3.1).
vec2 disc_point(vec2 u) {
    precise vec2 p = turn_vector(u.x) * sqrt(u.y);
    return p;
}

// Uniform on the regular polygon with so many corners on the unit circle, one of them at the turn.
vec2 polygon_point(vec2 u, float corners, float turn) {
    precise float along = u.x * corners;
    float first = min(floor(along), corners - 1.0);
    precise float part = along - first;
    precise float t0 = first / corners + turn;
    precise float t1 = (first + 1.0) / corners + turn;
    vec2 a = turn_vector(t0 - floor(t0));
    vec2 b = turn_vector(t1 - floor(t1));
    precise vec2 p = (a + (b - a) * part) * sqrt(u.y);
    return p;
}

#endif
