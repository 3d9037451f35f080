//! Resolving the film into the frame.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{resolve as shader, resolve_float};

/// One thread a pixel. `float_output` says that the image is R32G32B32A32_SFLOAT, not R16G16B16A16_SFLOAT.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, float_output: bool) -> Result<Pass> {
    let bindings = shader::Bindings { frame: b(f.frame), film: b(f.film), color: f.color };
    let shader = if float_output { resolve_float::SHADER } else { shader::SHADER };
    kit.dispatch("resolve", shader, &bindings.list(), &[], f.pixels())
}
