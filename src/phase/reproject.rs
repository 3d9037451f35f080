//! Reprojection (paper 1, section 4.1): every cached sample claims the subpixel that it projects to.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::{Pass, Resource};
use crate::shaders::{reproject as shader, reproject_displaced, reproject_nearest};

/// Clears claims and masks, then reprojects. Of samples that meet on a subpixel the older wins.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources) -> Result<Vec<Pass>> {
    let [claims, masks] = cleared(f);
    Ok(vec![claims, masks, kit.dispatch("reproject", &shader::SHADER, &bindings(f), &[], f.dense())?])
}

/// As [`passes`], but the nearer wins, and others take what is free in their pixel.
///
/// # Errors
/// As for [`passes`].
pub fn nearest_passes(kit: &Kit, f: &FrameResources) -> Result<Vec<Pass>> {
    let [claims, masks] = cleared(f);
    // The plan is of no use yet, and holds as much.
    let mut displaced = bindings(f);
    displaced.push(b(f.plan));
    Ok(vec![
        claims,
        masks,
        kit.dispatch("reproject", &reproject_nearest::SHADER, &bindings(f), &[], f.dense())?,
        Pass::copy("reproject", f.masks, f.plan),
        kit.dispatch("reproject", &reproject_displaced::SHADER, &displaced, &[], f.dense())?,
    ])
}

fn cleared(f: &FrameResources) -> [Pass; 2] {
    [Pass::fill("reproject", f.claims, u32::MAX), Pass::fill("reproject", f.masks, 0)]
}

fn bindings(f: &FrameResources) -> Vec<Resource> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        samples: b(f.previous),
        claims: b(f.claims),
        masks: b(f.masks),
    };
    bindings.list()
}
