//! Verification (paper 1, section 4.3): one camera ray an entry of the dense list, bounded for cached samples.

use super::{FrameResources, Kit, SceneResources, b};
use crate::Result;
use crate::gpu::{Pass, Threads};
use crate::shaders::verify as shader;

/// One thread a sample of the list.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Pass> {
    traced("verify", kit, f, s, f.dense())
}

/// As [`pass`], for the samples that were listed last, a thread each.
pub(super) fn traced(
    label: &'static str,
    kit: &Kit,
    f: &FrameResources,
    s: &SceneResources,
    threads: Threads,
) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        nodes: b(s.nodes),
        corners: b(s.corners),
        rest: b(s.rest),
        samples: b(f.samples),
        found: b(f.found),
        triangles: b(s.triangles),
        materials: b(s.materials),
        vertices: Some(b(s.vertices)),
        atlas: Some(s.atlas),
        srgb: Some(b(s.srgb)),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
        sampler_table: f.seeds.map(|seeds| b(seeds.table)),
        traversals: f.traversals.map(b),
        previous_corners: f.previous_corners.map(b),
    };
    let shader = shader::modelling(kit.model());
    kit.dispatch(label, shader, &bindings.of(shader), &[], threads)
}
