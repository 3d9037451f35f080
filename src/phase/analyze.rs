//! Analysis (paper 1, section 4.2): which samples stay, and where new ones are needed.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::analyze as shader;

/// One thread a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        masks: b(f.masks),
        plan: b(f.plan),
        tiles: b(f.tiles),
        counters: b(f.counters),
    };
    kit.dispatch("analyze", &shader::SHADER, &bindings.list(), &[], f.pixels())
}
