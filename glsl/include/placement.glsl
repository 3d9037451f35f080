// Where instances and their triangles are, at the time at which a thread's ray is, if the shutter is open for one. Needs binding
// `instances`, with MOTION `previous_corners`.

#ifndef STILLRAY_PLACEMENT
#define STILLRAY_PLACEMENT

#ifdef MOTION
#include "motion.glsl"

// When this thread's sample is seen: part of the way from the last frame to this one. An entry shader sets it, by the sample's
// seed or by what a path keeps of it, before it asks for anything below.
float frame_time = 1.0;
#else
#include "ray.glsl"

const float frame_time = 1.0;
#endif

// Where an instance is at a time, as far as rays that leave the camera are concerned.
void relative_rows(uint id, float time, out vec4 rows[3]) {
    rows = instances.data[id].to_relative;
#ifdef MOTION
    if ((instances.data[id].flags & INSTANCE_MOVES) != 0u && time < 1.0) {
        blend_rows(instances.data[id].previous, instances.data[id].to_relative, time, rows);
    }
#endif
}

// Where an instance is at a time, part of the way from the last frame to this one. One that has no inverse then gets one of
// zeros, with which no ray is in range.
Placement placement_at(uint id, float time) {
    Placement at;
    at.to_relative = instances.data[id].to_relative;
    at.to_object = instances.data[id].to_object;
#ifdef MOTION
    at.slack = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    at.flags = instances.data[id].flags;
    if ((at.flags & INSTANCE_MOVES) != 0u && time < 1.0) {
        blend_rows(instances.data[id].previous, instances.data[id].to_relative, time, at.to_relative);
        if (!invert(at)) {
            at.to_object = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
        }
    }
#endif
    return at;
}

#ifdef MOTION
// Moves the corners of a triangle slot of an instance that deforms to where they are at a time; `local` is the slot's number
// among those of the mesh.
void shape_at(uint flags, uint local, float time, inout vec3 a, inout vec3 b, inout vec3 c) {
    if ((flags & INSTANCE_DEFORMS) != 0u && time < 1.0) {
        uint at = 9u * ((flags >> INSTANCE_SHAPE_SHIFT) + local);
        a = blend_point(vec3(previous_corners.data[at], previous_corners.data[at + 1u], previous_corners.data[at + 2u]), a, time);
        b = blend_point(vec3(previous_corners.data[at + 3u], previous_corners.data[at + 4u], previous_corners.data[at + 5u]), b, time);
        c = blend_point(vec3(previous_corners.data[at + 6u], previous_corners.data[at + 7u], previous_corners.data[at + 8u]), c, time);
    }
}
#endif

#endif
