#version 460
#extension GL_GOOGLE_include_directive : require

// Whether each of a list of rays hits anything before its end, one thread a ray.
//
// variant count: COUNT
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer NodesBlock { uvec4 data[]; } nodes;
layout(set = 0, binding = 1, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 2, std430) readonly buffer RestBlock { float data[]; } rest;
layout(set = 0, binding = 3, std430) readonly buffer InstancesBlock { Instance data[]; } instances;
// Two a ray, camera-relative: (origin, tmax), (direction, unused).
layout(set = 0, binding = 4, std430) readonly buffer RaysBlock { vec4 data[]; } rays;
layout(set = 0, binding = 5, std430) writeonly buffer OccludedBlock { uint data[]; } occluded;
#ifdef COUNT
// Of each ray: nodes visited, triangles tested.
layout(set = 0, binding = 6, std430) writeonly buffer CostsBlock { uvec2 data[]; } costs;
layout(set = 0, binding = 30, std430) buffer TraversalsBlock { Traversals data; } traversals;
#endif
layout(push_constant) uniform Push { uint count; } push;

#define TRAVERSE_ANY
#include "traverse.glsl"

void trace(uint i) {
    vec4 origin = rays.data[2u * i];
    Intersection found = traverse(origin.xyz, rays.data[2u * i + 1u].xyz, origin.w);
    occluded.data[i] = found.primitive == HIT_SKY ? 0u : 1u;
#ifdef COUNT
    costs.data[i] = uvec2(nodes_visited, triangles_tested);
#endif
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    begin_count();
    if (i < push.count) trace(i);
    end_count(RAY_SHADOW);
}
