// Where a path goes on at a surface: into the lobe of what is reflected, or through it (paper 2, sections 3.3 and 3.5).
// Twin: src/oracle/shade/lobe.rs. No bindings, no loops.

#ifndef STILLRAY_LOBE
#define STILLRAY_LOBE

#include "brdf.glsl"
#include "disc.glsl"
#include "types.glsl"

// What of a surface decides where a path goes on.
struct Scatterer {
    Reflector reflector;
    float exponent;  // of Phong's lobe; 0: the lobe of the roughness
    float index;     // of refraction, relative: on the viewer's side over that behind; 0: a thin wall, the same on both
    float part;      // chance of a reflection where both are possible, 0..1; 0: the part of the light that is reflected
};

// A direction in which a path goes on.
struct Bounce {
    vec3 direction;  // unit vector
    vec3 weight;     // radiance to the viewer over that from the direction, on average over all draws; 0: nowhere
    bool through;    // behind the surface
};

// Two unit vectors that are perpendicular to a unit vector and each other (Duff et al. 2017).
void basis(vec3 n, out vec3 right, out vec3 up) {
    float side = n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (side + n.z);
    float b = n.x * n.y * a;
    right = vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    up = vec3(b, side + n.y * n.y * a, -n.y);
}

// A microfacet's normal as it is seen from a direction above the horizon, for a normal of +z (Heitz 2018, by the cap of
// Dupuy and Benyoub 2023). An alpha of 0 is a mirror.
vec3 visible_normal(vec3 view, float alpha, vec2 u) {
    vec3 stretched = normalize(vec3(view.xy * alpha, view.z));
    // 1 - z and 1 + z one by one, so that neither pole is where a small number is the difference of large ones.
    float below = u.y * (1.0 + stretched.z);
    float above = (1.0 - stretched.z) + (1.0 - u.y) * (1.0 + stretched.z);
    vec3 half_vector = vec3(turn_vector(u.x) * sqrt(max(below * above, 0.0)), 1.0 - below) + stretched;
    vec3 normal = vec3(half_vector.xy * alpha, max(half_vector.z, 0.0));
    float size = dot(normal, normal);
    return size > 1e-30 ? normal / sqrt(size) : vec3(0.0, 0.0, 1.0);
}

// Part of what visible microfacets send along one direction that is not in the shadow of others, for cosines above 0 (Smith,
// height-correlated: G2 / G1).
float unshadowed(float cosine_in, float cosine_out, float a2) {
    float root_in = sqrt(cosine_in * cosine_in * (1.0 - a2) + a2);
    float root_out = sqrt(cosine_out * cosine_out * (1.0 - a2) + a2);
    return cosine_out * (root_in + cosine_in) / max(root_in * cosine_out + root_out * cosine_in, SMALLEST_NORMAL);
}

// What single scattering loses is put back, as in reflect_uniform(), but for what the fit of the albedo may be off by: nothing
// reflects more than it gets.
vec3 lobe_gain(vec3 f0, float cosine, float roughness) {
    float lost = max(1.0 - ALBEDO_ERROR - lobe_albedo(cosine, roughness).x, 0.0);
    vec3 average = f0 + (1.0 - f0) * (1.0 / 21.0);
    return 1.0 + average * lost / (1.0 - average * lost);
}

// Reflectance at normal incidence between two indices of refraction.
float interface_reflectance(float index) {
    float r = (index - 1.0) / (index + 1.0);
    return r * r;
}

// exp(-x) and 1 - exp(-2 x), for x >= 0: the cosine and the squared sine of a direction whose cosine is a power.
vec2 power_cosine(float x) {
    float series = 2.0 * x * (1.0 - x * (1.0 - x * (2.0 / 3.0 - x * (1.0 / 3.0))));
    float decayed = exp(-x);
    return vec2(decayed, x < 0.015625 ? series : 1.0 - decayed * decayed);
}

// Around the mirrored direction, by its cosine to the power of the exponent (paper 2, section 3.3).
vec3 phong_direction(vec3 mirrored, float exponent, vec2 u) {
    vec3 right;
    vec3 up;
    basis(mirrored, right, up);
    vec2 lobe = power_cosine(-log(1.0 - u.y) / (exponent + 1.0));
    vec2 around = turn_vector(u.x) * sqrt(lobe.y);
    return normalize(right * around.x + up * around.y + mirrored * lobe.x);
}

