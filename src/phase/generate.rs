//! Supersampling: stratified new samples, the same number in every pixel.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::generate as shader;

/// One thread a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        samples: b(f.samples),
        offsets: b(f.offsets),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
    };
    let shader = shader::modelling(kit.model());
    kit.dispatch("generate", shader, &bindings.of(shader), &[], f.pixels())
}
