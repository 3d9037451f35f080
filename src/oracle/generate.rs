//! Stratified samples of supersampling. Twin of `glsl/generate.comp` and `glsl/include/stratify.glsl`, exact.

use super::camera;
use super::gather::Gathered;
use super::random::{hash_combine, hash_uint, unit_float};
use crate::shaders::{Frame, NEW_INSTANCE, Sample};

/// The same number of new samples in every pixel.
pub fn generate(frame: &Frame) -> Gathered {
    let mut out = Gathered { offsets: vec![0], ..Gathered::default() };
    for pixel in camera::pixels_in_order(frame.size) {
        let shift = pixel_shift(pixel, frame.seed, frame.jitter);
        for i in 0..frame.spp {
            let [x, y] = stratified_position(pixel, i, shift);
            out.samples.push(Sample { position: [x, y, 0.0], instance: NEW_INSTANCE });
        }
        out.offsets.push(out.samples.len() as u32);
    }
    out
}

/// The vector by which a pixel shifts the pattern on the torus (Cranley and Patterson 1976), in [0, 1)².
pub fn pixel_shift(pixel: [u32; 2], seed: u32, jitter: u32) -> [f32; 2] {
    let h = [jitter, pixel[0], pixel[1]].into_iter().fold(seed, hash_combine);
    [unit_float(hash_uint(h)), unit_float(hash_uint(h.wrapping_add(1)))]
}

/// Cell of the 4 x 4 grid of the i-th of 16 positions: four go to the four quarters, the next four to the four quarters
/// again, each time to another quarter of them.
pub fn cell(i: u32) -> [u32; 2] {
    const QUARTERS: [[u32; 2]; 4] = [[0, 0], [1, 1], [0, 1], [1, 0]];
    let (coarse, fine) = (QUARTERS[(i % 4) as usize], QUARTERS[(i / 4 % 4) as usize]);
    [0, 1].map(|axis| 2 * coarse[axis] + fine[axis])
}

/// The i-th position in a pixel, in pixels of the frame.
pub fn stratified_position(pixel: [u32; 2], i: u32, shift: [f32; 2]) -> [f32; 2] {
    let cell = cell(i);
    [0, 1].map(|axis| {
        let moved = cell[axis] as f32 * 0.25 + shift[axis];
        pixel[axis] as f32 + (moved - moved.floor())
    })
}
