//! Shadow rays (paper 1, section 6: one a light and shading), in a kernel of their own.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::shadow as shader;

/// One thread a sample of the list.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        nodes: b(s.nodes),
        corners: b(s.corners),
        rest: b(s.rest),
        lights: b(f.lights),
        found: b(f.found),
        lit: b(f.lit),
        samples: b(f.samples),
        triangles: Some(b(s.triangles)),
        materials: Some(b(s.materials)),
        vertices: Some(b(s.vertices)),
        atlas: Some(s.atlas),
        srgb: Some(b(s.srgb)),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
        sampler_table: f.seeds.map(|seeds| b(seeds.table)),
        previous_corners: f.previous_corners.map(b),
        environment_map: Some(b(s.environment_map)),
        traversals: f.traversals.map(b),
    };
    let shader = shader::modelling(kit.model());
    kit.dispatch("shadow", shader, &bindings.of(shader), &[], f.dense())
}
