//! The fill: after verification, what has been covered is replaced in the same frame.
//!
//! Paper 1 decides where samples are needed before it knows what the movement has covered, and mends it a frame later. In
//! motion, that frame is every frame: beside an edge that moves, samples are missing (section 7, figure 10). Here the
//! analysis runs once visibility is known, and the samples that it adds are listed and traced then.

use super::{FrameResources, Kit, SceneResources, b, list, verify};
use crate::Result;
use crate::gpu::{Pass, Range, Threads};
use crate::shaders::{append, scan_fill, survey};

/// Masks of what is visible now, for the analysis that follows. One thread a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn survey_pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let bindings = survey::Bindings {
        frame: b(f.frame),
        offsets: b(f.offsets),
        found: b(f.found),
        masks: b(f.masks),
        counters: b(f.counters),
    };
    kit.dispatch("analyze", survey::SHADER, &bindings.list(), &[], f.pixels())
}

/// Lists what the analysis adds behind what was verified, forgets what it evicts, and traces what is new.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources, s: &SceneResources) -> Result<Vec<Pass>> {
    let sum = list::scan_pass("fill", scan_fill::SHADER, kit, f)?;
    Ok(vec![sum, append_pass(kit, f)?, verify::traced("fill", kit, f, s, added(f))?])
}

fn append_pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let bindings = append::Bindings {
        frame: b(f.frame),
        masks: b(f.masks),
        plan: b(f.plan),
        tiles: b(f.tiles),
        counters: b(f.counters),
        offsets: b(f.offsets),
        extras: b(f.extras),
        samples: b(f.samples),
        found: b(f.found),
        ages: f.ages.map(b),
        sources: f.sources.map(b),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
    };
    let shader = append::modelling(kit.model());
    kit.dispatch("fill", shader, &bindings.of(shader), &[], f.pixels())
}

/// A thread a sample that was added.
fn added(f: &FrameResources) -> Threads {
    let offset = std::mem::offset_of!(crate::shaders::Counters, fill_x) as u64;
    Threads::Indirect(Range { name: "fill arguments", offset: f.counters.offset + offset, size: 12, ..f.counters })
}
