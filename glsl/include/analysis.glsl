// Density analysis on bitmasks (paper 1, section 4.2). Twin: src/oracle/analyze.rs, exact. No bindings.
//
// A mask word holds the occupancy of a pixel's 16 subpixels in its low half and, of those, the unoccluded ones in its
// high half. The occlusion mask of the paper is the one without the other.

#ifndef STILLRAY_ANALYSIS
#define STILLRAY_ANALYSIS

#include "random.glsl"
#include "types.glsl"

// Unoccluded samples in the 2 x 2 pixels centred on a pixel: all of its own, and the facing halves and quarters of its
// neighbours. `near[i]` is the mask word of neighbour (i % 3 - 1, i / 3 - 1); off the frame it is 0.
uint window_count(uint near[9]) {
    const uint facing[9] = uint[9](0xcc00u, 0xff00u, 0x3300u, 0xccccu, 0xffffu, 0x3333u, 0x00ccu, 0x00ffu, 0x0033u);
    uint count = 0u;
    for (int i = 0; i < 9; ++i) {
        count += uint(bitCount((near[i] >> 16) & facing[i]));
    }
    return count;
}

// Whether that window holds a sample that was found occluded: whether surfaces move against each other there.
//
// Where they do, Equation 1 is biased, and this is where we depart from it. Surfaces in front keep all their samples. Those
// behind lose the ones that get covered, and what is uncovered beside begins without any. The density of the window stays
// within its tolerance, since samples of both crowd where the front advances: the front weighs too much in the picture, and
// thin strands look thicker and brighter than they are (paper 1, section 7). So here a pixel has to answer for itself: its
// strata are balanced, which evicts where samples crowd, and it is filled to the target without tolerance, which adds where
// they are missing. Elsewhere, and for a camera that only turns or zooms, samples are left alone. It costs reuse at edges: of
// a hairball at density 4, panned, 91 % of the samples are reused instead of 97 %, and its mean radiance is, after ten
// frames, within 0.3 % of the reference instead of 1.4 % too bright. What is left in the first frames of a movement
// is that verification comes after the analysis: what was covered just now is counted as there. FRAME_PAPER_EDGES has it the
// paper's way.
bool window_hides(uint near[9]) {
    uint turned[9];
    for (int i = 0; i < 9; ++i) {
        turned[i] = (near[i] & ~(near[i] >> 16)) << 16;
    }
    return window_count(turned) != 0u;
}

// Area of that window in quarter pixels, clipped to the frame.
uint window_quarters(uvec2 pixel, uvec2 size) {
    uint across = 2u + uint(pixel.x > 0u) + uint(pixel.x + 1u < size.x);
    uint down = 2u + uint(pixel.y > 0u) + uint(pixel.y + 1u < size.y);
    return across * down;
}

// 4 x 4 ordered dither (Bayer 1973), a number in 0..15; every 2 x 2 block holds one of each quarter of the range.
uint bayer(uvec2 pixel) {
    uvec2 p = pixel & 3u;
    uint q = p.x ^ p.y;
    return ((q & 1u) << 3) | ((p.y & 1u) << 2) | ((q & 2u)) | ((p.y & 2u) >> 1);
}

// Equation 1: samples to add (positive) or to evict (negative). The paper rounds up. Every pixel of a sparse region does
// so, which overshoots: with d_target = 0.5 an empty region would fill to 1, empty, fill, and so on. The fraction is
// therefore dithered over pixels: right on average, the same for whole numbers, and it settles.
int sample_demand(uint count, uint quarters, float d_target, float d_tolerance, uvec2 pixel) {
    // Everything times the window's area: Vulkan does not round divisions correctly, and a density that is off by an ulp
    // would cross the tolerance or a whole number. Sums, products and comparisons are exact here.
    float area = float(quarters);
    precise float lack = d_target * area - float(4u * count);
    // A tolerance above the target allows a density of 0, and would leave the frame black for ever: an empty window asks.
    precise float allowed = (lack > 0.0 ? min(d_tolerance, d_target) : d_tolerance) * area;
    if (!(abs(lack) >= allowed)) {
        return 0;
    }
    precise float scaled = abs(lack) + (float(bayer(pixel)) + 0.5) * 0.0625 * area;
    int n = int(min(scaled / area, 16.0));
    n -= int(float(n) * area > scaled);
    n += int(n < 16 && float(n + 1) * area <= scaled);
    return lack < 0.0 ? -n : n;
}

