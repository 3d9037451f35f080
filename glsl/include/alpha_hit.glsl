// Asks a surface met on the way whether it is there: what the ALPHA variants of the tracing shaders define for
// traverse.glsl. Uses the bindings frame, instances, corners, rest, triangles, vertices, materials, atlas and srgb.

#ifndef STILLRAY_ALPHA_HIT
#define STILLRAY_ALPHA_HIT

#include "alpha.glsl"
#include "material.glsl"
#include "ray.glsl"
#include "triangle.glsl"

// A pixel's footprint at a point of an instance, in object space. It goes by the point's distance from the camera whatever
// the ray, so that camera rays and shadow rays see the same surface.
float footprint(Instance inst, vec3 object) {
    vec3 relative = transform_point(inst.to_relative, object);
    vec3 scale = vec3(length(inst.to_object[0].xyz), length(inst.to_object[1].xyz), length(inst.to_object[2].xyz));
    return length(relative) * frame.data.forward.w * largest_component(scale);
}

bool alpha_hit(uint instance, uint primitive, float u, float v, float t) {
    Triangle corner = triangles.data[primitive];
    Material material = materials.data[corner.material];
    uint holes = MATERIAL_MASK | MATERIAL_BLEND;
#ifdef SHADOW_RAYS
    holes |= MATERIAL_TRANSMITS;
#endif
    if ((material.flags & holes) == 0u) {
        return true;
    }
    Vertex a = vertices.data[corner.vertex0];
    Vertex b = vertices.data[corner.vertex1];
    Vertex c = vertices.data[corner.vertex2];
    Attributes at = attributes_at(a, b, c, u, v);
    float alpha = base_color_at(material, at).a;
    vec3 p0;
    vec3 p1;
    vec3 p2;
    unpack_corners(corners.data[2u * primitive], corners.data[2u * primitive + 1u], rest.data[primitive], p0, p1, p2);
    vec3 object = triangle_point(p0, p1, p2, u, v);
    uint seed = hash_combine(frame.data.alpha_seed, instance);
    float cell = footprint(instances.data[instance], object);
#ifdef SHADOW_RAYS
    if ((material.flags & MATERIAL_TRANSMITS) != 0u
        && !(transmission_at(material, at) <= alpha_threshold(object, cell, ~seed))) {
        return false;
    }
#endif
    return alpha_passes(material, alpha, object, cell, seed);
}

#endif
