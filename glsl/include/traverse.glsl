// The walk through both levels of the acceleration structure (src/accel/): top-level nodes over instances, and under each
// instance the nodes of its mesh, all in one buffer. Two loops: the walk, and the primitives of a leaf.
//
// An entry shader binds, under these names, before it includes this file:
//   readonly buffer .. { uvec4 data[]; } nodes;         five a node: the top level from node 0, then the meshes'
//   readonly buffer .. { vec4 data[]; } corners;        two a triangle slot: (v0.xyz, v1.x), (v1.yz, v2.xy)
//   readonly buffer .. { float data[]; } rest;          one a triangle slot: v2.z
//   readonly buffer .. { Instance data[]; } instances;
// With TRAVERSE_ANY defined the walk ends at the first hit found, whichever it is. With ALPHA defined the shader also
// provides, before it includes this file,
//   bool alpha_hit(uint instance, uint primitive, float u, float v, float t)
// which says whether the surface is there; it is asked for instances with INSTANCE_ALPHA only.
//
// With CULL_BACK defined it provides, likewise,
//   bool is_one_sided(uint primitive)
// and triangles that are one-sided are not met from behind (glTF 2.0, section 3.9.8).
//
// With MOTION defined, it includes placement.glsl and sets `frame_time`, when the ray is: instances are met where they are then.
//
// Call traverse() from one place: a second call is a second copy of its loops for the driver's compiler.

#ifndef STILLRAY_TRAVERSE
#define STILLRAY_TRAVERSE

#include "count.glsl"
#include "intersect.glsl"

// What a ray found.
struct Intersection {
    uint instance;   // meaningless if primitive is HIT_SKY
    uint primitive;  // global triangle slot, or HIT_SKY
    float u;         // weight of vertex 1
    float v;         // weight of vertex 2
    float t;         // in lengths of the direction; tmax if nothing is hit
};

struct Corners {
    vec3 v0;
    vec3 v1;
    vec3 v2;
};

// Object-space vertices of a triangle slot.
Corners load_corners(uint primitive) {
    vec4 a = corners.data[2u * primitive];
    vec4 b = corners.data[2u * primitive + 1u];
    return Corners(a.xyz, vec3(a.w, b.xy), vec3(b.zw, rest.data[primitive]));
}

// Whether a hit is to be taken instead of the best one: the nearer, and of equally near ones the one of the lower instance,
// then of the lower primitive, so that the result does not depend on the order of the walk. (The t of a triangle seen
// edge-on is uncertain by its whole depth; a box that another hit has put out of reach may hold such a one. The walk's own
// order is fixed by the trees, so that the outcome is the same run after run there too.) best starts with both zero: nothing
// is lower, so a hit at tmax itself is not taken.
bool is_better(Intersection best, float t, uint instance, uint primitive) {
    bool lower = instance < best.instance || (instance == best.instance && primitive < best.primitive);
    return t > 0.0 && (t < best.t || (t == best.t && lower));
}

