//! Reprojection (paper 1, section 4.1): every cached sample claims the subpixel that it projects to.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::{Pass, Resource};
use crate::shaders::{reproject as shader, reproject_displaced, reproject_nearest};

/// Clears claims and masks, then reprojects. Of samples that meet on a subpixel the older wins.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    let [claims, masks] = cleared(f);
    let shader = shader::modelling(kit.model());
    Ok(vec![claims, masks, kit.dispatch("reproject", shader, &bindings(f, s).of(shader), &[], f.dense())?])
}

/// As [`passes`], but the nearer wins, and others take what is free in their pixel.
///
/// # Errors
/// As for [`passes`].
pub fn nearest_passes(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    let [claims, masks] = cleared(f);
    let nearest = reproject_nearest::modelling(kit.model());
    let displaced = reproject_displaced::modelling(kit.model());
    Ok(vec![
        claims,
        masks,
        kit.dispatch("reproject", nearest, &bindings(f, s).of(nearest), &[], f.dense())?,
        Pass::copy("reproject", f.masks, f.plan),
        kit.dispatch("reproject", displaced, &bindings(f, s).of(displaced), &[], f.dense())?,
    ])
}

fn cleared(f: &FrameResources) -> [Pass; 2] {
    [Pass::fill("reproject", f.claims, u32::MAX), Pass::fill("reproject", f.masks, 0)]
}

/// Of all variants: `taken` is the masks before, in the plan, which is of no use yet and holds as much.
fn bindings(f: &FrameResources, s: &SceneResources) -> reproject_displaced::Bindings<Resource> {
    reproject_displaced::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        samples: b(f.previous),
        claims: b(f.claims),
        masks: b(f.masks),
        taken: b(f.plan),
        seeds: f.seeds.map(|seeds| b(seeds.previous)),
        sampler_table: f.seeds.map(|seeds| b(seeds.table)),
        corners: Some(b(s.corners)),
        rest: Some(b(s.rest)),
        previous_corners: f.previous_corners.map(b),
    }
}
