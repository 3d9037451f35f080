#version 460
#extension GL_GOOGLE_include_directive : require
// The radiance of every visible sample towards the camera.
//
// Where paths go on, it also says where: the first of their rays.
//
// models: LENS AREA DEFORM ENVIRONMENT PATH MEDIUM MOTION EMITTER
#include "types.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer FrameBlock { Frame data; } frame;
layout(set = 0, binding = 1, std430) readonly buffer Instances { Instance data[]; } instances;
layout(set = 0, binding = 2, std430) readonly buffer CountersBlock { Counters data; } counters;
layout(set = 0, binding = 3, std430) readonly buffer CornersBlock { vec4 data[]; } corners;
layout(set = 0, binding = 4, std430) readonly buffer Rest { float data[]; } rest;
layout(set = 0, binding = 5, std430) readonly buffer Triangles { Triangle data[]; } triangles;
layout(set = 0, binding = 6, std430) readonly buffer Vertices { Vertex data[]; } vertices;
layout(set = 0, binding = 7, std430) readonly buffer Materials { Material data[]; } materials;
layout(set = 0, binding = 8) uniform sampler2DArray atlas;
layout(set = 0, binding = 9, std430) readonly buffer Srgb { float data[256]; } srgb;
layout(set = 0, binding = 10, std430) readonly buffer Lights { Light data[]; } lights;
layout(set = 0, binding = 11, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 12, std430) readonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 13, std430) readonly buffer Lit { uint data[]; } lit;
layout(set = 0, binding = 14, std430) writeonly buffer ShadedBlock { Shaded data[]; } shaded;
#if defined(LENS) || defined(AREA) || defined(ENVIRONMENT)
layout(set = 0, binding = 15, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 16, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
#endif
#ifdef PATH
layout(set = 0, binding = 19, std430) writeonly buffer PathOrigins { uvec4 data[]; } path_origins;
layout(set = 0, binding = 20, std430) writeonly buffer PathDirections { uvec4 data[]; } path_directions;
layout(set = 0, binding = 21, std430) writeonly buffer PathWeights { uvec4 data[]; } path_weights;
layout(set = 0, binding = 22, std430) writeonly buffer PathList { uint data[]; } path_list;
layout(set = 0, binding = 23, std430) buffer PathCountersBlock { PathCounters data[]; } path_counters;
#endif
#ifdef ENVIRONMENT
layout(set = 0, binding = 18, std430) readonly buffer EnvironmentMap { uint data[]; } environment_map;
#endif
#ifdef MEDIUM
layout(set = 0, binding = 24, std430) readonly buffer MediumBlock { Medium data; } medium;
#endif

#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
#ifdef DEFORM
layout(set = 0, binding = 17, std430) readonly buffer PreviousCorners { float data[]; } previous_corners;
#endif
#include "radiance.glsl"
#ifdef PATH
#include "path.glsl"
#endif

const Shaded NOT_VISIBLE = Shaded(0u, 0u, 0u, -1.0);

// Where a sample was on its instance in the last frame.
vec3 previous_position(Sample s, uint id) {
#ifdef DEFORM
    uint flags = instances.data[id].flags;
    if ((flags & INSTANCE_DEFORMS) != 0u) {
        uint at = 9u * ((flags >> INSTANCE_SHAPE_SHIFT) + uint(s.position.x));
        vec3 corner[3];
        for (int i = 0; i < 3; ++i, at += 3u) {
            corner[i] =
                vec3(previous_corners.data[at], previous_corners.data[at + 1u], previous_corners.data[at + 2u]);
        }
        return triangle_point(corner[0], corner[1], corner[2], s.position.y, s.position.z);
    }
#endif
    return s.position;
}

// Where samples are followed to, in distances from the middle of the frame to its border.
const float MOTION_REACH = 64.0;

// Where the sample lies in its pixel, and how far it moved since the last frame, in pixels; false if that is unknown. Rounding
// may have put a visible sample past the frame's border, by a little: it belongs to the pixel at the border.
bool locate(Sample s, uint slot, out vec2 offset, out vec2 motion, out float depth) {
    bool surface = is_surface(s);
    vec3 now = relative_position(s);
    vec3 before = s.position;
    depth = uintBitsToFloat(INFINITY_BITS);
    if (surface) {
        uint id = s.instance & INSTANCE_MASK;
        before = transform_point(instances.data[id].previous, previous_position(s, id));
        depth = length(now);
    }
#ifdef LENS
    uint seed = seeds.data[slot];
#else
    const uint seed = 0u;
#endif
    vec2 pixel;
    vec2 last;
    bool here = place_within(eye_now(), seed, now, surface, MOTION_REACH, pixel);
    bool there = place_within(eye_before(), seed, before, surface, MOTION_REACH, last);
    offset = pixel - clamp(floor(pixel), vec2(0.0), vec2(frame.data.size - 1u));
#ifdef MOTION
    // Motion is told from frame to frame, whenever in between the sample is seen.
    if (frame_time < 1.0) {
        frame_time = 1.0;
        here = place_within(eye_now(), seed, relative_position(s), surface, MOTION_REACH, pixel);
    }
#endif
    motion = pixel - last;
    return here && there;
}

// Shades a visible sample; where its path goes on, which way.
uint shade(uint slot, Found f) {
#if defined(LENS) || defined(AREA) || defined(ENVIRONMENT)
    uint seed = seeds.data[slot];
#else
    const uint seed = 0u;
#endif
#ifdef MOTION
    frame_time = frame_time_of(seed);
#endif
#ifdef LENS
    vec3 viewer = ray_origin(seed);
#else
    const vec3 viewer = vec3(0.0);
#endif
    uint kind = 0u;
    vec3 radiance;
    if (f.instance == SKY_INSTANCE) {
        radiance = sky_radiance(samples.data[slot].position);
    } else {
        Seen seen = seen_from(viewer, f);
#ifdef PATH
        bool rays = is_followed(seen.surface);
        radiance = radiance_of(seen, seed, lit.data[slot], rays, frame.data.indirect > 0u);
        if (rays) {
            kind = follow_path(seen, slot, seed, 0u, vec3(1.0), 0u, radiance);
        }
#else
        radiance = radiance_of(seen, seed, lit.data[slot], false, false);
#endif
    }
    vec2 offset;
    vec2 motion;
    float depth;
    bool known = locate(samples.data[slot], slot, offset, motion, depth);
    Shaded result = pack_shaded(radiance, offset, motion, depth);
    result.motion = known ? result.motion : MOTION_UNKNOWN;
    shaded.data[slot] = result;
    return kind;
}

void main() {
    uint slot = dense_index();
    bool listed = slot < counters.data.samples;
    Found f = Found(0u, FOUND_LOST, 0.0, 0.0);
    if (listed) {
        f = found.data[slot];
    }
    uint kind = 0u;
    if (listed && f.primitive != FOUND_LOST && (f.instance & OCCLUDED_BIT) == 0u) {
        kind = shade(slot, f);
    } else if (listed) {
        shaded.data[slot] = NOT_VISIBLE;
    }
#ifdef PATH
    list_path(gl_LocalInvocationIndex, listed ? slot : NO_PATH, kind, 0u, slot);
#endif
}
