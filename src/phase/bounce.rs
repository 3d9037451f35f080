//! Secondary rays (paper 2, sections 3.3 and 3.5): what is seen in reflections and through what transmits.
//!
//! A step of all paths at a time: its rays, those of a kind together unless the settings say otherwise ([`crate::settings::Grouping`]),
//! then shadow rays from what they find, then its shading, which lists the next step's.

use super::{FrameResources, Kit, PathResources, SceneResources, b};
use crate::Result;
use crate::gpu::{Pass, Range, Threads};
use crate::shaders::{PathCounters, bounce, route, scatter, shadow_bounce};

/// The passes of so many steps; none where paths are not modelled.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources, s: &SceneResources, steps: u32) -> Result<Vec<Pass>> {
    let Some(paths) = &f.paths else { return Ok(Vec::new()) };
    let mut passes = Vec::new();
    for step in 0..steps {
        let threads = threads(paths, step);
        passes.push(route_pass(kit, f, paths, step)?);
        passes.push(bounce_pass(kit, f, s, paths, step, threads)?);
        passes.push(shadow_pass(kit, f, s, paths, step, threads)?);
        passes.push(scatter_pass(kit, f, s, paths, step, threads)?);
    }
    Ok(passes)
}

/// A thread a ray of a step.
fn threads(paths: &PathResources, step: u32) -> Threads {
    let offset = paths.counters.offset + u64::from(step) * size_of::<PathCounters>() as u64;
    Threads::Indirect(Range { name: "path arguments", offset, size: 12, ..paths.counters })
}

fn route_pass(kit: &Kit, f: &FrameResources, paths: &PathResources, step: u32) -> Result<Pass> {
    let bindings = route::Bindings { path_counters: b(paths.counters), counters: b(f.counters), frame: b(f.frame) };
    let push = route::Push { step };
    kit.dispatch("bounce", route::SHADER, &bindings.list(), bytemuck::bytes_of(&push), Threads::Exactly([1, 1, 1]))
}

fn bounce_pass(
    kit: &Kit,
    f: &FrameResources,
    s: &SceneResources,
    paths: &PathResources,
    step: u32,
    threads: Threads,
) -> Result<Pass> {
    let bindings = bounce::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        nodes: b(s.nodes),
        corners: b(s.corners),
        rest: b(s.rest),
        path_origins: b(paths.origins),
        path_directions: b(paths.directions),
        path_list: b(paths.list),
        path_counters: b(paths.counters),
        found: b(f.found),
        triangles: Some(b(s.triangles)),
        materials: Some(b(s.materials)),
        vertices: Some(b(s.vertices)),
        atlas: Some(s.atlas),
        srgb: Some(b(s.srgb)),
        traversals: f.traversals.map(b),
        previous_corners: f.previous_corners.map(b),
    };
    let shader = bounce::modelling(kit.model());
    kit.dispatch("bounce", shader, &bindings.of(shader), bytemuck::bytes_of(&bounce::Push { step }), threads)
}

fn shadow_pass(
    kit: &Kit,
    f: &FrameResources,
    s: &SceneResources,
    paths: &PathResources,
    step: u32,
    threads: Threads,
) -> Result<Pass> {
    let Some(seeds) = f.seeds else { return Err(super::missing("the seeds of samples")) };
    let bindings = shadow_bounce::Bindings {
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
        triangles: Some(b(s.triangles)),
        materials: Some(b(s.materials)),
        vertices: Some(b(s.vertices)),
        atlas: Some(s.atlas),
        srgb: Some(b(s.srgb)),
        seeds: b(seeds.now),
        sampler_table: b(seeds.table),
        environment_map: b(s.environment_map),
        path_origins: b(paths.origins),
        path_list: b(paths.list),
        path_counters: b(paths.counters),
        traversals: f.traversals.map(b),
        previous_corners: f.previous_corners.map(b),
    };
    let shader = shadow_bounce::modelling(kit.model());
    let push = shadow_bounce::Push { step };
    kit.dispatch("bounce", shader, &bindings.of(shader), bytemuck::bytes_of(&push), threads)
}

fn scatter_pass(
    kit: &Kit,
    f: &FrameResources,
    s: &SceneResources,
    paths: &PathResources,
    step: u32,
    threads: Threads,
) -> Result<Pass> {
    let Some(seeds) = f.seeds else { return Err(super::missing("the seeds of samples")) };
    let bindings = scatter::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        corners: b(s.corners),
        rest: b(s.rest),
        triangles: b(s.triangles),
        vertices: b(s.vertices),
        materials: b(s.materials),
        atlas: s.atlas,
        srgb: b(s.srgb),
        lights: b(f.lights),
        found: b(f.found),
        lit: b(f.lit),
        shaded: b(f.shaded),
        seeds: b(seeds.now),
        sampler_table: b(seeds.table),
        environment_map: b(s.environment_map),
        path_origins: b(paths.origins),
        path_directions: b(paths.directions),
        path_weights: b(paths.weights),
        path_list: b(paths.list),
        path_counters: b(paths.counters),
        medium: f.medium.map(b),
        previous_corners: f.previous_corners.map(b),
    };
    let shader = scatter::modelling(kit.model());
    let push = scatter::Push { step };
    kit.dispatch("bounce", shader, &bindings.of(shader), bytemuck::bytes_of(&push), threads)
}
