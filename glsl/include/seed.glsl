// What a sample carries of how it was drawn, where a frame models what is sampled: the pixel that it was made for and its
// number there, from which follow its places on the lens and on lights. They travel with the sample, so that its noise stays
// on the surface. Twin: src/oracle/seed.rs, exact. With bindings `sampler_table` and `frame` it tells the coordinates.

#ifndef STILLRAY_SEED
#define STILLRAY_SEED

#include "types.glsl"

// 14 bits a pixel coordinate, 4 bits of number: a frame has 16384 pixels across at most, and a pixel 16 samples.
uint new_seed(uvec2 pixel, uint number) {
    return pixel.x | (pixel.y << 14) | (number << 28);
}

#if defined(LENS) || defined(AREA) || defined(ENVIRONMENT) || defined(PATH)
#include "sampler.glsl"

// Pairs of dimensions of a path; 0 is the place in the pixel.
const uint PAIR_LENS = 1u;
const uint PAIR_TIME = 2u;
const uint PAIR_LIGHT = 3u;
const uint PAIR_ENVIRONMENT = 5u;
const uint PAIR_LOBE = 4u;
const uint PAIR_CHOICE = 6u;  // which lobe, and which triangle that shines

// A pair of coordinates, 2^32 to one.
uvec2 seed_bits(uint seed, uint pair) {
    uvec2 pixel = uvec2(seed & 16383u, (seed >> 14) & 16383u);
    return sampler_pair(pixel, (seed >> 28) + 16u * frame.data.variation, pair);
}

// The same in [0, 1).
vec2 seed_pair(uint seed, uint pair) {
    uvec2 at = seed_bits(seed, pair);
    return vec2(unit_float(at.x), unit_float(at.y));
}

#ifdef PATH
// Of the steps of a path after the first, as if another pixel's, the farther away the later: all pixels of a neighbourhood draw
// from another one of the same evenness.
uint path_seed(uint seed, uint step) {
    uint x = seed + 2741u * step;
    uint y = (seed >> 14) + 6053u * step;
    return (seed & 0xf0000000u) | (x & 16383u) | (y & 16383u) << 14;
}
#endif
#endif

#endif
