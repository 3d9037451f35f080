//! Where diffuse paths begin (paper 1, section 6.1). Twin of `glsl/indirect.comp` and `glsl/include/hemisphere.glsl`, in f64
//! with bounds on what a device's f32 may be off by; which path it is, exactly.

use super::changes::is_same_point;
use super::random::{hash_combine, hash_uint, unit_float};
use super::shade::kernel::{Seen, lit_radiance, seen_from};
use super::shade::lobe::basis;
use super::stage::{Stage, U};
use super::traverse::offset_origin;
use crate::sampler::sobol;
use crate::shaders::{FOUND_LOST, Found, Frame, Gathered, Light, NO_SOURCE, OCCLUDED_BIT, SKY_INSTANCE, Sample};
use glam::{DVec3, Vec3, Vec4};
use std::f64::consts::TAU;

/// Which dimensions a diffuse path's directions have: the pair that is free behind the camera.
pub const PAIR_DIFFUSE: u32 = 0;

/// The seed of a step of a path.
pub fn diffuse_seed(scramble: u32, step: u32) -> u32 {
    hash_combine(scramble, step)
}

/// A pair of coordinates of a path, 2^32 to one: the paths of a sample share out one sequence.
pub fn path_bits(number: u32, seed: u32, pair: u32) -> [u32; 2] {
    [0, 1].map(|axis| sobol::scrambled(number, 2 * pair + axis, seed))
}

/// Around a shading normal by the cosine to it, mirrored to above the surface. Unit vectors.
pub fn diffuse_direction(normal: DVec3, geometric: DVec3, [u, v]: [f64; 2]) -> DVec3 {
    let [right, up] = basis(normal);
    let across = v.sqrt();
    let direction = right * ((TAU * u).cos() * across) + up * ((TAU * u).sin() * across) + normal * (1.0 - v).sqrt();
    let direction = direction.normalize();
    (direction - 2.0 * direction.dot(geometric).min(0.0) * geometric).normalize()
}

/// What a component of a device's may differ by, for normals whose components are off by so much. A component of the basis moves
/// by three times what the normal's do, and weighs at most 1 across; 48 U are the roundings of basis, turn, roots and sums.
/// The mirror adds two dot products of three terms, and is continuous where it begins.
pub fn direction_error(normal: f64, geometric: f64) -> f64 {
    let scattered = (3.0 * 2.0_f64.sqrt() + 1.0) * normal + 48.0 * U;
    (1.0 + 2.0 * 3.0_f64.sqrt()) * scattered + (2.0 * 3.0_f64.sqrt() + 2.0) * geometric + 32.0 * U
}

/// Which of the last frame's samples one is, if it is one.
pub fn source_of(sources: &[u32], previous: &[Sample], samples: &[Sample], slot: usize) -> u32 {
    let same = |before: &Sample| is_same_point(*before, samples[slot]);
    if previous.get(sources[slot] as usize).is_some_and(same) { sources[slot] } else { NO_SOURCE }
}

/// The number of a sample's next path among those of its sample, and what tells the sample from others.
pub fn path_of(frame: &Frame, seed: u32, before: Option<Gathered>) -> [u32; 2] {
    [before.map_or(0, |g| g.paths >> 16), hash_combine(hash_uint(frame.seed), seed)]
}

/// The same of a sample that is not kept: those of a pixel share out one sequence, in all frames.
pub fn fresh_path_of(frame: &Frame, seed: u32) -> [u32; 2] {
    [(seed >> 28) + frame.spp * frame.variation, hash_combine(hash_uint(frame.seed), seed & 0x0fff_ffff)]
}

/// The first ray of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// What the surface scatters to the viewer of what the path brings; 0 where there is no path.
    pub albedo: DVec3,
    /// What a device's may differ by.
    pub albedo_error: f64,
    /// Camera-relative, metres.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: DVec3,
    /// The same if a device's rounding turns the basis of the normal the other way: the two meet where its z is 0.
    pub turned: Option<DVec3>,
    /// What a component of a device's may differ by.
    pub direction_error: f64,
    /// Whether a device's rounding may decide otherwise which side is seen.
    pub doubtful: bool,
}

/// A normal to the other side of where the basis turns, if that is within an error.
fn across_the_turn(normal: DVec3, error: f64) -> Option<DVec3> {
    let z = if normal.z < 0.0 { -normal.z } else { -normal.z.max(f64::MIN_POSITIVE) };
    (normal.z.abs() <= error).then_some(DVec3 { z, ..normal })
}

/// Begins path `number` of a sample; none from what is hidden, lost, sky or unlit.
pub fn start(stage: &Stage<'_>, found: &Found, [number, scramble]: [u32; 2]) -> Option<Start> {
    let visible = found.primitive != FOUND_LOST && found.instance & OCCLUDED_BIT == 0;
    if !visible || found.instance == SKY_INSTANCE {
        return None;
    }
    start_at(&seen_from(stage, stage.eye(), found), [number, diffuse_seed(scramble, 0)])
}

