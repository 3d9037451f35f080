//! Retention (paper 1, section 4.3): a pixel whose samples are all occluded keeps one, at its occluder's hit.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::retain as shader;

/// One thread a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        offsets: b(f.offsets),
        corners: b(s.corners),
        rest: b(s.rest),
        found: b(f.found),
        samples: b(f.samples),
        counters: b(f.counters),
        instances: Some(b(f.instances)),
    };
    let shader = shader::modelling(kit.model());
    kit.dispatch("retain", shader, &bindings.of(shader), &[], f.pixels())
}
