//! Reprojection (paper 1, section 4.1): which cached sample takes which subpixel. Twin of `glsl/reproject.comp`.

use super::bounded::Bounded;
use super::camera::{self, M, Projection};
use super::lens::{lens_shift, lens_shift_bounded};
use super::motion::{frame_at, relative_rows};
use crate::shaders::{FRAME_RESET, Frame, INSTANCE_MASK, Instance, OCCLUDED_BIT, SKY_INSTANCE, Sample};

/// A subpixel that nothing has claimed.
pub const UNCLAIMED: u32 = u32::MAX;

/// Outcome of the phase.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reprojected {
    /// A word a subpixel ([`camera::claim_slot`]): index of the winning sample, bit 31 if it is occluded, or [`UNCLAIMED`].
    pub claims: Vec<u32>,
    /// A word a pixel: occupied subpixels in the low half, those with an unoccluded sample in the high half.
    pub masks: Vec<u32>,
}

/// How a sample is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// From this point of the lens: metres along the axes across and up.
    pub lens: [f32; 2],
    /// At this time: part of the way from the last frame to this one.
    pub time: f32,
}

/// Through a lens, at the end of the frame.
impl From<[f32; 2]> for Seen {
    fn from(lens: [f32; 2]) -> Self {
        Self { lens, time: 1.0 }
    }
}

/// The samples of the last frame, the older first, with the point of the lens that each is seen from in this one, and when.
#[derive(Debug, Clone, Copy)]
pub struct Cache<'a> {
    /// The samples.
    pub samples: &'a [Sample],
    /// Metres along the axes across and up, one a sample; empty for a pinhole.
    pub lens: &'a [[f32; 2]],
    /// Part of the way from the last frame to this one, one a sample; empty if all are seen at its end.
    pub times: &'a [f32],
}

impl Cache<'_> {
    /// How a sample is seen.
    pub fn seen(&self, i: usize) -> Seen {
        Seen { lens: self.lens.get(i).copied().unwrap_or_default(), time: self.time(i) }
    }

    fn time(&self, i: usize) -> f32 {
        self.times.get(i).copied().unwrap_or(1.0)
    }
}

impl<'a> From<&'a [Sample]> for Cache<'a> {
    fn from(samples: &'a [Sample]) -> Self {
        Self { samples, lens: &[], times: &[] }
    }
}

impl<'a> From<&'a Vec<Sample>> for Cache<'a> {
    fn from(samples: &'a Vec<Sample>) -> Self {
        samples.as_slice().into()
    }
}

/// A subpixel of the frame: index of the pixel in list order, and bit index in the pixel.
pub type Subpixel = (usize, u32);

/// Where a sample may land on a device that keeps Vulkan's precision.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Landing {
    /// Nowhere: behind the camera, beside the frame, or of an instance that is gone.
    Nowhere,
    /// On this subpixel.
    On(Subpixel),
    /// On any of these, or nowhere if it is within the error of the frame's border.
    Among(Vec<Subpixel>),
    /// On any subpixel at all, or nowhere: so near the camera that its direction is noise, or at no number.
    Anywhere,
}

/// Reprojects all samples, the older first. Of those that meet on a subpixel an unoccluded one wins over occluded ones,
/// then the older one.
pub fn reproject<'a>(frame: &Frame, instances: &[Instance], cache: impl Into<Cache<'a>>) -> Reprojected {
    let cache = cache.into();
    let samples = cache.samples;
    let mut out = unclaimed(frame);
    for i in listed(frame, samples) {
        let Some(place) = landing(frame, instances, &samples[i], cache.seen(i)) else { continue };
        let occluded = |i: usize| samples[i].instance & OCCLUDED_BIT != 0;
        out.claim(frame.flags, Claim { place, i, occluded: occluded(i) }, |i, holder| {
            (occluded(i), i) < (occluded(holder), holder)
        });
    }
    out
}

