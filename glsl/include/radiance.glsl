// The radiance of what a ray has found, from light that comes straight from lights. Needs the bindings frame, instances, corners, rest,
// triangles, vertices, materials, atlas, srgb and lights, with AREA or ENVIRONMENT also sampler_table, with ENVIRONMENT
// environment_map, with MEDIUM medium, with MOTION previous_corners. Twin: src/oracle/shade/kernel.rs.

#ifndef STILLRAY_RADIANCE
#define STILLRAY_RADIANCE

#include "brdf.glsl"
#include "choice.glsl"
#ifdef EMITTER
#include "emitter.glsl"
#endif
#ifdef ENVIRONMENT
#include "environment.glsl"
#endif
#include "light.glsl"
#ifdef PATH
#include "lobe.glsl"
#endif
#include "material.glsl"
#ifdef MEDIUM
#include "medium.glsl"
#endif
#include "place.glsl"
#include "triangle.glsl"

// A point of a surface, seen from somewhere.
struct Seen {
    SurfacePoint point;
    Surface surface;
    vec3 view;      // unit vector to the viewer
    uint material;
};

SurfacePoint point_of(Found f, Instance inst, Placement at) {
    vec3 a;
    vec3 b;
    vec3 c;
    uint p = f.primitive;
    unpack_corners(corners.data[2u * p], corners.data[2u * p + 1u], rest.data[p], a, b, c);
#ifdef MOTION
    shape_at(inst.flags, p - inst.triangle_base, frame_time, a, b, c);
#endif
    return surface_point(at, a, b, c, f.u, f.v);
}

// What was found, from a viewer at a camera-relative point.
Seen seen_from(vec3 viewer, Found f) {
    Instance inst = instances.data[f.instance];
    Triangle corner = triangles.data[f.primitive];
    Seen seen;
    seen.material = corner.material;
    Placement at = placement_at(f.instance, frame_time);
    seen.point = point_of(f, inst, at);
#ifdef MOTION
    inst.to_relative = at.to_relative;
    inst.to_object = at.to_object;
    inst.flags = at.flags;
#endif
    seen.view = unit_or(viewer - seen.point.position, seen.point.normal);
    seen.surface = surface_at(materials.data[corner.material], inst, vertices.data[corner.vertex0],
        vertices.data[corner.vertex1], vertices.data[corner.vertex2], f.u, f.v, seen.point.normal, seen.view);
    return seen;
}

Reflected from_light(Seen seen, vec3 light) {
#ifdef PATH
    if (seen.surface.exponent > 0.0) {
        return phong_light(seen.surface.reflector, seen.surface.exponent, seen.surface.normal, seen.view, light);
    }
#endif
    return reflect_light(seen.surface.reflector, seen.surface.normal, seen.view, light);
}

Reflected from_everywhere(Seen seen) {
#ifdef PATH
    if (seen.surface.exponent > 0.0) {
        return phong_uniform(seen.surface.reflector, seen.surface.normal, seen.view);
    }
#endif
    return reflect_uniform(seen.surface.reflector, seen.surface.normal, seen.view);
}

// What a part of the reflected light counts for where a ray brings what the lobe reflects of the surroundings.
vec3 but_for_rays(Reflected part, bool rays) {
    return rays ? part.diffuse : both(part);
}

// What comes from nowhere in particular: light from all around, in a direction of any length.
vec3 sky_radiance(vec3 direction) {
    vec3 radiance = frame.data.environment.rgb;
#ifdef ENVIRONMENT
    if (has_environment_map()) {
        radiance += environment_radiance(direction);
    }
#endif
    return radiance;
}

#ifdef MEDIUM
// What fog and mist leave of a light on its way to a point.
vec3 left_of_light(vec3 point, vec3 direction, float distance) {
    return medium.data.kind == MEDIUM_NONE ? vec3(1.0) : light_transmittance(medium.data, point, direction, distance);
}
#endif

