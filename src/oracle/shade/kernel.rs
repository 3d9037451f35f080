//! The radiance and the place of every visible sample. Twin of `glsl/shade.comp`, in f64, with bounds on what a device's
//! f32 may be off by.
//!
//! The bounds are those of `tests/shading_twin.rs` for each part, put together; `U` is f32's unit roundoff.

use glam::{DVec3, Vec3, Vec4};

use super::brdf::{COSINE_MIN, Reflector};
use super::light::{IRRADIANCE_MAX, light_at};
use super::material::{Surface, emission_at, surface_at};
use crate::oracle::bounded::Bounded;
use crate::oracle::camera::{Projection, project_within, transform_bounded};
use crate::oracle::emitter::{Receiver, Shining, draw_emitter};
use crate::oracle::environment::{Afar, DIRECTION, IRRADIANCE};
use crate::oracle::lens::lens_shift_bounded;
use crate::oracle::motion::light_at_time;
use crate::oracle::shadow::light_weight;
use crate::oracle::stage::{Stage, U, normal_error};
use crate::oracle::traverse::{SurfacePoint, transform_point};
use crate::shaders::{
    ENVIRONMENT_LIGHT, FOUND_LOST, Found, Frame, INSTANCE_MASK, LIGHT_DIRECTIONAL, LIGHT_MESH, LIGHT_SHARP, LIGHT_SPOT,
    Light, OCCLUDED_BIT, SKY_INSTANCE, Sample,
};

/// Where samples are followed to, in distances from the middle of the frame to its border.
pub const MOTION_REACH: f32 = 64.0;

/// A visible sample, shaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shading {
    /// Radiance towards the camera, scene-linear RGB.
    pub radiance: DVec3,
    /// What a device's may differ by; infinite where it depends on a sign that rounding decides.
    pub error: DVec3,
    /// Where it lies in this frame, within [`MOTION_REACH`].
    pub place: Projection,
    /// Where it lies at the end of this frame, which is elsewhere if it is seen before, and moves.
    pub end: Projection,
    /// Where it lay in the last frame, within [`MOTION_REACH`].
    pub last: Projection,
    /// Distance from the camera in metres; infinite for the sky.
    pub depth: f64,
}

/// Shades one entry of the list; `None` for what is hidden or lost.
pub fn shade(stage: &Stage<'_>, lights: &[Light], sample: &Sample, found: &Found, lit: u32) -> Option<Shading> {
    if found.primitive == FOUND_LOST || found.instance & OCCLUDED_BIT != 0 {
        return None;
    }
    let environment = Vec4::from(stage.frame.environment).truncate().as_dvec3();
    let (radiance, error) = if found.instance == SKY_INSTANCE {
        sky_radiance(stage, environment, sample)
    } else {
        surface_radiance(stage, lights, environment, found, lit)
    };
    let ([place, end, last], depth) = locate(stage, sample);
    Some(Shading { radiance, error, place, end, last, depth })
}

fn sky_radiance(stage: &Stage<'_>, uniform: DVec3, sample: &Sample) -> (DVec3, DVec3) {
    let Some(map) = stage.afar.filter(Afar::is_there) else { return (uniform, DVec3::ZERO) };
    let (radiance, error) = map.radiance(sample.position);
    (uniform + radiance, error + U * (uniform + radiance))
}

/// Where the sample is, at its time, at the end of the frame and in the last one, and how far away it is.
fn locate(stage: &Stage<'_>, sample: &Sample) -> ([Projection; 3], f64) {
    let frame = stage.frame;
    let id = sample.instance & INSTANCE_MASK;
    let position = sample.position;
    let before = Frame {
        right: frame.previous_right,
        up: frame.previous_up,
        forward: frame.previous_forward,
        lens: frame.previous_lens,
        ..*frame
    };
    let surface = id < frame.instance_count;
    let project = |frame: &Frame, at: [Bounded; 3]| {
        let shift = lens_shift_bounded(frame, stage.lens, at, surface);
        project_within(frame, at, shift, MOTION_REACH)
    };
    if !surface {
        let at = position.map(Bounded::exact);
        return ([project(&stage.seen(), at), project(frame, at), project(&before, at)], f64::INFINITY);
    }
    let instance = stage.instance(id);
    let now = transform_bounded(&instance.to_relative, position);
    let end = transform_bounded(&stage.world.instances[id as usize].to_relative, position);
    let then = transform_bounded(&instance.previous, position);
    let depth = transform_point(&instance.to_relative, position.into()).as_dvec3().length();
    ([project(&stage.seen(), now), project(frame, end), project(&before, then)], depth)
}

