// Prefix sum over the 64 pixels of a tile, which is a workgroup. Every thread of it has to call. No bindings.

#ifndef STILLRAY_TILE_SUM
#define STILLRAY_TILE_SUM

shared uint sums[64];

// Samples before this thread's in the tile.
uint exclusive_sum(uint thread, uint count) {
    sums[thread] = count;
    barrier();
    for (uint step = 1u; step < 64u; step <<= 1) {
        uint before = thread >= step ? sums[thread - step] : 0u;
        barrier();
        sums[thread] += before;
        barrier();
    }
    return sums[thread] - count;
}

#endif
