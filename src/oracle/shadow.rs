//! Shadow rays: which lights reach a sample. Twin of `glsl/shadow.comp`, in f32 and in the shader's order.

use std::cell::Cell;

use glam::Vec3;

use super::stage::{Stage, U, normal_error};
use super::traverse::{Intersection, Query, any_with_alpha, offset_origin};
use crate::shaders::{FOUND_LOST, Found, LIGHT_DIRECTIONAL, Light, OCCLUDED_BIT, SKY_INSTANCE};

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

/// Traces the rays of one entry of the list; none for what is hidden, lost or sky.
pub fn shadow(stage: &Stage<'_>, lights: &[Light], found: &Found) -> Outcome {
    let mut outcome = Outcome::default();
    if found.primitive == FOUND_LOST || found.instance & OCCLUDED_BIT != 0 || found.instance == SKY_INSTANCE {
        return outcome;
    }
    for (i, light) in lights.iter().enumerate().take(stage.frame.light_count as usize) {
        let doubtful = Cell::new(false);
        if let Some(query) = shadow_query(stage, light, found, &doubtful) {
            outcome.rays += 1;
            let exists = |hit: &Intersection| stage.alpha_hit(hit, &doubtful);
            outcome.bits |= u32::from(!any_with_alpha(&stage.world, &query, &exists)) << i;
        }
        outcome.doubtful |= u32::from(doubtful.get()) << i;
    }
    outcome
}

/// The ray from a found point to a light; none to a light behind the surface. Sets `doubtful` where the side that the
/// viewer or the light is on is a matter of rounding.
pub fn shadow_query(stage: &Stage<'_>, light: &Light, found: &Found, doubtful: &Cell<bool>) -> Option<Query> {
    let point = stage.surface(found.instance, found.primitive, found.u, found.v);
    let directional = light.kind == LIGHT_DIRECTIONAL;
    let target = Vec3::from(light.position);
    let towards = if directional { -Vec3::from(light.direction) } else { target - point.position };
    let facing = point.normal.dot(point.position);
    let lit = point.normal.dot(towards);
    // Dot products of three terms with a normal that is off by its own error.
    let error = normal_error(stage, found.instance, found.primitive) + 4.0 * U;
    let near_zero = |dot: f32, of: Vec3| f64::from(dot.abs()) <= error * f64::from(of.length());
    if near_zero(facing, point.position) || near_zero(lit, towards) {
        doubtful.set(true);
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
