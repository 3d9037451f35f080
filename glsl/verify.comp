#version 460
#extension GL_GOOGLE_include_directive : require
// Paper 1, section 4.3: one ray an entry of the dense list. A new sample's ray is unbounded and makes the sample. A cached
// sample's ray ends a little behind the sample: it finds the sample's own surface, or what hides it. Of a list to which a
// fill was added behind, only that part is traced.
//
// models: ALPHA LENS DEFORM MOTION COUNT
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer Nodes { uvec4 data[]; } nodes;
layout(set = 0, binding = 4, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 5, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 6, std430) buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 7, std430) writeonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 8, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 9, std430) readonly buffer Materials { Material data[]; } materials;
#ifdef ALPHA
#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
layout(set = 0, binding = 10, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 11) uniform sampler2DArray atlas;
layout(set = 0, binding = 12, std430) readonly buffer Srgb { float data[256]; } srgb;
#endif
#ifdef LENS
layout(set = 0, binding = 13, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 14, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef COUNT
layout(set = 0, binding = 30, std430) buffer TraversalsBlock { Traversals data; } traversals;
#endif
#ifdef MOTION
layout(set = 0, binding = 15, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#include "place.glsl"
#ifdef ALPHA
#include "alpha_hit.glsl"
#endif

// Only camera rays pass through the backs of one-sided surfaces: a wall keeps the light out whichever way it faces.
#define CULL_BACK
bool is_one_sided(uint primitive) {
    return (materials.data[triangles.data[primitive].material].flags & MATERIAL_DOUBLE_SIDED) == 0u;
}
#include "traverse.glsl"

// How far behind a cached sample its ray goes on, in parts of its length. At a grazing angle the ray may meet the
// sample's surface this much late; what is not that surface is told apart below, so the reach only costs time.
const float REACH = 1.0 + 1.0 / 64.0;

SurfacePoint surface_of(Intersection hit) {
    Corners c = load_corners(hit.primitive);
#ifdef MOTION
    Instance inst = instances.data[hit.instance];
    shape_at(inst.flags, hit.primitive - inst.triangle_base, frame_time, c.v0, c.v1, c.v2);
#endif
    return surface_point(placement_at(hit.instance, frame_time), c.v0, c.v1, c.v2, hit.u, hit.v);
}

// Whether the surface that was hit is the one that the sample lies on: whether the sample is on the hit triangle's plane,
// within the error with which either is known. The sample's ray meets a plane once, unless it lies in it. The clearance
// bounds the height lost by one way through the transforms; sample and hit went one each.
bool holds_sample(SurfacePoint hit, vec3 relative) {
    return abs(dot(hit.normal, relative - hit.position)) <= 2.0 * hit.clearance;
}

Found make_sample(uint slot, Intersection hit, vec3 direction) {
    if (hit.primitive == HIT_SKY) {
        samples.data[slot] = Sample(normalize(direction), SKY_INSTANCE);
        return Found(SKY_INSTANCE, HIT_SKY, 0.0, 0.0);
    }
#ifdef DEFORM
    if ((instances.data[hit.instance].flags & INSTANCE_DEFORMS) != 0u) {
        float local = float(hit.primitive - instances.data[hit.instance].triangle_base);
        samples.data[slot] = Sample(vec3(local, hit.u, hit.v), hit.instance);
        return Found(hit.instance, hit.primitive, hit.u, hit.v);
    }
#endif
    samples.data[slot] = Sample(surface_of(hit).object, hit.instance);
    return Found(hit.instance, hit.primitive, hit.u, hit.v);
}

Found check_sample(uint slot, uint id, vec3 relative, Intersection hit) {
    Found f = Found(hit.instance, hit.primitive, hit.u, hit.v);
    bool nothing = hit.primitive == HIT_SKY;
    if (id == SKY_INSTANCE) {
        f.instance = nothing ? SKY_INSTANCE : f.instance | OCCLUDED_BIT;
    } else if (nothing) {
        f = Found(0u, FOUND_LOST, 0.0, 0.0);
    } else if (!holds_sample(surface_of(hit), relative)) {
        f.instance |= OCCLUDED_BIT;
        // Something behind the sample: its own surface was missed, past the edge that the sample sits on.
        if (hit.t > 1.0) {
            f = Found(0u, FOUND_LOST, 0.0, 0.0);
        }
    }
    bool lost = f.primitive == FOUND_LOST;
    samples.data[slot].instance = lost ? NEW_INSTANCE : id | (f.instance & OCCLUDED_BIT);
    return f;
}

struct CameraRay {
    vec3 origin;
    vec3 direction;  // to the sample, of its length, if it is on a surface
};

CameraRay camera_ray(uint slot, Sample s, vec3 target, bool added, bool surface) {
#ifdef LENS
    vec3 origin = ray_origin(seeds.data[slot]);
    if (added) {
        return CameraRay(origin, ray_direction(s.position.xy, origin));
    }
    return CameraRay(origin, surface ? target - origin : target);
#else
    return CameraRay(vec3(0.0), added ? camera_direction(frame.data, s.position.xy) : target);
#endif
}

void verify(uint slot) {
    Sample s = samples.data[slot];
#ifdef MOTION
    frame_time = frame_time_of(seeds.data[slot]);
#endif
    uint id = s.instance & INSTANCE_MASK;
    bool added = id == NEW_INSTANCE;
    bool surface = is_surface(s);
    vec3 target = added ? vec3(0.0) : relative_position(s);
    CameraRay ray = camera_ray(slot, s, target, added, surface);
    Intersection hit = traverse(ray.origin, ray.direction, surface ? REACH : uintBitsToFloat(INFINITY_BITS));
    if (added) {
        found.data[slot] = make_sample(slot, hit, ray.direction);
    } else {
        found.data[slot] = check_sample(slot, id, target, hit);
    }
}

void main() {
    uint slot = counters.data.first + dense_index();
    begin_count();
    if (slot < counters.data.samples) {
        verify(slot);
    }
    end_count(RAY_CAMERA);
}
