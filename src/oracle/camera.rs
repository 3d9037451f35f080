//! Pixels, subpixels and the pinhole camera. Twin of `glsl/include/camera.glsl`.
//!
//! Positions are camera-relative in world axes; pixel coordinates have x to the right and y down, (0, 0) at the corner
//! of the frame. Paper 1, section 4.1: a sample is brought to world space and then projected.

use super::bounded::Bounded;
use crate::shaders::{FRAME_QUARTERS, Frame};

/// Subpixels of a pixel across and down (M in paper 1). Bit i of a mask is subpixel (i % 4, i / 4).
pub const M: u32 = 4;

/// The bits of a mask that stand for subpixels: all, or with [`FRAME_QUARTERS`] (M = 2) the first of each stratum.
pub fn subpixel_bits(flags: u32) -> u32 {
    (0..M * M).filter(|place| subpixel_bit(*place, flags) == *place).map(|bit| 1 << bit).sum()
}

/// The bit that stands for a place of the 4 x 4.
pub fn subpixel_bit(place: u32, flags: u32) -> u32 {
    let across = if flags & FRAME_QUARTERS != 0 { 2 } else { 1 };
    let [x, y] = [place % M, place / M].map(|at| at / across * across);
    y * M + x
}

/// Subpixels of a pixel.
pub fn subpixels(flags: u32) -> usize {
    subpixel_bits(flags).count_ones() as usize
}

/// Where the claim on a subpixel is among those of all pixels.
pub fn claim_slot(pixel: usize, bit: u32, flags: u32) -> usize {
    let before = subpixel_bits(flags) & ((1 << bit) - 1);
    pixel * subpixels(flags) + before.count_ones() as usize
}

/// Pixels of a tile across and down.
pub const TILE: u32 = 8;

/// All pixels of a frame in the order of the dense lists: tile by tile, row by row in a tile.
pub fn pixels_in_order(size: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let starts = move |axis: usize| (0..size[axis]).step_by(TILE as usize);
    let along = move |axis: usize, start: u32| start..(start + TILE).min(size[axis]);
    starts(1).flat_map(move |ty| {
        starts(0).flat_map(move |tx| along(1, ty).flat_map(move |y| along(0, tx).map(move |x| [x, y])))
    })
}

/// Place of a pixel of the frame in that order.
pub fn pixel_index(pixel: [u32; 2], size: [u32; 2]) -> usize {
    let origin = pixel.map(|p| p / TILE * TILE);
    let tile_width = TILE.min(size[0] - origin[0]);
    let tile_height = TILE.min(size[1] - origin[1]);
    let rows_above = origin[1] * size[0];
    let tiles_left = origin[0] * tile_height;
    let in_tile = (pixel[1] - origin[1]) * tile_width + pixel[0] - origin[0];
    (rows_above + tiles_left + in_tile) as usize
}

/// Tiles across and down.
pub fn tiles(size: [u32; 2]) -> [u32; 2] {
    size.map(|n| n.div_ceil(TILE))
}

/// A point through the rows of a 3 x 4 matrix, in f32 and in the shader's order: agrees to the bit.
pub fn transform_point(rows: &[[f32; 4]; 3], p: [f32; 3]) -> [f32; 3] {
    rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
}

fn dot(axis: [f32; 4], p: [f32; 3]) -> f32 {
    axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2]
}

/// As [`project_through`], for a pinhole.
pub fn project(frame: &Frame, relative: [f32; 3]) -> Option<[f32; 2]> {
    project_through(frame, relative, [0.0; 2])
}

/// Projects a camera-relative point (or a direction, for the sky) to pixel coordinates; `None` outside the frustum. `shift` is
/// [`super::lens::lens_shift`]. In f32 and in the shader's order: agrees to the bit where the device divides correctly.
pub fn project_through(frame: &Frame, relative: [f32; 3], shift: [f32; 2]) -> Option<[f32; 2]> {
    let z = dot(frame.forward, relative);
    let x = dot(frame.right, relative) + shift[0];
    let y = dot(frame.up, relative) + shift[1];
    let half_width = z * frame.right[3];
    let half_height = z * frame.up[3];
    if !(x.abs() < half_width && y.abs() < half_height) {
        return None;
    }
    let px = (x / half_width * 0.5 + 0.5) * frame.size[0] as f32;
    let py = (0.5 - y / half_height * 0.5) * frame.size[1] as f32;
    Some([px, py])
}

/// Where a point projects to on any device that keeps Vulkan's precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Outside the frustum.
    Outside,
    /// Inside, at these pixel coordinates.
    Inside([Bounded; 2]),
    /// So near the frustum's border that a device may decide either way. The coordinates are those if it is inside.
    Border([Bounded; 2]),
}

/// [`transform_point`] with its error bound.
pub fn transform_bounded(rows: &[[f32; 4]; 3], p: [f32; 3]) -> [Bounded; 3] {
    let p = p.map(Bounded::exact);
    rows.map(|r| {
        let r = r.map(Bounded::exact);
        r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]
    })
}

/// [`project`] with its error bound: the known answer.
pub fn project_bounded(frame: &Frame, p: [Bounded; 3]) -> Projection {
    project_within(frame, p, [Bounded::exact(0.0); 2], 1.0)
}

