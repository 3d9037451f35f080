// Points on triangles. Twin: src/oracle/triangle.rs. No bindings.

#ifndef STILLRAY_TRIANGLE
#define STILLRAY_TRIANGLE

// Corners are stored as 36 bytes a triangle in two buffers: (a, b.x), (b.yz, c.xy) and c.z.
void unpack_corners(vec4 first, vec4 second, float last, out vec3 a, out vec3 b, out vec3 c) {
    a = first.xyz;
    b = vec3(first.w, second.xy);
    c = vec3(second.zw, last);
}

// The point with barycentric weights u of b and v of c. As surface_point() of ray.glsl has it,
// to the bit: a replaced and a new sample of the same hit agree.
vec3 triangle_point(vec3 a, vec3 b, vec3 c, float u, float v) {
    precise vec3 ab = b - a;
    precise vec3 ac = c - a;
    precise vec3 p = a + (u * ab + v * ac);
    return p;
}

#endif
