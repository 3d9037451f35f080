#version 460
#extension GL_GOOGLE_include_directive : require
// Asks the shading includes one question a thread; tests/shading_twin.rs compiles it with one of the macros below defined.
#include "types.glsl"

layout(local_size_x = 64) in;

#ifdef ASK_ALPHA
#include "alpha.glsl"
struct Question { vec3 position; float cell; uint seed; uint padding0; uint padding1; uint padding2; };
struct Answer { float threshold; };
Answer reply(Question q) {
    return Answer(alpha_threshold(q.position, q.cell, q.seed));
}
#endif

#ifdef ASK_PACK
#include "pack.glsl"
struct Question { vec3 color; float depth; vec2 offset; vec2 motion; uint normal; uint tangent; uint rg; uint ba; };
struct Answer { vec4 normal; vec4 tangent; vec4 color; Shaded shaded; };
Answer reply(Question q) {
    return Answer(vec4(decode_normal(q.normal), 0.0), decode_tangent(q.tangent), decode_color(q.rg, q.ba),
        pack_shaded(q.color, q.offset, q.motion, q.depth));
}
#endif

#ifdef ASK_LIGHT
#include "light.glsl"
struct Question { Light light; vec4 point; };
struct Answer { vec4 direction_distance; vec4 irradiance; };
Answer reply(Question q) {
    Incident i = light_at(q.light, q.point.xyz);
    return Answer(vec4(i.direction, i.distance), vec4(i.irradiance, 0.0));
}
#endif

#ifdef ASK_BRDF
#include "brdf.glsl"
struct Question { vec3 base_color; float metallic; vec3 normal; float roughness; vec4 view; vec4 light; };
struct Answer { vec4 punctual; vec4 uniform_light; };
Answer reply(Question q) {
    Reflector r = Reflector(q.base_color, q.metallic, q.roughness, q.view.w, q.light.w);
    return Answer(vec4(both(reflect_light(r, q.normal, q.view.xyz, q.light.xyz)), 0.0),
        vec4(both(reflect_uniform(r, q.normal, q.view.xyz)), 0.0));
}
#endif

#ifdef ASK_SCATTER
#include "lobe.glsl"
struct Question {
    vec3 base_color; float metallic;
    vec3 normal; float roughness;
    vec3 geometric; float dielectric;
    vec3 view; float opaque;
    vec2 u; float which; float part;
    float exponent; float index; float padding0; float padding1;
};
struct Answer { vec3 direction; uint through; vec3 weight; uint padding; };
Answer reply(Question q) {
    Reflector r = Reflector(q.base_color, q.metallic, q.roughness, q.dielectric, q.opaque);
    Bounce b = scatter(Scatterer(r, q.exponent, q.index, q.part), q.normal, q.geometric, q.view, q.u, q.which);
    return Answer(b.direction, uint(b.through), b.weight, 0u);
}
#endif

#ifdef ASK_COLOR
#include "color.glsl"
struct Question { vec4 color; };
struct Answer { vec4 mapped; vec4 encoded; };
Answer reply(Question q) {
    vec3 mapped = tone_map(q.color.rgb);
    return Answer(vec4(mapped, 0.0), vec4(linear_to_srgb(q.color.rgb), 0.0));
}
#endif

#ifdef TEXTURED
layout(set = 0, binding = 2) uniform sampler2DArray atlas;
layout(set = 0, binding = 3, std430) readonly buffer Srgb { float data[256]; } srgb;
#endif

#ifdef ASK_TEXTURE
#include "texture.glsl"
struct Question { TextureSlot slot; vec2 uv0; vec2 uv1; uint is_srgb; uint padding0; uint padding1; uint padding2; };
struct Answer { vec4 color; };
Answer reply(Question q) {
    return Answer(sample_texture(q.slot, q.uv0, q.uv1, q.is_srgb != 0u));
}
#endif

#ifdef ASK_MATERIAL
#include "material.glsl"
struct Question { Material material; Instance instance; Vertex vertices[3]; vec2 uv; uvec2 padding; vec4 geometric; vec4 view; };
struct Answer { vec4 base; vec4 emissive_occlusion; vec4 normal_metallic; vec4 geometric_roughness; };
Answer reply(Question q) {
    Surface s = surface_at(q.material, q.instance, q.vertices[0], q.vertices[1], q.vertices[2], q.uv.x, q.uv.y,
        q.geometric.xyz, q.view.xyz);
    Reflector r = s.reflector;
    return Answer(vec4(r.base_color, s.alpha), vec4(s.emissive, s.occlusion), vec4(s.normal, r.metallic),
        vec4(s.geometric, r.roughness));
}
#endif

layout(set = 0, binding = 0, std430) readonly buffer Questions { Question data[]; } questions;
layout(set = 0, binding = 1, std430) writeonly buffer Answers { Answer data[]; } answers;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < questions.data.length()) {
        answers.data[i] = reply(questions.data[i]);
    }
}