/// As [`reproject`], but of equally occluded ones the nearer wins; of equally near ones it goes by the bits of their
/// positions, then by age.
pub fn reproject_nearest<'a>(frame: &Frame, instances: &[Instance], cache: impl Into<Cache<'a>>) -> Reprojected {
    let cache = cache.into();
    let samples = cache.samples;
    let mut out = unclaimed(frame);
    for i in listed(frame, samples) {
        let Some(place) = landing(frame, instances, &samples[i], cache.seen(i)) else { continue };
        let occluded = samples[i].instance & OCCLUDED_BIT != 0;
        out.claim(frame.flags, Claim { place, i, occluded }, |i, holder| {
            precedes(frame, instances, cache, [i, holder])
        });
    }
    out
}

/// After [`reproject_nearest`], whose outcome is `first`: samples without a claim try for the next free subpixel of their
/// pixel, going round, in the same order.
pub fn reproject_displaced<'a>(
    frame: &Frame,
    instances: &[Instance],
    cache: impl Into<Cache<'a>>,
    first: &Reprojected,
) -> Reprojected {
    let cache = cache.into();
    let samples = cache.samples;
    let mut out = first.clone();
    for i in listed(frame, samples) {
        let Some((pixel, subpixel)) = landing(frame, instances, &samples[i], cache.seen(i)) else { continue };
        let holds = first.claims[camera::claim_slot(pixel, subpixel, frame.flags)] & INSTANCE_MASK == i as u32;
        let free = camera::subpixel_bits(frame.flags) & !first.masks[pixel];
        let mut round = (1..M * M).map(|step| (subpixel + step) % (M * M));
        let free = round.find(|bit| free >> bit & 1 != 0);
        let Some(free) = free.filter(|_| !holds) else { continue };
        let occluded = samples[i].instance & OCCLUDED_BIT != 0;
        out.claim(frame.flags, Claim { place: (pixel, free), i, occluded }, |i, holder| {
            precedes(frame, instances, cache, [i, holder])
        });
    }
    out
}

fn unclaimed(frame: &Frame) -> Reprojected {
    let pixels = (frame.size[0] * frame.size[1]) as usize;
    Reprojected { claims: vec![UNCLAIMED; pixels * camera::subpixels(frame.flags)], masks: vec![0; pixels] }
}

/// What there is to reproject.
fn listed(frame: &Frame, samples: &[Sample]) -> std::ops::Range<usize> {
    if frame.flags & FRAME_RESET != 0 { 0..0 } else { 0..samples.len() }
}

/// Whether the first of two samples has the better claim.
fn precedes(frame: &Frame, instances: &[Instance], cache: Cache<'_>, two: [usize; 2]) -> bool {
    let [a, b] = two.map(|i| {
        let sample = &cache.samples[i];
        let depth = match space(frame, sample) {
            Some(Some(instance)) => {
                let rows = relative_rows(&instances[instance], cache.time(i));
                let [x, y, z] = camera::transform_point(&rows, sample.position);
                x * x + y * y + z * z
            }
            _ => f32::INFINITY,
        };
        (sample.instance & OCCLUDED_BIT, depth, sample.position.map(f32::to_bits), i)
    });
    a < b
}

/// A claim of sample `i`.
struct Claim {
    place: Subpixel,
    i: usize,
    occluded: bool,
}

impl Reprojected {
    /// Gives a subpixel to a sample, unless another holds it and ours does not come before that one.
    fn claim(&mut self, flags: u32, claim: Claim, before: impl Fn(usize, usize) -> bool) {
        let Claim { place: (pixel, subpixel), i, occluded } = claim;
        let claim = &mut self.claims[camera::claim_slot(pixel, subpixel, flags)];
        if *claim == UNCLAIMED || before(i, (*claim & INSTANCE_MASK) as usize) {
            *claim = if occluded { OCCLUDED_BIT | i as u32 } else { i as u32 };
        }
        self.masks[pixel] |= 1 << subpixel;
        if !occluded {
            self.masks[pixel] |= 1 << (subpixel + M * M);
        }
    }
}

