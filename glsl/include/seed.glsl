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

#if defined(LENS) || defined(AREA) || defined(ENVIRONMENT) || defined(PATH) || defined(MOTION)
#include "sampler.glsl"

// Pairs of dimensions of a path; 0 is the place in the pixel.
const uint PAIR_LENS = 1u;
const uint PAIR_TIME = 2u;
const uint PAIR_LIGHT = 3u;
const uint PAIR_ENVIRONMENT = 5u;
const uint PAIR_LOBE = 4u;
const uint PAIR_CHOICE = 6u;  // which lobe, and which triangle that shines
const uint PAIR_EMITTER = 7u;  // which of several

#ifdef DIFFUSE
const uint PAIR_DIFFUSE = 0u;  // a diffuse path's directions: pair 0 is free behind the camera
// Of the diffuse path that the thread is about: its number among those of its sample, what tells the sample from others, and
// whether it was reflected since a surface scattered it.
uint path_number = 0u;
uint path_scramble = 0u;
bool path_mirrored = false;

// As a ray carries them.
void resume_path(uint tag, uint scramble) {
    path_number = tag & PATH_NUMBER;
    path_scramble = scramble;
    path_mirrored = (tag & PATH_MIRRORED) != 0u;
}

// A step of it: another scrambling, of order (Burley 2020) and of values.
uint diffuse_seed(uint step) {
    return hash_combine(path_scramble, step);
}

// A pair of its coordinates, 2^32 to one: the paths of a sample share out one sequence, step by step.
uvec2 path_bits(uint seed, uint pair) {
    uvec2 point = sobol_point(owen_scramble(path_number, hash_uint(seed)), 2u * pair);
    return uvec2(owen_scramble(point.x, hash_combine(seed, 2u * pair)),
        owen_scramble(point.y, hash_combine(seed, 2u * pair + 1u)));
}
#endif

// A pair of a sample's own coordinates, 2^32 to one.
uvec2 sample_bits(uint seed, uint pair) {
    uvec2 pixel = uvec2(seed & 16383u, (seed >> 14) & 16383u);
    return sampler_pair(pixel, (seed >> 28) + 16u * frame.data.variation, pair);
}

// The same where a path is: behind the camera diffuse paths have coordinates of their own.
uvec2 seed_bits(uint seed, uint pair) {
#if defined(DIFFUSE) && !defined(AT_CAMERA)
    return path_bits(seed, pair);
#else
    return sample_bits(seed, pair);
#endif
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
