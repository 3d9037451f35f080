#version 460
#extension GL_GOOGLE_include_directive : require
// Adds the radiance of what the secondary rays of a step have found, and sends their paths on. Fog and mist take from the light
// that surfaces get, but are not marched along these rays.
//
// The `diffuse` variant does it for diffuse paths: their radiance is kept apart, and they go on wherever a surface scatters light.
//
// variant diffuse: DIFFUSE
// models: MEDIUM MOTION EMITTER
#define PATH
#define AREA
#define ENVIRONMENT
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 3, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 4, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 5, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 6, std430) readonly buffer Materials { Material data[]; } materials;
layout(set = 0, binding = 7) uniform sampler2DArray atlas;
layout(set = 0, binding = 8, std430) readonly buffer Srgb { float data[256]; } srgb;
layout(set = 0, binding = 9, std430) readonly buffer Lights { Light data[]; } lights;
layout(set = 0, binding = 10, std430) readonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 11, std430) readonly buffer Lit { uint data[]; } lit;
#ifdef DIFFUSE
layout(set = 0, binding = 12, std430) buffer BroughtBlock { uvec4 data[]; } brought;
#else
layout(set = 0, binding = 12, std430) buffer ShadedBlock { Shaded data[]; } shaded;
#endif
layout(set = 0, binding = 13, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 14, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
layout(set = 0, binding = 15, std430) readonly buffer EnvironmentMap { uint data[]; } environment_map;
layout(set = 0, binding = 16, std430) buffer PathOrigins { uvec4 data[]; } path_origins;
layout(set = 0, binding = 17, std430) buffer PathDirections { uvec4 data[]; } path_directions;
layout(set = 0, binding = 18, std430) buffer PathWeights { uvec4 data[]; } path_weights;
layout(set = 0, binding = 19, std430) buffer PathList { uint data[]; } path_list;
layout(set = 0, binding = 20, std430) buffer PathCountersBlock { PathCounters data[]; } path_counters;
#ifdef MEDIUM
layout(set = 0, binding = 21, std430) readonly buffer MediumBlock { Medium data; } medium;
#endif
#ifdef MOTION
layout(set = 0, binding = 22, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
layout(push_constant) uniform Push { uint step; } push;

#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
#include "filter.glsl"
#include "path.glsl"
#include "path_list.glsl"
#ifdef DIFFUSE
#include "indirect.glsl"

// Of what transmits, paths by chance either go on as its reflections and refractions do or are scattered.
uint follow_diffuse(Seen seen, uint slot, uint seed, uint step, vec3 throughput, uint inside, inout vec3 radiance) {
    Reflector r = seen.surface.reflector;
    float passing = transmits(r) ? (largest_component(diffuse_color(r)) > 0.0 ? 0.5 : 1.0) : 0.0;
    if (unit_float(seed_bits(seed, PAIR_CHOICE).y) < passing) {
        return follow_path(seen, slot, seed, step, throughput / passing, inside, radiance);
    }
    vec3 weight = throughput * from_everywhere(seen).diffuse / (1.0 - passing);
    return step < most_rays() ? send_diffuse(seen, slot, seed, weight, inside) : PATH_ENDS;
}
#endif

// What a ray brings, and where its path goes on.
uint follow(uint slot, out vec3 radiance) {
    Found f = found.data[slot];
#ifdef MOTION
    frame_time = frame_time_of(seeds.data[slot]);
#endif
    uvec4 state = path_weights.data[slot];
#ifdef DIFFUSE
    resume_path(path_origins.data[slot].w, path_directions.data[slot].w);
#endif
    vec3 throughput = uintBitsToFloat(state.xyz);
    if (f.instance == SKY_INSTANCE) {
        radiance = throughput * radiance_beyond(uintBitsToFloat(path_directions.data[slot].xyz));
        return PATH_ENDS;
    }
    vec3 origin = uintBitsToFloat(path_origins.data[slot].xyz);
    Seen seen = seen_from(origin, f);
    throughput *= transmittance(state.w, length(seen.point.position - origin));
#ifdef DIFFUSE
    uint seed = diffuse_seed(push.step + 1u);
    bool on = push.step + 1u < most_rays();
    radiance = throughput * radiance_of(seen, seed, lit.data[slot], transmits(seen.surface.reflector), on);
    return seen.surface.unlit ? PATH_ENDS : follow_diffuse(seen, slot, seed, push.step + 1u, throughput, state.w, radiance);
#else
    uint seed = path_seed(seeds.data[slot], push.step + 1u);
    bool rays = is_followed(seen.surface);
    radiance = throughput * radiance_of(seen, seed, lit.data[slot], rays, false);
    return rays ? follow_path(seen, slot, seed, push.step + 1u, throughput, state.w, radiance) : PATH_ENDS;
#endif
}

void main() {
    uint index = dense_index();
    uint slot = listed_path(push.step, index);
    uint kind = PATH_ENDS;
    if (slot != NO_PATH) {
        vec3 radiance;
        kind = follow(slot, radiance);
#ifdef DIFFUSE
        uvec4 b = brought.data[slot];
        brought.data[slot] = uvec4(floatBitsToUint(uintBitsToFloat(b.xyz) + radiance), b.w);
#else
        Shaded s = shaded.data[slot];
        shaded.data[slot] = with_color(s, shaded_color(s) + radiance);
#endif
    }
    bool listed = index < path_counters.data[push.step].listed;
    list_path(gl_LocalInvocationIndex, listed ? index : NO_PATH, kind, push.step + 1u, slot);
}
