#version 460
#extension GL_GOOGLE_include_directive : require
// Fog and mist (paper 2, section 3.6): one march a pixel through its middle, up to its farthest visible sample. Each sample's
// colour is composited with what the march has gathered at the sample's depth. A step scatters the light of one of the lights,
// each in its turn, with a shadow ray.
//
// models: ALPHA COUNT
#define AREA
#define MEDIUM_NOISE
#define TRAVERSE_ANY
#include "types.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer Nodes { uvec4 data[]; } nodes;
layout(set = 0, binding = 4, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 5, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 6, std430) readonly buffer Lights { Light data[]; } lights;
layout(set = 0, binding = 7, std430) readonly buffer MediumBlock { Medium data; } medium;
layout(set = 0, binding = 8, std430) readonly buffer MediumNoise { float data[]; } medium_noise;
layout(set = 0, binding = 9, std430) buffer ShadedBlock { Shaded data[]; } shaded;
layout(set = 0, binding = 10, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 11, std430) readonly buffer Extras { uint data[]; } extras;
#ifdef ALPHA
#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
layout(set = 0, binding = 12, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 13, std430) readonly buffer Materials { Material data[]; } materials;
layout(set = 0, binding = 14, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 15) uniform sampler2DArray atlas;
layout(set = 0, binding = 16, std430) readonly buffer Srgb { float data[256]; } srgb;
#endif
#ifdef COUNT
layout(set = 0, binding = 30, std430) buffer TraversalsBlock { Traversals data; } traversals;
#endif
#include "camera.glsl"
#ifdef ALPHA
#include "alpha_hit.glsl"
#endif
#include "light.glsl"
#include "medium.glsl"
#include "pack.glsl"
#include "random.glsl"
#include "slots.glsl"
#include "traverse.glsl"

// What a march has gathered, up to `at`.
struct March {
    vec3 gathered;       // radiance scattered towards the camera
    vec3 transmittance;
    float at;            // metres
};

// What the medium scatters towards the camera at a point, where it is opaque. `turn` says whose turn it is.
vec3 source_at(Medium m, vec3 point, vec3 direction, uint turn, inout uint rays) {
    vec3 source = m.ambient;
    uint count = frame.data.light_count;
    if (count > 0u) {
        Light light = lights.data[turn % count];
        Incident incident = light_at(light, point);
        bool directional = light.kind == LIGHT_DIRECTIONAL;
        bool lit = largest_component(incident.irradiance) > 0.0;
        if (lit && frame.data.shadow_rays != 0u) {
            vec3 towards = directional ? -light.direction : light.position - point;
            float tmax = directional ? uintBitsToFloat(INFINITY_BITS) : 1.0;
            ++rays;
            lit = traverse(point, towards, tmax).primitive == HIT_SKY;
        }
        if (lit) {
            float phase = medium_phase(m.anisotropy, dot(incident.direction, direction));
            vec3 left = light_transmittance(m, point, incident.direction, incident.distance);
            source += incident.irradiance * left * (phase * float(count));
        }
    }
    return medium_albedo(m) * min(source, vec3(MEDIUM_SOURCE_MAX));
}

void composite(uint slot, vec3 transmittance, vec3 gathered) {
    uint second = shaded.data[slot].color_b_offset;
    vec3 color = vec3(unpackHalf2x16(shaded.data[slot].color_rg), unpackHalf2x16(second).x);
    vec3 seen = transmittance * color + gathered;
    shaded.data[slot].color_rg = packHalf2x16(vec2(storable(seen.r), storable(seen.g)));
    shaded.data[slot].color_b_offset =
        (packHalf2x16(vec2(storable(seen.b), 0.0)) & 0xffffu) | (second & 0xffff0000u);
}

// Composites the samples of a pixel beyond what has been gathered and up to `to`; if it is the last step, all.
void finish(uint index, Medium m, March march, float to, bool last, vec3 source, float density) {
    vec3 extinction = medium_extinction(m);
    for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
        float depth = shaded.data[slots.at].depth;
        if (depth > march.at && (depth <= to || last)) {
            vec3 passed = optical_depth(extinction * density, min(depth, to) - march.at);
            vec3 left = m.kind == MEDIUM_FOG ? exp(-optical_depth(extinction, depth)) : march.transmittance * exp(-passed);
            composite(slots.at, left, march.gathered + march.transmittance * source * opacity(passed));
        }
    }
}

float farthest(uint index) {
    float far = -1.0;
    for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
        far = max(far, shaded.data[slots.at].depth);
    }
    return far;
}

void march_through(uvec2 pixel) {
    Medium m = medium.data;
    vec3 extinction = medium_extinction(m);
    if (any(greaterThanEqual(pixel, frame.data.size)) || m.kind == MEDIUM_NONE
        || !(largest_component(extinction) >= SMALLEST_NORMAL)) {
        return;
    }
    uint index = pixel_index(pixel, frame.data.size);
    vec3 through = camera_direction(frame.data, vec2(pixel) + 0.5);
    vec3 direction = through / length(through);
    vec2 way = vec2(0.0, farthest(index));
    if (m.kind == MEDIUM_MIST) {
        vec2 box = box_interval(m.centre, m.half_extent + m.amplitude, vec3(0.0), direction);
        way = vec2(box.x, min(box.y, way.y));
    }
    if (!(way.x < way.y)) {
        return;
    }
    // The same in every frame, unless the method draws anew in each.
    uint h = hash_combine(hash_combine(frame.data.seed, index), frame.data.jitter);
    float jitter = unit_float(h);
    uint turn = hash_uint(h);
    uint rays = 0u;
    March march = March(vec3(0.0), vec3(1.0), way.x);
    bool ended = false;
    for (uint k = 0u; k < m.steps; ++k) {
        count_step();
        bool last = ended || k + 1u == m.steps;
        float to = last ? way.y : march_depth(m, way.x, way.y, float(k + 1u) / float(m.steps));
        vec3 point = direction * march_depth(m, way.x, way.y, (float(k) + jitter) / float(m.steps));
        float density = ended ? 0.0 : medium_density(m, point);
        vec3 source = vec3(0.0);
        if (density > 0.0) {
            source = source_at(m, point, direction, turn % max(frame.data.light_count, 1u) + k, rays);
        }
        finish(index, m, march, to, last, source, density);
        if (last) {
            break;
        }
        vec3 passed = optical_depth(extinction * density, to - march.at);
        march.gathered += march.transmittance * source * opacity(passed);
        march.transmittance = m.kind == MEDIUM_FOG ? exp(-optical_depth(extinction, to)) : march.transmittance * exp(-passed);
        march.at = to;
        ended = largest_component(march.transmittance) < TRANSMITTANCE_LEAST;
    }
    atomicAdd(counters.data.shadow_rays, rays);
}

void main() {
    begin_count();
    march_through(gl_GlobalInvocationID.xy);
    end_count(RAY_MARCH);
}