/// Bounds on the directions that shading starts from, in radians.
#[derive(Debug, Clone, Copy)]
pub struct Directions {
    /// Of the shading normal.
    pub normal: f64,
    /// Of the surface's.
    pub geometric: f64,
    /// Of the direction to the viewer.
    pub view: f64,
    /// Whether a surface seen from behind is told from one seen from the front on every device.
    pub side_is_sure: bool,
}

impl Directions {
    /// What the part that is reflected of a uniform radiance may be off by.
    pub fn uniform_error(&self) -> f64 {
        16.0 * U + 4.0 * COLOR + 8.0 * albedo_error(self)
    }
}

/// A point of a surface, seen from somewhere.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// What it is like there.
    pub surface: Surface,
    /// Unit vector to the viewer.
    pub view: DVec3,
    /// Where it is.
    pub point: SurfacePoint,
    /// What the directions may be off by.
    pub bounds: Directions,
}

/// What was found, from a viewer at a camera-relative point.
pub fn seen_from(stage: &Stage<'_>, viewer: Vec3, found: &Found) -> Seen {
    let material = stage.material(found.primitive);
    let instance = stage.instance(found.instance);
    let point = stage.surface(found.instance, found.primitive, found.u, found.v);
    let geometric = point.normal.as_dvec3();
    let back = viewer.as_dvec3() - point.position.as_dvec3();
    let view = if back.length() > 0.0 { back.normalize() } else { geometric };
    let spot = stage.spot(found.primitive, found.u, found.v);
    let surface = surface_at(material, &instance, &spot, geometric, view, stage.textures);
    let at = spot.attributes();
    let map = (material.normal_texture.texel_size != 0)
        .then(|| stage.textures.sample(&material.normal_texture, at.uv0, at.uv1, false).truncate() * 2.0 - 1.0);
    let flip = normal_error(stage, found.instance, found.primitive);
    let bounds = Directions {
        normal: normal_bound(map, f64::from(material.normal_scale)),
        geometric: flip,
        view: 12.0 * U,
        side_is_sure: geometric.dot(view).abs() > flip + 16.0 * U,
    };
    Seen { surface, view, point, bounds }
}

fn surface_radiance(
    stage: &Stage<'_>,
    lights: &[Light],
    environment: DVec3,
    found: &Found,
    lit: u32,
) -> (DVec3, DVec3) {
    let seen = seen_from(stage, stage.eye(), found);
    let (mut radiance, mut error) = lit_radiance(stage, lights, environment, &seen, (lit, false));
    if seen.surface.unlit {
        return (radiance, error);
    }
    let shines = |i: &u32| lights[*i as usize].shape == LIGHT_MESH && lit >> i & 1 != 0;
    if let (Some(shining), Some(_)) = (&stage.shining, (0..stage.frame.light_count).find(shines)) {
        let (part, part_error) = reflected_from_emitter(
            stage,
            &seen.surface,
            &seen.bounds,
            seen.view,
            (shining, Receiver { point: seen.point, error: seen.bounds.geometric }),
        );
        radiance += part;
        error += part_error + 4.0 * U * radiance;
    }
    if lit >> ENVIRONMENT_LIGHT & 1 != 0 {
        let (part, part_error) = reflected_from_afar(&seen.surface, &seen.bounds, seen.view, stage.afar);
        radiance += part;
        error += part_error + 4.0 * U * radiance;
    }
    (radiance, if seen.bounds.side_is_sure { error } else { DVec3::INFINITY })
}

/// Radiance to a viewer but for what a map of light from all around adds, and what a device's may differ by as far as it is sure which
/// side is seen. Besides the bits of the lights that reach it: whether what it scatters of the surroundings is left out.
pub fn lit_radiance(
    stage: &Stage<'_>,
    lights: &[Light],
    environment: DVec3,
    seen: &Seen,
    (lit, diffuse): (u32, bool),
) -> (DVec3, DVec3) {
    let Seen { surface, view, point, bounds } = seen;
    let lights: Vec<Light> = lights.iter().map(|light| light_at_time(light, stage.world.time)).collect();
    let (radiance, error) = reflected(surface, bounds, *view, (environment, &lights, lit), point.position, stage.frame);
    if surface.unlit || !diffuse {
        return (radiance, error);
    }
    let scattered = surface.reflector.uniform_parts(surface.normal, *view).diffuse;
    (radiance - scattered * environment * surface.occlusion, error)
}

