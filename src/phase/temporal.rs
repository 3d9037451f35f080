//! What is made of the frames before: temporal integration (paper 1, section 6), or the box filter of paper 3. Both write the
//! frame, in place of [`super::resolve`].

use super::{FrameResources, HistoryResources, Kit, b};
use crate::Result;
use crate::gpu::{Pass, Range};
use crate::settings::{HistoryFilter, Precision, Settings};
use crate::shaders::{
    average, average_float, temporal as shader, temporal_float, temporal_precise, temporal_precise_float,
};

const LABEL: &str = "temporal";

/// One thread a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if the pipeline cannot be made.
pub fn pass(kit: &Kit, f: &FrameResources, history: &HistoryResources, settings: &Settings) -> Result<Pass> {
    match *history {
        HistoryResources::Integrated { motion, previous, current } => {
            integrate(kit, f, [motion, previous, current], settings)
        }
        HistoryResources::Frames(history) => mean(kit, f, history, settings),
    }
}

fn integrate(
    kit: &Kit,
    f: &FrameResources,
    [motion, previous, history]: [Range; 3],
    settings: &Settings,
) -> Result<Pass> {
    let bindings = shader::Bindings {
        frame: b(f.frame),
        film: b(f.film),
        motion: b(motion),
        previous: b(previous),
        history: b(history),
        color: f.color,
    };
    let shader = match (settings.history.precision, settings.float_output) {
        (Precision::Half, false) => shader::SHADER,
        (Precision::Half, true) => temporal_float::SHADER,
        (Precision::Float, false) => temporal_precise::SHADER,
        (Precision::Float, true) => temporal_precise_float::SHADER,
    };
    let push = shader::Push {
        alpha: settings.history.alpha,
        clamp_width: settings.history.clamp,
        cubic: u32::from(settings.history.filter == HistoryFilter::CatmullRom),
    };
    kit.dispatch(LABEL, shader, &bindings.list(), bytemuck::bytes_of(&push), f.pixels())
}

fn mean(kit: &Kit, f: &FrameResources, history: Range, settings: &Settings) -> Result<Pass> {
    let bindings = average::Bindings { frame: b(f.frame), film: b(f.film), history: b(history), color: f.color };
    let shader = if settings.float_output { average_float::SHADER } else { average::SHADER };
    let push = average::Push { frames: settings.box_frames };
    kit.dispatch(LABEL, shader, &bindings.list(), bytemuck::bytes_of(&push), f.pixels())
}
