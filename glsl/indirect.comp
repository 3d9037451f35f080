#version 460
#extension GL_GOOGLE_include_directive : require
// Indirect light (paper 1, section 6.1): the first ray of a diffuse path from every visible sample, and what its surface scatters
// of what the path will bring. `accumulate` reads both.
//
// The `stable` variant looks for what the sample was in the last frame: the paths of a sample are numbered through all frames,
// and one that was given to what hides it is another sample.
//
// variant stable: STABLE
// models: LENS
#define PATH
#define DIFFUSE
#define AT_CAMERA
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
layout(set = 0, binding = 11, std430) readonly buffer FoundBlock { Found data[]; } found;
layout(set = 0, binding = 12, std430) readonly buffer Seeds { uint data[]; } seeds;
layout(set = 0, binding = 13, std430) readonly buffer SamplerTable { uint data[]; } sampler_table;
layout(set = 0, binding = 14, std430) writeonly buffer GatheredBlock { Gathered data[]; } gathered;
layout(set = 0, binding = 15, std430) writeonly buffer BroughtBlock { uvec4 data[]; } brought;
layout(set = 0, binding = 16, std430) writeonly buffer PathOrigins { uvec4 data[]; } path_origins;
layout(set = 0, binding = 17, std430) writeonly buffer PathDirections { uvec4 data[]; } path_directions;
layout(set = 0, binding = 18, std430) writeonly buffer PathWeights { uvec4 data[]; } path_weights;
layout(set = 0, binding = 19, std430) writeonly buffer PathList { uint data[]; } path_list;
layout(set = 0, binding = 20, std430) buffer PathCountersBlock { PathCounters data[]; } path_counters;
#ifdef STABLE
layout(set = 0, binding = 21, std430) readonly buffer Samples { Sample data[]; } samples;
layout(set = 0, binding = 22, std430) readonly buffer Previous { Sample data[]; } previous;
layout(set = 0, binding = 23, std430) readonly buffer Sources { uint data[]; } sources;
layout(set = 0, binding = 24, std430) readonly buffer PreviousGathered { Gathered data[]; } previous_gathered;
#endif

#define READ_NEAREST ((frame.data.flags & FRAME_NEAREST) != 0u)
#include "identity.glsl"
#include "indirect.glsl"
#include "mean.glsl"

// Which of the last frame's samples this one is, if it is one.
uint source_of(uint slot) {
#ifdef STABLE
    uint source = sources.data[slot];
    bool known = source != NO_SOURCE && is_same_point(previous.data[source], samples.data[slot]);
    return known ? source : NO_SOURCE;
#else
    return NO_SOURCE;
#endif
}

// Which path of which sample this is. Without a cache the samples of a pixel share out one sequence, in all frames.
void begin_path(uint seed, uint source) {
#ifdef STABLE
    path_scramble = hash_combine(hash_uint(frame.data.seed), seed);
    path_number = source == NO_SOURCE ? 0u : paths_before(previous_gathered.data[source]);
#else
    path_scramble = hash_combine(hash_uint(frame.data.seed), seed & 0x0fffffffu);
    path_number = (seed >> 28) + frame.data.spp * frame.data.variation & PATH_NUMBER;
#endif
}

uint start(uint slot, Found f, uint source, out vec3 albedo) {
    uint seed = seeds.data[slot];
#ifdef LENS
    vec3 viewer = ray_origin(seed);
#else
    const vec3 viewer = vec3(0.0);
#endif
    Seen seen = seen_from(viewer, f);
    albedo = seen.surface.unlit ? vec3(0.0) : from_everywhere(seen).diffuse;
    if (!(largest_component(albedo) > 0.0)) {
        return PATH_ENDS;
    }
    begin_path(seed, source);
    return send_diffuse(seen, slot, diffuse_seed(0u), vec3(1.0), 0u);
}

void main() {
    uint slot = dense_index();
    uint kind = PATH_ENDS;
    if (slot < counters.data.samples) {
        Found f = found.data[slot];
        uint source = source_of(slot);
        bool visible = f.primitive != FOUND_LOST && (f.instance & OCCLUDED_BIT) == 0u;
        vec3 albedo = vec3(0.0);
        if (visible && f.instance != SKY_INSTANCE) {
            kind = start(slot, f, source, albedo);
        }
        gathered.data[slot] = Gathered(albedo, kind);
        brought.data[slot] = uvec4(0u, 0u, 0u, source);
    }
    list_path(gl_LocalInvocationIndex, slot < counters.data.samples ? slot : NO_PATH, kind, 0u, slot);
}
