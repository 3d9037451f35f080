// Pixels, subpixels and the camera. Twin: src/oracle/camera.rs. No bindings.
//
// Positions are camera-relative in world axes; pixel coordinates have x to the right and y down, (0, 0) at the corner of
// the frame and (0.5, 0.5) in the middle of its first pixel.

#ifndef STILLRAY_CAMERA
#define STILLRAY_CAMERA

#include "ray.glsl"

// Subpixels of a pixel across and down (M in paper 1). Bit i of a mask is subpixel (i % 4, i / 4).
const uint M = 4u;

// With FRAME_QUARTERS, M is 2: a pixel has a subpixel a stratum. Masks stay as they are, and the first of a stratum's four
// bits stands for it.
const uint QUARTER_BITS = 0x0505u;

// The bits of a mask that stand for subpixels.
uint subpixel_bits(uint flags) {
    return (flags & FRAME_QUARTERS) != 0u ? QUARTER_BITS : 0xffffu;
}

// The bit that stands for a place of the 4 x 4.
uint subpixel_bit(uint place, uint flags) {
    return (flags & FRAME_QUARTERS) != 0u ? place & 10u : place;
}

// Where the claim on a subpixel is among those of all pixels.
uint claim_slot(uint index, uint bit, uint flags) {
    uint quarter = (bit >> 3) * 2u + ((bit >> 1) & 1u);
    return (flags & FRAME_QUARTERS) != 0u ? index * 4u + quarter : index * (M * M) + bit;
}

// Pixels are numbered tile by tile (8 x 8, the last ones smaller), so that lists in pixel order are coherent. There are
// no gaps: every index below width * height is one pixel.
uint pixel_index(uvec2 pixel, uvec2 size) {
    uvec2 tile = pixel / 8u;
    uvec2 inside = pixel % 8u;
    uvec2 extent = min(uvec2(8u), size - tile * 8u);
    return tile.y * 8u * size.x + tile.x * 8u * extent.y + inside.y * extent.x + inside.x;
}

// Threads of a workgroup of every dispatch over the dense list. (gl_WorkGroupSize would be 1 here: glslang takes its value
// where it is read, and a shader's local size is declared after its includes.)
const uint DENSE_GROUP = 64u;

// Index in the dense list of samples. Its dispatches are two-dimensional, since one dimension can be short of groups.
uint dense_index() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * DENSE_GROUP + gl_LocalInvocationIndex;
}

// `precise` throughout: several kernels project the same point and must agree to the bit.
float dot_precise(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}

// Projects a camera-relative point (or a direction, for the sky). False for what lies behind, or farther from the middle of
// the frame than `reach` times its border. `shift` is where a ray from elsewhere on the lens shows it, in metres at its depth.
// The comparison precedes the division, so that nothing is ever divided by zero: |x| < z tan reach implies z tan > 0.
bool project_within(
    vec4 right, vec4 up, vec3 forward, uvec2 size, vec3 relative, vec2 shift, float reach, out vec2 pixel) {
    precise float x = dot_precise(right.xyz, relative) + shift.x;
    precise float y = dot_precise(up.xyz, relative) + shift.y;
    float z = dot_precise(forward, relative);
    precise float half_width = z * right.w;
    precise float half_height = z * up.w;
    pixel = vec2(0.0);
    if (!(abs(x) < half_width * reach && abs(y) < half_height * reach)) {
        return false;
    }
    precise float px = (x / half_width * 0.5 + 0.5) * float(size.x);
    precise float py = (0.5 - y / half_height * 0.5) * float(size.y);
    pixel = vec2(px, py);
    return true;
}

// Direction through a point of the frame, of length 1 along the viewing direction.
vec3 axes_direction(vec4 right, vec4 up, vec3 forward, uvec2 size, vec2 pixel) {
    vec2 ndc = pixel / vec2(size) * 2.0 - 1.0;
    return forward + right.xyz * (ndc.x * right.w) - up.xyz * (ndc.y * up.w);
}

vec3 camera_direction(Frame frame, vec2 pixel) {
    return axes_direction(frame.right, frame.up, frame.forward.xyz, frame.size, pixel);
}

// The pixel that a projected point lies in. Rounding can put a point just inside the frustum on the frame's far edge.
uvec2 pixel_of(vec2 pixel, uvec2 size) {
    return min(uvec2(pixel), size - 1u);
}

// The place in that pixel among 4 x 4, as a bit index.
uint subpixel_of(vec2 pixel, uvec2 owner) {
    uvec2 sub = min(uvec2((pixel - vec2(owner)) * float(M)), uvec2(M - 1u));
    return sub.y * M + sub.x;
}

#endif
