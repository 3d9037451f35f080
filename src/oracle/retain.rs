//! The last-sample rule (paper 1, section 4.3): a pixel of which all samples are occluded takes an occluder's hit. Twin
//! of `glsl/retain.comp`, exact.

use super::triangle::{corners_of, triangle_point};
use crate::shaders::{Counters, FOUND_LOST, FRAME_SETTLED, Found, Frame, INSTANCE_MASK, OCCLUDED_BIT, Sample};

/// Corners of the scene's triangle slots, as the shader stores them.
#[derive(Debug, Clone, Copy)]
pub struct Corners<'a> {
    /// Two entries a slot.
    pub corners: &'a [[f32; 4]],
    /// One entry a slot.
    pub rest: &'a [f32],
}

#[derive(PartialEq)]
enum Outcome {
    Visible,
    Occluded,
    Lost,
}

/// Applies the rule to every pixel, in place, and counts `occluded`, `lost` and `replaced` (the rest is 0).
pub fn retain(
    frame: &Frame,
    offsets: &[u32],
    triangles: Corners<'_>,
    found: &mut [Found],
    samples: &mut [Sample],
) -> Counters {
    let mut counters = Counters::default();
    for range in offsets.windows(2).map(|o| o[0] as usize..o[1] as usize) {
        let outcomes: Vec<Outcome> = found[range.clone()].iter().map(outcome).collect();
        let count = |kind: Outcome| outcomes.iter().filter(|&o| *o == kind).count() as u32;
        counters.lost += count(Outcome::Lost);
        counters.occluded += count(Outcome::Occluded);
        let first_occluded = outcomes.iter().position(|o| *o == Outcome::Occluded);
        let settled = frame.flags & FRAME_SETTLED != 0;
        let Some(first) = first_occluded.filter(|_| count(Outcome::Visible) == 0 && !settled) else { continue };
        let slot = range.start + first;
        let hit = &mut found[slot];
        hit.instance &= INSTANCE_MASK;
        let triangle = corners_of(triangles.corners, triangles.rest, hit.primitive as usize);
        samples[slot] = Sample { position: triangle_point(triangle, hit.u, hit.v), instance: hit.instance };
        counters.replaced += 1;
    }
    counters
}

fn outcome(found: &Found) -> Outcome {
    if found.primitive == FOUND_LOST {
        Outcome::Lost
    } else if found.instance & OCCLUDED_BIT != 0 {
        Outcome::Occluded
    } else {
        Outcome::Visible
    }
}
