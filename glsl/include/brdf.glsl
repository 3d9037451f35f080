// The metallic-roughness BRDF of glTF 2.0 (specification, appendix B), for punctual lights and for uniform light from
// everywhere. Twin: src/oracle/shade/brdf.rs. No bindings, no loops.

#ifndef STILLRAY_BRDF
#define STILLRAY_BRDF

// alpha = roughness^2 is at least 2^-10 (perceptual roughness 1/32), for two reasons. A narrower lobe under a punctual light
// is a spike of less than 2 milliradians, about a pixel, which single rays find or miss at random. And a unit vector in f32
// is good to 2^-22 radians, which changes the lobe's height by up to 2 * 2^-22 / alpha: with this alpha by less than 2^-11.
const float ALPHA_MIN = 0.0009765625;
// A shading normal may face away from the viewer although the surface does not. The lobe is then taken at a grazing angle.
const float COSINE_MIN = 0.000244140625;  // 2^-12
// Squared length of light + view below which their directions oppose each other up to rounding.
const float HALF_VECTOR_MIN = 9.094947e-13;  // 2^-40
const float PI = 3.14159265358979;

// What of a surface the BRDF depends on.
struct Reflector {
    vec3 base_color;   // 0..1
    float metallic;    // 0..1
    float roughness;   // 0..1, perceptual
    float dielectric;  // 0..1: reflectance at normal incidence of what is not metal
    float opaque;      // 0..1: part of what enters it, where it is not metal, that does not pass through
};

// What goes where: scattered below the surface, and by the lobe.
struct Reflected {
    vec3 diffuse;
    vec3 specular;
};

// Reflectance at normal incidence.
vec3 specular_color(Reflector r) {
    return vec3(r.dielectric) * (1.0 - r.metallic) + r.base_color * r.metallic;
}

vec3 diffuse_color(Reflector r) {
    return r.base_color * (1.0 - r.metallic) * r.opaque;
}

float alpha_of(float roughness) {
    return max(roughness * roughness, ALPHA_MIN);
}

// What lobe_albedo() is off by at most.
const float ALBEDO_ERROR = 0.018;

// x^5 for x in 0..1.
float fifth_power(float x) {
    float x2 = x * x;
    return x2 * x2 * x;
}

// Directional albedo of the specular lobe: (for f0 = 1, the part of it that Schlick's factor (1 - cos)^5 scales). Rational
// least-maximum fits, made for this project, of the integrals of the lobe above over the hemisphere: within 0.018 of both for
// cosines of 0.03..1 (held constant below) and all roughness. Their denominators stay above 0.6 there.
vec2 lobe_albedo(float cosine, float roughness) {
    float x = clamp(cosine, 0.03, 1.0);
    float y = alpha_of(roughness);
    float p = 0.97403 + y * (-11.08942 + y * (426.76951 - 255.19079 * y))
        + x * (-18.61348 + y * (136.33995 - 87.62469 * y) + x * (268.70304 - 239.89797 * y - 61.24613 * x));
    float q = 1.0 + y * (-8.76324 + y * (413.30746 - 234.62415 * y))
        + x * (-19.40884 + y * (158.33334 + 335.40212 * y) + x * (272.22361 - 306.77257 * y - 62.82817 * x));
    float r = 1.0067 + y * (15.45131 - 4.19271 * y) + x * (-1.99403 - 17.0129 * y + 0.82439 * x);
    float s = 1.0 + y * (35.36222 + y * (227.77088 + 86.80755 * y))
        + x * (2.70334 + y * (-162.64114 + 749.12166 * y) + x * (6.58293 + 629.66126 * y + 22.68433 * x));
    float whole = clamp(p / q, 0.0, 1.0);
    return vec2(whole, clamp(r / s, 0.0, whole));
}

// The same averaged over all directions, weighted by their cosine: within 0.0021 and 0.0009.
vec2 mean_lobe_albedo(float roughness) {
    float y = alpha_of(roughness);
    float whole = 1.00214 + y * (-0.13413 + y * (-1.86144 + y * (2.26377 - 0.8632 * y)));
    return vec2(min(whole, 1.0), 0.04858 + y * (-0.16445 + y * (0.21085 - 0.09229 * y)));
}

