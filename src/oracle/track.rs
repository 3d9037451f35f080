//! Point tracking (paper 3, section 2): the one ray of each pixel. Twin of `glsl/nearest.comp`, `glsl/track.comp` and
//! `glsl/include/track.glsl`, exact where the device divides correctly.

use super::camera;
use super::random::{hash_uint, pixel_hash, unit_float};
use super::reproject::{landing_position, space};
use crate::shaders::{Counters, FRAME_RESET, FRAME_SETTLED, Frame, Instance, NEW_INSTANCE, Sample, Tracked};

/// Outcome of the phase.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracking {
    /// A new sample a pixel, in list order.
    pub samples: Vec<Sample>,
    /// Where each pixel's ray goes, in pixels: what the next frame is told as `aims`.
    pub aims: Vec<[f32; 2]>,
    /// The point that won each pixel.
    pub tracked: Vec<Tracked>,
    /// `reused`, `added` and `histogram`; the rest is 0.
    pub counters: Counters,
}

/// A pixel that no point is projected to.
pub const UNTRACKED: Tracked = Tracked { nearest: u32::MAX, point: u32::MAX, others: u32::MAX };

/// Directs the rays of a frame by the points of the last one. `aims` are those of the last frame.
pub fn track(frame: &Frame, instances: &[Instance], previous: &[Sample], aims: &[[f32; 2]]) -> Tracking {
    let tracked = nearest(frame, instances, previous);
    let mut counters = Counters::default();
    let mut out = Vec::new();
    for (index, (pixel, won)) in camera::pixels_in_order(frame.size).zip(&tracked).enumerate() {
        let point = (*won != UNTRACKED).then(|| &previous[won.point as usize]);
        let aim = if frame.flags & FRAME_SETTLED != 0 {
            aims[index]
        } else {
            let projected = point.and_then(|p| landing_position(frame, instances, p, [0.0; 2]));
            projected.unwrap_or_else(|| random_position(pixel, pixel_hash(pixel, frame.frame, frame.seed)))
        };
        out.push(aim);
        counters.reused += u32::from(point.is_some());
        counters.added += u32::from(point.is_none());
        counters.histogram[won.others.wrapping_add(1).min(16) as usize] += 1;
    }
    let new = |[x, y]: &[f32; 2]| Sample { position: [*x, *y, 0.0], instance: NEW_INSTANCE };
    Tracking { samples: out.iter().map(new).collect(), aims: out, tracked, counters }
}

/// The nearest point of each pixel, the first in the list among equals.
fn nearest(frame: &Frame, instances: &[Instance], previous: &[Sample]) -> Vec<Tracked> {
    let mut tracked = vec![UNTRACKED; (frame.size[0] * frame.size[1]) as usize];
    if frame.flags & FRAME_RESET != 0 {
        return tracked;
    }
    for (i, sample) in previous.iter().enumerate() {
        let Some(position) = landing_position(frame, instances, sample, [0.0; 2]) else { continue };
        let won = &mut tracked[camera::pixel_index(camera::pixel_of(position, frame.size), frame.size)];
        let key = distance_key(frame, instances, sample);
        if *won == UNTRACKED || key < won.nearest {
            *won = Tracked { nearest: key, point: i as u32, others: won.others };
        }
        won.others = won.others.wrapping_add(1);
    }
    tracked
}

/// Bits of the squared distance from the camera, square metres; infinity for the sky.
pub fn distance_key(frame: &Frame, instances: &[Instance], sample: &Sample) -> u32 {
    let Some(Some(instance)) = space(frame, sample) else { return f32::INFINITY.to_bits() };
    let [x, y, z] = camera::transform_point(&instances[instance].to_relative, sample.position);
    (x * x + y * y + z * z).to_bits()
}

/// Anywhere in the pixel, in pixels of the frame.
pub fn random_position(pixel: [u32; 2], h: u32) -> [f32; 2] {
    let random = [unit_float(h), unit_float(hash_uint(h))];
    [0, 1].map(|i| pixel[i] as f32 + random[i])
}
