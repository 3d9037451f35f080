//! Reprojection (paper 1, section 4.1): every cached sample claims the subpixel that it projects to.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::reproject as shader;

/// Clears claims and masks, then reprojects.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources) -> Result<Vec<Pass>> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        samples: b(f.previous),
        claims: b(f.claims),
        masks: b(f.masks),
    };
    Ok(vec![
        Pass::fill("reproject", f.claims, u32::MAX),
        Pass::fill("reproject", f.masks, 0),
        kit.dispatch("reproject", &shader::SHADER, &bindings.list(), &[], f.dense())?,
    ])
}