// The subpixels of stratum s in 0..3, a quarter of the pixel.
uint stratum_mask(uint s) {
    return 0x0033u << (2u * (s & 1u) + 8u * (s >> 1));
}

// The stratum with the most (or the fewest) samples; ties go to the first in an order that `turn` rotates.
uint extreme_stratum(uint mask, uint turn, bool most) {
    uint best = 0u;
    int best_count = most ? -1 : 17;
    for (uint i = 0u; i < 4u; ++i) {
        uint s = (i + turn) & 3u;
        int count = bitCount(mask & stratum_mask(s));
        if (most ? count > best_count : count < best_count) {
            best = s;
            best_count = count;
        }
    }
    return best;
}

// One set bit of a mask that is not empty, chosen by a hash.
uint choose_bit(uint mask, uint h) {
    uint skip = h % uint(bitCount(mask));
    for (uint i = 0u; i < skip; ++i) {
        mask &= mask - 1u;
    }
    return mask & (~mask + 1u);
}

// The mask word without the visible samples by which a stratum has two or more than another.
uint balanced(uint word, uint h) {
    for (uint i = 0u; i < 16u; ++i) {
        uint visible = word >> 16;
        h = hash_uint(h);
        uint most = visible & stratum_mask(extreme_stratum(visible, h & 3u, true));
        uint least = visible & stratum_mask(extreme_stratum(visible, h & 3u, false));
        if (bitCount(most) < bitCount(least) + 2) {
            break;
        }
        word &= ~(choose_bit(most, h >> 2) * 0x10001u);
    }
    return word;
}

// What becomes of a pixel: kept subpixels in the low half, new ones in the high half. `there` are the bits that stand for
// subpixels.
uint plan_pixel(uint word, int demand, uint occluded_limit, uint there, uint h) {
    uint visible = word >> 16;
    uint occluded = (word & 0xffffu) & ~visible;
    uint added = 0u;
    for (int i = demand; i < 0 && visible != 0u; ++i) {
        h = hash_uint(h);
        uint s = extreme_stratum(visible, h & 3u, true);
        visible &= ~choose_bit(visible & stratum_mask(s), h >> 2);
    }
    for (int i = 0; i < demand; ++i) {
        h = hash_uint(h);
        uint taken = visible | added;
        uint stratum = stratum_mask(extreme_stratum(taken, h & 3u, false)) & there & ~taken;
        if (stratum == 0u) {
            break;  // the emptiest stratum is full: so are all
        }
        uint vacant = stratum & ~occluded;
        added |= choose_bit(vacant != 0u ? vacant : stratum, h >> 2);
        occluded &= ~added;
    }
    while (uint(bitCount(occluded)) > occluded_limit) {
        h = hash_uint(h);
        occluded &= ~choose_bit(occluded, h >> 2);
    }
    return visible | occluded | (added << 16);
}

// Where a new sample lies: anywhere in its subpixel but for a margin of an eighth, which is wider than the error of
// reprojecting it, so that it is found in the same subpixel again when nothing moves.
vec2 new_position(uvec2 pixel, uint subpixel, uint h, uint flags) {
    uint hx = hash_combine(h, subpixel);
    uint hy = hash_uint(hx);
    precise vec2 inside = 0.125 + 0.75 * vec2(unit_float(hx), unit_float(hy));
    float extent = (flags & FRAME_QUARTERS) != 0u ? 2.0 : 1.0;
    precise vec2 position = vec2(pixel) + (vec2(subpixel & 3u, subpixel >> 2) + inside * extent) * 0.25;
    return position;
}

uint pixel_hash(uvec2 pixel, uint frame, uint seed) {
    return hash_combine(hash_combine(hash_combine(seed, frame), pixel.x), pixel.y);
}

#endif
