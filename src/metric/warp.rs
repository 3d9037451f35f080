//! Where a pixel's surface was in the frames before, by exact motion vectors and depths.
//!
//! A motion vector m(p, t) is the pixels, right and down, by which the surface at pixel p has moved since frame t - 1: it was
//! at p - m. Longer lags are composed: the vector of the frame before is read at the pixel where the surface was found.
//!
//! A position counts only if the surface was really seen there:
//! - It lies inside the frame, with all pixels that bilinear reading needs.
//! - One of those pixels has the depth that the surface should have had. Of several the nearest in depth is taken.
//!
//! Depth is distance from the camera in metres, infinite for the sky. How far it should have been is known only as far as
//! the frame itself tells: `d + shift ± tolerance`, with
//! - `shift` the median over the picture by which distances changed along the motion, which is what the camera's own step
//!   makes of most of them;
//! - `tolerance = 1.5 (sx + sy) + 3 MAD + 4 ε d`. `sx` and `sy` are the slopes of depth in metres a pixel, of both one-sided
//!   differences the smaller one, lest a silhouette beside the pixel count as a slope. A depth belongs to some sample of its
//!   pixel, up to half a pixel from the centre, in both frames, and the position found is up to another half a pixel from
//!   a pixel's centre: 1.5 pixels on each axis. `MAD` is the median absolute deviation of the changes from `shift`: two cover a
//!   change that is even over some range (as of a camera that orbits), three cover 95 % of a normal one. The last term is
//!   rounding.
//!
//! A surface that approaches or recedes by more than that, unlike most of the picture, is left out; the share of valid
//! pixels says how many were.

use rayon::prelude::*;

use super::image::Plane;

/// How surfaces lie and move in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Pixels moved since the last frame, right and down; finite.
    pub motion: Vec<[f32; 2]>,
    /// Distance in metres; infinite for the sky.
    pub depth: Plane,
}

/// What a frame's distances have to do with those of the frame before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Metres that are added to a distance of this frame to get that of the frame before.
    shift: f64,
    /// Median absolute deviation from it, in metres.
    spread: f64,
}

/// A place between pixels, all of which are inside the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Index of the pixel to the left and above.
    corner: usize,
    /// Distance to the right and down from its centre, in 0..1.
    fraction: [f64; 2],
}

/// A surface on its way back through the frames.
#[derive(Debug, Clone, Copy)]
pub struct Trace {
    x: f64,
    y: f64,
    /// Where it was found.
    pixel: usize,
    depth: f64,
}

impl Geometry {
    /// A frame in which nothing moves and nothing is hidden.
    pub fn still(width: usize, height: usize) -> Self {
        Self { motion: vec![[0.0; 2]; width * height], depth: Plane::zeros(width, height) }
    }

    /// The surface at a pixel.
    pub fn start(&self, pixel: usize) -> Trace {
        let width = self.depth.width;
        let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
        Trace { x, y, pixel, depth: f64::from(self.depth.data[pixel]) }
    }

    /// Follows a surface of this frame to the frame `before`; none if it was not seen there.
    pub fn step(&self, before: &Self, change: Change, trace: Trace) -> Option<(Trace, Position)> {
        let [right, down] = self.motion[trace.pixel];
        let (x, y) = (trace.x - f64::from(right), trace.y - f64::from(down));
        let position = place(x, y, self.depth.width, self.depth.height)?;
        let expected = trace.depth + change.shift;
        let off = |pixel: usize| difference(f64::from(before.depth.data[pixel]), expected);
        let nearest = |a: &(usize, f64), b: &(usize, f64)| off(a.0).total_cmp(&off(b.0)).then(b.1.total_cmp(&a.1));
        let (pixel, _) = position.corners(self.depth.width).filter(|(_, weight)| *weight > 0.0).min_by(nearest)?;
        let seen = off(pixel) <= self.tolerance(trace.pixel, change);
        let depth = f64::from(before.depth.data[pixel]);
        seen.then_some((Trace { x, y, pixel, depth }, position))
    }

    /// How distances have changed since the frame `before`.
    pub fn change(&self, before: &Self) -> Change {
        let (width, height) = (self.depth.width, self.depth.height);
        let moved = |pixel: usize| {
            let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
            let [right, down] = self.motion[pixel];
            let at = place((x - f64::from(right)).round(), (y - f64::from(down)).round(), width, height)?;
            let change = f64::from(before.depth.data[at.corner]) - f64::from(self.depth.data[pixel]);
            change.is_finite().then_some(change)
        };
        let mut changes: Vec<f64> = (0..width * height).into_par_iter().with_min_len(4096).filter_map(moved).collect();
        let shift = median(&mut changes);
        changes.iter_mut().for_each(|c| *c = (*c - shift).abs());
        Change { shift, spread: median(&mut changes) }
    }

    /// Metres by which a distance may differ from what is expected.
    fn tolerance(&self, pixel: usize, change: Change) -> f64 {
        let (x, y) = (pixel % self.depth.width, pixel / self.depth.width);
        let slopes =
            self.slope(pixel, x, self.depth.width, 1) + self.slope(pixel, y, self.depth.height, self.depth.width);
        let depth = f64::from(self.depth.data[pixel]);
        let rounding = if depth.is_finite() { 4.0 * f64::from(f32::EPSILON) * depth } else { 0.0 };
        1.5 * slopes + 3.0 * change.spread + rounding
    }

    /// The smaller one-sided difference of depth along an axis, in metres a pixel; 0 where neither is finite.
    fn slope(&self, pixel: usize, at: usize, length: usize, step: usize) -> f64 {
        let depth = |i: usize| f64::from(self.depth.data[i]);
        let before = (at > 0).then(|| difference(depth(pixel - step), depth(pixel)));
        let after = (at + 1 < length).then(|| difference(depth(pixel + step), depth(pixel)));
        let least = before.unwrap_or(f64::INFINITY).min(after.unwrap_or(f64::INFINITY));
        if least.is_finite() { least } else { 0.0 }
    }
}

impl Position {
    /// The four pixels around and their weights.
    fn corners(self, width: usize) -> impl Iterator<Item = (usize, f64)> {
        let [fx, fy] = self.fraction;
        let weights =
            [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)];
        weights.into_iter().map(move |(right, down, weight)| (self.corner + right + down * width, weight))
    }

    /// The plane's value here, interpolated bilinearly.
    pub fn read(self, plane: &Plane) -> f64 {
        let needed = self.corners(plane.width).filter(|(_, weight)| *weight > 0.0);
        needed.map(|(pixel, weight)| weight * f64::from(plane.data[pixel])).sum()
    }
}

/// The place in pixels from the centre of the first one; none outside the frame.
fn place(x: f64, y: f64, width: usize, height: usize) -> Option<Position> {
    let inside = x >= 0.0 && y >= 0.0 && x <= (width - 1) as f64 && y <= (height - 1) as f64;
    let (left, above) = (x.floor(), y.floor());
    let position = || Position { corner: above as usize * width + left as usize, fraction: [x - left, y - above] };
    inside.then(position)
}

/// |a - b|, and 0 between two that are infinite.
fn difference(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() }
}

/// The upper of the two middle values; 0 of none.
fn median(values: &mut [f64]) -> f64 {
    let at = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(at, f64::total_cmp).1 }
}
