//! Where a path goes on at a surface. Twin of `glsl/include/lobe.glsl`, in f64, with bounds on what a device's f32 may be off
//! by; `U` is f32's unit roundoff.

use super::brdf::{ALBEDO_ERROR, COSINE_MIN, Reflector, lobe_albedo};
use crate::oracle::stage::U;
use glam::DVec3;
use std::f64::consts::TAU;

/// What of a surface decides where a path goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatterer {
    /// Its reflection of light; with `opaque` below 1 it lets some through.
    pub reflector: Reflector,
    /// Exponent of Phong's lobe, above 0; 0: the lobe of the roughness.
    pub exponent: f64,
    /// Index of refraction on the viewer's side over that behind; 0: a thin wall, the same on both.
    pub index: f64,
    /// Chance of a reflection where both are possible, below 1; 0: the part of the light that is reflected.
    pub part: f64,
}

/// A direction in which a path goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounce {
    /// Unit vector.
    pub direction: DVec3,
    /// Radiance to the viewer over that from the direction, on average over all draws.
    pub weight: DVec3,
    /// Whether it goes on behind the surface.
    pub through: bool,
    /// What a component of a device's direction may differ by.
    pub direction_error: f64,
    /// What a component of a device's weight may differ by.
    pub weight_error: f64,
    /// Whether a device's rounding may decide otherwise: at the critical angle, or at the horizon of the surface or of its normal.
    pub doubtful: bool,
}

