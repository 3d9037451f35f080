//! The dense ray list, which paper 1 (section 7) leaves to future work: a prefix sum over what the tiles keep, then
//! every pixel writes its samples where the list has room for them. No lane of the traces that follow is idle.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::{Pass, Threads};
use crate::shaders::{Shader, gather, scan};

/// Prefix sum, then gathering.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources) -> Result<Vec<Pass>> {
    Ok(vec![scan_pass("list", scan::SHADER, kit, f)?, gather_pass(kit, f)?])
}

/// The prefix sum, by one of its variants.
pub(super) fn scan_pass(label: &'static str, shader: &'static Shader, kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let [width, height] = f.size;
    let push = scan::Push { tile_count: width.div_ceil(8) * height.div_ceil(8) };
    let bindings = scan::Bindings { frame: b(f.frame), tiles: b(f.tiles), counters: b(f.counters) };
    let one_group = Threads::Exactly(shader.local_size);
    kit.dispatch(label, shader, &bindings.list(), bytemuck::bytes_of(&push), one_group)
}

fn gather_pass(kit: &Kit, f: &FrameResources) -> Result<Pass> {
    let bindings = gather::Bindings {
        frame: b(f.frame),
        claims: b(f.claims),
        masks: b(f.masks),
        plan: b(f.plan),
        tiles: b(f.tiles),
        counters: b(f.counters),
        previous: b(f.previous),
        samples: b(f.samples),
        offsets: b(f.offsets),
        previous_ages: f.previous_ages.map(b),
        ages: f.ages.map(b),
        sources: f.sources.map(b),
        previous_seeds: f.seeds.map(|seeds| b(seeds.previous)),
        seeds: f.seeds.map(|seeds| b(seeds.now)),
    };
    let shader = gather::modelling(kit.model());
    kit.dispatch("list", shader, &bindings.of(shader), &[], f.pixels())
}
