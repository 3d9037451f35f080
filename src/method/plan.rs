//! The frame of each method, as data.

use crate::Result;
use crate::gpu::pass::{self, Barrier, Pass, Work};
use crate::gpu::{Range, Resource};
use crate::phase::{self, FrameResources, Kit, SceneResources};
use crate::settings::{Aov, Sampling, Settings};
use crate::shaders::Access;

/// A frame: passes in order, and the barrier before each.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What runs.
    pub passes: Vec<Pass>,
    /// What it waits for; as long as `passes`.
    pub barriers: Vec<Option<Barrier>>,
    /// What follows: the host may read what the frame reads back.
    pub end: Barrier,
}

/// What goes in before the first phase and comes out after the last.
#[derive(Debug, Clone)]
pub struct Transfers {
    /// From the host's ring to device buffers.
    pub uploads: Vec<(Range, Range)>,
    /// Counters to buffers that the host reads.
    pub readbacks: Vec<(Range, Range)>,
}

/// The part of the counters that starts at zero in every frame; what precedes it is carried from the last one.
fn tallies(counters: Range) -> Range {
    let offset = std::mem::offset_of!(crate::shaders::Counters, reused) as u64;
    Range { name: "tallies", offset: counters.offset + offset, size: counters.size - offset, ..counters }
}

/// The passes of a method's frame.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn plan(
    kit: &Kit,
    settings: &Settings,
    f: &FrameResources,
    s: &SceneResources,
    transfers: &Transfers,
) -> Result<Plan> {
    let stable = settings.method.keeps_samples();
    let uploads = transfers.uploads.iter();
    let mut passes: Vec<Pass> = uploads.map(|(from, to)| Pass::copy("upload", *from, *to)).collect();
    passes.push(Pass::fill("upload", tallies(f.counters), 0));
    passes.extend(f.paths.map(|paths| Pass::fill("upload", paths.counters, 0)));
    passes.extend(f.traversals.map(|traversals| Pass::fill("upload", traversals, 0)));
    passes.extend(match settings.method.sampling() {
        Sampling::Reprojected if settings.fills() => decided_after_verification(kit, f, s)?,
        Sampling::Reprojected => decided_before_verification(kit, f, s)?,
        Sampling::Tracked => traced(phase::track::passes(kit, f, s)?, kit, f, s)?,
        Sampling::Fresh => traced(vec![phase::generate::pass(kit, f)?], kit, f, s)?,
    });
    passes.push(phase::shadow::pass(kit, f, s)?);
    if let Some(images) = f.aovs.as_ref().filter(|_| settings.aovs.contains(&Aov::Changes)) {
        passes.push(phase::changes::pass(kit, f, images)?);
    }
    passes.push(phase::shade::pass(kit, f, s)?);
    passes.extend(phase::bounce::passes(kit, f, s, settings.path_depth)?);
    passes.extend(phase::indirect::passes(kit, f, s, settings.indirect.depth)?);
    passes.extend(phase::accumulate::pass(kit, f)?);
    passes.extend(phase::medium::pass(kit, f, s)?);
    passes.push(phase::reconstruct::pass(kit, f, settings)?);
    passes.push(match &f.history {
        Some(history) => phase::temporal::pass(kit, f, history, settings)?,
        None => phase::resolve::pass(kit, f, settings.float_output)?,
    });
    if let Some(images) = &f.aovs {
        passes.push(phase::aov::pass(kit, f, images, stable)?);
    }
    passes.extend(transfers.readbacks.iter().map(|(from, to)| Pass::copy("readback", *from, *to)));
    let barriers = pass::barriers(&passes);
    Ok(Plan { passes, barriers, end: pass::to_host() })
}

/// Samples with their verification.
fn traced(mut passes: Vec<Pass>, kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    passes.push(phase::verify::pass(kit, f, s)?);
    Ok(passes)
}

/// Samples as paper 1 has them (its figure 2).
fn decided_before_verification(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    let mut passes = phase::reproject::passes(kit, f, s)?;
    passes.push(phase::analyze::pass(kit, f)?);
    passes.extend(phase::list::passes(kit, f)?);
    passes.push(phase::verify::pass(kit, f, s)?);
    passes.push(phase::retain::pass(kit, f, s)?);
    Ok(passes)
}

/// Samples with a fill: nothing is added or evicted before it is known what is visible.
fn decided_after_verification(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    let mut passes = phase::reproject::nearest_passes(kit, f, s)?;
    passes.push(phase::analyze::keep_pass(kit, f)?);
    passes.extend(phase::list::passes(kit, f)?);
    passes.push(phase::verify::pass(kit, f, s)?);
    passes.push(phase::fill::survey_pass(kit, f)?);
    passes.push(phase::analyze::fill_pass(kit, f)?);
    passes.extend(phase::fill::passes(kit, f, s)?);
    Ok(passes)
}

/// The plan in words: a line a pass with what it reads and writes, and the barriers between.
pub fn describe(plan: &Plan) -> String {
    let mut text = String::new();
    for (pass, barrier) in plan.passes.iter().zip(&plan.barriers) {
        if barrier.is_some() {
            text.push_str("  -- barrier --\n");
        }
        let what = match &pass.work {
            Work::Dispatch { pipeline, .. } => pipeline.shader.name,
            Work::Fill(..) => "fill",
            Work::Copy(..) => "copy",
        };
        let (reads, writes) = (names(pass, Access::Write), names(pass, Access::Read));
        text.push_str(&format!("{:<12} {what:<24} reads {reads:<60} writes {writes}\n", pass.label));
    }
    text
}

/// Names of what a pass touches in another way than only by `not`.
fn names(pass: &Pass, not: Access) -> String {
    let used = pass.uses.iter().filter(|(_, access)| *access != not).map(|(r, _): &(Resource, Access)| r.name());
    used.collect::<Vec<_>>().join(", ")
}
