// How paths go on from one surface to the next (paper 2, sections 3.3 and 3.5). Needs what radiance.glsl needs, and the bindings
//   buffer .. { uvec4 data[]; } path_origins;     one a sample: origin of its ray, camera-relative; its kind and number (path_tag)
//   buffer .. { uvec4 data[]; } path_directions;  its unit direction; of diffuse paths the scrambling
//   buffer .. { uvec4 data[]; } path_weights;     what its radiance counts for; what it is inside of
//   buffer .. { uint data[]; } path_list;         two in turn, `capacity` samples each: see PathCounters
//   buffer .. { PathCounters data[]; } path_counters;
// Every thread of a workgroup of 64 calls list_path().

#ifndef STILLRAY_PATH
#define STILLRAY_PATH

#include "lobe.glsl"
#include "radiance.glsl"
#include "tile_sum.glsl"

const uint PATH_ENDS = 0u;
const uint PATH_REFLECTED = 1u;
const uint PATH_REFRACTED = 2u;

// What a ray is inside of: two materials, one inside the other, as their numbers and 1. What is inside of more is not
// kept, nor a material beyond the first 65534. What is left without having been entered is what was entered last: a body's
// faces may be of several materials.
uint entered(uint inside, uint material) {
    return material < 65535u ? inside << 16 | material + 1u : inside;
}

uint left(uint inside, uint material) {
    return inside >> 16 == material + 1u ? inside & 0xffffu : inside >> 16;
}

// Index of refraction of what a ray is inside of.
float index_inside(uint inside) {
    uint material = inside & 0xffffu;
    return material == 0u ? 1.0 : max(materials.data[material - 1u].index, 1.0);
}

// What is left of light behind a length in metres of what a ray is inside of (Beer's law).
vec3 transmittance(uint inside, float length) {
    uint material = inside & 0xffffu;
    return material == 0u ? vec3(1.0) : exp(-materials.data[material - 1u].absorption * length);
}

bool transmits(Reflector r) {
    return r.opaque < 1.0 && r.metallic < 1.0;
}

// Whether a surface's lobe is followed by a ray.
bool is_followed(Surface s) {
    bool glossy = frame.data.gloss > 0.0 && s.reflector.roughness <= frame.data.gloss;
    return !s.unlit && (s.exponent > 0.0 || glossy || transmits(s.reflector));
}

// What a path brings whose ray finds nothing, what stands in for it where a ray is not sent, and how many rays a path has at
// most. Where light is scattered the map of light from all around has been sampled, and shadow rays pass straight through what
// transmits: a diffuse path brings the map only by way of a reflection.
#ifdef DIFFUSE
vec3 radiance_beyond(vec3 direction) {
    return path_mirrored ? sky_radiance(direction) : frame.data.environment.rgb;
}

vec3 radiance_instead(Bounce next) {
    return path_mirrored || !next.through ? beyond_radiance(next.direction) : frame.data.environment.rgb;
}

uint most_rays() {
    return frame.data.indirect;
}

// What a ray carries besides where it goes.
uint path_tag(bool through) {
    return RAY_INDIRECT << PATH_KIND | path_number | (path_mirrored || !through ? PATH_MIRRORED : 0u);
}
#else
const uint path_scramble = 0u;

vec3 radiance_beyond(vec3 direction) {
    return sky_radiance(direction);
}

vec3 radiance_instead(Bounce next) {
    return beyond_radiance(next.direction);
}

uint most_rays() {
    return frame.data.path_depth;
}

uint path_tag(bool through) {
    return (through ? RAY_REFRACTED : RAY_REFLECTED) << PATH_KIND;
}
#endif

// The next ray of a sample's path, if it goes on; what comes without one is added to the radiance.
uint follow_path(Seen seen, uint slot, uint seed, uint step, vec3 throughput, uint inside, inout vec3 radiance) {
    Material material = materials.data[seen.material];
    bool solid = (material.flags & MATERIAL_SOLID) != 0u;
    bool outside = dot(seen.point.normal, seen.view) >= 0.0;
    uint beyond = outside ? entered(inside, seen.material) : left(inside, seen.material);
    float own = max(material.index, 1.0);
    float index = outside ? index_inside(inside) / own : own / index_inside(beyond);
    Scatterer s = Scatterer(seen.surface.reflector, seen.surface.exponent, solid ? index : 0.0, frame.data.part);
    float which = unit_float(seed_bits(seed, PAIR_CHOICE).x);
    Bounce next = scatter(s, seen.surface.normal, seen.surface.geometric, seen.view, seed_pair(seed, PAIR_LOBE), which);
    vec3 weight = throughput * next.weight;
    if (!(largest_component(weight) > 0.0)) {
        return PATH_ENDS;
    }
    if (step >= most_rays()) {
        radiance += weight * radiance_instead(next);
        return PATH_ENDS;
    }
    uint within = next.through && solid ? beyond : inside;
    path_origins.data[slot] = uvec4(floatBitsToUint(offset_origin(seen.point, next.direction)), path_tag(next.through));
    path_directions.data[slot] = uvec4(floatBitsToUint(next.direction), path_scramble);
    path_weights.data[slot] = uvec4(floatBitsToUint(weight), within);
    return next.through ? PATH_REFRACTED : PATH_REFLECTED;
}

shared uint path_first[3];

// Lists a sample's ray of a kind for a step. In a workgroup they are in the order of its threads. `index` is the thread's in the list
// of samples, or in this step's list where every sample has a thread; NO_PATH behind its end.
void list_path(uint thread, uint index, uint kind, uint step, uint slot) {
    uint mine = kind == PATH_REFLECTED ? 1u : (kind == PATH_REFRACTED ? 0x10000u : 0u);
    uint before = exclusive_sum(thread, mine);
    if (thread == 63u) {
        uint all = before + mine;
        path_first[0] = atomicAdd(path_counters.data[step].reflected, all & 0xffffu);
        path_first[1] = atomicAdd(path_counters.data[step].refracted, all >> 16);
        path_first[2] = atomicAdd(path_counters.data[step].listed, (all & 0xffffu) + (all >> 16));
    }
    barrier();
    uvec2 behind = uvec2(before & 0xffffu, before >> 16);
    uint at = kind == PATH_REFLECTED ? path_first[0] + behind.x : frame.data.capacity - 1u - path_first[1] - behind.y;
    at = (frame.data.flags & FRAME_PATHS_MIXED) != 0u ? path_first[2] + behind.x + behind.y : at;
    bool spread = (frame.data.flags & FRAME_PATHS_SPREAD) != 0u;
    if (spread ? index != NO_PATH : kind != PATH_ENDS) {
        uint first = (step & 1u) * frame.data.capacity;
        path_list.data[first + (spread ? index : at)] = kind != PATH_ENDS ? slot : NO_PATH;
    }
}

#endif
