#version 460
#extension GL_GOOGLE_include_directive : require
// Exclusive prefix sum over the tiles' sample counts, in place, by a single workgroup: a tile is 64 pixels, so even at
// 8K there are only half a million. Then the length of the dense list and the arguments of the dispatches over it. The
// `fill` variant lists what is added behind the list that is there already.
//
// variant fill: FILL
#include "types.glsl"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) buffer Tiles { uint data[]; } tiles;
layout(set = 0, binding = 2, std430) buffer CountersBlock { Counters data; } counters;
layout(push_constant) uniform Push { uint tile_count; } push;

shared uint sums[256];

// floor(2^32 a / b) for a < b < 2^31, by long division: 64-bit integers are optional in Vulkan.
uint fraction(uint a, uint b) {
    uint quotient = 0u;
    for (int bit = 0; bit < 32; ++bit) {
        a <<= 1;
        quotient <<= 1;
        if (a >= b) {
            a -= b;
            quotient |= 1u;
        }
    }
    return quotient;
}

// Workgroups across and down for this many threads.
uvec2 groups_of(uint threads) {
    uint groups = (threads + 63u) / 64u;
    return uvec2(min(groups, 32768u), (groups + 32767u) / 32768u);
}

void finish(uint total) {
#ifdef FILL
    uint listed = counters.data.samples;
#else
    uint listed = 0u;
#endif
    uint room = frame.data.capacity - listed;
    bool fits = total <= room;
    counters.data.thin = fits ? 0u : max(fraction(room, total), 1u);  // 0 means that all fits
    uint high = total;
    uint low;
    if (!fits) {
        umulExtended(total, counters.data.thin, high, low);
    }
    counters.data.first = listed;
    counters.data.samples = listed + high;
    uvec2 groups = groups_of(listed + high);
    counters.data.trace_x = groups.x;
    counters.data.trace_y = groups.y;
    counters.data.trace_z = 1u;
#ifdef FILL
    groups = groups_of(high);
    counters.data.fill_x = groups.x;
    counters.data.fill_y = groups.y;
    counters.data.fill_z = 1u;
#endif
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint each = (push.tile_count + 255u) / 256u;
    uint first = min(thread * each, push.tile_count);
    uint end = min(first + each, push.tile_count);
    uint sum = 0u;
    for (uint i = first; i < end; ++i) {
        uint count = tiles.data[i];
        tiles.data[i] = sum;
        sum += count;
    }
    sums[thread] = sum;
    barrier();
    for (uint step = 1u; step < 256u; step <<= 1) {
        uint before = thread >= step ? sums[thread - step] : 0u;
        barrier();
        sums[thread] += before;
        barrier();
    }
    uint offset = sums[thread] - sum;
    for (uint i = first; i < end; ++i) {
        tiles.data[i] += offset;
    }
    if (thread == 255u) {
        finish(sums[255]);
    }
}
