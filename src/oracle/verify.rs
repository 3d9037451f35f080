//! Verification (paper 1, section 4.3): what a camera ray finds for each sample of the list. Twin of `glsl/verify.comp`, in
//! f32 and in the shader's order.

use std::cell::Cell;

use glam::{Vec3, Vec4};

use super::stage::{Stage, U, normal_error};
use super::traverse::{Intersection, Query, SurfacePoint, Surfaces, closest_seen, transform_point};
use crate::shaders::{
    FOUND_LOST, Found, Frame, HIT_SKY, INSTANCE_MASK, NEW_INSTANCE, OCCLUDED_BIT, SKY_INSTANCE, Sample,
};

/// Where the ray of a cached sample ends, in lengths of its distance.
pub const REACH: f32 = 1.0 + 1.0 / 64.0;

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The sample, made if it was new, marked if it is hidden or lost.
    pub sample: Sample,
    /// What its ray found.
    pub found: Found,
    /// Another device's rounding may decide otherwise.
    pub doubtful: bool,
}

/// Verifies one entry of the list.
pub fn verify(stage: &Stage<'_>, sample: Sample) -> Outcome {
    let id = sample.instance & INSTANCE_MASK;
    let query = query(stage, sample);
    let doubtful = Cell::new(false);
    let exists = |hit: &Intersection| stage.alpha_hit(hit, &doubtful);
    let is_one_sided = |primitive| stage.is_one_sided(primitive);
    let hit = closest_seen(&stage.world, &query, &Surfaces { exists: &exists, is_one_sided: &is_one_sided });
    let (sample, found) = if id == NEW_INSTANCE {
        make_sample(stage, hit, query.direction)
    } else {
        check_sample(stage, Sample { instance: id, ..sample }, target(stage, sample), hit, &doubtful)
    };
    Outcome { sample, found, doubtful: doubtful.get() }
}

/// The ray of a sample.
pub fn query(stage: &Stage<'_>, sample: Sample) -> Query {
    let id = sample.instance & INSTANCE_MASK;
    let position = Vec3::from(sample.position);
    let surface = id < stage.frame.instance_count;
    let origin = stage.eye();
    let direction = if id == NEW_INSTANCE {
        camera_direction(&stage.seen(), [position.x, position.y]) - origin * stage.frame.lens[1]
    } else if surface {
        target(stage, sample) - origin
    } else {
        position
    };
    Query { origin, direction, tmax: if surface { REACH } else { f32::INFINITY } }
}

/// Where a cached sample is, camera-relative; of the sky, its direction.
fn target(stage: &Stage<'_>, sample: Sample) -> Vec3 {
    let id = sample.instance & INSTANCE_MASK;
    let position = Vec3::from(sample.position);
    if id < stage.frame.instance_count { transform_point(&stage.instance(id).to_relative, position) } else { position }
}

/// [`super::camera::camera_direction`] in f32 and in the shader's order.
pub fn camera_direction(frame: &Frame, pixel: [f32; 2]) -> Vec3 {
    let ndc = [0, 1].map(|i| pixel[i] / frame.size[i] as f32 * 2.0 - 1.0);
    let axis = |a: [f32; 4]| Vec4::from(a).truncate();
    axis(frame.forward) + axis(frame.right) * (ndc[0] * frame.right[3]) - axis(frame.up) * (ndc[1] * frame.up[3])
}

fn found(hit: &Intersection) -> Found {
    Found { instance: hit.instance, primitive: hit.primitive, u: hit.u, v: hit.v }
}

fn make_sample(stage: &Stage<'_>, hit: Option<Intersection>, direction: Vec3) -> (Sample, Found) {
    let Some(hit) = hit else {
        let position = (direction / direction.length()).to_array();
        let sky = Found { instance: SKY_INSTANCE, primitive: HIT_SKY, u: 0.0, v: 0.0 };
        return (Sample { position, instance: SKY_INSTANCE }, sky);
    };
    let object = stage.surface(hit.instance, hit.primitive, hit.u, hit.v).object;
    (Sample { position: object.to_array(), instance: hit.instance }, found(&hit))
}

fn check_sample(
    stage: &Stage<'_>,
    sample: Sample,
    relative: Vec3,
    hit: Option<Intersection>,
    doubtful: &Cell<bool>,
) -> (Sample, Found) {
    let id = sample.instance;
    let lost = (Sample { instance: NEW_INSTANCE, ..sample }, LOST);
    let hidden = |found: Found| {
        let instance = found.instance | OCCLUDED_BIT;
        (Sample { instance: id | OCCLUDED_BIT, ..sample }, Found { instance, ..found })
    };
    match hit {
        None if id == SKY_INSTANCE => (sample, Found { instance: SKY_INSTANCE, primitive: HIT_SKY, u: 0.0, v: 0.0 }),
        None => lost,
        Some(hit) if id == SKY_INSTANCE => hidden(found(&hit)),
        Some(hit) if holds_sample(stage, &hit, relative, doubtful) => (sample, found(&hit)),
        Some(hit) if hit.t > 1.0 => lost,
        Some(hit) => hidden(found(&hit)),
    }
}

const LOST: Found = Found { instance: 0, primitive: FOUND_LOST, u: 0.0, v: 0.0 };

/// Height of a camera-relative point over the plane of a hit triangle, and the height up to which it lies on it, metres.
pub fn height_and_limit(point: &SurfacePoint, relative: Vec3) -> (f32, f32) {
    (point.normal.dot(relative - point.position).abs(), 2.0 * point.clearance)
}

fn holds_sample(stage: &Stage<'_>, hit: &Intersection, relative: Vec3, doubtful: &Cell<bool>) -> bool {
    let point = stage.surface(hit.instance, hit.primitive, hit.u, hit.v);
    let (height, limit) = height_and_limit(&point, relative);
    // The difference is off by 1 U a component and the dot product by 3 U; the clearance is a sum of positive terms of some
    // forty operations, divided by a length.
    let away = f64::from((relative - point.position).length());
    let uncertain = away * (normal_error(stage, hit.instance, hit.primitive) + 4.0 * U) + 64.0 * U * f64::from(limit);
    if f64::from((height - limit).abs()) <= uncertain {
        doubtful.set(true);
    }
    height <= limit
}
