// Where a sample is, and where the picture shows it: through its own point of the lens, if the camera has an aperture, and at
// its own time, if the shutter is open for one. Needs bindings `frame` and `instances`, with LENS `sampler_table`, with DEFORM
// `corners` and `rest`, with MOTION `previous_corners`.

#ifndef STILLRAY_PLACE
#define STILLRAY_PLACE

#include "camera.glsl"
#include "placement.glsl"
#include "seed.glsl"

// The axes of a camera, and its lens.
struct Eye {
    vec4 right;
    vec4 up;
    vec3 forward;
    vec4 lens;
};

#ifdef MOTION
// A sample has its time in the shutter's interval, as it has its place on the lens.
float frame_time_of(uint seed) {
    precise float time = 1.0 - frame.data.shutter * (1.0 - unit_float(sample_bits(seed, PAIR_TIME).x));
    return time;
}

Eye eye_now() {
    Eye eye = Eye(frame.data.right, frame.data.up, frame.data.forward.xyz, frame.data.lens);
    if ((frame.data.flags & FRAME_TURNS) != 0u && frame_time < 1.0) {
        blend_axes(frame.data.previous_right.xyz, frame.data.previous_forward.xyz, frame_time, eye.right.xyz, eye.forward);
        precise vec3 up = eye.right.yzx * eye.forward.zxy - eye.right.zxy * eye.forward.yzx;
        precise float wide = frame.data.previous_right.w + (eye.right.w - frame.data.previous_right.w) * frame_time;
        precise float high = frame.data.previous_up.w + (eye.up.w - frame.data.previous_up.w) * frame_time;
        eye.right.w = wide;
        eye.up = vec4(up, high);
    }
    return eye;
}
#else
Eye eye_now() {
    return Eye(frame.data.right, frame.data.up, frame.data.forward.xyz, frame.data.lens);
}
#endif

Eye eye_before() {
    return Eye(frame.data.previous_right, frame.data.previous_up, frame.data.previous_forward.xyz, frame.data.previous_lens);
}

bool is_surface(Sample s) {
    return (s.instance & INSTANCE_MASK) < frame.data.instance_count;
}

#ifdef DEFORM
#include "triangle.glsl"

// A sample on a surface that deforms lies on a triangle, wherever that is.
vec3 object_position(Sample s, uint id) {
    if ((instances.data[id].flags & INSTANCE_DEFORMS) == 0u) {
        return s.position;
    }
    uint p = instances.data[id].triangle_base + uint(s.position.x);
    vec3 a;
    vec3 b;
    vec3 c;
    unpack_corners(corners.data[2u * p], corners.data[2u * p + 1u], rest.data[p], a, b, c);
#ifdef MOTION
    shape_at(instances.data[id].flags, uint(s.position.x), frame_time, a, b, c);
#endif
    return triangle_point(a, b, c, s.position.y, s.position.z);
}
#else
vec3 object_position(Sample s, uint id) {
    return s.position;
}
#endif

// Camera-relative metres; a direction for the sky.
vec3 relative_position(Sample s) {
    vec3 relative = s.position;
    if (is_surface(s)) {
        uint id = s.instance & INSTANCE_MASK;
        vec4 rows[3];
        relative_rows(id, frame_time, rows);
        relative = transform_point(rows, object_position(s, id));
    }
    return relative;
}

#ifdef LENS
#include "disc.glsl"

// A sample's point of a lens, in metres along the axes across and up.
vec2 lens_point(uint seed, vec4 lens) {
    vec2 u = seed_pair(seed, PAIR_LENS);
    vec2 unit = lens.z > 0.0 ? polygon_point(u, lens.z, lens.w) : disc_point(u);
    precise vec2 p = unit * lens.x;
    return p;
}

// Where a sample's camera ray starts, relative to the middle of the lens, metres.
vec3 ray_origin(uint seed) {
    vec2 p = lens_point(seed, frame.data.lens);
    Eye eye = eye_now();
    precise vec3 origin = eye.right.xyz * p.x + eye.up.xyz * p.y;
    return origin;
}

// The direction through a point of the frame: it leads to the same point in focus as the ray through the middle.
vec3 ray_direction(vec2 pixel, vec3 origin) {
    Eye eye = eye_now();
    precise vec3 direction =
        axes_direction(eye.right, eye.up, eye.forward, frame.data.size, pixel) - origin * frame.data.lens.y;
    return direction;
}

// The ray from a lens point p through a point at depth z meets the plane in focus, at distance f, where the ray through the
// middle goes to (x + p (z / f - 1)) / z; for the sky, whose point has no distance, to (x + p z / f) / z.
vec2 through_lens(Eye eye, uint seed, vec3 relative, bool surface) {
    vec2 p = lens_point(seed, eye.lens);
    precise float out_of_focus = dot_precise(eye.forward, relative) * eye.lens.y - (surface ? 1.0 : 0.0);
    precise vec2 shift = p * out_of_focus;
    return shift;
}
#endif

// Where the picture shows what is `relative` to the camera, as far out as `reach` times the frame's border.
bool place_within(Eye eye, uint seed, vec3 relative, bool surface, float reach, out vec2 pixel) {
#ifdef LENS
    vec2 shift = through_lens(eye, seed, relative, surface);
#else
    const vec2 shift = vec2(0.0);
#endif
    return project_within(eye.right, eye.up, eye.forward, frame.data.size, relative, shift, reach, pixel);
}

#endif
