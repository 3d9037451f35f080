// When the samples that a frame asks for exceed what the cache holds, each pixel gives up an equal part: offsets are
// scaled by the part that fits, so that counts stay whole and nothing depends on which pixel comes first. No bindings.

#ifndef STILLRAY_THIN
#define STILLRAY_THIN

// `thin` is 2^32 times the part that fits, 0 if everything does.
uint thinned(uint offset, uint thin) {
    uint high;
    uint low;
    umulExtended(offset, thin, high, low);
    return thin == 0u ? offset : high;
}

#endif
