// Where diffuse paths go (paper 1, section 6.1). Twin: src/oracle/indirect.rs. Needs what path.glsl needs, and DIFFUSE.

#ifndef STILLRAY_INDIRECT
#define STILLRAY_INDIRECT

#include "hemisphere.glsl"
#include "path.glsl"

// The next ray of a diffuse path; nowhere if it counts for nothing. It starts on the viewer's side of the surface.
uint send_diffuse(Seen seen, uint slot, uint seed, vec3 weight, uint inside) {
    if (!(largest_component(weight) > 0.0)) {
        return PATH_ENDS;
    }
    uvec2 bits = path_bits(seed, PAIR_DIFFUSE);
    vec2 u = vec2(unit_float(bits.x), unit_float(bits.y));
    vec3 direction = diffuse_direction(seen.surface.normal, seen.surface.geometric, u);
    uint tag = RAY_INDIRECT << PATH_KIND | path_number;
    path_origins.data[slot] = uvec4(floatBitsToUint(offset_origin(seen.point, seen.surface.geometric)), tag);
    path_directions.data[slot] = uvec4(floatBitsToUint(direction), path_scramble);
    path_weights.data[slot] = uvec4(floatBitsToUint(weight), inside);
    return PATH_REFLECTED;
}

#endif
