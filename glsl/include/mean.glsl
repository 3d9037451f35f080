// The mean of what the paths of a sample have brought, and how it takes on one more (paper 1, section 6.1). Twin:
// src/oracle/indirect.rs. No bindings, no loops.

#ifndef STILLRAY_MEAN
#define STILLRAY_MEAN

#include "types.glsl"

const uint MEAN_COUNT = 0xffffu;        // that a mean counts for at most, and the bits that say so
const float BROUGHT_MAX = 1e30;         // keeps sums finite; far above what a half holds

Gathered nothing_gathered() {
    return Gathered(vec3(0.0), 0u);
}

uint paths_before(Gathered g) {
    return g.paths >> 16;
}

// What a path may bring: finite, and at most `most` in any channel, of the same colour; 0: no limit.
vec3 within_limit(vec3 brought, float most) {
    bvec3 nan = greaterThan(floatBitsToUint(brought) & 0x7fffffffu, uvec3(INFINITY_BITS));
    vec3 finite = mix(clamp(brought, vec3(0.0), vec3(BROUGHT_MAX)), vec3(0.0), nan);
    float brightest = max(max(finite.r, finite.g), finite.b);
    return most > 0.0 && brightest > most ? finite * (most / brightest) : finite;
}

// With one path more. While light falls alike in each frame the mean is that of all paths, however many; else those of long ago are
// forgotten: the newest counts for `alpha` at least, and the mean for `count` paths at most, by which it goes on once nothing moves.
Gathered with_path(Gathered g, vec3 brought, bool alike, float alpha, uint count) {
    uint before = g.paths & MEAN_COUNT;
    float equal = 1.0 / float(before + 1u);
    float weight = alike ? equal : max(alpha, equal);
    precise vec3 mean = g.radiance + weight * (brought - g.radiance);
    uint counts = min(before + 1u, alike ? MEAN_COUNT : count);
    return Gathered(mean, counts | (g.paths & 0xffff0000u) + 0x10000u);
}

#endif
