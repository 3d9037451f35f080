//! Reconstruction (paper 1, section 4.4): a truncated Gaussian over the 3 × 3 pixels around, with a weight a sample or a
//! weight an area.

use super::{FrameResources, HistoryResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::settings::{Settings, Weights};
use crate::shaders::{
    Shader, reconstruct as shader, reconstruct_accumulate, reconstruct_motion, voronoi, voronoi_motion,
};

/// One thread a pixel. Where frames accumulate the film sums over them, from the last reset on; where they are integrated, the
/// longest motion is kept as well.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, settings: &Settings) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        offsets: b(f.offsets),
        shaded: b(f.shaded),
        film: b(f.film),
        extras: b(f.extras),
    };
    let mut list = bindings.list();
    let mut integrated = false;
    if let Some(HistoryResources::Integrated { motion, .. }) = f.history {
        list.push(b(motion));
        integrated = true;
    }
    kit.dispatch("reconstruct", shader_of(settings, integrated), &list, &[], f.pixels())
}

fn shader_of(settings: &Settings, integrated: bool) -> &'static Shader {
    match (settings.weights(), integrated) {
        _ if settings.method.accumulates() => reconstruct_accumulate::SHADER,
        (Weights::Equal, false) => shader::SHADER,
        (Weights::Equal, true) => reconstruct_motion::SHADER,
        (Weights::Voronoi, false) => voronoi::SHADER,
        (Weights::Voronoi, true) => voronoi_motion::SHADER,
    }
}
