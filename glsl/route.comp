#version 460
#extension GL_GOOGLE_include_directive : require
// How many secondary rays a step has: the arguments of its dispatches. One thread.
//
// variant diffuse: DIFFUSE
#include "types.glsl"

layout(local_size_x = 1) in;
layout(set = 0, binding = 0, std430) buffer PathCountersBlock { PathCounters data[]; } path_counters;
layout(set = 0, binding = 1, std430) buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 2, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(push_constant) uniform Push { uint step; } push;

void main() {
    uint reflected = path_counters.data[push.step].reflected;
    uint refracted = path_counters.data[push.step].refracted;
    bool spread = (frame.data.flags & FRAME_PATHS_SPREAD) != 0u;
    uint listed = spread ? counters.data.samples : reflected + refracted;
    uint groups = (listed + 63u) / 64u;
    path_counters.data[push.step].listed = listed;
    path_counters.data[push.step].trace_x = min(groups, 32768u);
    path_counters.data[push.step].trace_y = (groups + 32767u) / 32768u;
    path_counters.data[push.step].trace_z = 1u;
#ifdef DIFFUSE
    counters.data.indirect_rays += reflected + refracted;
#else
    counters.data.reflection_rays += reflected;
    counters.data.refraction_rays += refracted;
#endif
}
