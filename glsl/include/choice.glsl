// Which lights a sample sends shadow rays to. Twin: src/oracle/shadow.rs, exact. No bindings, no loops.

#ifndef STILLRAY_CHOICE
#define STILLRAY_CHOICE

#include "random.glsl"
#include "types.glsl"

// Where a scene has more lights than a sample has shadow rays, as many as there are rays are chosen for it, all sets of that
// size alike, and each counts for as many as are left out: right on average. The choice is the sample's own, by a hash of
// where it lies on its surface, so that it stays with the sample.
uint light_hash(Sample s, uint seed) {
    uvec3 at = floatBitsToUint(s.position);
    return hash_combine(hash_combine(hash_combine(hash_combine(seed, s.instance & INSTANCE_MASK), at.x), at.y), at.z);
}

// For how many lights each chosen one counts. Without shadow rays all are chosen.
float light_weight(uint lights, uint rays) {
    return rays == 0u || rays >= lights ? 1.0 : float(lights) / float(rays);
}

#endif
