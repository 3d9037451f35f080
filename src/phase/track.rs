//! Point tracking (paper 3, Algorithm 1): the hit points of the last frame direct the rays of this one.

use super::{FrameResources, Kit, b};
use crate::Result;
use crate::gpu::Pass;
use crate::shaders::{nearest, nearest_index, track as shader};

/// Clears what is known of the pixels, finds the nearest point of each in two steps, and lists a ray a pixel.
///
/// # Errors
/// [`crate::Error::Vulkan`] if a pipeline cannot be made.
pub fn passes(kit: &Kit, f: &FrameResources) -> Result<Vec<Pass>> {
    let points = nearest::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        counters: b(f.counters),
        samples: b(f.previous),
        tracked: b(f.claims),
    }
    .list();
    let bindings = shader::Bindings {
        frame: b(f.frame),
        instances: b(f.instances),
        previous: b(f.previous),
        tracked: b(f.claims),
        aims: b(f.aims),
        samples: b(f.samples),
        offsets: b(f.offsets),
        counters: b(f.counters),
    };
    Ok(vec![
        Pass::fill("track", f.claims, u32::MAX),
        kit.dispatch("track", &nearest::SHADER, &points, &[], f.dense())?,
        kit.dispatch("track", &nearest_index::SHADER, &points, &[], f.dense())?,
        kit.dispatch("track", &shader::SHADER, &bindings.list(), &[], f.pixels())?,
    ])
}
