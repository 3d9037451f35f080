#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 4.1: each cached sample claims the subpixel that it projects to. Where several land on one subpixel
// the smallest claim wins: unoccluded before occluded, then the older index. The minimum does not depend on the order of
// arrival, which is Algorithm 1's outcome without its race.
//
// The `nearest` variant, for a frame with a fill, prefers the nearer of two that are equally occluded before the older. What
// is about to be covered is known only after verification: where the older wins, a sample that gets covered takes the
// subpixel of one in front of it, and surfaces in front lose samples wherever they move. That minimum needs a depth and
// an index, more than an atomic minimum of 32 bits holds; so a claim is replaced by compare and swap, as long as ours is less.
// It is strict, so that every swap is a step down: the outcome is the minimum, in whatever order samples arrive. Of equally
// near ones, such as samples of the sky, their positions decide, which stay what they are when the list's order does not.
//
// The `displaced` variant comes after it. Samples that did not get their subpixel, which is most often one that was covered
// and is about to come back, would be missing behind what moves on. Each tries for the next subpixel of its pixel that is
// free; two that try for the same are again ordered by the minimum.
//
// variant nearest: NEAREST
// variant displaced: NEAREST DISPLACED
// models: LENS DEFORM MOTION

#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 4, std430) buffer Claims { uint data[]; } claims;
layout(set = 0, binding = 5, std430) buffer Masks { uint data[]; } masks;
#ifdef DISPLACED
layout(set = 0, binding = 6, std430) readonly buffer Taken { uint data[]; } taken;  // the masks before
#endif

#ifdef LENS
layout(set = 0, binding = 7, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 8, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef DEFORM
layout(set = 0, binding = 9, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 10, std430) readonly buffer Rest { float data[]; } rest;
#endif
#ifdef MOTION
layout(set = 0, binding = 11, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#include "place.glsl"

#ifdef NEAREST
// Squared distance from the camera, with the sky behind everything.
float depth_key(Sample s) {
    if (!is_surface(s)) {
        return uintBitsToFloat(INFINITY_BITS);
    }
    vec3 relative = relative_position(s);
    return dot_precise(relative, relative);
}

// Whether a sample comes before the one that holds a claim.
bool precedes(uint mine, Sample s, float depth, uint held) {
    uint occluded = mine & OCCLUDED_BIT;
    if (occluded != (held & OCCLUDED_BIT)) {
        return occluded == 0u;
    }
    Sample holder = samples.data[held & INSTANCE_MASK];
    float other = depth_key(holder);
    uvec3 ours = floatBitsToUint(s.position);
    uvec3 theirs = floatBitsToUint(holder.position);
    if (depth != other) {
        return depth < other;
    }
    bool less = ours.z < theirs.z || (ours.z == theirs.z && mine < held);
    less = ours.y < theirs.y || (ours.y == theirs.y && less);
    return ours.x < theirs.x || (ours.x == theirs.x && less);
}

void claim(uint slot, uint mine, Sample s) {
    const uint UNCLAIMED = 0xffffffffu;
    float depth = depth_key(s);
    uint expected = UNCLAIMED;
    uint held = atomicCompSwap(claims.data[slot], expected, mine);
    while (held != expected && precedes(mine, s, depth, held)) {
        expected = held;
        held = atomicCompSwap(claims.data[slot], expected, mine);
    }
}
#else
void claim(uint slot, uint mine, Sample s) {
    atomicMin(claims.data[slot], mine);
}
#endif

void main() {
    uint i = dense_index();
    if (i >= counters.data.samples || (frame.data.flags & FRAME_RESET) != 0u) {
        return;
    }
    Sample s = samples.data[i];
    bool surface = is_surface(s);
    if (!surface && (s.instance & INSTANCE_MASK) != SKY_INSTANCE) {
        return;  // lost
    }
#ifdef LENS
    uint seed = seeds.data[i];
#ifdef MOTION
    frame_time = frame_time_of(seed);
#endif
#else
    const uint seed = 0u;
#endif
    vec2 where;
    if (!place_within(eye_now(), seed, relative_position(s), surface, 1.0, where)) {
        return;
    }
    uvec2 pixel = pixel_of(where, frame.data.size);
    uint flags = frame.data.flags;
    uint subpixel = subpixel_bit(subpixel_of(where, pixel), flags);
    uint index = pixel_index(pixel, frame.data.size);
    uint occluded = s.instance & OCCLUDED_BIT;
    uint slot = claim_slot(index, subpixel, flags);
#ifdef DISPLACED
    uint vacant = ~taken.data[index] & subpixel_bits(flags);
    // Claims on what was taken before do not change any more.
    if ((claims.data[slot] & INSTANCE_MASK) == i || vacant == 0u) {
        return;
    }
    uint behind = vacant & ~((2u << subpixel) - 1u);
    subpixel = uint(findLSB(behind != 0u ? behind : vacant));
    slot = claim_slot(index, subpixel, flags);
#endif
    claim(slot, occluded | i, s);
    atomicOr(masks.data[index], (occluded == 0u ? 0x10001u : 1u) << subpixel);
}
