//! Twin of `glsl/include/brdf.glsl`: the metallic-roughness BRDF.

use glam::DVec3;
use std::f64::consts::PI;

/// Least squared roughness; see the shader for its reasons.
pub const ALPHA_MIN: f64 = 1.0 / 1024.0;
/// Least cosine between normal and view.
pub const COSINE_MIN: f64 = 1.0 / 4096.0;
/// What [`lobe_albedo`] is off by at most.
pub const ALBEDO_ERROR: f64 = 0.018;
const HALF_VECTOR_MIN: f64 = 1.0 / (1u64 << 40) as f64;

/// What of a surface the BRDF depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflector {
    /// Scene-linear RGB, 0..=1.
    pub base_color: DVec3,
    /// 0..=1.
    pub metallic: f64,
    /// Perceptual, 0..=1.
    pub roughness: f64,
    /// Reflectance at normal incidence of what is not metal, 0..=1.
    pub dielectric: f64,
    /// Part of what enters it, where it is not metal, that does not pass through, 0..=1.
    pub opaque: f64,
}

impl Default for Reflector {
    /// White plaster of glTF's index of refraction, 1.5.
    fn default() -> Self {
        Self { base_color: DVec3::ONE, metallic: 0.0, roughness: 1.0, dielectric: 0.04, opaque: 1.0 }
    }
}

/// What goes where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflected {
    /// What is scattered below the surface.
    pub diffuse: DVec3,
    /// What the lobe reflects.
    pub specular: DVec3,
}

impl Reflected {
    const NONE: Self = Self { diffuse: DVec3::ZERO, specular: DVec3::ZERO };

    /// Both parts.
    pub fn both(self) -> DVec3 {
        self.specular + self.diffuse
    }
}

impl Reflector {
    /// Reflectance at normal incidence.
    pub fn specular_color(&self) -> DVec3 {
        DVec3::splat(self.dielectric) * (1.0 - self.metallic) + self.base_color * self.metallic
    }

    /// Albedo of what enters the surface.
    pub fn diffuse_color(&self) -> DVec3 {
        self.base_color * (1.0 - self.metallic) * self.opaque
    }

    fn alpha(&self) -> f64 {
        (self.roughness * self.roughness).max(ALPHA_MIN)
    }

    /// BRDF times cosine, 1/sr: radiance to `view` over irradiance from `light` on a perpendicular surface. All three are
    /// unit vectors away from the surface.
    pub fn reflect_light(&self, normal: DVec3, view: DVec3, light: DVec3) -> DVec3 {
        self.reflect_parts(normal, view, light).both()
    }

    /// As [`Self::reflect_light`], told apart.
    pub fn reflect_parts(&self, normal: DVec3, view: DVec3, light: DVec3) -> Reflected {
        let nl = normal.dot(light).min(1.0);
        if nl <= 0.0 {
            return Reflected::NONE;
        }
        let nv = normal.dot(view).clamp(COSINE_MIN, 1.0);
        let f0 = self.specular_color();
        let diffuse = self.diffuse_color() * self.layer_weight(nl, nv) * (nl / PI);
        let sum = light + view;
        let sum2 = sum.length_squared();
        if sum2 < HALF_VECTOR_MIN {
            return Reflected { diffuse, specular: DVec3::ZERO };
        }
        let a2 = self.alpha() * self.alpha();
        let nh = normal.dot(sum);
        let q = (a2 * nh * nh + normal.cross(sum).length_squared()) / sum2;
        let d = a2 / (PI * q * q);
        let root = |c: f64| (c * c * (1.0 - a2) + a2).sqrt();
        let visibility = 0.5 / (nl * root(nv) + nv * root(nl));
        let fresnel = f0 + (1.0 - f0) * (1.0 - 0.5 * sum2.sqrt()).max(0.0).powi(5);
        Reflected { diffuse, specular: fresnel * (d * visibility * nl) }
    }

    /// What of the light gets through the specular lobe into the diffuse layer and out again.
    fn layer_weight(&self, nl: f64, nv: f64) -> DVec3 {
        let f0 = self.specular_color();
        let lobe = |[whole, schlick]: [f64; 2]| f0 * (whole - schlick) + schlick;
        let through = |cosine: f64| 1.0 - lobe(lobe_albedo(cosine, self.roughness));
        let mean = 1.0 - lobe(mean_lobe_albedo(self.roughness));
        through(nl) * through(nv) / mean.max(DVec3::splat(1.0 / 256.0))
    }

    /// The part of a uniform radiance that is reflected to `view`, 0..=1.
    pub fn reflect_uniform(&self, normal: DVec3, view: DVec3) -> DVec3 {
        self.uniform_parts(normal, view).both()
    }

    /// As [`Self::reflect_uniform`], told apart.
    pub fn uniform_parts(&self, normal: DVec3, view: DVec3) -> Reflected {
        let [whole, schlick] = lobe_albedo(normal.dot(view), self.roughness);
        let f0 = self.specular_color();
        let single = f0 * (whole - schlick) + schlick;
        let average = f0 + (1.0 - f0) / 21.0;
        let lost = 1.0 - whole;
        let specular = (single + single * average * lost / (1.0 - average * lost)).min(DVec3::ONE);
        Reflected { diffuse: self.diffuse_color() * (1.0 - specular), specular }
    }
}

/// Directional albedo of the specular lobe, and the part of it that Schlick's factor scales: the shader's fits.
pub fn lobe_albedo(cosine: f64, roughness: f64) -> [f64; 2] {
    let x = cosine.clamp(0.03, 1.0);
    let y = (roughness * roughness).max(ALPHA_MIN);
    let p = 0.97403
        + y * (-11.08942 + y * (426.76951 - 255.19079 * y))
        + x * (-18.61348 + y * (136.33995 - 87.62469 * y) + x * (268.70304 - 239.89797 * y - 61.24613 * x));
    let q = 1.0
        + y * (-8.76324 + y * (413.30746 - 234.62415 * y))
        + x * (-19.40884 + y * (158.33334 + 335.40212 * y) + x * (272.22361 - 306.77257 * y - 62.82817 * x));
    let r = 1.0067 + y * (15.45131 - 4.19271 * y) + x * (-1.99403 - 17.0129 * y + 0.82439 * x);
    let s = 1.0
        + y * (35.36222 + y * (227.77088 + 86.80755 * y))
        + x * (2.70334 + y * (-162.64114 + 749.12166 * y) + x * (6.58293 + 629.66126 * y + 22.68433 * x));
    let whole = (p / q).clamp(0.0, 1.0);
    [whole, (r / s).clamp(0.0, whole)]
}

/// The same averaged over all directions, weighted by their cosine.
pub fn mean_lobe_albedo(roughness: f64) -> [f64; 2] {
    let y = (roughness * roughness).max(ALPHA_MIN);
    let whole: f64 = 1.00214 + y * (-0.13413 + y * (-1.86144 + y * (2.26377 - 0.8632 * y)));
    [whole.min(1.0), 0.04858 + y * (-0.16445 + y * (0.21085 - 0.09229 * y))]
}