/// As [`project_bounded`], up to `reach` times as far from the middle of the frame as its border.
pub fn project_within(frame: &Frame, p: [Bounded; 3], shift: [Bounded; 2], reach: f32) -> Projection {
    let dot = |axis: [f32; 4]| {
        let a = axis.map(Bounded::exact);
        a[0] * p[0] + a[1] * p[1] + a[2] * p[2]
    };
    let (x, y, z) = (dot(frame.right) + shift[0], dot(frame.up) + shift[1], dot(frame.forward));
    let half_width = z * Bounded::exact(frame.right[3]);
    let half_height = z * Bounded::exact(frame.up[3]);
    let [across, down] = [half_width, half_height].map(|half| half * Bounded::exact(reach));
    let outside = |a: Bounded, most: Bounded| most.value + most.error <= a.abs().value - a.error;
    if outside(x, across) || outside(y, down) {
        return Projection::Outside;
    }
    let half = Bounded::exact(0.5);
    let px = (x / half_width * half + half) * Bounded::exact(frame.size[0] as f32);
    let py = (half - y / half_height * half) * Bounded::exact(frame.size[1] as f32);
    if x.abs().surely_below(&across) && y.abs().surely_below(&down) {
        Projection::Inside([px, py])
    } else {
        Projection::Border([px, py])
    }
}

/// Direction through a point of the frame, of length 1 along the viewing direction.
pub fn camera_direction(frame: &Frame, pixel: [f64; 2]) -> [f64; 3] {
    let ndc = [0, 1].map(|i| pixel[i] / f64::from(frame.size[i]) * 2.0 - 1.0);
    [0, 1, 2].map(|i| {
        let (right, up) = (f64::from(frame.right[i]), f64::from(frame.up[i]));
        let tangents = [f64::from(frame.right[3]), f64::from(frame.up[3])];
        f64::from(frame.forward[i]) + right * ndc[0] * tangents[0] - up * ndc[1] * tangents[1]
    })
}

/// The pixel that a projected point lies in. Rounding can put a point just inside the frustum on the frame's far edge.
pub fn pixel_of(position: [f32; 2], size: [u32; 2]) -> [u32; 2] {
    [0, 1].map(|i| (position[i] as u32).min(size[i] - 1))
}

/// The place in that pixel among 4 x 4, as a bit index in 0..16.
pub fn subpixel_of(position: [f32; 2], owner: [u32; 2]) -> u32 {
    let [x, y] = [0, 1].map(|i| (((position[i] - owner[i] as f32) * M as f32) as u32).min(M - 1));
    y * M + x
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn frame(size: [u32; 2]) -> Frame {
        let right = [1.0, 0.0, 0.0, 0.75];
        let up = [0.0, 1.0, 0.0, 0.5];
        Frame { right, up, forward: [0.0, 0.0, -1.0, 0.0], size, ..Frame::zeroed() }
    }

    #[test]
    fn every_pixel_has_one_index_and_no_index_is_left_out() {
        let sizes = [[1, 1], [7, 5], [8, 8], [9, 17], [64, 64], [1, 100], [100, 1], [97, 61], [131, 3], [15, 16]];
        for size in sizes {
            let listed: Vec<usize> = pixels_in_order(size).map(|p| pixel_index(p, size)).collect();
            let counted: Vec<usize> = (0..(size[0] * size[1]) as usize).collect();
            assert_eq!(listed, counted, "{size:?}");
        }
    }

    #[test]
    fn a_shifted_index_is_noticed() {
        // The order of tiles matters: row order is not it as soon as a frame is wider than a tile.
        assert_ne!(pixel_index([0, 1], [9, 9]), 9);
    }

    #[test]
    fn the_axis_meets_the_middle_and_what_lies_behind_meets_nothing() {
        let frame = frame([60, 40]);
        assert_eq!(project(&frame, [0.0, 0.0, -7.0]), Some([30.0, 20.0]));
        assert_eq!(project(&frame, [0.0, 0.0, 7.0]), None);
        assert_eq!(project(&frame, [0.0; 3]), None);
        assert_eq!(project(&frame, [f32::NAN, 0.0, -1.0]), None);
        assert_eq!(project_bounded(&frame, [0.0, 0.0, 7.0].map(Bounded::exact)), Projection::Outside);
    }

    #[test]
    fn up_is_up_and_right_is_right() {
        let [x, y] = project(&frame([60, 40]), [0.1, 0.1, -1.0]).unwrap();
        assert!(x > 30.0 && y < 20.0);
    }

    #[test]
    fn a_direction_projects_to_where_it_came_from() {
        let frame = frame([60, 40]);
        for pixel in [[0.5, 0.5], [12.25, 3.5], [59.75, 39.875]] {
            let direction = camera_direction(&frame, pixel).map(|v| Bounded::exact(v as f32));
            let Projection::Inside(found) = project_bounded(&frame, direction) else { panic!("{pixel:?} is inside") };
            // The direction is rounded to f32 first, which moves it by 2^-24 of its length of at most 1.4, and the
            // frame is 60 pixels wide for a tangent of 1.5.
            let rounding = 1.4 * 60.0 / 16_777_216.0;
            (0..2).for_each(|i| assert!((found[i].value - pixel[i]).abs() < rounding, "{pixel:?} {found:?}"));
        }
    }

    #[test]
    fn the_far_edge_belongs_to_the_last_pixel() {
        assert_eq!(pixel_of([8.0, 4.0], [8, 4]), [7, 3]);
        assert_eq!(subpixel_of([8.0, 4.0], [7, 3]), 15);
        assert_eq!(subpixel_of([7.25, 3.5], [7, 3]), 9);
    }
}
