// Directions above a surface. Twin: src/oracle/indirect.rs. No bindings, no loops.

#ifndef STILLRAY_HEMISPHERE
#define STILLRAY_HEMISPHERE

#include "disc.glsl"
#include "lobe.glsl"

// Around a shading normal, by the cosine to it (Malley's method). What would go below the surface, whose normal is another, is
// mirrored to above it, so that none is lost and a surface in even light is as bright as its albedo. Unit vectors; u in [0, 1).
vec3 diffuse_direction(vec3 normal, vec3 geometric, vec2 u) {
    vec3 right;
    vec3 up;
    basis(normal, right, up);
    vec2 across = turn_vector(u.x) * sqrt(u.y);
    vec3 direction = normalize(right * across.x + up * across.y + normal * sqrt(1.0 - u.y));
    float below = min(dot(direction, geometric), 0.0);
    return normalize(direction - 2.0 * below * geometric);
}

#endif