// What of the light that the lobe lets into the diffuse layer, and out of it again, per projected solid angle and pi
// (Kelemen and Szirmay-Kalos 2001). Over the hemisphere it adds up to what the lobe has left, so that white plastic reflects
// all. The specification's 1 - F(view . half vector) does not know what the lobe has reflected: smooth white plastic at a
// grazing angle would reflect 1.7 times the light. This is the one departure from appendix B.
vec3 layer_weight(vec3 f0, float nl, float nv, float roughness) {
    vec2 in_albedo = lobe_albedo(nl, roughness);
    vec2 out_albedo = lobe_albedo(nv, roughness);
    vec2 mean = mean_lobe_albedo(roughness);
    vec3 enters = 1.0 - (f0 * (in_albedo.x - in_albedo.y) + in_albedo.y);
    vec3 leaves = 1.0 - (f0 * (out_albedo.x - out_albedo.y) + out_albedo.y);
    // The guard is for nearly pure metals, which have next to no diffuse layer.
    return enters * leaves / max(1.0 - (f0 * (mean.x - mean.y) + mean.y), 0.00390625);
}

// Reflected radiance over irradiance on a perpendicular surface: BRDF times cosine. `normal`, `view` (to the viewer) and
// `light` (to the light) are unit vectors. Finite and not negative for all of them, 0 if the light is behind.
Reflected reflect_light(Reflector r, vec3 normal, vec3 view, vec3 light) {
    float nl = min(dot(normal, light), 1.0);
    if (!(nl > 0.0)) {
        return Reflected(vec3(0.0), vec3(0.0));
    }
    float nv = clamp(dot(normal, view), COSINE_MIN, 1.0);
    vec3 f0 = specular_color(r);
    vec3 diffuse = diffuse_color(r) * layer_weight(f0, nl, nv, r.roughness) * (nl / PI);
    vec3 sum = light + view;
    float sum2 = dot(sum, sum);
    if (sum2 < HALF_VECTOR_MIN) {
        return Reflected(diffuse, vec3(0.0));  // grazing from opposite sides: there is no half vector
    }
    // D = alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2) of the angle between normal and half vector: the usual form with
    // cos^2 (alpha^2 - 1) + 1 cancels where the lobe is high.
    float a2 = alpha_of(r.roughness);
    a2 *= a2;
    float nh = dot(normal, sum);
    vec3 away = cross(normal, sum);
    float q = (a2 * nh * nh + dot(away, away)) / sum2;
    float d = a2 / (PI * q * q);
    // Smith's height-correlated visibility (Heitz 2014). Both roots are at least alpha.
    float visibility = 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2));
    // view . half vector is half the sum's length.
    float schlick = fifth_power(max(1.0 - 0.5 * sqrt(sum2), 0.0));
    vec3 fresnel = f0 + (1.0 - f0) * schlick;
    return Reflected(diffuse, fresnel * (d * visibility * nl));
}

// The part of a uniform radiance that the surface reflects to the viewer. What the lobe loses to single scattering is put
// back as by Fdez-Aguera 2019 ("A Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting"), and the
// diffuse layer gets what the specular one lets through: a white surface, dielectric or metal, reflects all.
Reflected reflect_uniform(Reflector r, vec3 normal, vec3 view) {
    vec2 albedo = lobe_albedo(dot(normal, view), r.roughness);
    vec3 f0 = specular_color(r);
    vec3 single = f0 * (albedo.x - albedo.y) + albedo.y;
    vec3 average = f0 + (1.0 - f0) * (1.0 / 21.0);
    float lost = 1.0 - albedo.x;
    // single <= 1 - lost (1 - average) - ...: the sum of the series is at most 1; the guard is for rounding. The
    // denominator is at least the albedo, which is not below 0.25.
    vec3 specular = min(single + single * average * lost / (1.0 - average * lost), 1.0);
    return Reflected(diffuse_color(r) * (1.0 - specular), specular);
}

vec3 both(Reflected part) {
    return part.specular + part.diffuse;
}

#endif
