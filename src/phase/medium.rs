//! Fog and mist (paper 2, section 3.6): a march a pixel, composited with each of its samples.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::medium as shader;

/// One thread a pixel; none if no medium is modelled.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Option<Pass>> {
    let Some(medium) = f.medium else { return Ok(None) };
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        nodes: b(s.nodes),
        corners: b(s.corners),
        rest: b(s.rest),
        lights: b(f.lights),
        medium: b(medium),
        medium_noise: b(s.medium_noise),
        shaded: b(f.shaded),
        offsets: b(f.offsets),
        extras: b(f.extras),
        triangles: Some(b(s.triangles)),
        materials: Some(b(s.materials)),
        vertices: Some(b(s.vertices)),
        atlas: Some(s.atlas),
        srgb: Some(b(s.srgb)),
        traversals: f.traversals.map(b),
    };
    let shader = shader::modelling(kit.model());
    kit.dispatch("medium", shader, &bindings.of(shader), &[], f.pixels()).map(Some)
}
