//! Where a frame's samples lie, to be looked at or drawn.

use crate::accel::Geometry;
use crate::oracle::camera::{project, transform_point};
use crate::oracle::triangle::triangle_point;
use crate::shaders::{
    Frame, INSTANCE_DEFORMS, INSTANCE_MASK, Instance, NEW_INSTANCE, OCCLUDED_BIT, SKY_INSTANCE, Sample,
};

/// A sample of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamplePoint {
    /// Pixels to the right of and below the frame's upper left corner.
    pub at: [f32; 2],
    /// What is there.
    pub kind: SampleKind,
}

/// What a sample is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleKind {
    /// A visible surface.
    Surface,
    /// The environment, behind all surfaces.
    Environment,
    /// A surface of earlier frames that is hidden in this one, and kept (paper 1, section 4.1).
    Occluded,
}

/// Projects a frame's list of samples, in its order, seen through the middle of the lens, as the reprojection of the next frame would if nothing moved. Samples
/// that were given up, and those that lie outside the frame by rounding, are left out.
pub fn points(frame: &Frame, instances: &[Instance], samples: &[Sample]) -> Vec<SamplePoint> {
    samples.iter().filter_map(|sample| point(frame, instances, sample)).collect()
}

/// Puts samples that are told by their triangle, on instances that deform, to where that is in a geometry.
pub fn place(geometry: &Geometry, instances: &[Instance], samples: &mut [Sample]) {
    for sample in samples {
        let Some(instance) = instances.get((sample.instance & INSTANCE_MASK) as usize) else { continue };
        if instance.flags & INSTANCE_DEFORMS != 0 {
            let [slot, u, v] = sample.position;
            let corners = geometry.corners(instance.triangle_base + slot as u32).map(|p| p.to_array());
            sample.position = triangle_point(corners, u, v);
        }
    }
}

fn point(frame: &Frame, instances: &[Instance], sample: &Sample) -> Option<SamplePoint> {
    let place = |id: u32| Some(transform_point(&instances.get(id as usize)?.to_relative, sample.position));
    let (relative, visible) = match sample.instance & INSTANCE_MASK {
        NEW_INSTANCE => return None,
        SKY_INSTANCE => (sample.position, SampleKind::Environment),
        id => (place(id)?, SampleKind::Surface),
    };
    let kind = if sample.instance & OCCLUDED_BIT == 0 { visible } else { SampleKind::Occluded };
    project(frame, relative).map(|at| SamplePoint { at, kind })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_where_they_are_projected() {
        // 90 degrees, 8 x 8 pixels, looking along -z.
        let frame = Frame {
            right: [1.0, 0.0, 0.0, 1.0],
            up: [0.0, 1.0, 0.0, 1.0],
            forward: [0.0, 0.0, -1.0, 0.0],
            size: [8, 8],
            ..Frame::default()
        };
        let two_to_the_right = Instance {
            to_relative: [[1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            ..Instance::default()
        };
        let sample = |position, instance| Sample { position, instance };
        let samples = [
            sample([0.0, 0.0, -4.0], 0),
            sample([0.0, 2.0, -4.0], OCCLUDED_BIT),
            sample([0.0, 0.0, -1.0], SKY_INSTANCE),
            sample([0.0, 0.0, -4.0], NEW_INSTANCE),
            sample([9.0, 0.0, -4.0], 0),
            sample([0.0, 0.0, -4.0], 1),
        ];
        let found = points(&frame, &[two_to_the_right], &samples);
        let point = |at, kind| SamplePoint { at, kind };
        let expected = [
            point([6.0, 4.0], SampleKind::Surface),
            point([6.0, 2.0], SampleKind::Occluded),
            point([4.0, 4.0], SampleKind::Environment),
        ];
        assert_eq!(found, expected);
    }
}
