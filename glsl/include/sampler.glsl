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

// Point `index` of the sequence of Sobol' in two dimensions.
uvec2 sobol_point(uint index, uint dimension) {
    uvec2 x = uvec2(0u);
    for (; index != 0u; index &= index - 1u) {
        uint at = SAMPLER_DIRECTIONS + 32u * dimension + uint(findLSB(index));
        x ^= uvec2(sampler_table.data[at], sampler_table.data[at + 32u]);
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
uvec2 sequence_pair(uvec2 pixel, uint index, uint pair) {
    uint log_count = sampler_table.data[SAMPLER_LOG_COUNT];
    uint block = hash_combine(hash_combine(sampler_table.data[SAMPLER_SEED], pixel.x >> 8), pixel.y >> 8);
    uint seed = hash_combine(block, index >> log_count);
    uint place = spread_bits(pixel.x & 255u) | (spread_bits(pixel.y & 255u) << 1);
    uint number = (place << log_count) | (index & ((1u << log_count) - 1u));
    uvec2 point = sobol_point(owen_scramble(number, hash_uint(seed)), 2u * pair);
    uint scrambling = hash_combine(seed, 2u * pair);
    return uvec2(owen_scramble(point.x, scrambling), owen_scramble(point.y, hash_combine(seed, 2u * pair + 1u)));
}

uint in_cell(uint at, uint copy, uint round, uint point) {
    uint inside = hash_combine(hash_combine(copy, round), point);
    uint cells = 0xffffffffu << (32u - sampler_table.data[SAMPLER_DIGITS]);
    return ((at ^ copy) & cells) | (inside & ~cells);
}

// After sixteen samples a pixel goes on with the next pattern; after all 256 with another copy of them.
uvec2 pattern_pair(uvec2 pixel, uint index, uint pair) {
    uint tile = (pixel.y & 15u) * 16u + (pixel.x & 15u);
    uint own = sampler_table.data[SAMPLER_TILE + tile / 4u] >> (8u * (tile & 3u)) & 255u;
    uint round = index / 16u;
    uint pattern = (own + round) & 15u;
    uint point = pattern * 16u + (index & 15u);
    uint first = SAMPLER_POINTS + (pair * 256u + point) * 2u;
    uvec2 at = uvec2(sampler_table.data[first], sampler_table.data[first + 1u]);
    uint seed = sampler_table.data[SAMPLER_SEED];
    if (seed == 0u && round < 16u) {
        return at;
    }
    uint copy = hash_combine(seed, round / 16u);
    return uvec2(in_cell(at.x, hash_combine(copy, 2u * pair), round, point),
        in_cell(at.y, hash_combine(copy, 2u * pair + 1u), round, point));
}

// Where sample `index` of a pixel lies in dimensions 2 `pair` and 2 `pair` + 1, below 16: fixed-point numbers, 2^32 to one.
uvec2 sampler_pair(uvec2 pixel, uint index, uint pair) {
    uint kind = sampler_table.data[SAMPLER_KIND];
    if (kind == SAMPLER_PATTERNS) {
        return pattern_pair(pixel, index, pair);
    }
    if (kind == SAMPLER_SEQUENCE) {
        return sequence_pair(pixel, index, pair);
    }
    uint h = hash_combine(hash_combine(hash_uint(sampler_table.data[SAMPLER_SEED]), pixel.x), pixel.y);
    h = hash_combine(h, index);
    return uvec2(hash_combine(h, 2u * pair), hash_combine(h, 2u * pair + 1u));
}

#endif
