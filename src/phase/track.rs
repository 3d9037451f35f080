//! Point tracking (paper 3, Algorithm 1): the hit points of the last frame direct the rays of this one.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::{Pass, Resource};
use crate::shaders::{nearest, nearest_index, track as shader};

/// Clears what is known of the pixels, finds the nearest point of each in two steps, and lists a ray a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    let points = nearest::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        samples: b(f.previous),
        tracked: b(f.claims),
        seeds: f.seeds.map(|seeds| b(seeds.previous)),
        sampler_table: f.seeds.map(|seeds| b(seeds.table)),
        corners: Some(b(s.corners)),
        rest: Some(b(s.rest)),
        previous_corners: f.previous_corners.map(b),
    };
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        previous: b(f.previous),
        tracked: b(f.claims),
        aims: b(f.aims),
        samples: b(f.samples),
        offsets: b(f.offsets),
        counters: b(f.counters),
        previous_seeds: f.seeds.map(|seeds| b(seeds.previous)),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
        sampler_table: f.seeds.map(|seeds| b(seeds.table)),
        corners: Some(b(s.corners)),
        rest: Some(b(s.rest)),
        previous_corners: f.previous_corners.map(b),
    };
    let dispatch = |shader, list: &[Resource], threads| kit.dispatch("track", shader, list, &[], threads);
    let [distance, index] = [nearest::modelling(kit.model()), nearest_index::modelling(kit.model())];
    let aim = shader::modelling(kit.model());
    Ok(vec![
        Pass::fill("track", f.claims, u32::MAX),
        dispatch(distance, &points.of(distance), f.dense())?,
        dispatch(index, &points.of(index), f.dense())?,
        dispatch(aim, &bindings.of(aim), f.pixels())?,
    ])
}