/// Two unit vectors that are perpendicular to a unit vector and each other.
pub fn basis(n: DVec3) -> [DVec3; 2] {
    let side = if n.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    let right = DVec3::new(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    [right, DVec3::new(b, side + n.y * n.y * a, -n.y)]
}

/// Of a direction in the frame of a normal: two dot products with vectors of some ten operations, and a length.
const FROM: f64 = 24.0 * U;
/// Of [`crate::oracle::lens::turn_vector`], its argument's rounding included.
const TURN: f64 = 12.0 * U;

/// A microfacet's normal as it is seen from a direction above the horizon, for a normal of +z, and what a device's may differ
/// by, for a `v` away from 1 (the cap's far end, where a root has no bound).
fn facet_bounded(view: DVec3, alpha: f64, [u, v]: [f64; 2]) -> (DVec3, f64) {
    let stretch = DVec3::new(view.x * alpha, view.y * alpha, view.z).length();
    let stretched = FROM / stretch + 12.0 * U;
    // The root of a product of which one factor is at least 1 - v, off by twice what z is.
    let half = stretched + TURN + (2.0 * stretched + 8.0 * U) / (1.0 - v).max(U).sqrt();
    let facet = visible_normal(view, alpha, [u, v]);
    // The facet f is (a x, a y, z) over its length, which is that of (x, y, z), at least 1 - v, over that of (f.x / a, f.y / a, f.z).
    let unstretched = DVec3::new(facet.x, facet.y, facet.z * alpha).length() / alpha.max(U);
    (facet, if alpha == 0.0 { 0.0 } else { half * unstretched.max(1.0) / (1.0 - v).max(U) + 12.0 * U })
}

/// A microfacet's normal as it is seen from a direction above the horizon, for a normal of +z.
pub fn visible_normal(view: DVec3, alpha: f64, [u, v]: [f64; 2]) -> DVec3 {
    let stretched = DVec3::new(view.x * alpha, view.y * alpha, view.z).normalize();
    let below = v * (1.0 + stretched.z);
    let above = (1.0 - stretched.z) + (1.0 - v) * (1.0 + stretched.z);
    let across = (below * above).max(0.0).sqrt();
    let half = DVec3::new((TAU * u).cos() * across, (TAU * u).sin() * across, 1.0 - below) + stretched;
    DVec3::new(half.x * alpha, half.y * alpha, half.z.max(0.0)).try_normalize().unwrap_or(DVec3::Z)
}

/// Part of what visible microfacets send along one direction that is not in the shadow of others.
pub fn unshadowed(cosine_in: f64, cosine_out: f64, a2: f64) -> f64 {
    let root = |c: f64| (c * c * (1.0 - a2) + a2).sqrt();
    let (root_in, root_out) = (root(cosine_in), root(cosine_out));
    cosine_out * (root_in + cosine_in) / (root_in * cosine_out + root_out * cosine_in).max(f64::MIN_POSITIVE)
}

/// What single scattering loses, put back but for what the albedo may be off by.
pub fn lobe_gain(f0: DVec3, cosine: f64, roughness: f64) -> DVec3 {
    let lost = (1.0 - ALBEDO_ERROR - lobe_albedo(cosine, roughness)[0]).max(0.0);
    let average = f0 + (1.0 - f0) / 21.0;
    1.0 + average * lost / (1.0 - average * lost)
}

/// Around the mirrored direction, and what a device's may differ by: Vulkan's logarithm is good to 2^-21 near 1 and to 3 ulp
/// elsewhere, its exponential to 3 + 2 x ulp.
fn phong_bounded(mirrored: DVec3, exponent: f64, [u, v]: [f64; 2]) -> (DVec3, f64) {
    let [right, up] = basis(mirrored);
    let x = -(1.0 - v).ln() / (exponent + 1.0);
    let sine = (-(-2.0 * x).exp_m1()).sqrt();
    let error = (8.0 * U + 6.0 * U * (1.0 - v).ln().abs()) / (exponent + 1.0) + 24.0 * U * x;
    let across = (error / sine.max(f64::MIN_POSITIVE)).min((2.0 * error).sqrt());
    let direction = right * ((TAU * u).cos() * sine) + up * ((TAU * u).sin() * sine) + mirrored * (-x).exp();
    (direction.normalize(), FROM + across + error + (TURN + 8.0 * U) * sine + 16.0 * U)
}

/// A value with a bound on what a device's may differ by.
#[derive(Clone, Copy)]
struct Known<T> {
    value: T,
    error: f64,
}

/// What decides between reflection and refraction at a facet.
struct Facet {
    normal: Known<DVec3>,
    cosine: Known<f64>,
    /// Cosine behind the surface, and its square.
    behind: Known<f64>,
    behind2: f64,
    fresnel: Known<DVec3>,
    f0: DVec3,
    /// What of the light passes that is not reflected.
    through: f64,
}

impl Facet {
    fn of(s: &Scatterer, from: DVec3, u: [f64; 2]) -> Self {
        let reflector = &s.reflector;
        let alpha = reflector.roughness * reflector.roughness;
        let (facet, error) = if s.exponent > 0.0 { (DVec3::Z, 0.0) } else { facet_bounded(from, alpha, u) };
        let cosine = Known { value: from.dot(facet).clamp(0.0, 1.0), error: error + FROM + 4.0 * U };
        let through = (1.0 - reflector.opaque) * (1.0 - reflector.metallic);
        let index2 = if s.index > 0.0 { s.index * s.index } else { 1.0 };
        let behind2 = 1.0 - index2 * (1.0 - cosine.value * cosine.value);
        let behind2_error = index2 * 2.0 * cosine.error + (4.0 * index2 + 2.0) * U;
        let behind = behind2.max(0.0).sqrt();
        let behind_error = (behind2_error / behind.max(f64::MIN_POSITIVE)).min(behind2_error.sqrt());
        let refracts = through > 0.0 && s.index > 0.0;
        let f0 = if refracts {
            DVec3::splat(((s.index - 1.0) / (s.index + 1.0)).powi(2)).lerp(reflector.base_color, reflector.metallic)
        } else {
            reflector.specular_color()
        };
        let behind = Known { value: behind, error: behind_error };
        let grazing = if refracts && s.index > 1.0 { behind } else { cosine };
        let lost = (1.0 - grazing.value).clamp(0.0, 1.0);
        let slope = 5.0 * (lost + grazing.error).min(1.0).powi(4);
        let fresnel = Known { value: f0 + (1.0 - f0) * lost.powi(5), error: slope * grazing.error + 24.0 * U };
        Self { normal: Known { value: facet, error }, cosine, behind, behind2, fresnel, f0, through }
    }

    /// The chance of a reflection.
    fn part(&self, s: &Scatterer) -> Known<f64> {
        if s.part > 0.0 {
            return Known { value: s.part, error: 0.0 };
        }
        let passing = (1.0 - self.fresnel.value) * s.reflector.base_color * self.through;
        let (reflected, all) =
            (self.fresnel.value.max_element(), passing.max_element() + self.fresnel.value.max_element());
        let value = (reflected / all.max(f64::from(f32::MIN_POSITIVE))).clamp(0.05, 0.95);
        // Sum and quotient of what is off by as much as Fresnel's factor: where next to nothing goes on, in proportion.
        Known { value, error: 3.0 * self.fresnel.error / all.max(f64::MIN_POSITIVE) + 8.0 * U }
    }

    /// The mirrored direction.
    fn mirrored(&self, from: DVec3) -> Known<DVec3> {
        let value = 2.0 * self.cosine.value * self.normal.value - from;
        Known { value, error: 2.0 * (self.cosine.error + self.normal.error) + FROM + 8.0 * U }
    }

    /// The direction behind a surface of this relative index; 0: a thin wall.
    fn bent(&self, index: f64, from: DVec3) -> Known<DVec3> {
        if index <= 0.0 {
            let mirrored = self.mirrored(from);
            return Known { value: mirrored.value * DVec3::new(1.0, 1.0, -1.0), ..mirrored };
        }
        let along = index * self.cosine.value - self.behind.value;
        let error = index * (self.cosine.error + FROM) + self.behind.error + along.abs() * self.normal.error;
        Known { value: self.normal.value * along - from * index, error: error + 8.0 * (1.0 + index) * U }
    }
}

/// Where the path goes on; none where nothing is left of it, unless a device's rounding may decide otherwise. All vectors are unit
/// vectors, the normals on the viewer's side.
pub fn scatter(s: &Scatterer, [normal, geometric]: [DVec3; 2], view: DVec3, u: [f64; 2], which: f64) -> Option<Bounce> {
    let [right, up] = basis(normal);
    let from = DVec3::new(right.dot(view), up.dot(view), normal.dot(view).max(COSINE_MIN)).normalize();
    let phong = s.exponent > 0.0;
    let facet = Facet::of(s, from, u);
    let total = facet.through > 0.0 && facet.behind2 <= 0.0;
    let both_ways = facet.through > 0.0 && !total;
    let part = facet.part(s);
    let passes = both_ways && which >= part.value;
    let unsure = both_ways && (which - part.value).abs() <= part.error;
    let chance = if both_ways { part.value } else { 1.0 };
    let slack = if both_ways { part.error / chance.min(1.0 - chance) } else { 0.0 };
    let (to, weight) = if passes {
        let scale = s.reflector.base_color * (facet.through / (1.0 - chance));
        let error = (facet.fresnel.error + slack + 8.0 * U) * scale.max_element();
        (facet.bent(s.index, from), Known { value: (1.0 - facet.fresnel.value) * scale, error })
    } else {
        let whole = if total { Known { value: DVec3::ONE, error: 0.0 } } else { facet.fresnel };
        let gain = if phong { Known { value: DVec3::ONE, error: 0.0 } } else { gain_bounded(&facet, s, from.z) };
        let error =
            (whole.error * gain.value.max_element() + gain.error + slack * gain.value.max_element() + 8.0 * U) / chance;
        let to = if phong {
            let (value, error) = phong_bounded(DVec3::new(-from.x, -from.y, from.z), s.exponent, u);
            Known { value, error }
        } else {
            facet.mirrored(from)
        };
        (to, Known { value: whole.value * gain.value / chance, error })
    };
    let direction = (right * to.value.x + up * to.value.y + normal * to.value.z).normalize();
    let direction_error = 2.0 * to.error + 16.0 * U;
    let side = if passes { -1.0 } else { 1.0 };
    let (height, over) = (to.value.z * side, direction.dot(geometric) * side);
    let critical = facet.through > 0.0 && facet.behind2.abs() <= 4.0 * facet.cosine.error * (1.0 + s.index * s.index);
    let doubtful = unsure || critical || height.abs() <= 2.0 * direction_error || over.abs() <= 2.0 * direction_error;
    let beyond = height <= 0.0 || over <= 0.0;
    if beyond && !doubtful {
        return None;
    }
    let alpha = s.reflector.roughness * s.reflector.roughness;
    let lit = if phong { 1.0 } else { unshadowed(from.z, height.clamp(0.0, 1.0), alpha * alpha) };
    let relative = 2.0 * FROM / from.z + 2.0 * direction_error / height.abs().max(f64::MIN_POSITIVE) + 16.0 * U;
    let weight_error = weight.error * lit + weight.value.max_element() * lit * relative;
    Some(Bounce { direction, weight: weight.value * lit, through: passes, direction_error, weight_error, doubtful })
}

/// The gain, and what a device's may differ by: the albedo's fits are off by eighty roundings and 4.1 times what the cosine is.
fn gain_bounded(facet: &Facet, s: &Scatterer, cosine: f64) -> Known<DVec3> {
    let value = lobe_gain(facet.f0, cosine, s.reflector.roughness);
    let lost = 82.0 * U + 4.1 * FROM + 10.7 * 2.0 * U;
    Known { value, error: (lost + 8.0 * U) * value.max_element().powi(2) }
}