// The closest hit with 0 < t < tmax (with TRAVERSE_ANY: some such hit). The direction need not be normalised.
//
// A group is (base, bits). As nodes: bits 24..31 are children to visit in order of priority, bits 0..7 all inner children.
// As primitives: bits 0..23. What is put off is pushed as one of both kinds, at most one entry a level, and two more where
// an instance is entered: accel/ keeps the sum of the depths below TRAVERSAL_STACK.
Intersection traverse(vec3 origin, vec3 direction, float tmax) {
    count_ray();
    const uint WORLD = 0xffffffffu;
    uvec2 stack[TRAVERSAL_STACK];
    uint stacked = 0u;
    uint entered = WORLD;  // entries on the stack when the instance was entered; WORLD: in the top level
    uint instance = 0u;
    uint node_base = 0u;
    uint triangle_base = 0u;
#ifdef MOTION
    uint shape = 0u;  // the instance's flags
#endif
    Intersection best = Intersection(0u, 0u, 0.0, 0.0, tmax);
    bool found = false;
    uvec2 group = uvec2(0u, in_range(origin, direction) ? 0x80000000u : 0u);
    Ray ray = make_ray(origin, group.y == 0u ? vec3(1.0) : direction);

    for (uint visited = 0u; visited < TRAVERSAL_STEPS; visited++) {
        uvec2 primitives = group;
        if (group.y > 0x00ffffffu) {
            uint inner = group.y;
            uint bit = findMSB(inner);
            uint child = (bit - 24u) ^ (ray.octant & 7u);
            uint node = 5u * (node_base + group.x + bitCount(inner & ((1u << child) - 1u)));
            group.y &= ~(1u << bit);
            if (group.y > 0x00ffffffu && stacked < TRAVERSAL_STACK) stack[stacked++] = group;
            count_node();
            uvec4 head = nodes.data[node];
            uvec4 refs = nodes.data[node + 1u];
            uint hits = hit_children(head, refs, nodes.data[node + 2u], nodes.data[node + 3u], nodes.data[node + 4u], ray, best.t);
            group = uvec2(refs.x, (hits & 0xff000000u) | (head.w >> 24));
            primitives = uvec2(refs.y, hits & 0x00ffffffu);
        } else {
            group = uvec2(0u);
        }

        bool enter = false;
        while (primitives.y != 0u) {
            uint bit = findMSB(primitives.y);
            primitives.y &= ~(1u << bit);
            uint slot = primitives.x + bit;
            if (entered == WORLD) {
                instance = instances.data[slot].leaf;
                enter = true;
                break;
            }
            uint primitive = triangle_base + slot;
            count_triangle(instance, primitive);
            Corners corner = load_corners(primitive);
#ifdef MOTION
            shape_at(shape, slot, frame_time, corner.v0, corner.v1, corner.v2);
#endif
            TriangleHit hit;
            if (hit_triangle(ray, corner.v0, corner.v1, corner.v2, hit) && is_better(best, hit.t, instance, primitive)) {
#ifdef CULL_BACK
                if (hit.back && is_one_sided(primitive)) continue;
#endif
#ifdef ALPHA
                if ((instances.data[instance].flags & INSTANCE_ALPHA) != 0u
                    && !alpha_hit(instance, primitive, hit.u, hit.v, hit.t)) continue;
#endif
                best = Intersection(instance, primitive, hit.u, hit.v, hit.t);
                found = true;
#ifdef TRAVERSE_ANY
                break;
#endif
            }
        }
#ifdef TRAVERSE_ANY
        if (found) break;
#endif

        if (enter) {
            if (primitives.y != 0u && stacked < TRAVERSAL_STACK) stack[stacked++] = primitives;
            if (group.y > 0x00ffffffu && stacked < TRAVERSAL_STACK) stack[stacked++] = group;
            entered = stacked;
            node_base = instances.data[instance].node_base;
            triangle_base = instances.data[instance].triangle_base;
#ifdef MOTION
            shape = instances.data[instance].flags;
            Placement at = placement_at(instance, frame_time);
            vec3 o = transform_point(at.to_object, origin);
            vec3 d = transform_direction(at.to_object, direction);
#else
            vec3 o = transform_point(instances.data[instance].to_object, origin);
            vec3 d = transform_direction(instances.data[instance].to_object, direction);
#endif
            bool usable = in_range(o, d);
            ray = make_ray(o, usable ? d : vec3(1.0));
            group = uvec2(0u, usable ? 0x80000000u : 0u);
        }
        if (group.y <= 0x00ffffffu) {
            if (stacked == entered) {
                entered = WORLD;
                node_base = 0u;
                ray = make_ray(origin, direction);
            }
            if (stacked == 0u) break;
            group = stack[--stacked];
        }
    }
    if (!found) best.primitive = HIT_SKY;
    return best;
}

#endif