/// As `material_excess` of the test has it: 128 U for a smooth normal; with a map, whose length divides, three times that
/// for each axis and 32 U of the map's values.
fn normal_bound(map: Option<DVec3>, scale: f64) -> f64 {
    let Some(m) = map else { return 3f64.sqrt() * 128.0 * U };
    let length = (m * DVec3::new(scale, scale, 1.0)).length();
    3f64.sqrt() * (3.0 * 384.0 * U * length + 3.0 * 32.0 * U * scale.max(1.0)) / length
}

/// Colour factors are off by 40 U, emission by four times that.
const COLOR: f64 = 40.0 * U;
/// Absolute error of the fits of the lobe's albedo, but for that of their arguments.
const FIT: f64 = 2.0 * 4.1 * 10.0 * U;

/// The albedo has a slope of 4.1 in the cosine and 10.7 in alpha, which is a square.
fn albedo_error(bounds: &Directions) -> f64 {
    FIT + 4.1 * (bounds.normal + bounds.view + 3.0 * U) + 10.7 * 3.0 * COLOR
}

fn reflected(
    surface: &Surface,
    bounds: &Directions,
    view: DVec3,
    (environment, lights, lit): (DVec3, &[Light], u32),
    position: Vec3,
    frame: &Frame,
) -> (DVec3, DVec3) {
    let reflector = &surface.reflector;
    if surface.unlit {
        return (reflector.base_color, DVec3::splat(COLOR));
    }
    let albedo = albedo_error(bounds);
    let uniform = reflector.reflect_uniform(surface.normal, view);
    let ambient = uniform * environment * surface.occlusion;
    let uniform_error = bounds.uniform_error();
    let mut radiance = surface.emissive + ambient;
    let mut error = 4.0 * COLOR * surface.emissive.max(DVec3::ONE) + environment * (uniform_error + COLOR);
    let mut unsure = false;
    let weight = light_weight(frame);
    let lit = (0..frame.light_count).filter(|i| lit >> i & 1 != 0).map(|i| &lights[i as usize]);
    for light in lit.filter(|light| light.shape != LIGHT_MESH) {
        let mut incident = light_at(light, position.to_array());
        incident.irradiance *= weight;
        let part = reflector.reflect_light(surface.normal, view, incident.direction);
        let directions = (surface.normal, view, incident.direction);
        let reflection = reflection_error(reflector, bounds, directions, albedo);
        let bare =
            light_at(&Light { inv_range2: 0.0, kind: light.kind & LIGHT_DIRECTIONAL, ..*light }, position.to_array());
        let cone = if light.kind == LIGHT_SPOT { f64::from(light.spot_scale).abs() } else { 0.0 };
        let irradiance_error = weight * bare.irradiance * (41.0 + 64.0 + 64.0 * (1.0 + cone)) * U;
        radiance += part * incident.irradiance;
        let Some((relative, absolute)) = reflection else {
            unsure |= incident.irradiance != DVec3::ZERO;
            continue;
        };
        error += (part * relative + absolute) * (incident.irradiance + irradiance_error) + part * irradiance_error;
    }
    // Each sum and product of the total rounds once more.
    error += 4.0 * f64::from(frame.light_count + 2) * U * radiance;
    (radiance, if unsure { DVec3::INFINITY } else { error })
}

/// What the sample's direction of the map adds.
fn reflected_from_afar(surface: &Surface, bounds: &Directions, view: DVec3, afar: Option<Afar<'_>>) -> (DVec3, DVec3) {
    let Some(drawn) = afar.and_then(|map| map.drawn()) else { return (DVec3::ZERO, DVec3::ZERO) };
    let direction = drawn.direction.as_dvec3();
    let irradiance = drawn.irradiance.min(DVec3::splat(IRRADIANCE_MAX));
    let part = surface.reflector.reflect_light(surface.normal, view, direction);
    // What the direction is off by is to the bound as if the normal were.
    let bounds = Directions { normal: bounds.normal + DIRECTION, ..*bounds };
    let albedo = albedo_error(&bounds);
    match reflection_error(&surface.reflector, &bounds, (surface.normal, view, direction), albedo) {
        Some((relative, absolute)) => {
            (part * irradiance, (part * (relative + IRRADIANCE) + absolute) * irradiance * (1.0 + IRRADIANCE))
        }
        None if irradiance == DVec3::ZERO => (DVec3::ZERO, DVec3::ZERO),
        None => (part * irradiance, DVec3::INFINITY),
    }
}

