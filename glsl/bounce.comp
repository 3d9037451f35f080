#version 460
#extension GL_GOOGLE_include_directive : require
// What the secondary rays of a step find (paper 2, sections 3.3 and 3.5), one thread a ray: those that are reflected first, then those
// that are refracted. It takes the place of what the camera ray has found, which is shaded by then.
//
// models: ALPHA MOTION COUNT
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer Nodes { uvec4 data[]; } nodes;
layout(set = 0, binding = 3, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 4, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 5, std430) readonly buffer PathOrigins { uvec4 data[]; } path_origins;
layout(set = 0, binding = 6, std430) readonly buffer PathDirections { uvec4 data[]; } path_directions;
layout(set = 0, binding = 7, std430) readonly buffer PathList { uint data[]; } path_list;
layout(set = 0, binding = 8, std430) readonly buffer PathCountersBlock { PathCounters data[]; } path_counters;
layout(set = 0, binding = 9, std430) writeonly buffer FoundBlock { Found data[]; } found;
layout(push_constant) uniform Push { uint step; } push;
#ifdef ALPHA
#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
layout(set = 0, binding = 10, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 11, std430) readonly buffer Materials { Material data[]; } materials;
layout(set = 0, binding = 12, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 13) uniform sampler2DArray atlas;
layout(set = 0, binding = 14, std430) readonly buffer Srgb { float data[256]; } srgb;
#include "alpha_hit.glsl"
#endif
#ifdef COUNT
layout(set = 0, binding = 30, std430) buffer TraversalsBlock { Traversals data; } traversals;
#endif
#ifdef MOTION
layout(set = 0, binding = 15, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
layout(set = 0, binding = 16, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 17, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#include "camera.glsl"
#include "path_list.glsl"
#include "place.glsl"
#include "traverse.glsl"

void follow(uint slot) {
    vec3 origin = uintBitsToFloat(path_origins.data[slot].xyz);
#ifdef MOTION
    frame_time = frame_time_of(seeds.data[slot]);
#endif
    vec3 direction = uintBitsToFloat(path_directions.data[slot].xyz);
    Intersection hit = traverse(origin, direction, uintBitsToFloat(INFINITY_BITS));
    bool sky = hit.primitive == HIT_SKY;
    found.data[slot] = Found(sky ? SKY_INSTANCE : hit.instance, hit.primitive, hit.u, hit.v);
}

void main() {
    uint slot = listed_path(push.step, dense_index());
    begin_count();
    uint kind = RAY_REFLECTED;
    if (slot != NO_PATH) {
        kind = path_origins.data[slot].w >> PATH_KIND & PATH_KINDS;
        follow(slot);
    }
    end_count(kind);
}
