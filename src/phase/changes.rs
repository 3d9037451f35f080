//! What is not as it was in the last frame: the image of [`crate::renderer::Aov::Changes`].

use super::{AovResources, FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{changes as shader, changes_stable};

/// One thread a pixel. Reads the lights that reach each sample, so that it comes before `reconstruct`.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, images: &AovResources) -> Result<Pass> {
    let mut list =
        shader::Bindings { frame: b(f.frame), offsets: b(f.offsets), changes: images.changes, extras: b(f.extras) }
            .list();
    let mut shader = shader::SHADER;
    if let Some(memory) = f.memory {
        list.extend([f.masks, f.plan, f.previous, f.samples, memory.sources, f.lit].map(b));
        list.extend([memory.previous_reached, memory.reached].map(b));
        shader = changes_stable::SHADER;
    }
    kit.dispatch("changes", shader, &list, &[], f.pixels())
}
