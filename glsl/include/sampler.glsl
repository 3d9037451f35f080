// Where samples lie in the dimensions of a path (paper 2, section 4). Twin: src/sampler/, exact. Needs the binding
// `sampler_table`, which the twin fills.

#ifndef STILLRAY_SAMPLER
#define STILLRAY_SAMPLER

#include "random.glsl"
#include "types.glsl"

// Nested uniform scrambling (Owen 1995) by a hash: every bit is turned or not by a hash of those above.
uint owen_scramble(uint x, uint seed) {
    x = bitfieldReverse(x);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return bitfieldReverse(x);
}

// Point `index` of the sequence of Sobol'.
uint sobol_point(uint index, uint dimension) {
    uint x = 0u;
    for (; index != 0u; index &= index - 1u) {
        x ^= sampler_table.data[SAMPLER_DIRECTIONS + 32u * dimension + uint(findLSB(index))];
    }
    return x;
}

uint spread_bits(uint n) {
    n = (n | (n << 4)) & 0x0f0fu;
    n = (n | (n << 2)) & 0x3333u;
    return (n | (n << 1)) & 0x5555u;
}

// Pixels in Morton order of blocks of 256 x 256 share out one sequence. What comes after the count a pixel has another
// scrambling.
uint sequence_coordinate(uvec2 pixel, uint index, uint dimension) {
    uint log_count = sampler_table.data[SAMPLER_LOG_COUNT];
    uint block = hash_combine(hash_combine(sampler_table.data[SAMPLER_SEED], pixel.x >> 8), pixel.y >> 8);
    uint seed = hash_combine(block, index >> log_count);
    uint place = spread_bits(pixel.x & 255u) | (spread_bits(pixel.y & 255u) << 1);
    uint number = (place << log_count) | (index & ((1u << log_count) - 1u));
    uint shuffled = owen_scramble(number, hash_uint(seed));
    return owen_scramble(sobol_point(shuffled, dimension), hash_combine(seed, dimension));
}

// After sixteen samples a pixel goes on with the next pattern; after all 256 with another copy of them.
uint pattern_coordinate(uvec2 pixel, uint index, uint dimension) {
    uint tile = (pixel.y & 15u) * 16u + (pixel.x & 15u);
    uint own = sampler_table.data[SAMPLER_TILE + tile / 4u] >> (8u * (tile & 3u)) & 255u;
    uint round = index / 16u;
    uint pattern = (own + round) & 15u;
    uint point = pattern * 16u + (index & 15u);
    uint at = sampler_table.data[SAMPLER_POINTS + ((dimension / 2u) * 256u + point) * 2u + (dimension & 1u)];
    uint seed = sampler_table.data[SAMPLER_SEED];
    if (seed == 0u && round < 16u) {
        return at;
    }
    uint copy = hash_combine(hash_combine(seed, round / 16u), dimension);
    uint inside = hash_combine(hash_combine(copy, round), point);
    uint cells = 0xffffffffu << (32u - sampler_table.data[SAMPLER_DIGITS]);
    return ((at ^ copy) & cells) | (inside & ~cells);
}

// Where sample `index` of a pixel lies in a dimension below 16: a fixed-point number, 2^32 to one.
uint sampler_coordinate(uvec2 pixel, uint index, uint dimension) {
    uint kind = sampler_table.data[SAMPLER_KIND];
    if (kind == SAMPLER_PATTERNS) {
        return pattern_coordinate(pixel, index, dimension);
    }
    if (kind == SAMPLER_SEQUENCE) {
        return sequence_coordinate(pixel, index, dimension);
    }
    uint h = hash_combine(hash_combine(hash_uint(sampler_table.data[SAMPLER_SEED]), pixel.x), pixel.y);
    return hash_combine(hash_combine(h, index), dimension);
}

#endif
