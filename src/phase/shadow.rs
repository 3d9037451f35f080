//! Shadow rays (paper 1, section 6: one a light and shading), in a kernel of their own.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{shadow as shader, shadow_alpha};

/// One thread a sample of the list.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Pass> {
    let mut list = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        nodes: b(s.nodes),
        corners: b(s.corners),
        rest: b(s.rest),
        lights: b(f.lights),
        found: b(f.found),
        lit: b(f.lit),
        samples: b(f.samples),
    }
    .list();
    if s.alpha {
        list.extend([b(s.triangles), b(s.materials)]);
        list.extend(s.alpha_resources());
    }
    let shader = if s.alpha { &shadow_alpha::SHADER } else { &shader::SHADER };
    kit.dispatch("shadow", shader, &list, &[], f.dense())
}
