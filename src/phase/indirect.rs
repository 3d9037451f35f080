//! Indirect light (paper 1, section 6.1): a diffuse path from every visible sample, followed like what is seen in reflections.

use super::{FrameResources, IndirectResources, Kit, PathResources, SceneResources, b, bounce};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{indirect as fresh, indirect_stable as stable};

/// The first rays, one thread a sample, and so many steps; none where indirect light is not modelled.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources, s: &SceneResources, steps: u32) -> Result<Vec<Pass>> {
    let (Some(paths), Some(indirect)) = (&f.paths, &f.indirect) else { return Ok(Vec::new()) };
    let round = bounce::Round { label: "indirect", diffuse: true, sum: indirect.brought };
    // What reflections have counted is done with.
    let mut passes = vec![Pass::fill("indirect", paths.counters, 0), start(kit, f, s, paths, indirect)?];
    passes.extend(bounce::follow(kit, f, s, paths, round, steps)?);
    Ok(passes)
}

fn start(
    kit: &Kit,
    f: &FrameResources,
    s: &SceneResources,
    paths: &PathResources,
    indirect: &IndirectResources,
) -> Result<Pass> {
    let Some(seeds) = f.seeds else { return Err(super::missing("the seeds of samples")) };
    let bindings = stable::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        corners: b(s.corners),
        rest: b(s.rest),
        triangles: b(s.triangles),
        vertices: b(s.vertices),
        materials: b(s.materials),
        atlas: s.atlas,
        srgb: b(s.srgb),
        lights: b(f.lights),
        found: b(f.found),
        seeds: b(seeds.now),
        sampler_table: b(seeds.table),
        gathered: b(indirect.gathered),
        brought: b(indirect.brought),
        path_origins: b(paths.origins),
        path_directions: b(paths.directions),
        path_weights: b(paths.weights),
        path_list: b(paths.list),
        path_counters: b(paths.counters),
        samples: b(f.samples),
        previous: b(f.previous),
        // What is not kept is not read.
        sources: b(f.sources.unwrap_or(f.samples)),
        previous_gathered: b(indirect.previous.unwrap_or(indirect.gathered)),
    };
    let kept = indirect.previous.is_some();
    let shader = if kept { stable::modelling(kit.model()) } else { fresh::modelling(kit.model()) };
    kit.dispatch("indirect", shader, &bindings.of(shader), &[], f.dense())
}