/// What the sample's point of what shines adds.
fn reflected_from_emitter(
    stage: &Stage<'_>,
    surface: &Surface,
    bounds: &Directions,
    view: DVec3,
    (shining, receiver): (&Shining<'_>, Receiver),
) -> (DVec3, DVec3) {
    let position = receiver.point.position;
    let emitter = draw_emitter(stage, shining, &Light { shape: LIGHT_MESH, ..Light::default() }, &receiver);
    let material = stage.material(emitter.primitive);
    let [u, v] = emitter.weights;
    let emission = emission_at(material, &stage.spot(emitter.primitive, u, v).attributes(), stage.textures);
    let incident = light_at(&emitter.light, position.to_array());
    let weight = light_weight(stage.frame);
    let irradiance = incident.irradiance * emission * weight;
    let part = surface.reflector.reflect_light(surface.normal, view, incident.direction);
    // The cosine at the lamp and the emission are off by as much whatever they are: bounds are of those without them.
    let bare = light_at(&Light { shape: LIGHT_SHARP, ..emitter.light }, position.to_array()).irradiance * weight;
    let most = Vec3::from(material.emissive).as_dvec3();
    let lamp = normal_error(stage, emitter.instance, emitter.primitive) + (41.0 + 64.0 + 64.0) * U;
    let irradiance_error = bare * emission * (lamp + emitter.error) + bare * most * 4.0 * COLOR;
    let albedo = albedo_error(bounds);
    let bound = reflection_error(&surface.reflector, bounds, (surface.normal, view, incident.direction), albedo);
    match bound.filter(|_| !emitter.doubtful) {
        Some((relative, absolute)) => {
            let error = (part * relative + absolute) * (irradiance + irradiance_error) + part * irradiance_error;
            (part * irradiance, error)
        }
        None if irradiance + irradiance_error == DVec3::ZERO && !emitter.doubtful => (DVec3::ZERO, DVec3::ZERO),
        None => (part * irradiance, DVec3::INFINITY),
    }
}

/// Relative error of the specular lobe and absolute error of the diffuse layer, as `brdf_excess` of the test has them, with
/// the directions and the roughness off too; `None` for a light so low, or a lobe so narrow, that there is no bound.
fn reflection_error(
    reflector: &Reflector,
    bounds: &Directions,
    (normal, view, light): (DVec3, DVec3, DVec3),
    albedo: f64,
) -> Option<(f64, f64)> {
    let along = bounds.normal + 24.0 * U + 3.0 * U;
    let nl = normal.dot(light);
    if nl.abs() <= 4.0 * along {
        return None;
    }
    if nl < 0.0 {
        return Some((0.0, 0.0));
    }
    let nv = normal.dot(view).max(COSINE_MIN);
    let sum = (light + view).length();
    let alpha = (reflector.roughness * reflector.roughness).max(1.0 / 1024.0);
    let angle = bounds.normal + (bounds.view + 24.0 * U) / sum + (4.0 / sum + 8.0) * U;
    // The roughness is off by COLOR; alpha is its square, and D falls with the square of alpha, V with alpha at most.
    let blunt = 6.0 * COLOR / alpha.sqrt();
    let cosines = 2.0 * along / nl + 2.0 * (bounds.normal + bounds.view + 3.0 * U) / nv;
    // First order in the angle; what is above it is within the factor for angles below an eighth of alpha.
    if angle > alpha / 8.0 {
        return None;
    }
    let relative = 3.0 * angle / alpha + blunt + cosines + (100.0 + 6.0 / nl + 6.0 / nv) * U + 8.0 * COLOR;
    let mean = 1.0 - reflector.specular_color().max_element();
    let layer = (nl + along) * (64.0 * U + 4.0 * albedo + 4.0 * COLOR) / mean.max(1.0 / 256.0).powi(2)
        * (1.0 - reflector.metallic)
        + along
        + 4.0 * COLOR;
    Some((relative, layer))
}
