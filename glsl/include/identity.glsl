// Which samples of two frames are one. Twin: src/oracle/changes.rs, exact. No bindings.

#ifndef STILLRAY_IDENTITY
#define STILLRAY_IDENTITY

#include "types.glsl"

// Whether this is the point that it was. Verification only marks a sample: one with another instance is lost, and one at
// another place was replaced.
bool is_same_point(Sample a, Sample b) {
    bool instance = ((a.instance ^ b.instance) & INSTANCE_MASK) == 0u;
    return instance && floatBitsToUint(a.position) == floatBitsToUint(b.position);
}

#endif