/// From a surface by a path's number and seed; none if it is unlit.
fn start_at(seen: &Seen, [number, seed]: [u32; 2]) -> Option<Start> {
    let Seen { surface, view, point, bounds } = seen;
    if surface.unlit {
        return None;
    }
    let albedo = surface.reflector.uniform_parts(surface.normal, *view).diffuse;
    let u = path_bits(number, seed, PAIR_DIFFUSE).map(|x| f64::from(unit_float(x)));
    let turned = across_the_turn(surface.normal, bounds.normal);
    let normal_error = bounds.normal * if turned.is_some() { 3.0 } else { 1.0 };
    Some(Start {
        albedo,
        albedo_error: bounds.uniform_error(),
        origin: offset_origin(point, surface.geometric.as_vec3()),
        direction: diffuse_direction(surface.normal, surface.geometric, u),
        turned: turned.map(|normal| diffuse_direction(normal, surface.geometric, u)),
        direction_error: direction_error(normal_error, bounds.geometric),
        doubtful: !bounds.side_is_sure,
    })
}

/// A ray of a path, and what it is about to bring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Camera-relative, metres.
    pub origin: Vec3,
    /// What its radiance counts for.
    pub weight: Vec3,
    /// The number of its path.
    pub number: u32,
    /// What tells its sample from others.
    pub scramble: u32,
}

/// What a ray has brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brought {
    /// Scene-linear RGB.
    pub radiance: DVec3,
    /// What a device's may differ by; infinite where it depends on a sign that rounding decides.
    pub error: DVec3,
    /// The next ray, whose weight is the albedo times that of this one.
    pub next: Option<Start>,
}

/// What ray `step` of a path finds, and where the path goes on: in a scene without a map of light from all around, from surfaces that
/// nothing passes through. Twin of the `diffuse` variant of `glsl/scatter.comp`.
pub fn bring(stage: &Stage<'_>, lights: &[Light], found: &Found, ray: &Ray, (step, lit): (u32, u32)) -> Brought {
    let weight = ray.weight.as_dvec3();
    let environment = Vec4::from(stage.frame.environment).truncate().as_dvec3();
    if found.instance == SKY_INSTANCE {
        let radiance = weight * environment;
        return Brought { radiance, error: 4.0 * U * radiance, next: None };
    }
    let seen = seen_from(stage, ray.origin, found);
    let on = step + 1 < stage.frame.indirect;
    let (radiance, error) = lit_radiance(stage, lights, environment, &seen, (lit, on));
    let error = if seen.bounds.side_is_sure { (error + 8.0 * U * radiance) * weight } else { DVec3::INFINITY };
    let next = start_at(&seen, [ray.number, diffuse_seed(ray.scramble, step + 1)]);
    Brought { radiance: radiance * weight, error, next: next.filter(|_| on) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of the direction and of its cosine's square are those of a density of cosine / pi: 2/3 along the normal, and 1/2.
    #[test]
    fn directions_follow_the_cosine() {
        let normal = DVec3::new(0.3, -0.5, -0.7).normalize();
        let side = 256;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(side);
        let draws = (0..side * side).map(|i| diffuse_direction(normal, normal, [at(i % side), at(i / side)]));
        let (mean, square) = draws.fold((DVec3::ZERO, 0.0), |(m, s), d| (m + d, s + d.dot(normal).powi(2)));
        let n = f64::from(side * side);
        // The midpoint rule of the root, whose slope has no bound at 1: within side^-1.5.
        let error = f64::from(side).powf(-1.5);
        assert!((mean / n - normal * 2.0 / 3.0).length() < error, "{mean}");
        assert!((square / n - 0.5).abs() < error, "{square}");
        assert!((mean / n - normal * 0.5).length() > error, "evenly drawn ones would be told apart");
    }

    #[test]
    fn none_go_below_the_surface() {
        let (normal, geometric) = (DVec3::new(0.9, 0.1, 0.1).normalize(), DVec3::Z);
        let at = |i: u32| (f64::from(i) + 0.5) / 64.0;
        let draws = (0..64 * 64).map(|i| diffuse_direction(normal, geometric, [at(i % 64), at(i / 64)]));
        let heights: Vec<f64> = draws.map(|d| d.dot(geometric)).collect();
        assert!(heights.iter().all(|h| *h >= 0.0));
        let unmirrored = (0..64 * 64).map(|i| diffuse_direction(normal, normal, [at(i % 64), at(i / 64)]));
        assert!(unmirrored.filter(|d| d.dot(geometric) < 0.0).count() > 1000, "many would");
    }

    #[test]
    fn paths_of_a_sample_are_even_together() {
        // Each aligned run of 16 paths has one in each of 4 x 4 cells, at every step.
        for step in 0..5 {
            let cell = |number: u32| path_bits(number, diffuse_seed(77, step), PAIR_DIFFUSE).map(|x| x >> 30);
            for run in [0, 16, 160] {
                let cells: std::collections::BTreeSet<[u32; 2]> = (run..run + 16).map(cell).collect();
                assert_eq!(cells.len(), 16);
            }
            let astray: std::collections::BTreeSet<[u32; 2]> = (5..21).map(cell).collect();
            assert!(astray.len() <= 16);
        }
    }
}
