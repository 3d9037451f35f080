//! What diffuse paths have brought goes into the means of their samples, and from there into their colours (paper 1, section 6.1).

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{accumulate as fresh, accumulate_stable as stable};

/// One thread a sample of the list; none where indirect light is not modelled.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources) -> Result<Option<Pass>> {
    let Some(indirect) = &f.indirect else { return Ok(None) };
    let mut list = fresh::Bindings {
        frame: b(f.frame),
        counters: b(f.counters),
        brought: b(indirect.brought),
        gathered: b(indirect.gathered),
        shaded: b(f.shaded),
    }
    .list();
    let mut shader = fresh::SHADER;
    if let Some(previous) = indirect.previous {
        list.push(b(previous));
        shader = stable::SHADER;
    }
    kit.dispatch("accumulate", shader, &list, &[], f.dense()).map(Some)
}
