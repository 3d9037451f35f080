//! Shading (paper 1, section 4.3): the radiance of every visible sample towards the camera.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::shade as shader;

/// One thread a sample of the list.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        corners: b(s.corners),
        rest: b(s.rest),
        triangles: b(s.triangles),
        vertices: b(s.vertices),
        materials: b(s.materials),
        atlas: s.atlas,
        srgb: b(s.srgb),
        lights: b(f.lights),
        samples: b(f.samples),
        found: b(f.found),
        lit: b(f.lit),
        shaded: b(f.shaded),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
        sampler_table: f.seeds.map(|seeds| b(seeds.table)),
        environment_map: Some(b(s.environment_map)),
        path_origins: f.paths.map(|paths| b(paths.origins)),
        path_directions: f.paths.map(|paths| b(paths.directions)),
        path_weights: f.paths.map(|paths| b(paths.weights)),
        path_list: f.paths.map(|paths| b(paths.list)),
        path_counters: f.paths.map(|paths| b(paths.counters)),
        previous_corners: f.previous_corners.map(b),
        medium: f.medium.map(b),
    };
    let shader = shader::modelling(kit.model());
    kit.dispatch("shade", shader, &bindings.of(shader), &[], f.dense())
}
