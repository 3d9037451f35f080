#version 460
#extension GL_GOOGLE_include_directive : require
// Takes what a sample's diffuse path has brought into the sample's mean, and adds what the surface scatters of the mean to the sample's
// colour (paper 1, section 6.1). The mean is that of the light, without the surface's own colour: textures stay sharp. A sample that
// is hidden, or scatters nothing, keeps the mean that it has.
//
// Without a cache a path is all that is known.
//
// variant stable: STABLE
#include "camera.glsl"
#include "filter.glsl"
#include "mean.glsl"
#include "pack.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 2, std430) readonly buffer BroughtBlock { uvec4 data[]; } brought;
// As `indirect` leaves it: what the surface scatters, and whether there is a path.
layout(set = 0, binding = 3, std430) buffer GatheredBlock { Gathered data[]; } gathered;
layout(set = 0, binding = 4, std430) buffer ShadedBlock { Shaded data[]; } shaded;
#ifdef STABLE
layout(set = 0, binding = 5, std430) readonly buffer PreviousGathered { Gathered data[]; } previous_gathered;
#endif

Gathered gathered_before(uint source) {
#ifdef STABLE
    if (source != NO_SOURCE) {
        return previous_gathered.data[source];
    }
#endif
    return nothing_gathered();
}

void main() {
    uint slot = dense_index();
    if (slot >= counters.data.samples) {
        return;
    }
    uvec4 path = brought.data[slot];
    Gathered started = gathered.data[slot];
    Gathered g = gathered_before(path.w);
    if (started.paths != 0u) {
        vec3 light = within_limit(uintBitsToFloat(path.xyz), frame.data.indirect_clamp);
        bool alike = (frame.data.flags & FRAME_LIT_ALIKE) != 0u;
        g = with_path(g, light, alike, frame.data.indirect_alpha, frame.data.indirect_count);
        Shaded s = shaded.data[slot];
        shaded.data[slot] = with_color(s, shaded_color(s) + started.radiance * g.radiance);
    }
    gathered.data[slot] = g;
}