// As reflect_light(), with Phong's lobe: what phong_direction() draws, weighted by Fresnel's factor at the normal.
Reflected phong_light(Reflector r, float exponent, vec3 normal, vec3 view, vec3 light) {
    float nl = min(dot(normal, light), 1.0);
    if (!(nl > 0.0)) {
        return Reflected(vec3(0.0), vec3(0.0));
    }
    float nv = clamp(dot(normal, view), COSINE_MIN, 1.0);
    vec3 f0 = specular_color(r);
    vec3 fresnel = f0 + (1.0 - f0) * fifth_power(1.0 - nv);
    vec3 off = 2.0 * nv * normal - view - light;
    float x = 0.5 * dot(off, off);  // one less the cosine
    float decay = x < 0.015625 ? x * (1.0 + x * (0.5 + x * (1.0 / 3.0))) : -log(max(1.0 - x, SMALLEST_NORMAL));
    float lobe = x < 1.0 ? exp(-exponent * decay) * (exponent + 1.0) / (2.0 * PI) : 0.0;
    return Reflected(diffuse_color(r) * (1.0 - fresnel) * (nl / PI), fresnel * lobe);
}

// As reflect_uniform(), with Phong's lobe.
Reflected phong_uniform(Reflector r, vec3 normal, vec3 view) {
    vec3 f0 = specular_color(r);
    vec3 fresnel = f0 + (1.0 - f0) * fifth_power(1.0 - clamp(dot(normal, view), COSINE_MIN, 1.0));
    return Reflected(diffuse_color(r) * (1.0 - fresnel), fresnel);
}

// What is reflected over what goes on at all, but for a twentieth of the paths at least: light may come from either side.
float reflected_part(vec3 fresnel, vec3 passing) {
    float reflected = max(fresnel.r, max(fresnel.g, fresnel.b));
    float passes = max(passing.r, max(passing.g, passing.b));
    return clamp(reflected / max(reflected + passes, SMALLEST_NORMAL), 0.05, 0.95);
}

// Where the path goes on. `normal` is the shading normal and `geometric` the surface's, both unit and on the viewer's side;
// `u` draws within the lobe, `which` between reflection and refraction, all 0..1. Radiance is not scaled by the square of the
// index: light from lights is not refracted on its way either.
Bounce scatter(Scatterer s, vec3 normal, vec3 geometric, vec3 view, vec2 u, float which) {
    Bounce nowhere = Bounce(geometric, vec3(0.0), false);
    vec3 right;
    vec3 up;
    basis(normal, right, up);
    vec3 from = normalize(vec3(dot(right, view), dot(up, view), max(dot(normal, view), COSINE_MIN)));
    float alpha = s.reflector.roughness * s.reflector.roughness;
    bool phong = s.exponent > 0.0;
    vec3 facet = phong ? vec3(0.0, 0.0, 1.0) : visible_normal(from, alpha, u);
    float cosine = clamp(dot(from, facet), 0.0, 1.0);

    // Schlick's approximation goes by the larger of the two angles; beyond the critical one all is reflected.
    float through = (1.0 - s.reflector.opaque) * (1.0 - s.reflector.metallic);
    bool solid = s.index > 0.0;
    float behind2 = 1.0 - (solid ? s.index * s.index : 1.0) * (1.0 - cosine * cosine);
    float behind = sqrt(max(behind2, 0.0));
    vec3 f0 = specular_color(s.reflector);
    if (through > 0.0 && solid) {
        f0 = mix(vec3(interface_reflectance(s.index)), s.reflector.base_color, s.reflector.metallic);
    }
    float grazing = through > 0.0 && solid && s.index > 1.0 ? behind : cosine;
    vec3 fresnel = f0 + (1.0 - f0) * fifth_power(1.0 - grazing);
    bool total = through > 0.0 && behind2 <= 0.0;
    bool both_ways = through > 0.0 && !total;
    vec3 to;
    vec3 weight = total ? vec3(1.0) : fresnel;
    vec3 passing = (1.0 - fresnel) * s.reflector.base_color * through;
    float part = s.part > 0.0 ? s.part : reflected_part(fresnel, passing);
    bool passes = both_ways && which >= part;
    if (passes) {
        vec3 straight = reflect(-from, facet) * vec3(1.0, 1.0, -1.0);
        to = solid ? facet * (s.index * cosine - behind) - from * s.index : straight;
        weight = passing / (1.0 - part);
    } else if (phong) {
        vec3 mirrored = vec3(-from.xy, from.z);
        to = phong_direction(mirrored, s.exponent, u);
        weight = weight / (both_ways ? part : 1.0);
    } else {
        to = 2.0 * cosine * facet - from;
        weight = weight * lobe_gain(f0, from.z, s.reflector.roughness) / (both_ways ? part : 1.0);
    }
    vec3 direction = normalize(right * to.x + up * to.y + normal * to.z);
    float side = passes ? -1.0 : 1.0;
    // What would leave on the wrong side of the surface is lost.
    if (!(to.z * side > 0.0) || !(dot(direction, geometric) * side > 0.0)) {
        return nowhere;
    }
    float lit = phong ? 1.0 : unshadowed(from.z, min(to.z * side, 1.0), alpha * alpha);
    return Bounce(direction, weight * lit, passes);
}

#endif
