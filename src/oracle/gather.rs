//! The dense ray list: what each pixel keeps and adds, in pixel order. Twin of `glsl/gather.comp`, exact.
//! Paper 1 leaves the load balance of verification to future work (section 8); this list is the answer to it.

use super::analyze::new_position;
use super::camera::{self, M};
use super::random::pixel_hash;
use super::reproject::Reprojected;
use super::scan::thinned;
use crate::shaders::{Frame, INSTANCE_MASK, NEW_INSTANCE, Sample};

pub use crate::shaders::NO_SOURCE;

/// A cache: samples in pixel order, with the frames that each has lived.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Gathered {
    /// Kept samples as they were, new ones with their position in pixels.
    pub samples: Vec<Sample>,
    /// First sample of each pixel in list order, and the length of the list.
    pub offsets: Vec<u32>,
    /// Frames since each was added, 0 for a new one. Empty if no ages were given.
    pub ages: Vec<u32>,
    /// Which of the last frame's samples each is, [`NO_SOURCE`] for a new one.
    pub sources: Vec<u32>,
}

/// Builds the list for `plan`, of which each pixel gives up its part if `thin` is not 0 (see [`super::scan`]).
/// `ages` belong to the `previous` samples and may be empty.
pub fn gather(
    frame: &Frame,
    thin: u32,
    reprojected: &Reprojected,
    plan: &[u32],
    previous: &[Sample],
    ages: &[u32],
) -> Gathered {
    let mut out = Gathered { offsets: vec![0], ..Gathered::default() };
    let mut wanted = 0;
    for (index, pixel) in camera::pixels_in_order(frame.size).enumerate() {
        wanted += plan[index].count_ones();
        let room = (thinned(wanted, thin) as usize) - out.samples.len();
        for entry in in_order(plan[index], reprojected.masks[index], thin).into_iter().take(room) {
            match entry {
                Entry::New(subpixel) => {
                    let [x, y] =
                        new_position(pixel, subpixel, pixel_hash(pixel, frame.frame, !frame.seed), frame.flags);
                    out.samples.push(Sample { position: [x, y, 0.0], instance: NEW_INSTANCE });
                    out.ages.extend(ages.first().map(|_| 0));
                    out.sources.push(NO_SOURCE);
                }
                Entry::Kept(subpixel) => {
                    let claim = reprojected.claims[camera::claim_slot(index, subpixel, frame.flags)];
                    let source = (claim & INSTANCE_MASK) as usize;
                    out.samples.push(previous[source]);
                    out.ages.extend(ages.get(source).map(|age| age.saturating_add(1)));
                    out.sources.push(source as u32);
                }
            }
        }
        out.offsets.push(out.samples.len() as u32);
    }
    out
}

enum Entry {
    Kept(u32),
    New(u32),
}

/// A pixel's samples: by subpixel and then the new ones if all fit; else what matters most first, which are unoccluded, then
/// new, then occluded ones.
fn in_order(plan: u32, mask: u32, thin: u32) -> Vec<Entry> {
    let set = |bits: u32| (0..M * M).filter(move |bit| bits >> bit & 1 != 0);
    let (kept, visible) = (plan & 0xffff, if thin == 0 { 0xffff } else { mask >> 16 });
    let mut all: Vec<Entry> = set(kept & visible).map(Entry::Kept).collect();
    all.extend(set(plan >> 16).map(Entry::New));
    all.extend(set(kept & !visible).map(Entry::Kept));
    all
}
