//! Analysis (paper 1, section 4.2): which samples stay, and where new ones are needed.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{Shader, analyze as shader, analyze_fill, analyze_keep};

/// One thread a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    dispatch("analyze", shader::SHADER, kit, f)
}

/// The plan to keep everything, for a frame that decides after verification.
///
/// # Errors
/// As for [`pass`].
pub fn keep_pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    dispatch("list", analyze_keep::SHADER, kit, f)
}

/// The decision after verification: tiles count what is added.
///
/// # Errors
/// As for [`pass`].
pub fn fill_pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    dispatch("analyze", analyze_fill::SHADER, kit, f)
}

fn dispatch(label: &'static str, shader: &'static Shader, kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        masks: b(f.masks),
        plan: b(f.plan),
        tiles: b(f.tiles),
        counters: b(f.counters),
    };
    kit.dispatch(label, shader, &bindings.list(), &[], f.pixels())
}
