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
    let bindings = shader::Bindings { frame: b(f.frame), samples: b(f.samples), offsets: b(f.offsets) };
    kit.dispatch("generate", &shader::SHADER, &bindings.list(), &[], f.pixels())
}
