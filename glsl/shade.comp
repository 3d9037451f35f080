#version 460
#extension GL_GOOGLE_include_directive : require
// The radiance of every visible sample towards the camera.
//
// models: LENS AREA DEFORM ENVIRONMENT MEDIUM
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 4, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 5, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 6, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 7, std430) readonly buffer Materials { Material data[]; } materials;
layout(set = 0, binding = 8) uniform sampler2DArray atlas;
layout(set = 0, binding = 9, std430) readonly buffer Srgb { float data[256]; } srgb;
layout(set = 0, binding = 10, std430) readonly buffer Lights { Light data[]; } lights;
layout(set = 0, binding = 11, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 12, std430) readonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 13, std430) readonly buffer Lit { uint data[]; } lit;
layout(set = 0, binding = 14, std430) writeonly buffer ShadedBlock { Shaded data[]; } shaded;
#if defined(LENS) || defined(AREA) || defined(ENVIRONMENT)
layout(set = 0, binding = 15, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 16, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef ENVIRONMENT
layout(set = 0, binding = 18, std430) readonly buffer EnvironmentMap { uint data[]; } environment_map;
#endif
#ifdef MEDIUM
layout(set = 0, binding = 24, std430) readonly buffer MediumBlock { Medium data; } medium;
#endif

#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
#ifdef DEFORM
layout(set = 0, binding = 17, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#include "brdf.glsl"
#include "choice.glsl"
#ifdef ENVIRONMENT
#include "environment.glsl"
#endif
#include "light.glsl"
#include "material.glsl"
#ifdef MEDIUM
#include "medium.glsl"
#endif
#include "place.glsl"
#include "triangle.glsl"

const Shaded NOT_VISIBLE = Shaded(0u, 0u, 0u, -1.0);

SurfacePoint point_of(Found f, Instance inst) {
    vec3 a;
    vec3 b;
    vec3 c;
    uint p = f.primitive;
    unpack_corners(corners.data[2u * p], corners.data[2u * p + 1u], rest.data[p], a, b, c);
    return surface_point(inst.to_relative, inst.to_object, a, b, c, f.u, f.v);
}

vec3 surface_radiance(Found f, uint slot, uint lit_bits) {
    Instance inst = instances.data[f.instance];
    Triangle corner = triangles.data[f.primitive];
    Material material = materials.data[corner.material];
    SurfacePoint point = point_of(f, inst);
#ifdef LENS
    vec3 view = unit_or(ray_origin(seeds.data[slot]) - point.position, point.normal);
#else
    vec3 view = unit_or(-point.position, point.normal);
#endif
    Surface s = surface_at(material, inst, vertices.data[corner.vertex0], vertices.data[corner.vertex1],
        vertices.data[corner.vertex2], f.u, f.v, point.normal, view);
    if (s.unlit) {
        return s.base_color;
    }
    vec3 ambient = reflect_uniform(s.base_color, s.metallic, s.roughness, s.normal, view);
    vec3 radiance = s.emissive + ambient * frame.data.environment.rgb * s.occlusion;
    float weight = light_weight(frame.data.light_count, frame.data.shadow_rays);
#ifdef AREA
    vec2 at = seed_pair(seeds.data[slot], PAIR_LIGHT);
#endif
    for (uint i = 0u; i < frame.data.light_count; ++i) {
        if ((lit_bits >> i & 1u) != 0u) {
#ifdef AREA
            Incident incident = light_at(light_point(lights.data[i], at), point.position);
#else
            Incident incident = light_at(lights.data[i], point.position);
#endif
#ifdef MEDIUM
            if (medium.data.kind != MEDIUM_NONE) {
                incident.irradiance *=
                    light_transmittance(medium.data, point.position, incident.direction, incident.distance);
            }
#endif
            vec3 part = reflect_light(s.base_color, s.metallic, s.roughness, s.normal, view, incident.direction);
            radiance += part * (incident.irradiance * weight);
        }
    }
#ifdef ENVIRONMENT
    if (has_environment_map() && (lit_bits >> ENVIRONMENT_LIGHT & 1u) != 0u) {
        FromAfar sky = environment_sample(seed_bits(seeds.data[slot], PAIR_ENVIRONMENT));
#ifdef MEDIUM
        if (medium.data.kind != MEDIUM_NONE) {
            sky.irradiance *= light_transmittance(medium.data, point.position, sky.direction, uintBitsToFloat(INFINITY_BITS));
        }
#endif
        vec3 part = reflect_light(s.base_color, s.metallic, s.roughness, s.normal, view, sky.direction);
        radiance += part * min(sky.irradiance, vec3(IRRADIANCE_MAX));
    }
#endif
    return radiance;
}

// Where a sample was on its instance in the last frame.
vec3 previous_position(Sample s, uint id) {
#ifdef DEFORM
    uint flags = instances.data[id].flags;
    if ((flags & INSTANCE_DEFORMS) != 0u) {
        uint at = 9u * ((flags >> INSTANCE_SHAPE_SHIFT) + uint(s.position.x));
        vec3 corner[3];
        for (int i = 0; i < 3; ++i, at += 3u) {
            corner[i] =
                vec3(previous_corners.data[at], previous_corners.data[at + 1u], previous_corners.data[at + 2u]);
        }
        return triangle_point(corner[0], corner[1], corner[2], s.position.y, s.position.z);
    }
#endif
    return s.position;
}

// Where samples are followed to, in distances from the middle of the frame to its border.
const float MOTION_REACH = 64.0;

// Where the sample lies in its pixel, and how far it moved since the last frame, in pixels; false if that is unknown. Rounding
// may have put a visible sample past the frame's border, by a little: it belongs to the pixel at the border.
bool locate(Sample s, uint slot, out vec2 offset, out vec2 motion, out float depth) {
    bool surface = is_surface(s);
    vec3 now = relative_position(s);
    vec3 before = s.position;
    depth = uintBitsToFloat(INFINITY_BITS);
    if (surface) {
        uint id = s.instance & INSTANCE_MASK;
        before = transform_point(instances.data[id].previous, previous_position(s, id));
        depth = length(now);
    }
#ifdef LENS
    uint seed = seeds.data[slot];
#else
    const uint seed = 0u;
#endif
    vec2 pixel;
    vec2 last;
    bool here = place_within(eye_now(), seed, now, surface, MOTION_REACH, pixel);
    bool there = place_within(eye_before(), seed, before, surface, MOTION_REACH, last);
    offset = pixel - clamp(floor(pixel), vec2(0.0), vec2(frame.data.size - 1u));
    motion = pixel - last;
    return here && there;
}

void main() {
    uint slot = dense_index();
    if (slot >= counters.data.samples) {
        return;
    }
    Found f = found.data[slot];
    if (f.primitive == FOUND_LOST || (f.instance & OCCLUDED_BIT) != 0u) {
        shaded.data[slot] = NOT_VISIBLE;
        return;
    }
    vec3 radiance = frame.data.environment.rgb;
    if (f.instance != SKY_INSTANCE) {
        radiance = surface_radiance(f, slot, lit.data[slot]);
    }
#ifdef ENVIRONMENT
    else if (has_environment_map()) {
        radiance += environment_radiance(samples.data[slot].position);
    }
#endif
    vec2 offset;
    vec2 motion;
    float depth;
    bool known = locate(samples.data[slot], slot, offset, motion, depth);
    Shaded result = pack_shaded(radiance, offset, motion, depth);
    result.motion = known ? result.motion : MOTION_UNKNOWN;
    shaded.data[slot] = result;
}
