//! Reconstruction (paper 1, section 4.4): a truncated Gaussian over the 3 × 3 pixels around.

use super::{FrameResources, HistoryResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{reconstruct as shader, reconstruct_accumulate, reconstruct_motion};

/// One thread a pixel. With `accumulate` the film sums over frames, from the last reset on; where frames are integrated, the
/// longest motion is kept as well.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, accumulate: bool) -> Result<Pass> {
    let bindings = shader::Bindings { frame: b(f.frame), offsets: b(f.offsets), shaded: b(f.shaded), film: b(f.film) };
    let mut list = bindings.list();
    let shader = match f.history {
        Some(HistoryResources::Integrated { motion, .. }) => {
            list.push(b(motion));
            &reconstruct_motion::SHADER
        }
        _ if accumulate => &reconstruct_accumulate::SHADER,
        _ => &shader::SHADER,
    };
    kit.dispatch("reconstruct", shader, &list, &[], f.pixels())
}
