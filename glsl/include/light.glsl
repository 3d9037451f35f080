// Punctual lights (KHR_lights_punctual), and with AREA lights that have an extent. Twin: src/oracle/shade/light.rs. No bindings, no loops.

#ifndef STILLRAY_LIGHT
#define STILLRAY_LIGHT

#ifdef AREA
#include "disc.glsl"
#endif
#include "types.glsl"

// What a light sends to a point.
struct Incident {
    vec3 direction;   // unit vector to the light; 0 at the light itself
    float distance;   // metres; infinity for directional lights
    vec3 irradiance;  // on a surface perpendicular to the direction; finite
};

// Irradiances are cut off here, so that what is multiplied with them later stays finite. It is far above what a half holds.
const float IRRADIANCE_MAX = 1.1529215e18;  // 2^60

#ifdef MOTION
// A light at a time, part of the way from the last frame to this one. Its direction is this frame's.
Light light_at_time(Light light, float time) {
    precise vec3 position = light.position - light.moved * (1.0 - time);
    light.position = position;
    return light;
}
#endif

#ifdef AREA
// One point of a light that has an extent, as a light: the mean over all points is the light (paper 2, section 3.2). A lamp's
// surface looks along its direction; the sun's is a disc or a rectangle in the sky.
Light light_point(Light light, vec2 u) {
    if (light.shape == LIGHT_SHARP || light.shape == LIGHT_MESH) {
        return light;
    }
    vec2 p = light.shape == LIGHT_DISC ? disc_point(u) : 2.0 * u - 1.0;
    precise vec3 offset = light.right * p.x + light.up * p.y;
    if (light.kind == LIGHT_DIRECTIONAL) {
        vec3 towards = light.direction + offset;
        light.direction = towards / length(towards);
    } else {
        light.position += offset;
    }
    return light;
}
#endif

// Windowed inverse square and spot cone. Sizes are divided out before anything is squared: scenes of micrometres and of
// light years neither overflow nor vanish. At the light's own position there is no direction, and no light.
Incident light_at(Light light, vec3 point) {
    if (light.kind == LIGHT_DIRECTIONAL) {
        return Incident(-light.direction, uintBitsToFloat(0x7f800000u), min(light.intensity, vec3(IRRADIANCE_MAX)));
    }
    vec3 to = light.position - point;
    float size = max(max(abs(to.x), abs(to.y)), abs(to.z));
    if (!(size >= SMALLEST_NORMAL)) {
        return Incident(vec3(0.0), 0.0, vec3(0.0));
    }
    vec3 scaled = to / size;
    float length2 = dot(scaled, scaled);  // 1..3
    float stretch = sqrt(length2);
    vec3 direction = scaled / stretch;
    float factor = 1.0;
    if (light.inv_range2 > 0.0) {
        float part = size * sqrt(light.inv_range2);
        part = part * part * length2;  // (distance / range)^2
        factor = clamp(1.0 - part * part, 0.0, 1.0);
    }
    if (light.kind == LIGHT_SPOT) {
        float cone = clamp(dot(light.direction, -direction) * light.spot_scale + light.spot_offset, 0.0, 1.0);
        factor *= cone * cone;
    }
#ifdef AREA
    // What shines evenly from a surface falls off with the cosine (Lambert); its intensity is that along the normal.
    if (light.kind == LIGHT_POINT && light.shape != LIGHT_SHARP) {
        factor *= max(dot(light.direction, -direction), 0.0);
    }
#endif
    // One division at a time: the square of the distance alone may not be a float.
    vec3 irradiance = min(light.intensity * factor / length2 / size, vec3(IRRADIANCE_MAX)) / size;
    return Incident(direction, size * stretch, min(irradiance, vec3(IRRADIANCE_MAX)));
}

#endif
