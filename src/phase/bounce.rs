//! Secondary rays (paper 2, sections 3.3 and 3.5): what is seen in reflections and through what transmits.
//!
//! A step of all paths at a time: its rays, those of a kind together unless the settings say otherwise ([`crate::settings::Grouping`]),
//! then shadow rays from what they find, then its shading, which lists the next step's.

use super::{FrameResources, Kit, PathResources, SceneResources, b};
use crate::Result;
use crate::gpu::{Pass, Range, Threads};
use crate::shaders::{
    PathCounters, bounce, route, route_diffuse, scatter, scatter_diffuse, shadow_bounce, shadow_diffuse,
};

/// What all paths of a frame are followed for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Round {
    /// Of its passes.
    pub label: &'static str,
    /// Diffuse paths, or what reflections and refractions show.
    pub diffuse: bool,
    /// What is added to: shaded samples, or what diffuse paths bring.
    pub sum: Range,
}

/// The passes of so many steps; none where paths are not modelled.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources, s: &SceneResources, steps: u32) -> Result<Vec<Pass>> {
    let Some(paths) = &f.paths else { return Ok(Vec::new()) };
    follow(kit, f, s, paths, Round { label: "bounce", diffuse: false, sum: f.shaded }, steps)
}

/// The passes of so many steps of a round.
pub(super) fn follow(
    kit: &Kit,
    f: &FrameResources,
    s: &SceneResources,
    paths: &PathResources,
    round: Round,
    steps: u32,
) -> Result<Vec<Pass>> {
    let mut passes = Vec::new();
    for step in 0..steps {
        let step = Step { kit, f, s, paths, round, step };
        passes.extend([step.route()?, step.bounce()?, step.shadow()?, step.scatter()?]);
    }
    Ok(passes)
}

/// A step of all paths.
struct Step<'a> {
    kit: &'a Kit,
    f: &'a FrameResources,
    s: &'a SceneResources,
    paths: &'a PathResources,
    round: Round,
    step: u32,
}

impl Step<'_> {
    /// A thread a ray.
    fn threads(&self) -> Threads {
        let counters = self.paths.counters;
        let offset = counters.offset + u64::from(self.step) * size_of::<PathCounters>() as u64;
        Threads::Indirect(Range { name: "path arguments", offset, size: 12, ..counters })
    }

    fn route(&self) -> Result<Pass> {
        let bindings = route::Bindings {
            path_counters: b(self.paths.counters),
            counters: b(self.f.counters),
            frame: b(self.f.frame),
        };
        let shader = if self.round.diffuse { route_diffuse::SHADER } else { route::SHADER };
        let push = route::Push { step: self.step };
        let one = Threads::Exactly([1, 1, 1]);
        self.kit.dispatch(self.round.label, shader, &bindings.list(), bytemuck::bytes_of(&push), one)
    }

    fn bounce(&self) -> Result<Pass> {
        let Self { f, s, paths, .. } = self;
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
            found: b(paths.found),
            triangles: Some(b(s.triangles)),
            materials: Some(b(s.materials)),
            vertices: Some(b(s.vertices)),
            atlas: Some(s.atlas),
            srgb: Some(b(s.srgb)),
            seeds: f.seeds.map(|seeds| b(seeds.now)),
            sampler_table: f.seeds.map(|seeds| b(seeds.table)),
            traversals: f.traversals.map(b),
            previous_corners: f.previous_corners.map(b),
        };
        let shader = bounce::modelling(self.kit.model());
        let push = bounce::Push { step: self.step };
        self.kit.dispatch(self.round.label, shader, &bindings.of(shader), bytemuck::bytes_of(&push), self.threads())
    }

    fn shadow(&self) -> Result<Pass> {
        let Self { f, s, paths, .. } = self;
        let Some(seeds) = f.seeds else { return Err(super::missing("the seeds of samples")) };
        let bindings = shadow_diffuse::Bindings {
            frame: b(f.frame),
            instances: b(f.instances),
            counters: b(f.counters),
            nodes: b(s.nodes),
            corners: b(s.corners),
            rest: b(s.rest),
            lights: b(f.lights),
            found: b(paths.found),
            lit: b(paths.lit),
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
            path_directions: b(paths.directions),
            traversals: f.traversals.map(b),
            previous_corners: f.previous_corners.map(b),
        };
        let model = self.kit.model();
        let shader =
            if self.round.diffuse { shadow_diffuse::modelling(model) } else { shadow_bounce::modelling(model) };
        let push = shadow_diffuse::Push { step: self.step };
        self.kit.dispatch(self.round.label, shader, &bindings.of(shader), bytemuck::bytes_of(&push), self.threads())
    }

    fn scatter(&self) -> Result<Pass> {
        let Self { f, s, paths, .. } = self;
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
            found: b(paths.found),
            lit: b(paths.lit),
            shaded: b(self.round.sum),
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
        let model = self.kit.model();
        let shader = if self.round.diffuse { scatter_diffuse::modelling(model) } else { scatter::modelling(model) };
        let push = scatter::Push { step: self.step };
        self.kit.dispatch(self.round.label, shader, &bindings.of(shader), bytemuck::bytes_of(&push), self.threads())
    }
}
