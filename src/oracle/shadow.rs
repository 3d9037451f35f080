//! Shadow rays: which lights reach a sample. Twin of `glsl/shadow.comp`, in f32 and in the shader's order.

use std::cell::Cell;

use glam::Vec3;

use super::emitter::{Receiver, draw_emitter};
use super::motion::light_at_time;
use super::random::{hash_combine, hash_uint};
use super::stage::{Stage, U, normal_error};
use super::traverse::{Intersection, Query, any_with_alpha, offset_origin};
use crate::shaders::{
    ENVIRONMENT_LIGHT, FOUND_LOST, Found, Frame, INSTANCE_MASK, LIGHT_DIRECTIONAL, LIGHT_MESH, Light, OCCLUDED_BIT,
    SKY_INSTANCE, Sample,
};

/// What a sample's shadow rays found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Outcome {
    /// A bit a light that reaches the sample.
    pub bits: u32,
    /// Rays traced.
    pub rays: u32,
    /// Lights of which another device's rounding may decide otherwise.
    pub doubtful: u32,
}

/// Traces the rays of one entry of the list; none for what is hidden, lost or sky. Lights that are not chosen reach nothing;
/// without rays (`shadow_rays` 0) all reach that are before the surface.
pub fn shadow(stage: &Stage<'_>, lights: &[Light], sample: &Sample, found: &Found) -> Outcome {
    let mut outcome = Outcome::default();
    if found.primitive == FOUND_LOST || found.instance & OCCLUDED_BIT != 0 || found.instance == SKY_INSTANCE {
        return outcome;
    }
    let untraced = stage.frame.shadow_rays == 0;
    let chosen = chosen_lights(stage.frame, sample);
    for (i, light) in lights.iter().enumerate().filter(|(i, _)| chosen.get(*i).is_some_and(|c| *c)) {
        let doubtful = Cell::new(false);
        let query = shadow_query(stage, light, found, &doubtful);
        if untraced {
            outcome.bits |= u32::from(query.is_some()) << i;
        } else if let Some(query) = query {
            outcome.rays += 1;
            let exists = |hit: &Intersection| stage.shadow_hit(hit, &doubtful);
            outcome.bits |= u32::from(!any_with_alpha(&stage.world, &query, &exists)) << i;
        }
        outcome.doubtful |= u32::from(doubtful.get()) << i;
    }
    if let Some(light) = light_from_afar(stage) {
        let doubtful = Cell::new(false);
        let query = shadow_query(stage, &light, found, &doubtful);
        outcome.rays += u32::from(!untraced && query.is_some());
        let exists = |hit: &Intersection| stage.shadow_hit(hit, &doubtful);
        let reaches = query.is_some_and(|query| untraced || !any_with_alpha(&stage.world, &query, &exists));
        outcome.bits |= u32::from(reaches) << ENVIRONMENT_LIGHT;
        outcome.doubtful |= u32::from(doubtful.get()) << ENVIRONMENT_LIGHT;
    }
    outcome
}

/// The sample's direction of the map of light from all around, as a light that shines along it; none if there is no map.
pub fn light_from_afar(stage: &Stage<'_>) -> Option<Light> {
    let drawn = stage.afar?.drawn()?;
    Some(Light { kind: LIGHT_DIRECTIONAL, direction: (-drawn.direction).to_array(), ..Light::default() })
}

/// Which lights of the frame are chosen for a sample: as many as it has rays, by a hash of where it lies on its surface, and
/// all of them if there are no rays at all.
pub fn chosen_lights(frame: &Frame, sample: &Sample) -> Vec<bool> {
    let lights = frame.light_count;
    let mut wanted = if frame.shadow_rays == 0 { lights } else { frame.shadow_rays.min(lights) };
    let [x, y, z] = sample.position.map(f32::to_bits);
    let mut h = [sample.instance & INSTANCE_MASK, x, y, z].into_iter().fold(frame.seed, hash_combine);
    let mut choose = |left: u32| {
        h = hash_uint(h);
        let chosen = h % left < wanted;
        wanted -= u32::from(chosen);
        chosen
    };
    (1..=lights).rev().map(&mut choose).collect()
}

/// For how many lights each chosen one counts.
pub fn light_weight(frame: &Frame) -> f64 {
    let (lights, rays) = (frame.light_count, frame.shadow_rays);
    if rays == 0 || rays >= lights { 1.0 } else { f64::from(lights) / f64::from(rays) }
}

/// The ray from a found point to a light; none to a light behind the surface. Sets `doubtful` where the side that the
/// viewer or the light is on is a matter of rounding.
pub fn shadow_query(stage: &Stage<'_>, light: &Light, found: &Found, doubtful: &Cell<bool>) -> Option<Query> {
    let point = stage.surface(found.instance, found.primitive, found.u, found.v);
    let shines = stage.shining.filter(|_| light.shape == LIGHT_MESH);
    let receiver = Receiver { point, error: normal_error(stage, found.instance, found.primitive) };
    let emitter = shines.map(|shining| draw_emitter(stage, &shining, light, &receiver));
    if emitter.is_some_and(|emitter| emitter.doubtful) {
        doubtful.set(true);
    }
    let drawn = emitter.map(|emitter| emitter.light);
    let light = &drawn.unwrap_or_else(|| light_at_time(light, stage.world.time));
    let directional = light.kind == LIGHT_DIRECTIONAL;
    let target = Vec3::from(light.position);
    let towards = if directional { -Vec3::from(light.direction) } else { target - point.position };
    let seen_along = point.position - stage.eye();
    let facing = point.normal.dot(seen_along);
    let lit = point.normal.dot(towards);
    // Dot products of three terms with a normal that is off by its own error.
    let error = normal_error(stage, found.instance, found.primitive) + 4.0 * U;
    let near_zero = |dot: f32, of: Vec3| f64::from(dot.abs()) <= error * f64::from(of.length());
    if near_zero(facing, seen_along) || near_zero(lit, towards) {
        doubtful.set(true);
    }
    if drawn.is_some() {
        // Its normal is off by no more than that of any triangle here.
        let away = Vec3::from(light.direction).dot(towards);
        if near_zero(away, towards) {
            doubtful.set(true);
        }
        if away.is_nan() || away >= 0.0 {
            return None;
        }
    }
    let viewer_side = if facing <= 0.0 { 1.0 } else { -1.0 };
    if lit * viewer_side > 0.0 {
        let origin = offset_origin(&point, towards);
        let direction = if directional { towards } else { target - origin };
        Some(Query { origin, direction, tmax: if directional { f32::INFINITY } else { 1.0 } })
    } else {
        None
    }
}
