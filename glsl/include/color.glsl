// From scene-linear radiance to what a display shows. Twin: src/report/tonemap.rs. No bindings, no loops.

#ifndef STILLRAY_COLOR
#define STILLRAY_COLOR

// Khronos PBR Neutral (2024): leaves colours up to 0.8 alone but for the 4 % that Fresnel adds, and compresses the rest
// towards white. Takes finite, non-negative radiance; gives 0..1.
vec3 tone_map(vec3 color) {
    const float start = 0.76;
    const float desaturation = 0.15;
    float low = min(color.r, min(color.g, color.b));
    color -= low < 0.08 ? low - 6.25 * low * low : 0.04;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < start) {
        return color;
    }
    const float range = 1.0 - start;
    float new_peak = 1.0 - range * range / (peak + range - start);
    color *= new_peak / peak;
    float whiten = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
    return mix(color, vec3(new_peak), whiten);
}

// IEC 61966-2-1, for 0..1. Vulkan's pow is good to a few dozen units in the last place here, a thousandth of an 8-bit step.
vec3 linear_to_srgb(vec3 color) {
    vec3 x = clamp(color, 0.0, 1.0);
    vec3 curved = 1.055 * pow(max(x, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;
    return mix(curved, x * 12.92, lessThanEqual(x, vec3(0.0031308)));
}

#endif
