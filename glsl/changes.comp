#version 460
#extension GL_GOOGLE_include_directive : require
// What is not as it was in the last frame, in samples a pixel, one thread a pixel:
//   red    new in this frame
//   green  evicted by the analysis
//   blue   whose visibility changed: hidden now and not before or the reverse, lost, or given to what hides them
//   alpha  seen in both frames, which another set of lights reaches than before
// Without a cache samples have no identity from frame to frame: all are new.
//
// The image is apart from those of aov.comp since Vulkan promises four to a shader, and since the lights that reach a
// sample are known only until `reconstruct` writes over them.
//
// variant stable: STABLE
#include "camera.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Offsets { uint data[]; } offsets;
layout(set = 0, binding = 2, rgba32f) uniform writeonly image2D changes;
layout(set = 0, binding = 3, std430) readonly buffer Extras { uint data[]; } extras;
#ifdef STABLE
layout(set = 0, binding = 4, std430) readonly buffer Masks { uint data[]; } masks;
layout(set = 0, binding = 5, std430) readonly buffer Plan { uint data[]; } plan;
layout(set = 0, binding = 6, std430) readonly buffer Previous { Sample data[]; } previous;
layout(set = 0, binding = 7, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 8, std430) readonly buffer Sources { uint data[]; } sources;
layout(set = 0, binding = 9, std430) readonly buffer Lit { uint data[]; } lit;
layout(set = 0, binding = 10, std430) readonly buffer PreviousReached { uint data[]; } previous_reached;
layout(set = 0, binding = 11, std430) writeonly buffer Reached { uint data[]; } reached;

#endif

#include "identity.glsl"
#include "slots.glsl"

#ifdef STABLE
vec4 change_of(uint slot) {
    uint lights = lit.data[slot];
    reached.data[slot] = lights;
    uint source = sources.data[slot];
    if (source == NO_SOURCE) {
        return vec4(1.0, 0.0, 0.0, 0.0);
    }
    Sample before = previous.data[source];
    Sample now = samples.data[slot];
    bool turned = ((before.instance ^ now.instance) & OCCLUDED_BIT) != 0u;
    if (turned || !is_same_point(before, now)) {
        return vec4(0.0, 0.0, 1.0, 0.0);
    }
    bool relit = (now.instance & OCCLUDED_BIT) == 0u && lights != previous_reached.data[source];
    return vec4(0.0, 0.0, 0.0, relit);
}
#endif

void main() {
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, frame.data.size))) {
        return;
    }
    uint index = pixel_index(gl_GlobalInvocationID.xy, frame.data.size);
    vec4 counts = vec4(0.0);
    for (Slots slots = slots_of(index); has_slot(slots); next_slot(slots)) {
#ifdef STABLE
        counts += change_of(slots.at);
#else
        counts.r += 1.0;
#endif
    }
#ifdef STABLE
    float evicted = float(bitCount((masks.data[index] >> 16) & ~plan.data[index]));
    // What a fill evicts has been listed, and is there as lost.
    bool listed = (frame.data.flags & FRAME_FILL) != 0u;
    counts += vec4(0.0, evicted, listed ? -evicted : 0.0, 0.0);
#endif
    imageStore(changes, ivec2(gl_GlobalInvocationID.xy), counts);
}
