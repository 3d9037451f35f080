//! Reconstruction (paper 1, section 4.4): a truncated Gaussian over the 3 × 3 pixels around.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{reconstruct as shader, reconstruct_accumulate};

/// One thread a pixel. With `accumulate` the film sums over frames, from the last reset on.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, accumulate: bool) -> Result<Pass> {
    let bindings = shader::Bindings { frame: b(f.frame), offsets: b(f.offsets), shaded: b(f.shaded), film: b(f.film) };
    let shader = if accumulate { &reconstruct_accumulate::SHADER } else { &shader::SHADER };
    kit.dispatch("reconstruct", shader, &bindings.list(), &[], f.pixels())
}