#ifdef PATH
// What stands in for what lies there, where a path ends: light from all around, blurred, for one ray says little of it and a sun in
// it would sparkle.
vec3 beyond_radiance(vec3 direction) {
    vec3 radiance = frame.data.environment.rgb;
#ifdef ENVIRONMENT
    if (has_environment_map()) {
        radiance += environment_blurred(direction);
    }
#endif
    return radiance;
}
#endif

// What shines by itself. Where that is sampled as a light, a diffuse path brings it only by way of a reflection: where light was
// scattered a shadow ray has asked for it, straight through what transmits.
vec3 emission(Surface s) {
#if defined(EMITTER) && defined(DIFFUSE) && !defined(AT_CAMERA)
    bool is_light = frame.data.emitters > 0u;
    return is_light && !path_mirrored ? vec3(0.0) : s.emissive;
#else
    return s.emissive;
#endif
}

#ifdef EMITTER
// The sample's point of what shines. A ray that the lobe is followed by finds what shines by itself.
Light emitter_light(Light light, uint seed, vec2 at, SurfacePoint receiver) {
    Emitter e = draw_emitter(light, at, seed_bits(seed, PAIR_CHOICE).y, seed_pair(seed, PAIR_EMITTER).x, receiver);
    Triangle t = triangles.data[e.primitive];
    Attributes there = attributes_at(vertices.data[t.vertex0], vertices.data[t.vertex1], vertices.data[t.vertex2], e.weights.x, e.weights.y);
    e.light.intensity = min(emission_at(materials.data[t.material], there) * e.light.intensity, vec3(INTENSITY_MAX));
    return e.light;
}
#endif

// Towards the viewer; `lit_bits` are the lights that reach it, `rays` says that its lobe is followed by a ray, `diffuse` that
// what it scatters of the surroundings is.
vec3 radiance_of(Seen seen, uint seed, uint lit_bits, bool rays, bool diffuse) {
    Surface s = seen.surface;
    if (s.unlit) {
        return s.reflector.base_color;
    }
    Reflected everywhere = from_everywhere(seen);
    everywhere.diffuse = diffuse ? vec3(0.0) : everywhere.diffuse;
    vec3 ambient = but_for_rays(everywhere, rays);
    vec3 radiance = emission(s) + ambient * frame.data.environment.rgb * s.occlusion;
    float weight = light_weight(frame.data.light_count, frame.data.shadow_rays);
#ifdef AREA
    vec2 at = seed_pair(seed, PAIR_LIGHT);
#endif
    for (uint i = 0u; i < frame.data.light_count; ++i) {
        if ((lit_bits >> i & 1u) != 0u) {
            Light light = lights.data[i];
#ifdef MOTION
            light = light_at_time(light, frame_time);
#endif
#ifdef AREA
            light = light_point(light, at);
#endif
#ifdef EMITTER
            bool shines = light.shape == LIGHT_MESH;
            if (shines) {
                light = emitter_light(light, seed, at, seen.point);
            }
#else
            const bool shines = false;
#endif
            Incident incident = light_at(light, seen.point.position);
#ifdef MEDIUM
            incident.irradiance *= left_of_light(seen.point.position, incident.direction, incident.distance);
#endif
            vec3 part = but_for_rays(from_light(seen, incident.direction), rays && shines);
            radiance += part * (incident.irradiance * weight);
        }
    }
#ifdef ENVIRONMENT
    if (has_environment_map() && (lit_bits >> ENVIRONMENT_LIGHT & 1u) != 0u) {
        FromAfar sky = environment_sample(seed_bits(seed, PAIR_ENVIRONMENT));
#ifdef MEDIUM
        sky.irradiance *= left_of_light(seen.point.position, sky.direction, uintBitsToFloat(INFINITY_BITS));
#endif
        vec3 part = but_for_rays(from_light(seen, sky.direction), rays);
        radiance += part * min(sky.irradiance, vec3(IRRADIANCE_MAX));
    }
#endif
    return radiance;
}

#endif
