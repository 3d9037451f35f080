// Texture sampling from the atlas by texel fetches. Twin: src/oracle/shade/texture.rs. No loops.
//
// The entry shader declares, before it includes this:
//     uniform sampler2DArray atlas;        // RGBA8 unorm: all images (src/scene/atlas.rs)
//     buffer ... { float data[256]; } srgb;  // atlas::srgb_table(): sRGB code to linear, each value rounded once
// and may define READ_NEAREST: whether all textures are read as those that ask for their nearest texel.
//
// Level 0 only, nearest or bilinear: there are no mip maps. Every method here takes several samples a pixel over time, and
// a cached sample's colour must not depend on the footprint it was first seen with.

#ifndef STILLRAY_TEXTURE
#define STILLRAY_TEXTURE

#include "types.glsl"

#ifndef READ_NEAREST
#define READ_NEAREST false
#endif

const uint WRAP_REPEAT = 0u;
const uint WRAP_MIRROR = 1u;

// Texel coordinates from 2^30 on, infinities and NaNs, by their bits. Converting those to integers is undefined, and floats
// of that size step over whole images anyway: they read texel 0.
float guard_texel(float x) {
    return (floatBitsToUint(x) & 0x7fffffffu) < 0x4e800000u ? x : 0.0;
}

// The texel in 0..n-1 that texel coordinate i of the infinite plane shows. Exact for all |i| <= 2^30. (GLSL leaves % of
// negative numbers undefined: negative coordinates are mirrored first.)
uint wrap_texel(int i, uint n, uint mode) {
    uint k = uint(i < 0 ? -1 - i : i);
    if (mode == WRAP_REPEAT) {
        uint r = k % n;
        return i < 0 ? n - 1u - r : r;
    }
    if (mode == WRAP_MIRROR) {
        uint r = k % (2u * n);
        return r < n ? r : 2u * n - 1u - r;
    }
    return uint(clamp(i, 0, int(n) - 1));
}

vec4 fetch_texel(TextureSlot slot, uvec2 texel, bool is_srgb) {
    ivec2 at = ivec2(texel + uvec2(slot.texel_origin & 0xffffu, slot.texel_origin >> 16));
    vec4 c = texelFetch(atlas, ivec3(at, int(slot.page)), 0);
    if (is_srgb) {
        uvec3 code = uvec3(c.rgb * 255.0 + 0.5);
        c.rgb = vec3(srgb.data[code.r], srgb.data[code.g], srgb.data[code.b]);
    }
    return c;
}

bool has_texture(TextureSlot slot) {
    return slot.texel_size != 0u;
}

// The slot's texture at the vertex's texture coordinates; colours are decoded before they are filtered. Only for slots that
// have a texture. `precise`: which texels are read must not depend on how a compiler contracts the arithmetic.
vec4 sample_texture(TextureSlot slot, vec2 uv0, vec2 uv1, bool is_srgb) {
    vec2 uv = (slot.flags & 32u) != 0u ? uv1 : uv0;
    uvec2 size = uvec2(slot.texel_size & 0xffffu, slot.texel_size >> 16);
    uvec2 mode = uvec2(slot.flags & 3u, (slot.flags >> 2) & 3u);
    bool nearest = READ_NEAREST || (slot.flags & 16u) != 0u;
    precise float u = (slot.transform.x * uv.x + slot.transform.y * uv.y) + slot.offset.x;
    precise float v = (slot.transform.z * uv.x + slot.transform.w * uv.y) + slot.offset.y;
    precise vec2 at = vec2(u * float(size.x), v * float(size.y)) - (nearest ? 0.0 : 0.5);
    at = vec2(guard_texel(at.x), guard_texel(at.y));
    precise vec2 corner = floor(at);
    precise vec2 weight = at - corner;
    ivec2 i = ivec2(corner);
    uint x0 = wrap_texel(i.x, size.x, mode.x);
    uint y0 = wrap_texel(i.y, size.y, mode.y);
    vec4 c00 = fetch_texel(slot, uvec2(x0, y0), is_srgb);
    if (nearest) {
        return c00;
    }
    uint x1 = wrap_texel(i.x + 1, size.x, mode.x);
    uint y1 = wrap_texel(i.y + 1, size.y, mode.y);
    vec4 c10 = fetch_texel(slot, uvec2(x1, y0), is_srgb);
    vec4 c01 = fetch_texel(slot, uvec2(x0, y1), is_srgb);
    vec4 c11 = fetch_texel(slot, uvec2(x1, y1), is_srgb);
    // Differences of equal texels are exactly 0: a constant image stays constant.
    vec4 top = c00 + (c10 - c00) * weight.x;
    vec4 bottom = c01 + (c11 - c01) * weight.x;
    return top + (bottom - top) * weight.y;
}

#endif
