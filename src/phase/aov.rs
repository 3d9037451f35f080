//! Images besides colour: see [`crate::renderer::Aov`].

use super::{AovResources, FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{aov as shader, aov_age, aov_stable};

/// One thread a pixel. `stable` says that there are masks and a plan to show.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, images: &AovResources, stable: bool) -> Result<Pass> {
    let mut list = shader::Bindings {
        frame: b(f.frame),
        offsets: b(f.offsets),
        shaded: b(f.shaded),
        depth: images.depth,
        motion: images.motion,
        density: images.density,
        age: images.age,
        extras: b(f.extras),
    }
    .list();
    let shader = match (stable, f.ages) {
        (false, _) => shader::SHADER,
        (true, None) => aov_stable::SHADER,
        (true, Some(_)) => aov_age::SHADER,
    };
    if stable {
        list.extend([b(f.masks), b(f.plan)]);
        list.extend(f.ages.map(b));
    }
    kit.dispatch("aov", shader, &list, &[], f.pixels())
}
