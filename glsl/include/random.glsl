// Integer hashing for tie-breaks and sample positions. Twin: src/oracle/random.rs, exact. No bindings.

#ifndef STILLRAY_RANDOM
#define STILLRAY_RANDOM

// PCG output permutation over a linear congruential step (O'Neill 2014; as a hash: Jarzynski and Olano 2020).
uint hash_uint(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash_combine(uint h, uint x) {
    return hash_uint(h ^ (x + 0x9e3779b9u));
}

// The top 24 bits as a number in [0, 1).
float unit_float(uint h) {
    return float(h >> 8u) * (1.0 / 16777216.0);
}

#endif
