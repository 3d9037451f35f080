//! The fill's additions to the dense list, and what it forgets. Twin of `glsl/append.comp`, exact.

use super::analyze::new_position;
use super::camera;
use super::random::pixel_hash;
use super::scan::thinned;
use crate::shaders::{Counters, FOUND_LOST, Found, Frame, NEW_INSTANCE, Sample};

/// A dense list that grows: entries behind the old ones are added in pixel order.
#[derive(Debug, Clone, PartialEq)]
pub struct Appended {
    /// As many as there is room for.
    pub samples: Vec<Sample>,
    /// As long as `samples`.
    pub found: Vec<Found>,
    /// First added sample of each pixel in list order, and the end of the list.
    pub extras: Vec<u32>,
}

/// Adds to `samples` what `plan` asks for, where `counters.first` says that they end, each pixel giving up its part if
/// `counters.thin` is not 0. What `masks` say is occupied and the plan does not keep is lost from now on.
pub fn append(
    frame: &Frame,
    counters: &Counters,
    masks: &[u32],
    plan: &[u32],
    offsets: &[u32],
    samples: &[Sample],
    found: &[Found],
) -> Appended {
    let mut out = Appended { samples: samples.to_vec(), found: found.to_vec(), extras: vec![counters.first] };
    let mut wanted = 0;
    for (index, pixel) in camera::pixels_in_order(frame.size).enumerate() {
        let occupied = (0..16).filter(|bit| masks[index] >> bit & 1 != 0);
        for (slot, bit) in (offsets[index] as usize..).zip(occupied) {
            if plan[index] >> bit & 1 == 0 {
                out.found[slot].primitive = FOUND_LOST;
                out.samples[slot].instance = NEW_INSTANCE;
            }
        }
        let h = pixel_hash(pixel, frame.frame, !frame.seed);
        let added = (0..16).filter(|bit| plan[index] >> (16 + bit) & 1 != 0);
        let start = counters.first + thinned(wanted, counters.thin);
        wanted += (plan[index] >> 16).count_ones();
        let end = counters.first + thinned(wanted, counters.thin);
        for (slot, subpixel) in (start..end).zip(added) {
            let [x, y] = new_position(pixel, subpixel, h, frame.flags);
            out.samples[slot as usize] = Sample { position: [x, y, 0.0], instance: NEW_INSTANCE };
        }
        out.extras.push(end);
    }
    out
}
