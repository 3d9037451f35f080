// From a hit to what shading needs (glTF 2.0, section 3.9). Twin: src/oracle/shade/material.rs. No loops.
//
// The entry shader declares what texture.glsl asks for.

#ifndef STILLRAY_MATERIAL
#define STILLRAY_MATERIAL

#include "brdf.glsl"
#include "pack.glsl"
#include "texture.glsl"
#include "types.glsl"

// A shading point.
struct Surface {
    Reflector reflector;
    float alpha;       // 0..1; 1 for opaque materials
    vec3 emissive;     // radiance
    float occlusion;   // 0..1: the part of the uniform light that arrives
    bool unlit;        // the base colour is the radiance
#ifdef PATH
    float exponent;    // of Phong's lobe; 0: the lobe of the roughness
#endif
    vec3 normal;       // shading normal, unit, world axes, on the viewer's side of the surface
    vec3 geometric;    // geometric normal, the same
};

// Texture coordinates and colour at a point of a triangle: all that an alpha test reads.
struct Attributes {
    vec2 uv0;
    vec2 uv1;
    vec4 color;
};

Attributes attributes_at(Vertex a, Vertex b, Vertex c, float u, float v) {
    precise float w = 1.0 - u - v;
    precise vec2 uv0 = (a.uv0 * w + b.uv0 * u) + c.uv0 * v;
    precise vec2 uv1 = (a.uv1 * w + b.uv1 * u) + c.uv1 * v;
    vec4 color = decode_color(a.color_rg, a.color_ba) * w + decode_color(b.color_rg, b.color_ba) * u
        + decode_color(c.color_rg, c.color_ba) * v;
    return Attributes(uv0, uv1, color);
}

// Base colour and alpha, 0..1: factor, texture and vertex colour.
vec4 base_color_at(Material material, Attributes at) {
    vec4 color = material.base_color * at.color;
    if (has_texture(material.base_color_texture)) {
        color *= sample_texture(material.base_color_texture, at.uv0, at.uv1, true);
    }
    return clamp(color, 0.0, 1.0);
}

// Part of what enters that passes through, 0..1.
float transmission_at(Material material, Attributes at) {
    float passes = material.transmission * (1.0 - clamp(material.metallic, 0.0, 1.0));
    if (has_texture(material.transmission_texture)) {
        passes *= clamp(sample_texture(material.transmission_texture, at.uv0, at.uv1, false).r, 0.0, 1.0);
    }
    return passes;
}

// Emitted radiance.
vec3 emission_at(Material material, Attributes at) {
    vec3 emission = material.emissive;
    if (has_texture(material.emissive_texture)) {
        emission *= sample_texture(material.emissive_texture, at.uv0, at.uv1, true).rgb;
    }
    return emission;
}

// v as a unit vector, whatever its length; `otherwise` if it has no direction. Tested by its bits, see pack.glsl.
vec3 unit_or(vec3 v, vec3 otherwise) {
    float size = max(max(abs(v.x), abs(v.y)), abs(v.z));
    uint bits = floatBitsToUint(size);
    if (bits < 0x00800000u || bits >= 0x7f800000u) {
        return otherwise;
    }
    return normalize(v / size);
}

// Normals go by the inverse transpose; the rows of to_object are the columns of the inverse's transpose.
vec3 normal_to_world(Instance instance, vec3 n) {
    return n.x * instance.to_object[0].xyz + n.y * instance.to_object[1].xyz + n.z * instance.to_object[2].xyz;
}

vec3 direction_to_world(Instance instance, vec3 d) {
    return vec3(dot(instance.to_relative[0].xyz, d), dot(instance.to_relative[1].xyz, d),
        dot(instance.to_relative[2].xyz, d));
}

// The normal map's normal in the frame of normal and tangent. A mirrored instance turns the handedness around: the
// bitangent is the cross product before the transform, and mirrors change the sign of cross products.
vec3 mapped_normal(Material material, Instance instance, Attributes at, vec3 normal, vec4 tangent) {
    vec3 t = direction_to_world(instance, tangent.xyz);
    t = unit_or(t, vec3(0.0));
    t -= normal * dot(normal, t);
    if (dot(t, t) < 1e-6) {
        return normal;  // along the normal to a thousandth of a radian: there is no frame
    }
    t = normalize(t);
    float handedness = (instance.flags & INSTANCE_FLIPPED) != 0u ? -tangent.w : tangent.w;
    vec3 b = cross(normal, t) * handedness;
    vec3 m = sample_texture(material.normal_texture, at.uv0, at.uv1, false).xyz * 2.0 - 1.0;
    m.xy *= material.normal_scale;
    return unit_or(t * m.x + b * m.y + normal * m.z, normal);
}

// `u` and `v` are the barycentric weights of b and c, `geometric` the unit world-space normal of the triangle's
// counter-clockwise side (in object space; SurfacePoint.normal of ray.glsl), `view` the unit vector to the viewer.
//
// What is seen from behind is shaded from behind, with both normals turned around: glTF asks for it where a material is
// double-sided, and where it is not, the traversal decides whether back faces are seen at all.
Surface surface_at(Material material, Instance instance, Vertex a, Vertex b, Vertex c, float u, float v, vec3 geometric, vec3 view) {
    Attributes at = attributes_at(a, b, c, u, v);
    float w = 1.0 - u - v;
    Surface s;
    vec4 base = base_color_at(material, at);
    s.reflector.base_color = base.rgb;
    s.alpha = (material.flags & (MATERIAL_MASK | MATERIAL_BLEND)) != 0u ? base.a : 1.0;
    s.unlit = (material.flags & MATERIAL_UNLIT) != 0u;
    s.reflector.metallic = material.metallic;
    s.reflector.roughness = material.roughness;
    s.reflector.dielectric = material.dielectric;
    s.reflector.opaque = 1.0;
#ifdef PATH
    s.exponent = material.exponent;
    s.reflector.opaque = 1.0 - transmission_at(material, at);
#endif
    if (has_texture(material.metallic_roughness_texture)) {
        vec4 mr = sample_texture(material.metallic_roughness_texture, at.uv0, at.uv1, false);
        s.reflector.roughness *= mr.g;
        s.reflector.metallic *= mr.b;
    }
    s.reflector.metallic = clamp(s.reflector.metallic, 0.0, 1.0);
    s.reflector.roughness = clamp(s.reflector.roughness, 0.0, 1.0);
    s.emissive = emission_at(material, at);
    s.occlusion = 1.0;
    if (has_texture(material.occlusion_texture)) {
        float open = sample_texture(material.occlusion_texture, at.uv0, at.uv1, false).r;
        s.occlusion = clamp(1.0 + material.occlusion_strength * (open - 1.0), 0.0, 1.0);
    }
    // Opposite normals at the corners can cancel: the triangle's own normal stands in.
    vec3 n = decode_normal(a.normal) * w + decode_normal(b.normal) * u + decode_normal(c.normal) * v;
    s.normal = unit_or(normal_to_world(instance, unit_or(n, vec3(0.0))), geometric);
    if (has_texture(material.normal_texture)) {
        vec4 ta = decode_tangent(a.tangent);
        vec3 t = ta.xyz * w + decode_tangent(b.tangent).xyz * u + decode_tangent(c.tangent).xyz * v;
        s.normal = mapped_normal(material, instance, at, s.normal, vec4(t, ta.w));
    }
    s.geometric = geometric;
    if (dot(geometric, view) < 0.0) {
        s.normal = -s.normal;
        s.geometric = -geometric;
    }
    return s;
}

#endif
