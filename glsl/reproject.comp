#version 460
#extension GL_GOOGLE_include_directive : require
#include "types.glsl"
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer SamplesBlock { Sample data[]; } samples;
layout(set = 0, binding = 1, std430) buffer Claims { uint data[]; } claims;
layout(push_constant) uniform Push { uint count; } push;
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count) atomicMin(claims.data[0], samples.data[i].instance);
}
