// What of a surface with an alpha mask or blend is there. Twin: src/oracle/shade/alpha.rs, exact. No bindings, no loops.
//
// Blending needs layers in order, which single rays do not bring, and every ray that went on behind a layer would be a
// ray to be verified. So alpha is coverage: a point of the surface is there if its alpha exceeds a threshold that is a hash
// of the point (Wyman and McGuire 2017, "Hashed Alpha Testing"). Averaged over a pixel this is blending, in any order.
// The threshold belongs to the point in object space, and so it travels with the surface as cached samples do: a camera
// that stands still sees the same bits, and one that moves sees noise that sticks to the surface instead of crawling over it.
//
// Points share a threshold within cells of about a pixel's footprint. Cells much smaller than a pixel would turn rounding
// of the hit point into noise; much larger ones would show. Rounding the footprint down to a power of two keeps the cells
// as they are while the distance changes, except where it passes an octave.

#ifndef STILLRAY_ALPHA
#define STILLRAY_ALPHA

#include "random.glsl"
#include "types.glsl"

// Index of a cell along an axis, as bits to be hashed: exact for every finite position, since dividing by a power of two
// and flooring both are. (No integer would hold the cells of a planet-sized mesh seen from near.)
uint cell_bits(float position, float inverse_cell) {
    precise float index = floor(position * inverse_cell);
    uint bits = floatBitsToUint(index);
    return bits == 0x80000000u ? 0u : bits;  // -0 and 0 are the same cell
}

// The threshold in [0, 1) of a point. `cell` is the size of a pixel's footprint in object space; `seed` varies the pattern,
// for references that converge, and so that instances and layers do not share one.
float alpha_threshold(vec3 object_position, float cell, uint seed) {
    // The power of two at or below the cell, within what has an inverse.
    uint exponent = clamp((floatBitsToUint(cell) >> 23) & 0xffu, 2u, 252u);
    float inverse_cell = uintBitsToFloat((254u - exponent) << 23);
    uint h = hash_combine(seed, cell_bits(object_position.x, inverse_cell));
    h = hash_combine(h, cell_bits(object_position.y, inverse_cell));
    h = hash_combine(h, cell_bits(object_position.z, inverse_cell));
    return unit_float(hash_combine(h, exponent));
}

// Whether a point of a surface with this alpha (0..1) is there. Alpha 1 always is, alpha 0 never.
bool alpha_passes(Material material, float alpha, vec3 object_position, float cell, uint seed) {
    if ((material.flags & MATERIAL_MASK) != 0u) {
        return alpha >= material.alpha_cutoff;
    }
    if ((material.flags & MATERIAL_BLEND) != 0u) {
        return alpha > alpha_threshold(object_position, cell, seed);
    }
    return true;
}

#endif