/// The subpixel that a sample projects to, in f32 and in the shader's order.
pub fn landing(frame: &Frame, instances: &[Instance], sample: &Sample, seen: impl Into<Seen>) -> Option<Subpixel> {
    let position = landing_position(frame, instances, sample, seen)?;
    let pixel = camera::pixel_of(position, frame.size);
    let bit = camera::subpixel_bit(camera::subpixel_of(position, pixel), frame.flags);
    Some((camera::pixel_index(pixel, frame.size), bit))
}

/// Where in the frame a sample projects to from a point of the lens, in pixels, in f32 and in the shader's order.
pub fn landing_position(
    frame: &Frame,
    instances: &[Instance],
    sample: &Sample,
    seen: impl Into<Seen>,
) -> Option<[f32; 2]> {
    let Seen { lens, time } = seen.into();
    let frame = &frame_at(frame, time);
    let space = space(frame, sample)?;
    let relative = match space {
        Some(instance) => camera::transform_point(&relative_rows(&instances[instance], time), sample.position),
        None => sample.position,
    };
    camera::project_through(frame, relative, lens_shift(frame, lens, relative, space.is_some()))
}

/// The same with every rounding error accounted for.
pub fn landing_bounded(frame: &Frame, instances: &[Instance], sample: &Sample, seen: impl Into<Seen>) -> Landing {
    let Seen { lens, time } = seen.into();
    let frame = &frame_at(frame, time);
    let space = space(frame, sample);
    let relative = match space {
        None => return Landing::Nowhere,
        Some(Some(instance)) => camera::transform_bounded(&relative_rows(&instances[instance], time), sample.position),
        Some(None) => sample.position.map(Bounded::exact),
    };
    let shift = lens_shift_bounded(frame, lens, relative, space.flatten().is_some());
    let (position, inside) = match camera::project_within(frame, relative, shift, 1.0) {
        Projection::Outside => return Landing::Nowhere,
        Projection::Inside(position) => (position, true),
        Projection::Border(position) => (position, false),
    };
    if position.iter().any(|p| !p.error.is_finite()) {
        return Landing::Anywhere;
    }
    let [columns, rows] = [0, 1].map(|axis| reached(position[axis], frame.size[axis]));
    let places = rows.flat_map(|y| columns.clone().map(move |x| [x, y])).map(|at| subpixel_at(at, frame.size));
    let mut all: Vec<Subpixel> =
        places.map(|(pixel, place)| (pixel, camera::subpixel_bit(place, frame.flags))).collect();
    all.sort_unstable();
    all.dedup();
    match all.as_slice() {
        [one] if inside => Landing::On(*one),
        _ => Landing::Among(all),
    }
}

/// The space a sample's position is in: `None` if it is lost, `Some(None)` for a direction of the sky.
pub(super) fn space(frame: &Frame, sample: &Sample) -> Option<Option<usize>> {
    match sample.instance & INSTANCE_MASK {
        instance if instance < frame.instance_count => Some(Some(instance as usize)),
        SKY_INSTANCE => Some(None),
        _ => None,
    }
}

/// Subpixels of the whole frame, along one axis, that a coordinate in pixels may lie in.
fn reached(position: Bounded, size: u32) -> std::ops::RangeInclusive<u32> {
    let last = f64::from(size * M - 1);
    let at = |p: f64| (p * f64::from(M)).floor().clamp(0.0, last) as u32;
    at(position.value - position.error)..=at(position.value + position.error)
}

fn subpixel_at(at: [u32; 2], size: [u32; 2]) -> Subpixel {
    (camera::pixel_index(at.map(|v| v / M), size), at[1] % M * M + at[0] % M)
}
