#version 460
#extension GL_GOOGLE_include_directive : require
// One shadow ray a light, up to a number, for every visible sample. A bit of `lit` says that the light reaches the sample;
// the rays towards lights behind the surface are not traced and leave their bits zero, as do lights that are not chosen. A map
// of light from all around gets one ray more, and the last bit.
//
// The `bounce` variant asks the same of what the secondary rays of a step have found, `diffuse` of those of diffuse paths.
//
// variant bounce: BOUNCE PATH LENS AREA ENVIRONMENT
// variant diffuse: BOUNCE DIFFUSE PATH LENS AREA ENVIRONMENT
// models: ALPHA LENS AREA ENVIRONMENT MOTION EMITTER COUNT
#define TRAVERSE_ANY
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer Nodes { uvec4 data[]; } nodes;
layout(set = 0, binding = 4, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 5, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 6, std430) readonly buffer Lights { Light data[]; } lights;
layout(set = 0, binding = 7, std430) readonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 8, std430) writeonly buffer Lit { uint data[]; } lit;
layout(set = 0, binding = 9, std430) readonly buffer Samples { Sample data[]; } samples;
#ifdef ALPHA
#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
layout(set = 0, binding = 10, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 11, std430) readonly buffer Materials { Material data[]; } materials;
layout(set = 0, binding = 12, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 13) uniform sampler2DArray atlas;
layout(set = 0, binding = 14, std430) readonly buffer Srgb { float data[256]; } srgb;
#endif
#if defined(LENS) || defined(AREA) || defined(ENVIRONMENT)
layout(set = 0, binding = 15, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 16, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef MOTION
layout(set = 0, binding = 17, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#ifdef ENVIRONMENT
layout(set = 0, binding = 18, std430) readonly buffer EnvironmentMap { uint data[]; } environment_map;
#endif
#ifdef COUNT
layout(set = 0, binding = 30, std430) buffer TraversalsBlock { Traversals data; } traversals;
#endif
#ifdef BOUNCE
layout(set = 0, binding = 19, std430) readonly buffer PathOrigins { uvec4 data[]; } path_origins;
layout(set = 0, binding = 20, std430) readonly buffer PathList { uint data[]; } path_list;
layout(set = 0, binding = 21, std430) readonly buffer PathCountersBlock { PathCounters data[]; } path_counters;
layout(push_constant) uniform Push { uint step; } push;
#include "path_list.glsl"
#endif
#ifdef DIFFUSE
layout(set = 0, binding = 22, std430) readonly buffer PathDirections { uvec4 data[]; } path_directions;
#endif
#include "place.glsl"
#ifdef ALPHA
// Light passes straight through what transmits: it is not refracted on its way from a light.
#define SHADOW_RAYS
#include "alpha_hit.glsl"
#endif
#include "choice.glsl"
#ifdef ENVIRONMENT
#include "environment.glsl"
#endif
#if defined(AREA) || defined(MOTION)
#include "light.glsl"
#endif
#ifdef EMITTER
#include "emitter.glsl"
#endif
#include "traverse.glsl"

shared uint tally;

// The bits of all lights for one sample; counts the rays. Lights are chosen one after the other, each with the chance that
// leaves all sets alike (selection sampling: Knuth, The Art of Computer Programming 3.4.2, algorithm S).
uint lights_reaching(Found f, uint slot, uint h, out uint rays) {
    Corners c = load_corners(f.primitive);
#ifdef MOTION
    Instance inst = instances.data[f.instance];
    shape_at(inst.flags, f.primitive - inst.triangle_base, frame_time, c.v0, c.v1, c.v2);
#endif
    SurfacePoint point = surface_point(placement_at(f.instance, frame_time), c.v0, c.v1, c.v2, f.u, f.v);
    // The lit side is the one that is seen.
#ifdef BOUNCE
#ifdef DIFFUSE
    uint seed = diffuse_seed(push.step + 1u);
#else
    uint seed = path_seed(seeds.data[slot], push.step + 1u);
#endif
    vec3 seen_along = point.position - uintBitsToFloat(path_origins.data[slot].xyz);
#elif defined(LENS)
    uint seed = seeds.data[slot];
    vec3 seen_along = point.position - ray_origin(seed);
#else
#if defined(AREA) || defined(ENVIRONMENT)
    uint seed = seeds.data[slot];
#endif
    vec3 seen_along = point.position;
#endif
    float viewer_side = dot(point.normal, seen_along) <= 0.0 ? 1.0 : -1.0;
#ifdef AREA
    vec2 at = seed_pair(seed, PAIR_LIGHT);
#endif
    uint bits = 0u;
    rays = 0u;
    uint lights_left = frame.data.light_count;
    bool untraced = frame.data.shadow_rays == 0u;
    uint wanted = untraced ? lights_left : min(frame.data.shadow_rays, lights_left);
    uint ends = frame.data.light_count;
#ifdef ENVIRONMENT
    // One direction of the map comes last, as a light that is always chosen: in the same loop, for compilers unroll each call of
    // a traversal by itself.
    vec3 sky = environment_sample(seed_bits(seed, PAIR_ENVIRONMENT)).direction;
    ends += has_environment_map() ? 1u : 0u;
#endif
    for (uint i = 0u; i < ends; ++i) {
        uint bit = i;
        bool chosen = true;
        Light light;
#ifdef ENVIRONMENT
        if (i == frame.data.light_count) {
            bit = ENVIRONMENT_LIGHT;
            light.kind = LIGHT_DIRECTIONAL;
            light.direction = -sky;
            light.shape = LIGHT_SHARP;
        } else
#endif
        {
            h = hash_uint(h);
            chosen = h % lights_left < wanted;
            wanted -= uint(chosen);
            --lights_left;
            light = lights.data[i];
#ifdef MOTION
            light = light_at_time(light, frame_time);
#endif
#ifdef AREA
            light = light_point(light, at);
#endif
#ifdef EMITTER
            if (light.shape == LIGHT_MESH) {
                uint draw = seed_bits(seed, PAIR_CHOICE).y;
                float pick = seed_pair(seed, PAIR_EMITTER).x;
                light = draw_emitter(light, at, draw, pick, point).light;
            }
#endif
        }
        bool directional = light.kind == LIGHT_DIRECTIONAL;
        vec3 towards = directional ? -light.direction : light.position - point.position;
        if (!chosen || !(dot(point.normal, towards) * viewer_side > 0.0)) {
            continue;
        }
#ifdef EMITTER
        // Half of what shines looks away.
        if (light.shape == LIGHT_MESH && !(dot(light.direction, towards) < 0.0)) {
            continue;
        }
#endif
        if (untraced) {
            bits |= 1u << bit;
            continue;
        }
        vec3 origin = offset_origin(point, towards);
        vec3 direction = directional ? towards : light.position - origin;
        // A ray towards a point light ends at t = 1, the light itself.
        float tmax = directional ? uintBitsToFloat(INFINITY_BITS) : 1.0;
        ++rays;
        bits |= traverse(origin, direction, tmax).primitive == HIT_SKY ? 1u << bit : 0u;
    }
    return bits;
}

void main() {
#ifdef BOUNCE
    uint slot = listed_path(push.step, dense_index());
    bool listed = slot != NO_PATH;
    uint salt = frame.data.seed + 0x9e3779b9u * (push.step + 1u);
#ifdef DIFFUSE
    if (listed) {
        resume_path(path_origins.data[slot].w, path_directions.data[slot].w);
        salt = hash_combine(salt, path_number);
    }
#endif
#else
    uint slot = dense_index();
    bool listed = slot < counters.data.samples;
    uint salt = frame.data.seed;
#endif
    if (gl_LocalInvocationIndex == 0u) {
        tally = 0u;
    }
    barrier();
    begin_count();
    if (listed) {
        Found f = found.data[slot];
        bool visible = f.primitive != FOUND_LOST && (f.instance & OCCLUDED_BIT) == 0u;
        uint bits = 0u;
        uint rays = 0u;
        if (visible && f.instance != SKY_INSTANCE) {
#ifdef MOTION
            frame_time = frame_time_of(seeds.data[slot]);
#endif
            bits = lights_reaching(f, slot, light_hash(samples.data[slot], salt), rays);
        }
        lit.data[slot] = bits;
        atomicAdd(tally, rays);
    }
    end_count(RAY_SHADOW);
    barrier();
    if (gl_LocalInvocationIndex == 0u && tally != 0u) {
        atomicAdd(counters.data.shadow_rays, tally);
    }
}
